"""Filters on a linear system, where Kalman's is the exact answer."""

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.estimation.literature.filters import KalmanFilter
from pivident.estimation.literature.filters.kalman_filters import (
    CentralDifferenceKalman,
    ExtendedKalman,
    UnscentedKalman,
)
from pivident.robot.gallery import load_robot
from tests.estimation.literature.filters.scenes import RATE, slide

METHODS = [
    ExtendedKalman(),
    UnscentedKalman(),
    UnscentedKalman(square_root=True),
    UnscentedKalman(alpha=1.0, kappa=1.0),
    CentralDifferenceKalman(),
    CentralDifferenceKalman(square_root=True),
]
ENCODER, TORQUE, DRIFT = 1e-5, 0.5, 0.2


def exact_kalman(q, tau, m, fv, start):
    """Kalman's filter of (q, dq, off), matrices by hand: midpoint rule of m a + fv dq + off = τ."""
    h = 1.0 / RATE
    whole = m + 0.5 * h * fv
    of_a = np.array([0.0, -fv / whole, -1.0 / whole])
    forward = np.eye(3)
    forward[0, 1] = h
    forward[0] += 0.5 * h * h * of_a
    forward[1] += h * of_a
    gain = np.array([0.5 * h * h, h, 0.0]) / whole
    x, p = np.array([q[0, 0], 0.0, start[0]]), np.diag([ENCODER**2, 1.0, start[1] ** 2])
    found = []
    for k in range(1, len(q)):
        x = forward @ x + gain * tau[k, 0]
        p = forward @ p @ forward.T + TORQUE**2 * np.outer(gain, gain)
        p[2, 2] += DRIFT**2 * h
        s = p[0, 0] + ENCODER**2
        found.append((q[k, 0] - x[0]) / np.sqrt(s))
        x = x + p[:, 0] * (q[k, 0] - x[0]) / s
        p = p - np.outer(p[:, 0], p[0]) / s
    return x, p, np.array(found)


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_a_linear_system_has_the_exact_answer(method):
    q, tau, (m, fv, _) = slide()
    base = base_parameters(load_robot("emps"))
    names = [p.stem for p in base.parameters]
    chosen = tuple(
        p for p in base.parameters if p.stem in ("ia", "m") or p.stem.startswith(("fv", "off"))
    )
    assert len(chosen) == 3, names
    kinds = ["m" if p.stem in ("ia", "m") else p.stem for p in chosen]
    first = {"m": m, "fv": fv, "off": 0.0}
    std = {"m": 1e-7 * m, "fv": 1e-7 * fv, "off": 5.0}
    kalman = KalmanFilter(
        base.robot,
        chosen,
        [first[k] for k in kinds],
        np.diag([std[k] ** 2 for k in kinds]),
        rate=RATE,
        encoder_std=ENCODER,
        torque_std=TORQUE,
        drift=[DRIFT if k == "off" else 0.0 for k in kinds],
        method=method,
    )
    kalman.start(q[0], dq_std=1.0)
    z, _ = kalman.run(q[1:], tau[1:])
    x, p, expected = exact_kalman(q, tau, m, fv, (0.0, 5.0))
    off = kinds.index("off")
    np.testing.assert_allclose(z[:, 0], expected, atol=1e-5)
    np.testing.assert_allclose(kalman.theta[off], x[2], rtol=1e-6)
    np.testing.assert_allclose(kalman.covariance[off, off], p[2, 2], rtol=1e-6)
    np.testing.assert_allclose([kalman.q[0], kalman.dq[0]], x[:2], atol=1e-9)
