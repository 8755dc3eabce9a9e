import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.regressor import Regressor
from pivident.robot.gallery import load_robot
from pivident.studies.excitation.constraints import Constraints, TorqueModel, smooth_maximum
from pivident.studies.excitation.limits import joint_limits
from pivident.studies.excitation.motions import MotionFamily

ROBOT = load_robot("staubli_tx40")
BASE = base_parameters(ROBOT)
REGRESSOR = Regressor.build(ROBOT, BASE.parameters)
VALUES = BASE.values(nominal_values(ROBOT, BASE.standard))
FAMILY = MotionFamily("splines", 6.0, 14)


def torque_model(uncertain=True):
    rng = np.random.default_rng(3)
    half = 0.02 * rng.standard_normal((len(BASE), len(BASE)))
    return TorqueModel(REGRESSOR, VALUES, half @ half.T if uncertain else None)


class Wall:
    """The first two joints must keep q1 + q2² below a wall: a clearance with a known gradient."""

    names = ("arm and wall",)
    bodies = surroundings = remarks = ()
    robot = load_robot("planar_2r")
    steepest = np.array([[1.0, 2.0 * np.pi, 0.0, 0.0, 0.0, 0.0]])[:, :2]

    def __init__(self, needed=0.02):
        self.needed = np.array([needed])

    def with_more(self, room):
        return Wall(self.needed[0] + room)

    def distances(self, q):
        return (1.5 - q[:, 0] - q[:, 1] ** 2)[None]

    def with_gradients(self, q):
        slopes = np.zeros((1, *q.shape))
        slopes[0, :, 0], slopes[0, :, 1] = -1.0, -2.0 * q[:, 1]
        return self.distances(q), slopes


def constraints(rms=False, uncertain=True, jerk=False):
    given = {j.name: {} for j in ROBOT.joints}
    for name in given:
        if rms:
            given[name]["rms_torque"] = 20.0
        if jerk:
            given[name]["jerk"] = 500.0
    limits = joint_limits(ROBOT, given)
    return Constraints.of(FAMILY, 12.0, limits, (torque_model(uncertain),), Wall())


def coefficients(seed=0, size=0.4):
    return size * np.random.default_rng(seed).standard_normal((FAMILY.size, ROBOT.size))


@pytest.mark.parametrize("rms", [False, True])
@pytest.mark.parametrize("uncertain", [False, True])
def test_gradients_by_differences(rms, uncertain):
    made = constraints(rms, uncertain, jerk=rms)
    x = coefficients()
    ratios, gradients = made.ratios_and_gradients(x)
    assert len(ratios) == 6 * (3 + 1 + 2 * rms) + 1
    rng = np.random.default_rng(1)
    for _ in range(3):
        direction = rng.standard_normal(x.shape)
        h = 1e-6
        ends = [made.ratios_and_gradients(x + s * h * direction)[0] for s in (1, -1)]
        slope = (ends[0] - ends[1]) / (2 * h)
        found = (gradients * direction).sum(axis=(1, 2))
        np.testing.assert_allclose(found, slope, rtol=2e-5, atol=2e-6 * np.abs(slope).max())


def test_ratios_are_those_of_the_motion():
    """Against the definitions, sample by sample; smoothing is never below the largest."""
    made = constraints(rms=True)
    x = coefficients(4, 0.2)
    q, dq, ddq, _ = made.motion(x)
    torque = REGRESSOR.torque(q, dq, ddq, VALUES)
    phi = REGRESSOR.matrix(q, dq, ddq)
    margin = 2 * np.sqrt(np.einsum("tjp,pq,tjq->tj", phi, made.torques[0].covariance, phi))
    limits = made.limits
    expected = max(
        (np.abs(q - limits.middle) / limits.half).max(),
        (np.abs(dq) / limits.speed).max(),
        (np.abs(ddq) / limits.acceleration).max(),
        ((np.abs(torque) + margin) / limits.torque).max(),
        np.sqrt((torque**2).mean(axis=0)).max() / 20.0,
        1.0 - (Wall().distances(q).min() - 0.02) / 0.1,
    )
    assert expected < 1.0, "the largest of all is looked for only where joints keep their limits"
    assert made.largest_ratio(x) == pytest.approx(expected, rel=1e-9)
    ratios, _ = made.ratios_and_gradients(x)
    assert expected - 1e-12 <= ratios.max() <= expected + 0.02


def test_smooth_maximum_bounds_the_largest():
    ratios = np.random.default_rng(0).uniform(0, 1, (500, 3))
    found, weights = smooth_maximum(ratios)
    largest = ratios.max(axis=0)
    assert (found >= largest).all()
    assert (found <= largest + np.log(500) / 350).all()
    np.testing.assert_allclose(weights.sum(axis=0), 1.0)


def test_margin_of_a_torque_is_two_standard_errors_of_the_model():
    rng = np.random.default_rng(8)
    model = torque_model()
    motion = tuple(rng.uniform(-1, 1, (3, 4, 6)))
    torque, margin = model.torque_and_margin(motion)
    draws = rng.multivariate_normal(VALUES, model.covariance, 20_000)
    spread = (REGRESSOR.matrix(*motion) @ draws.T).std(axis=2)
    np.testing.assert_allclose(margin, 2 * spread, rtol=0.03)
    np.testing.assert_allclose(torque, REGRESSOR.torque(*motion, VALUES))
