"""A problem whose log has no torque: its torque is that of the law, and what stays open is said."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS, WITHOUT_TORQUE
from pivident.estimation.parameter_rows import parameter_rows
from pivident.estimation.problem import TOPIC, Problem
from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD, PID
from pivident.loop.simulation.simulated_record import simulate
from pivident.robot.gallery import load_robot

LOOP = Loop(PD([6000.0, 2500.0], [180.0, 60.0]))


@pytest.fixture(scope="module")
def robot():
    return load_robot("planar_2r")


@pytest.fixture(scope="module")
def made(robot):
    return simulate(robot, LOOP, encoder=2e-6, duration=8.0, seed=3)


def positions_only(recording: Recording) -> Recording:
    return replace(recording, tau=np.zeros_like(recording.tau), torque_source="none")


@pytest.fixture(scope="module")
def problem(robot, made):
    return Problem(robot, positions_only(made.recording), LOOP)


def kinds(findings) -> list[str]:
    return [finding.kind for finding in findings if finding.topic == TOPIC]


def test_the_problem_computes_the_torque(problem, made):
    (recording,) = problem.recordings
    assert recording.torque_source == "law"
    np.testing.assert_allclose(recording.tau[1:], made.motion.tau[1:], atol=1e-8)


def test_what_positions_cannot_tell_is_said_once(problem):
    assert kinds(problem.findings) == ["scale"]
    again = replace(problem, parameters=None)
    assert kinds(again.findings) == ["scale"]


def test_torques_that_are_fed_forward_have_the_scale_of_the_description(robot, made):
    loop = replace(LOOP, feed_forward="gravity")
    (found,) = Problem(robot, positions_only(made.recording), loop).findings
    assert "of the description, whose torques the law feeds forward" in found.message


def test_a_measured_torque_has_nothing_to_say(robot, made):
    assert kinds(Problem(robot, made.recording, LOOP).findings) == []


@pytest.mark.parametrize("method", ["ls", "cloe"])
def test_the_scale_of_the_gains_is_that_of_the_parameters(method, robot, made):
    """Gains that are 20 % too large make all parameters so, and the fit is as good."""
    bare = positions_only(made.recording)
    larger = Loop(PD([7200.0, 3000.0], [216.0, 72.0]))
    found = [identify(Problem(robot, bare, loop), method) for loop in (LOOP, larger)]
    size = np.abs(found[0].theta) + found[0].std
    np.testing.assert_allclose(found[1].theta / size, 1.2 * found[0].theta / size, atol=1e-4)
    assert found[1].relative_error == pytest.approx(found[0].relative_error, rel=1e-6)
    assert [w.kind for w in found[1].warnings] == [w.kind for w in found[0].warnings]


@pytest.mark.parametrize(
    ("method", "said"), [("cloe", ["scale"]), ("piv", ["scale", "equation error"])]
)
def test_known_gains_give_the_parameters_in_si_units(method, said, problem, made):
    found = identify(problem, method)
    truth = np.array([made.truth[name] for name in found.names])
    assert np.all(np.abs(found.theta - truth) < 4.0 * found.std)
    assert np.median(found.std / np.maximum(np.abs(truth), found.std)) < 1e-3
    assert kinds(found.warnings) == said
    assert any("commands at the recorded positions" in s for s in found.recordings[0].account)


@pytest.mark.parametrize("method", ["cloe", "piv"])
def test_an_unknown_drive_gain_gives_ratios(method, robot, made):
    """The machine has a gain of 4 that nobody knows; parameters come out a quarter as large."""
    loop = Loop(PD([1500.0, 625.0], [45.0, 15.0]), gain_known=False)
    problem = Problem(robot, positions_only(made.recording), loop)
    found = identify(problem, method)
    truth = np.array([made.truth[name] for name in found.names])
    assert np.all(np.abs(4.0 * found.theta - truth) < 4.0 * 4.0 * found.std)
    assert "ratio" in kinds(found.warnings)
    assert any("ratio to the drive gain" in w.message for w in found.warnings)
    units = {row.name: row.unit for row in parameter_rows(found)}
    assert units["ia2"] == "kg m²/(N m/output)"
    assert {joint.torque_unit for joint in found.joints} == {"output"}


def test_a_gain_of_one_joint_that_is_wrong_shows(robot, made):
    """What the joints share, and the simulated loop, tell one wrong gain from a common scale."""
    loop = Loop(PD([6000.0, 3000.0], [180.0, 72.0]))
    found = identify(Problem(robot, positions_only(made.recording), loop), "cloe")
    assert "wrong gain" in [w.kind for w in found.warnings]


def test_an_integrator_leaves_a_constant_open(robot, made):
    loop = Loop(PID([6000.0, 2500.0], [180.0, 60.0], ki=[0.0, 100.0]))
    (found,) = [
        f
        for f in Problem(robot, positions_only(made.recording), loop).findings
        if f.kind == "integrator"
    ]
    assert "elbow" in found.message
    assert "shoulder" not in found.message


def test_least_squares_is_called_biased(problem):
    assert "biased" in kinds(identify(problem, "ls").warnings)


def test_methods_that_compare_torques_need_them():
    refused = {n for n, m in METHODS.items() if not m.handles.computed_torque}
    assert refused == {"didim", "clie", "ml", "oloe"}


@pytest.mark.parametrize("name", ["didim", "clie", "ml", "oloe"])
def test_methods_that_compare_torques_are_refused(name, problem):
    with pytest.raises(IdentificationError, match="needs measured torques") as caught:
        identify(problem, name)
    assert str(caught.value).endswith(f"use {WITHOUT_TORQUE[0]}")


def test_without_a_law_there_is_no_torque(robot, made):
    with pytest.raises(ExperimentError, match="no control law is known"):
        Problem(robot, positions_only(made.recording))
