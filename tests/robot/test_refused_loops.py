"""What does not handle closed loops yet says so before it computes anything."""

import numpy as np
import pytest

import pivident as pv
from pivident.app.cli.app import main
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.grouping.closed_form import closed_form_base_parameters
from pivident.dynamics.inverse_derivatives import inverse_dynamics_derivatives
from pivident.dynamics.parameters import standard_parameters
from pivident.dynamics.regressor_derivatives import RegressorDerivatives
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.control_law.law_gravity import gravity_columns
from pivident.estimation.drives.known_payload import Payload
from pivident.experiment.excite_keys import RoomEntry
from pivident.foundation.errors import RobotDescriptionError
from pivident.loop.simulation.gravity_compensation import GravityModel
from pivident.models import export_model, to_urdf
from pivident.models.export.sdf import to_sdf
from pivident.models.runnable_model import runnable_model
from pivident.robot import lugre, viscous
from pivident.robot.friction import FrictionLaw
from pivident.robot.refusals import without_loops
from pivident.studies import (
    Clearances,
    clearances_of_room,
    design_motion,
    exact_distances,
    fit_simulator,
    identify_payload,
    outline_of,
)

REFUSED = r"robot 'five-bar' has closed loops, which .* not handle yet; \w"

GAINS = pv.PD(kp=[800.0, 800.0], kd=[20.0, 20.0])


@pytest.fixture(scope="module")
def robot():
    return pv.load_robot("five_bar")


@pytest.fixture(scope="module")
def problem(robot):
    rest = robot.constraints.posture[list(robot.places)]
    t = np.arange(0.0, 3.0, 0.002)[:, None]
    reference = rest + 0.2 * np.sin(np.array([5.1, 7.3]) * t) * np.minimum(t, 1.0) ** 2
    loop = pv.Loop(GAINS)
    made = pv.simulate(robot, loop, reference, rate=500.0, encoder=1e-6, torque=0.05)
    return pv.Problem(robot, (made.recording,), loop)


@pytest.fixture(scope="module")
def result(problem):
    return pv.identify(problem, "ls")


def test_robots_without_loops_pass(robot):
    assert without_loops(robot.tree, "anything") is None
    with pytest.raises(RobotDescriptionError, match=r"which anything does not handle yet; wait"):
        without_loops(robot, "anything", "wait")


def test_joints_that_only_follow_others_may_stand_still():
    fingers = pv.load_robot("scara")
    with pytest.raises(
        RobotDescriptionError,
        match=r"follow others \(.*let those .* stand still.* \(frozen\), or w",
    ):
        without_loops(fingers, "anything", "wait")


def test_the_closed_form_of_base_parameters(robot):
    with pytest.raises(RobotDescriptionError, match=REFUSED):
        closed_form_base_parameters(robot)


@pytest.mark.parametrize("to", ["urdf", "sdf"])
def test_files_of_other_programs(robot, to):
    with pytest.raises(RobotDescriptionError, match=REFUSED + ".*MJCF, or as JSON"):
        export_model(runnable_model(robot), to)


@pytest.mark.parametrize("write", [to_sdf, to_urdf])
def test_files_that_are_written_by_themselves(robot, write):
    with pytest.raises(RobotDescriptionError, match=REFUSED + ".*MJCF, or as JSON"):
        write(runnable_model(robot))


@pytest.mark.parametrize(
    "look",
    [
        outline_of,
        lambda robot: Clearances.of(robot, ()),
        lambda robot: clearances_of_room(robot, RoomEntry()),
        lambda robot: exact_distances(robot, [(0, 1)], np.zeros((1, 2))),
    ],
)
def test_collisions(robot, look):
    with pytest.raises(RobotDescriptionError, match=REFUSED):
        look(robot)


def test_designed_motions(robot):
    with pytest.raises(RobotDescriptionError, match=REFUSED):
        design_motion(robot)


def test_simulators(robot, problem):
    with pytest.raises(RobotDescriptionError, match=REFUSED):
        fit_simulator(robot, problem.loop, problem.recordings)


def test_payloads(robot, problem, result):
    with pytest.raises(RobotDescriptionError, match=REFUSED):
        identify_payload(problem, problem.recordings)
    with pytest.raises(RobotDescriptionError, match=REFUSED):
        identify_payload(result, problem)
    with pytest.raises(RobotDescriptionError, match=REFUSED):
        Payload(1.0).base_columns(base_parameters(robot))


def test_gravity_in_the_control_law(robot, problem):
    with pytest.raises(RobotDescriptionError, match=REFUSED):
        gravity_columns(robot)
    with pytest.raises(RobotDescriptionError, match=REFUSED):
        GravityModel.nominal(robot)
    with pytest.raises(RobotDescriptionError, match=REFUSED):
        GravityModel(robot, np.zeros((2, 2, 4)))
    with pytest.raises(RobotDescriptionError, match=REFUSED):
        pv.simulate(robot, pv.Loop(GAINS, feed_forward="gravity_measured"))


def test_derivatives_of_the_inverse_dynamics(robot):
    still = np.zeros((1, 2))
    with pytest.raises(RobotDescriptionError, match=REFUSED):
        inverse_dynamics_derivatives(robot, (), np.zeros(0), still, still, still)
    with pytest.raises(RobotDescriptionError, match=REFUSED):
        RegressorDerivatives.of(regressor_of(robot, standard_parameters(robot)))


def test_friction_with_a_memory(robot, problem):
    slow = robot.with_friction(FrictionLaw((viscous(), *lugre(1e-3, 0.3, 0.1))))
    with pytest.raises(RobotDescriptionError, match=r"friction with a memory.*closed loops"):
        pv.Problem(slow, problem.recordings)


@pytest.mark.parametrize("command", [["excite", "five_bar", "--out", "{folder}"]])
def test_commands(command, tmp_path, capsys):
    code = main([word.format(folder=tmp_path / "motion") for word in command])
    assert code == 1
    assert "has closed loops, which" in capsys.readouterr().err
    assert not (tmp_path / "motion").exists()
