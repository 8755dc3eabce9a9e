"""Derivatives of the torque along changes of one joint's motion."""

import numpy as np
import pytest

import pivident as pv
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.regressor import Regressor
from pivident.judgement.model_errors.cause import STEP, RecordMotion
from pivident.robot.friction import FrictionLaw, dahl, viscous

RATE = 400.0


def motion(robot):
    """Sines of two joints."""
    base = base_parameters(robot)
    regressor = Regressor.build(robot, base.parameters)
    theta = base.values(nominal_values(robot, base.standard))
    theta = np.where(theta == 0.0, 0.3, theta)
    t = np.arange(800) / RATE
    phase = np.arange(robot.size)[:, None]
    w = 3.0 + phase
    q, dq = np.sin(w * t + phase), w * np.cos(w * t + phase)
    return RecordMotion(regressor, theta, q, dq, -(w**2) * q, RATE, 0)


def sine(own, joint):
    """A sine over the joint's own turn, with its derivatives by time."""
    q, dq, ddq = own.q[joint], own.dq[joint], own.ddq[joint]
    return np.sin(q), np.cos(q) * dq, np.cos(q) * ddq - np.sin(q) * dq**2


@pytest.mark.parametrize("transmitted", [False, True])
@pytest.mark.parametrize("joint", [0, 2, 5])
def test_derivatives_together_are_the_difference_along_the_change(joint, transmitted):
    own = motion(pv.load_robot("staubli_tx40"))
    change = sine(own, joint)
    found = own.along(joint, change, STEP, transmitted)
    moved = [own.q.copy(), own.dq.copy(), own.ddq.copy()]
    before = [x.copy() for x in moved]
    for signal, other, delta in zip(moved, before, change, strict=True):
        signal[joint] += STEP * delta
        other[joint] -= STEP * delta
    torque = own.transmitted_at if transmitted else own.torque_at
    expected = (torque(*moved) - torque(*before)) / (2.0 * STEP)
    np.testing.assert_allclose(found, expected, atol=2e-4 * np.abs(expected).max())


def test_a_fraction_of_the_rate_has_the_same_motion():
    own = motion(pv.load_robot("staubli_tx40"))
    half = own.every(2)
    inner = slice(50, -50)
    assert half.rate == RATE / 2 and own.every(1) is own
    np.testing.assert_allclose(half.q[:, inner], own.q[:, ::2][:, inner], atol=1e-4)
    np.testing.assert_allclose(half.seconds, own.seconds[::2])


def test_friction_with_memory_is_asked_along_the_whole_change():
    law = FrictionLaw((viscous(), dahl(0.01)))
    robot = pv.load_robot("emps").with_friction({"carriage": law})
    own = motion(robot)
    assert own.regressor.inner_entries.size
    change = sine(own, 0)
    expected = (
        own.torque_at(
            *(x + STEP * d for x, d in zip((own.q, own.dq, own.ddq), change, strict=True))
        )
        - own.torque
    ) / STEP
    np.testing.assert_array_equal(own.along(0, change, STEP), expected)
