"""The bound: against dense algebra, closed forms and simulated noise."""

import numpy as np
import pytest
from scipy.linalg import toeplitz

from pivident.loop.motion.motion import central_differences
from pivident.studies.many.study.bench import Bench
from pivident.studies.many.study.bound import ENDS, ORDER, efficiency_bounds, loop_noise, whitened
from tests.studies.many.study.small import small


def dense_bound(bench, covariance):
    """(Σ_j φ_jᵀ R_j⁻¹ φ_j)⁻¹ with the whole covariance matrix R_j of each joint's noise."""
    entry = bench.scenario.content.record
    q = bench.noise_free.q[:: entry.step]
    motion = [x[ENDS:-ENDS] for x in (q, *central_differences(q, entry.rate))]
    phi = bench.regressor.matrix(*motion)
    information = 0.0
    for j, r in enumerate(covariance):
        lags = np.concatenate([r, np.zeros(len(phi) - r.size)]) if r.size < len(phi) else r
        information += phi[:, j].T @ np.linalg.solve(toeplitz(lags[: len(phi)]), phi[:, j])
    return np.sqrt(np.diag(np.linalg.inv(information)))


def test_torque_noise_alone_is_ordinary_least_squares():
    bench = Bench(small(noise={"encoder": 0.0, "torque": 0.05}))
    bounds = efficiency_bounds(bench)
    expected = dense_bound(bench, np.full((2, 1), 0.05**2))
    assert bounds.torque_sensor == pytest.approx(expected, rel=1e-8)
    assert bounds.equation == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    "noise",
    [
        {"encoder": 2e-5, "torque": 0.05},
        {
            "encoder": 1e-6,
            "torque": 0.0,
            "coloured": {"std": 1e-5, "frequency": 80.0, "radius": 0.95},
        },
    ],
)
def test_loop_noise_is_weighted_as_by_its_covariance_matrix(noise):
    bench = Bench(small(noise=noise))
    covariance = loop_noise(bench)
    covariance[:, 0] += noise["torque"] ** 2
    bounds = efficiency_bounds(bench)
    assert bounds.equation == pytest.approx(dense_bound(bench, covariance), rel=2e-3)
    assert (bounds.torque_sensor is None) == (noise["torque"] == 0.0)


def test_the_bound_grows_with_the_noise():
    quiet, noisy = (
        efficiency_bounds(Bench(small(noise={"encoder": 1e-5, "torque": sigma})))
        for sigma in (0.05, 0.1)
    )
    assert (noisy.equation > quiet.equation).all()
    assert (quiet.equation > quiet.torque_sensor).all()


@pytest.mark.parametrize("control_rate", [500, 2000])
def test_loop_noise_is_what_the_law_makes_of_the_encoders(control_rate):
    """PD law on white noise, seen at the samples of the record."""
    bench = Bench(small(record={"rate": 500, "control_rate": control_rate}))
    covariance = loop_noise(bench)
    kp, kd = np.array([6000.0, 2500.0]), np.array([180.0, 60.0])
    b0, b1 = kp + kd * control_rate, -kd * control_rate
    assert covariance[:, 0] == pytest.approx((b0**2 + b1**2) * 4e-12, rel=1e-9)
    first = b0 * b1 * 4e-12 if control_rate == 500 else np.zeros(2)
    assert covariance[:, 1] == pytest.approx(first, rel=1e-9, abs=1e-9 * covariance[0, 0])


def test_noise_that_no_torque_carries_has_no_bound():
    bench = Bench(small(noise={"encoder": 2e-6, "torque": 0.0, "where": "record"}))
    bounds = efficiency_bounds(bench)
    assert bounds.equation is None and bounds.torque_sensor is None


def test_whitened_noise_is_white():
    rng = np.random.default_rng(4)
    white = rng.standard_normal((40, 6000))
    noise = white[:, 1:] - 0.9 * white[:, :-1]
    covariance = np.zeros(ORDER + 1)
    covariance[:2] = 1.81, -0.9
    made = whitened(noise, covariance)
    assert made.var() == pytest.approx(1.0, abs=0.02)
    assert abs(np.mean(made[:, 1:] * made[:, :-1])) < 0.01
    assert made[:, 0].var() == pytest.approx(1.0, abs=0.6)
