import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.signal import lfilter

from pivident.foundation.errors import IdentificationError
from pivident.signals.noise_models import fit_ar
from pivident.signals.prefilter import (
    Prefilter,
    StreamingFilter,
    lower_predictors,
    transient_length,
)

FILTERS = [
    ((1.0,), (1.0,)),
    ((2.0,), (4.0,)),
    ((1.0,), (1.0, -0.99)),
    ((0.5, -0.2), (2.0, -1.9)),
    ((1.0, -0.3), (1.0, -1.7, 0.72)),
    ((1.0, 0.4, 0.1, -0.2), (1.0, -0.5)),
]


def taps(order, seed=0):
    return np.r_[1, 0.1 * np.random.default_rng(seed).standard_normal(order)]


@pytest.mark.parametrize(("numerator", "denominator"), FILTERS)
@pytest.mark.parametrize("order", [0, 1, 7, 8, 150])
def test_filter_is_that_of_scipy(numerator, denominator, order):
    x = np.random.default_rng(1).standard_normal((3, 2500))
    fir = taps(order)
    expected = lfilter(fir, [1.0], lfilter(numerator, denominator, x, axis=1), axis=1)
    found = StreamingFilter(numerator, denominator, fir, 3).process(x)
    np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())


@given(
    st.sampled_from(FILTERS),
    st.integers(0, 40),
    st.lists(st.integers(0, 2999), max_size=6),
)
@settings(max_examples=40, deadline=None)
def test_blocks_give_exactly_the_whole(pair, order, cuts):
    x = np.random.default_rng(2).standard_normal((2, 3000))
    whole = StreamingFilter(*pair, taps(order), 2).process(x)
    stream = StreamingFilter(*pair, taps(order), 2)
    bounds = [0, *sorted(cuts), 3000]
    parts = [stream.process(x[:, start:stop]) for start, stop in pairwise(bounds)]
    np.testing.assert_array_equal(np.concatenate(parts, axis=1), whole)


def test_threads_do_not_change_the_numbers():
    x = np.random.default_rng(3).standard_normal((7, 20_000))
    one, three = (
        StreamingFilter((1.0,), (1.0, -0.9), taps(60), 7, threads).process(x) for threads in (1, 3)
    )
    np.testing.assert_array_equal(one, three)


def test_output_array_is_used_and_reset_returns_to_rest():
    x = np.random.default_rng(4).standard_normal((2, 100))
    stream = StreamingFilter((1.0,), (1.0, -0.9), taps(5), 2)
    out = np.empty_like(x)
    assert stream.process(x, out) is out
    again = stream.process(x)
    stream.reset()
    assert not np.array_equal(again, out)
    np.testing.assert_array_equal(stream.process(x), out)


def test_wrong_number_of_rows_is_refused():
    with pytest.raises(ValueError, match="3 rows for a filter of 2"):
        StreamingFilter((1.0,), (1.0,), (1.0,), 2).process(np.zeros((3, 10)))


def test_prefilter_makes_coloured_noise_white_with_unit_variance():
    """v = C(z) · AR noise; the prefilter is the inverse of C, then A, then the root of λ."""
    inverse = ((1.0,), (5.0, -4.5))
    ar_noise = lfilter([0.3], [1.0, -0.6, 0.2], np.random.default_rng(0).standard_normal(30_000))
    v = lfilter(inverse[1], inverse[0], ar_noise)
    model = fit_ar(lfilter(*inverse, v), 30)
    prefilter = Prefilter(*inverse, model.coefficients, model.innovation_variance)
    white = prefilter.stream(1).process(v[None])[0, prefilter.transient() :]
    assert np.var(white) == pytest.approx(1.0, rel=0.02)
    assert abs(np.mean(white[1:] * white[:-1])) < 0.02


def test_transient_of_the_inverse_of_a_proportional_derivative_law():
    kp, kd, h = 4934.8, 133.76, 2e-4
    denominator = (kp + kd / h, -kd / h)
    pole = (kd / h) / (kp + kd / h)
    length = transient_length((1.0,), denominator, 34)
    assert length == 34 + math.ceil(math.log(1e-4) / math.log(pole))
    assert length == pytest.approx(1288, abs=2)
    response = lfilter((1.0,), denominator, np.r_[1.0, np.zeros(3000)])
    assert np.abs(response[length - 34 :]).max() <= 1e-4 * abs(response[0])


def test_a_filter_without_poles_forgets_after_its_taps():
    assert transient_length((1.0, 0.5), (1.0,), 10) == 11


def test_an_integrator_in_the_denominator_is_refused():
    with pytest.raises(IdentificationError, match="integrator"):
        transient_length((1.0,), (1.0, -1.0), 5)


def autocovariance(ar, lags):
    """Autocovariance of A x = e, e of unit variance, by its long impulse response."""
    response = lfilter([1.0], ar, np.r_[1.0, np.zeros(20_000)])
    return np.array([response[: response.size - k] @ response[k:] for k in range(lags)])


@pytest.mark.parametrize("order", [1, 2, 5])
def test_after_excluded_samples_it_whitens_each_stretch_exactly(order):
    """On every stretch L is the inverse Cholesky factor of the noise's covariance matrix."""
    rng = np.random.default_rng(order)
    ar = np.real(np.poly(rng.uniform(-0.9, 0.9, order)))
    x, seen = rng.standard_normal((2, 400)), np.ones(400, bool)
    excluded = [(0, 7), (100, 101), (103, 140), (250, 300)]
    for start, stop in excluded:
        seen[start:stop] = False
        x[:, start:stop] = 1e3  # nothing of it may be left
    stream = Prefilter(fir=ar, variance=4.0).stream(2)
    cuts = [0, 3, 102, 120, 259, 400]
    out = np.hstack([stream.process(x[:, a:b], seen=seen[a:b]) for a, b in pairwise(cuts)])
    covariance = autocovariance(ar, 400)
    for start, stop in [(7, 100), (101, 103), (140, 250), (300, 400)]:
        lags = np.arange(stop - start)
        factor = np.linalg.cholesky(covariance[np.abs(lags[:, None] - lags)])
        expected = np.linalg.solve(factor, x[:, start:stop].T).T / 2.0
        np.testing.assert_allclose(out[:, start:stop], expected, atol=1e-9)


def test_a_filter_that_inverts_a_controller_goes_on_through_excluded_samples():
    x, seen = np.random.default_rng(4).standard_normal((1, 300)), np.ones(300, bool)
    seen[50:90] = False
    through = Prefilter((1.0,), (1.0, -0.9), taps(4)).stream(1).process(x)
    found = Prefilter((1.0,), (1.0, -0.9), taps(4)).stream(1).process(x, seen=seen)
    np.testing.assert_array_equal(found, through)


def test_lower_orders_of_a_model_outside_the_unit_circle_are_refused():
    with pytest.raises(IdentificationError, match="not stable"):
        lower_predictors(np.array([1.0, -2.5, 1.0]))
