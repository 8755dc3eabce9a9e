"""Recursions against the batch solution of the same rows."""

import numpy as np
import pytest

from pivident.estimation.identify import build_regression, identify
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.literature.filters import RecursiveInstruments, RecursiveLeastSquares
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import IdentificationError
from tests.estimation.literature.filters.scenes import planar_problem


@pytest.fixture(scope="module")
def arm():
    return planar_problem(samples=3000, limits=None)[0]


def test_without_forgetting_it_is_least_squares(arm):
    method = LeastSquares(signals=RandomWalk())
    found = identify(arm, method)
    known = estimate_kinematics(arm.recordings[0], method.signals)
    std = [joint.noise_std for joint in found.joints]
    least = RecursiveLeastSquares.of_robot(arm.robot, arm.regressor.parameters, torque_std=std)
    assert np.isnan(least.theta).all()
    for k in range(known.start, known.stop):
        least.update_motion(known.q[:, k], known.dq[:, k], known.ddq[:, k], known.tau[:, k])
    size = np.sqrt(np.diag(found.formula_covariance))
    np.testing.assert_allclose(least.theta / size, found.theta / size, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(
        least.covariance / np.outer(size, size),
        found.formula_covariance / np.outer(size, size),
        atol=1e-6,
    )


def test_its_rows_are_those_of_the_regressor(arm):
    phi, tau = build_regression(arm)
    known = estimate_kinematics(arm.recordings[0], RandomWalk())
    least = RecursiveLeastSquares(2, phi.shape[2])
    motion = RecursiveLeastSquares.of_robot(arm.robot, arm.regressor.parameters)
    for k in range(500):
        s = known.start + k
        least.update(phi[k], tau[k])
        motion.update_motion(known.q[:, s], known.dq[:, s], known.ddq[:, s], known.tau[:, s])
        np.testing.assert_allclose(motion._phi, phi[k], atol=1e-9)
    dense = np.linalg.lstsq(phi[:500].reshape(-1, phi.shape[2]), tau[:500].ravel(), rcond=None)[0]
    np.testing.assert_allclose(least.theta, dense, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(motion.theta, dense, rtol=1e-7, atol=1e-8)


def rows(seed=0, count=400):
    rng = np.random.default_rng(seed)
    phi = rng.standard_normal((count, 2, 3))
    tau = phi @ [1.0, -2.0, 0.5] + 0.1 * rng.standard_normal((count, 2))
    return phi, tau, phi + 0.3 * rng.standard_normal(phi.shape)


def test_forgetting_weighs_older_rows_less():
    phi, tau, _ = rows()
    least = RecursiveLeastSquares(2, 3, torque_std=[1.0, 2.0], forgetting=0.98)
    for own, torque in zip(phi, tau, strict=True):
        least.update(own, torque)
    weight = 0.98 ** np.arange(len(tau))[::-1, None] / [1.0, 4.0]
    gram = np.einsum("sja,sj,sjb->ab", phi, weight, phi)
    np.testing.assert_allclose(
        least.theta, np.linalg.solve(gram, np.einsum("sja,sj,sj->a", phi, weight, tau)), rtol=1e-11
    )
    np.testing.assert_allclose(least.covariance, np.linalg.inv(gram), rtol=1e-10)


def test_instruments_are_those_of_the_batch():
    phi, tau, z = rows(1)
    instruments = RecursiveInstruments(2, 3, torque_std=0.5, forgetting=0.99)
    assert np.isnan(instruments.theta).all() and np.isnan(instruments.covariance).all()
    for k in range(len(tau)):
        instruments.update(phi[k], tau[k], z[k])
    weight = 0.99 ** np.arange(len(tau))[::-1]
    gram = np.einsum("s,sja,sjb->ab", weight, z, phi) / 0.25
    moment = np.einsum("s,sja,sj->a", weight, z, tau) / 0.25
    squares = np.einsum("s,sja,sjb->ab", weight**2, z, z) / 0.25
    np.testing.assert_allclose(instruments.theta, np.linalg.solve(gram, moment), rtol=1e-11)
    inverse = np.linalg.inv(gram)
    np.testing.assert_allclose(instruments.covariance, inverse @ squares @ inverse.T, rtol=1e-9)


def test_instruments_take_the_bias_of_noise_in_the_rows_away():
    truth = np.array([1.0, -2.0, 0.5])
    rng = np.random.default_rng(2)
    least, instruments = RecursiveLeastSquares(1, 3), RecursiveInstruments(1, 3)
    for _ in range(20_000):
        clean = rng.standard_normal((1, 3))
        noisy = clean + 0.5 * rng.standard_normal((1, 3))
        least.update(noisy, clean @ truth)
        instruments.update(noisy, clean @ truth, clean)
    assert np.abs(least.theta - truth).max() > 0.1
    assert np.abs(instruments.theta - truth).max() < 0.05


def test_bad_input_is_refused():
    with pytest.raises(IdentificationError, match=r"forgetting is 1.5"):
        RecursiveLeastSquares(1, 2, forgetting=1.5)
    with pytest.raises(IdentificationError, match="torque_std"):
        RecursiveInstruments(2, 2, torque_std=[1.0, -1.0])
    least = RecursiveLeastSquares(1, 2)
    with pytest.raises(IdentificationError, match="knows no robot"):
        least.update_motion([0.0], [0.0], [0.0], [0.0])
    with pytest.raises(IdentificationError, match=r"sample 1: .*not finite"):
        least.update([[np.nan, 1.0]], [0.0])
