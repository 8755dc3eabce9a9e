"""What does not handle measured wrenches or bases yet says so before it computes anything."""

import numpy as np
import pytest

import pivident as pv
from pivident.data import with_wrenches
from pivident.dynamics.inverse_derivatives import inverse_dynamics_derivatives
from pivident.estimation.literature.filters.robot_equations import robot_equations
from pivident.foundation.errors import PividentError, RobotDescriptionError
from pivident.models import export_model
from pivident.models.consistency.consistent_model import make_consistent
from pivident.models.runnable_model import runnable_model
from pivident.robot import WrenchSensor, with_floating_base, with_wrench_sensors
from pivident.robot.refusals import without_loops, without_wrenches
from pivident.studies import design_motion, fit_simulator, identify_payload, outline_of

FLOOR, TOOL = WrenchSensor("floor", "base"), WrenchSensor("tool", "2")
LOOP = pv.Loop(pv.PD(kp=[6000.0, 2500.0], kd=[180.0, 60.0]))
ARM = pv.load_robot("planar_2r")
ROBOTS = {
    "held": with_wrench_sensors(ARM, [FLOOR]),
    "floating": with_wrench_sensors(with_floating_base(ARM), [FLOOR]),
    "tool": with_wrench_sensors(ARM, [TOOL]),
}
BASE = "has a measured base, which .* does not handle yet"
WRENCH = "has measured wrenches .*, which .* does not handle yet"
EITHER = f"{BASE}|{WRENCH}"


@pytest.fixture(scope="module")
def problems():
    """The same motion with each robot; its wrenches are noise."""
    rng = np.random.default_rng(1)
    t = np.arange(0.0, 4.0, 0.001)
    reference = np.column_stack([np.sin(5.0 * t), np.cos(7.0 * t)]) * np.minimum(t, 1.0)[:, None]
    made = pv.simulate(ARM, LOOP, reference, rate=1000.0, encoder=1e-6, torque=0.05).recording
    wrench, still = rng.normal(size=(len(t), 6)), np.zeros((len(t), 3))
    pose = still + 0.1 * np.sin(t)[:, None], np.broadcast_to(np.eye(3), (len(t), 3, 3))
    return {
        name: pv.Problem(
            robot,
            (
                with_wrenches(
                    made, robot, {robot.sensors[0].name: wrench},
                    pose if name == "floating" else None,
                ),
            ),
            LOOP,
        )
        for name, robot in ROBOTS.items()
    }  # fmt: skip


def test_robots_without_sensors_pass():
    without_loops(ARM, "anything")
    without_wrenches(ARM, "anything")
    for name in ("held", "floating"):
        with pytest.raises(RobotDescriptionError, match="which anything does not handle yet; wait"):
            without_loops(ROBOTS[name], "anything", "wait")
    with pytest.raises(RobotDescriptionError, match=r"\('tool'\), which anything does not"):
        without_wrenches(ROBOTS["tool"], "anything")


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("method", ["ekf", "ukf", "cdkf", "particle", "cloe", "clie", "ml", "oloe"])
def test_methods(problems, name, method):
    said = []
    with pytest.raises(RobotDescriptionError, match=EITHER):
        pv.identify(problems[name], method, said.append)
    assert not said


@pytest.mark.parametrize("name", ROBOTS)
def test_didim(problems, name):
    with pytest.raises(RobotDescriptionError, match=WRENCH):
        pv.identify(problems[name], "didim")


@pytest.mark.parametrize("name", ROBOTS)
def test_frequency_payload_and_simulators(problems, name):
    problem = problems[name]
    with pytest.raises(RobotDescriptionError, match=WRENCH):
        pv.identify(problem, "frequency")
    with pytest.raises(RobotDescriptionError, match=WRENCH):
        identify_payload(problem, problem.recordings)
    with pytest.raises(RobotDescriptionError, match=WRENCH):
        fit_simulator(problem.robot, LOOP, problem.recordings)


@pytest.mark.parametrize("name", ["held", "floating"])
def test_everything_else_that_needs_a_fixed_base(problems, name):
    robot, still = ROBOTS[name], np.zeros((1, 8))
    for refused in (
        lambda: outline_of(robot),
        lambda: design_motion(robot),
        lambda: export_model(runnable_model(robot), "urdf"),
        lambda: robot_equations(robot, ()),
        lambda: inverse_dynamics_derivatives(robot, (), np.zeros(0), still, still, still),
    ):
        with pytest.raises(RobotDescriptionError, match=BASE):
            refused()


def test_physical_consistency(problems):
    with pytest.raises(RobotDescriptionError, match=BASE):
        make_consistent(pv.identify(problems["held"], "ls"))


def test_instruments_that_a_floating_base_does_not_have(problems):
    for kind in ("loop", "response", "virtual"):
        method = pv.PrefilteredIV(instruments=kind)
        with pytest.raises(PividentError, match="floating base"):
            pv.identify(problems["floating"], method)
