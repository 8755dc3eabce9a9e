"""A log whose law compensates gravity against a file that states one that does not."""

import numpy as np
import pytest

from pivident.data.logs.log import Log
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values
from pivident.experiment.check.geometry_check import check_gravity
from pivident.experiment.file_keys import ControllerEntry
from pivident.judgement.audit.timing import Timing
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.controllers import PID
from pivident.loop.simulation.gravity_compensation import GravityCompensated, GravityModel
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.gallery import load_robot

RATE = 1000.0
KP, KD = [6000.0, 2500.0], [180.0, 60.0]


def log_of(compensates, ki=None):
    """A log of the planar arm under PD or PID, with gravity or without."""
    robot = load_robot("planar_2r")
    base = base_parameters(robot)
    model = make_model(robot, base.parameters, base.values(nominal_values(robot, base.standard)))
    postures = np.random.default_rng(2).uniform(-1.5, 1.5, (30, 2))
    q_ref, dq_ref, _ = point_to_point(postures, 0.8 * robot.rated_speeds, RATE, 5000)
    law = PID(KP, KD, ki)
    if compensates:
        law = GravityCompensated(law, GravityModel.nominal(robot))
    signals = LoopSignals(
        RATE, q_ref, dq_ref, None, None, np.ones(2), np.full(2, np.inf), np.full(2, 0.5),
        np.full(2, 50.0),
    )  # fmt: skip
    made = simulate(model, law, signals, robot.joint_names)
    noise = 0.02 * np.random.default_rng(1).standard_normal(made.tau.shape)
    channels = {"q": made.q, "q_ref": q_ref, "tau": made.tau + noise}
    return Log(
        "log", robot.joint_names, {}, {}, RATE, logged=channels, channels=channels, robot=robot
    )


def told(log, **entry):
    timing = Timing((), np.full(log.samples - 1, 1.0 / RATE), RATE, True)
    return check_gravity(log, timing, ControllerEntry(type="pd", kp=KP, kd=KD, **entry))


def test_gravity_in_the_law_is_named_with_the_next_step():
    log = log_of(True)
    (remark,) = told(log)
    assert "shoulder, elbow compensates gravity" in str(remark)
    assert "gravity_measured" in str(remark) and 'controller = "identify"' in str(remark)
    assert told(log, feed_forward="gravity_measured") == []


@pytest.mark.parametrize("ki", [None, [20000.0, 8000.0]])
def test_a_law_without_gravity_is_passed_over(ki):
    assert told(log_of(False, ki)) == []
