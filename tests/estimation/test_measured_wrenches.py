"""Estimates with measured wrenches on records by MuJoCo: what it was given is found."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco")

from benchmarks.base_wrench import ARM_GAINS, DRIVE_GAINS, FLOOR, arm_on_sensor, arm_record
from benchmarks.mujoco_base import Push, mujoco_base_record, truth_of
from benchmarks.quadruped import RATED, hanging_record, quadruped

from pivident.data.recording.measured_wrenches import with_wrenches
from pivident.estimation.drives.drive_gains import identify_drive_gains
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import LOW_SPEED, Problem
from pivident.foundation.errors import SimulationDiverged
from pivident.judgement.diagnostics.diagnostics import diagnose
from pivident.judgement.diagnostics.verdict import verdict
from pivident.judgement.model_errors.named_causes import named_causes
from pivident.judgement.validation.held_out.prediction import PredictionError
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.frames import Pose, rotation_about
from pivident.robot.gallery import load_robot
from pivident.robot.measured_base import BASE_JOINTS, with_wrench_sensors
from pivident.robot.wrench_sensor import WrenchSensor

PART = slice(0, 3), slice(3, 6)

LOOP = Loop(PD(*ARM_GAINS))


@pytest.fixture(scope="module")
def arm():
    """A TX40 on a force sensor."""
    robot = arm_on_sensor()
    return robot, arm_record(robot, 1, 4.0)


def off(result, robot):
    """Errors in standard errors."""
    truth = truth_of(robot)
    return (result.theta - [truth[name] for name in result.names]) / result.std


@pytest.mark.parametrize("method", ["ls", "iv-full-rate", "piv"])
def test_an_arm_on_a_force_sensor(arm, method):
    robot, recording = arm
    result = identify(Problem(robot, (recording,), LOOP), METHODS[method])
    errors = off(result, robot)
    assert result.converged and np.abs(errors).max() < 4.0
    assert np.mean(np.abs(errors) < 2.0) > 0.8
    assert np.isfinite(result.std).all()
    found = {joint.name: joint.torque_unit for joint in result.joints}
    assert found["base_z"] == "N" and found["base_yaw"] == "N m"
    # the mass of all bodies, base included, to a gram
    mass = sum(link.inertia[9] for link in robot.links)
    assert result.theta[result.names.index("mr[base]")] == pytest.approx(mass, abs=0.01)


def test_gains_of_drives_come_from_the_sensor(arm):
    robot, recording = arm
    commands = np.hstack([recording.tau[:, :6], recording.tau[:, 6:] / DRIVE_GAINS])
    loop = Loop(PD(*(gain / DRIVE_GAINS for gain in ARM_GAINS)))
    made = identify_drive_gains(Problem(robot, (replace(recording, tau=commands),), loop))
    assert made.joints == robot.joint_names[6:]
    np.testing.assert_allclose(made.kappa, DRIVE_GAINS, rtol=0.01)
    assert np.all(np.abs(made.kappa - DRIVE_GAINS) < 4.0 * made.std)
    assert all(group.anchored for group in made.groups)


def again(recording, sensor, values):
    """The problem with the sensor described, or its log written, in another way."""
    robot = with_wrench_sensors(arm_on_sensor(), [sensor])
    driven = replace(recording.behind(6), wrenches=(), wrench_torque=None).part(0, 3000)
    return Problem(robot, (with_wrenches(driven, robot, {"floor": values[:3000]}),), LOOP)


TURN = Pose(
    FLOOR.frame.rotation @ rotation_about(np.eye(3)[1], np.radians(3.0)), FLOOR.frame.translation
)
FRAMES = {
    "right": (FLOOR, lambda v: v, ""),
    "3 degrees": (replace(FLOOR, frame=TURN), lambda v: v, "frame about its y"),
    "sign": (replace(FLOOR, acts="by_robot"), lambda v: v, "opposite direction"),
    "axes": (
        FLOOR, lambda v: np.column_stack([v[:, 1], -v[:, 0], v[:, 2], v[:, 4], -v[:, 3], v[:, 5]]),
        "are y, -x, z",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", FRAMES)
def test_a_wrong_frame_is_named(arm, case):
    sensor, change, words = FRAMES[case]
    problem = again(arm[1], sensor, change(arm[1].wrenches[0].values))
    found = named_causes(problem, identify(problem, METHODS["piv"]))
    wrong = [cause for cause in found.named if cause.matters]
    if not words:
        assert not wrong
        return
    assert words in str(wrong[0]) and "floor" in str(wrong[0])


def test_an_axis_of_the_base_without_force_does_not_hide_the_others():
    size = np.array([10.0, 300.0, 0.1, 4.0, 0.01, 20.0, 16.0, 5.0])
    rms = np.array([0.1, 0.1, 0.1, 0.03, 0.01, 0.04, 0.08, 0.05])
    names = (*BASE_JOINTS, "shoulder", "elbow")
    units = ("N",) * 3 + ("N m",) * 5
    error = PredictionError(names, units, rms, size, rms, size, 0 * rms, 0 * rms, 20.0, 100)
    force, moment = (np.linalg.norm(rms[p]) / np.linalg.norm(size[p]) for p in (PART[0], PART[1]))
    ratios = [force] * 3 + [moment] * 3 + [0.08 / 16.0, 0.05 / 5.0]
    expected = 100.0 * np.sqrt(np.mean(np.square(ratios)))
    for total in (error.total, error.total_in_band, error.total_moving_in_band):
        assert total == pytest.approx(expected, rel=1e-12) and total < 1.0


@pytest.mark.parametrize("size", [0.0, 20.0])
def test_the_verdict_refuses_forces_that_nobody_measures(arm, size):
    values = arm[1].wrenches[0].values.copy()  # somebody pushes the arm, and the floor holds it
    values[:, 0] += size * np.sin(np.arange(len(values)) / 120.0)
    problem, methods = again(arm[1], FLOOR, values), {"ls": METHODS["ls"]}
    found = {"ls": identify(problem, methods["ls"])}
    judged = verdict(diagnose(problem, found, methods, folds=2))
    about = [s for s in judged.statements if s.topic == "wrenches"]
    if not size:
        assert not about
        assert not any("base_" in s.message for s in judged.statements if s.topic == "motion")
        return
    (statement,) = about
    assert judged.headline.startswith("Do not use it for torque prediction: the measured wrenches")
    assert "base_" in statement.message and "no sensor measures" in statement.next_step


@pytest.mark.parametrize("method", ["ls", "iv-full-rate", "piv"])
def test_a_quadruped_on_a_cable(hanging, method):
    robot, recording = hanging
    result = identify(Problem(robot, (recording,)), METHODS[method])
    errors = off(result, robot)
    assert np.mean(np.abs(errors) < 2.0) > (0.8 if method == "ls" else 0.85)
    assert np.isfinite(result.std).all()
    if method == "ls":
        return
    assert result.instruments.kind == "halves"
    # noise of a slow leg's speed is in the sign of its friction; a base has none
    (record,) = result.equations.records
    kin = record.kinematics
    slow = np.abs(kin.dq[6:]) < LOW_SPEED * RATED
    assert slow.mean() > 0.05
    assert not (record.used[6:] & slow).any()
    assert record.used[:6, kin.start + 500 : kin.stop].all()


@pytest.fixture(scope="module")
def hanging():
    robot = quadruped()
    return robot, hanging_record(robot, 1, 5.0)


@pytest.fixture(scope="module")
def pushing():
    """A planar arm whose tool pulls a spring, and the sensor between them."""
    robot = load_robot("planar_2r")
    rng = np.random.default_rng(8)
    q_ref, _, _ = point_to_point(
        rng.uniform(-1.5, 1.5, (8, 2)), 0.6 * robot.rated_speeds, 1000.0, 4000
    )

    def spring(t, p, v):
        return -150.0 * (p - [0.5, -0.3, 0.0]) - 5.0 * v

    tool = WrenchSensor("tool", "2", Pose(np.eye(3), np.array([0.4, 0.0, 0.0])))
    gains = np.array([6000.0, 2500.0]), np.array([180.0, 60.0])
    recording = mujoco_base_record(robot, q_ref, 1000.0, gains, [Push(tool, spring)], 1)
    return with_wrench_sensors(robot, [tool]), recording, Loop(PD(*gains))


@pytest.mark.parametrize("method", ["ls", "iv-full-rate", "piv"])
def test_a_sensor_at_the_tool(pushing, method):
    robot, recording, loop = pushing
    result = identify(Problem(robot, (recording,), loop), METHODS[method])
    errors = off(result, robot)
    assert np.abs(errors).max() < 4.0
    if method != "ls":
        assert result.instruments.kind == "loop"
    free = replace(recording, wrenches=(), wrench_torque=None)
    problem = Problem(replace(robot, sensors=()), (free,), loop)
    try:
        without = identify(problem, METHODS[method])
    except SimulationDiverged:
        assert method != "ls"  # so wrong that the simulated loop runs away
        return
    assert np.abs(off(without, robot)).max() > 10.0
