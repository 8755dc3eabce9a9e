"""Smoother, noise model, prefilter and decimation beside other implementations.

Run with ``pytest benchmarks/bench_signals.py --benchmark-enable``.
"""

import numpy as np
import pytest
from scipy.signal import lfilter, oaconvolve

from pivident.signals.bandpass import bandpass
from pivident.signals.decimation import parallel_decimation
from pivident.signals.noise_models import fit_ar
from pivident.signals.prefilter import StreamingFilter
from pivident.signals.random_walk import irwsm, smooth_channels
from pivident.signals.random_walk_likelihood import diffuse_fit

RATE = 5000.0
SAMPLES = 34_500
NVR = 1e-5


@pytest.fixture(scope="module")
def positions():
    """Six channels of slow motion under coarse encoder noise, shape (samples, 6)."""
    t = np.arange(SAMPLES)[:, None] / RATE
    q = np.sin(2 * np.pi * t * [0.3, 0.5, 0.7, 0.9, 1.1, 1.3])
    return q + 5e-4 * np.random.default_rng(0).standard_normal(q.shape)


@pytest.fixture(scope="module")
def columns():
    """Fifty columns of a TX40 record, time last."""
    return np.random.default_rng(0).standard_normal((50, 45_000))


@pytest.mark.benchmark(group="smoother with maximum likelihood, one channel")
@pytest.mark.parametrize("order", [2, 3, 4])
def test_maximum_likelihood(benchmark, positions, order):
    benchmark(irwsm, positions[:, 0], RATE, order)


@pytest.mark.benchmark(group="smoother with maximum likelihood, six channels")
@pytest.mark.parametrize("threads", [1, 2])
def test_six_channels(benchmark, positions, threads):
    benchmark(smooth_channels, positions, RATE, threads=threads)


@pytest.mark.benchmark(group="smoothing at a given ratio, order 2")
def test_smoothing(benchmark, positions):
    benchmark(irwsm, positions[:, 0], RATE, 2, NVR)


@pytest.mark.benchmark(group="smoothing at a given ratio, order 2")
def test_smoothing_simdkalman(benchmark, positions):
    import simdkalman

    kalman = simdkalman.KalmanFilter(
        state_transition=np.array([[1, 1], [0, 1]]),
        process_noise=np.diag([0, NVR]),
        observation_model=np.array([[1, 0]]),
        observation_noise=1.0,
    )
    benchmark(kalman.smooth, positions[:, 0], initial_covariance=1e10 * np.eye(2))


@pytest.mark.benchmark(group="smoothing at a given ratio, order 2")
def test_smoothing_statsmodels(benchmark, positions):
    from statsmodels.tsa.statespace.structural import UnobservedComponents

    y = positions[:, 0]
    model = UnobservedComponents(y, "smooth trend", use_exact_diffuse=True)
    benchmark(model.smooth, [2.5e-7, NVR * 2.5e-7])


@pytest.mark.benchmark(group="one likelihood, order 2")
def test_likelihood(benchmark, positions):
    y = np.ascontiguousarray(positions[:, 0])
    benchmark(lambda: diffuse_fit(y, NVR, 2).log_likelihood)


@pytest.mark.benchmark(group="one likelihood, order 2")
def test_likelihood_statsmodels(benchmark, positions):
    from statsmodels.tsa.statespace.structural import UnobservedComponents

    model = UnobservedComponents(positions[:, 0], "smooth trend", use_exact_diffuse=True)
    benchmark(model.loglike, [2.5e-7, NVR * 2.5e-7])


@pytest.mark.benchmark(group="Burg")
def test_burg_all_orders_to_150(benchmark, columns):
    benchmark(fit_ar, columns[0], 150)


@pytest.mark.benchmark(group="Burg")
def test_burg_statsmodels_order_150(benchmark, columns):
    from statsmodels.regression.linear_model import burg

    benchmark(burg, columns[0], 150)


@pytest.mark.benchmark(group="150 taps on 50 columns of 45,000 samples")
@pytest.mark.parametrize("threads", [1, 2])
def test_streaming_filter(benchmark, columns, threads):
    stream = StreamingFilter((1.0,), (1.0, -0.99), np.ones(151), len(columns), threads)
    out = np.empty_like(columns)
    benchmark(stream.process, columns, out)


@pytest.mark.benchmark(group="150 taps on 50 columns of 45,000 samples")
def test_overlap_add_of_scipy(benchmark, columns):
    taps = np.ones((1, 151))
    benchmark(lambda: oaconvolve(lfilter((1.0,), (1.0, -0.99), columns, axis=1), taps, axes=1))


@pytest.mark.benchmark(group="classical recipe")
def test_bandpass_of_six_channels(benchmark, positions):
    benchmark(bandpass, positions, RATE, 50.0)


@pytest.mark.benchmark(group="classical recipe")
def test_decimation_of_50_columns(benchmark, columns):
    tall = np.ascontiguousarray(columns.T)
    benchmark(parallel_decimation, tall, 100)
