"""Robots on feet that stand, against records by MuJoCo whose contact forces nobody knows."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.mujoco_base import Accuracy
from benchmarks.mujoco_stance import stance_record, standing_quadruped, truth_of_stance
from scipy.spatial.transform import Rotation

from pivident.app.cli import main
from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import RecordingError, RobotDescriptionError
from pivident.loop.motion.motion import residual_of
from pivident.loop.motion.planted_feet import on_planted_feet
from pivident.robot.gallery import load_robot
from pivident.robot.joints import Contact
from pivident.robot.robot_values import robot_of_values, robot_values
from pivident.signals.bandpass import butterworth


@pytest.fixture(scope="module")
def robot():
    return standing_quadruped()


@pytest.fixture(scope="module")
def record(robot):
    made = stance_record(robot, 1500, 0, Accuracy(1e-7, 0.0, 0.0, 1e-6, 1e-6), substeps=10)
    return made.part(100, made.samples)


def test_the_legs_follow_the_trunk(robot, record):
    closed, (made,) = on_planted_feet(robot, [record])
    assert closed.joint_names == robot.joint_names[:6]
    still = np.zeros_like(made.q).T
    legs = ClosedChains(closed).motion(made.q.T, still, still).q[6:]
    # noise of the pose over a leg of a quarter metre
    assert np.abs(legs.T - record.q[:, 6:]).max() < 1e-4
    assert made.samples == record.samples and not made.tau.any()


def test_the_unknown_contact_forces_leave_the_equations(robot, record):
    closed, recordings = on_planted_feet(robot, [record])
    problem = Problem(closed, recordings)
    truth = truth_of_stance(problem, robot)
    assert "ia[front_left_knee]" in [p.name for p in problem.base.standard]
    motion = estimate_kinematics(problem.recordings[0], RandomWalk())
    left, wrong, size = (
        np.std(butterworth(x.T, record.rate, 20.0)[motion.start : motion.stop], axis=0)
        for x in (
            residual_of(problem.regressor, motion, truth),
            residual_of(problem.regressor, motion, 1.2 * truth),
            motion.tau,
        )
    )
    assert np.all(left < 0.01 * size)
    assert np.all(wrong > 0.1 * size)


def test_torques_of_motors_do_the_work_of_the_base(robot, record):
    # by virtual work the torque on the base is that of the motors on the way of the legs
    closed, (made,) = on_planted_feet(robot, [replace(record, torque_timing="sampled")])
    still = np.zeros_like(made.q).T
    gain = ClosedChains(closed).motion(made.q.T, still, still).gain
    speed = np.random.default_rng(3).normal(size=(6,))
    legs = np.einsum("iat,a->ti", gain, speed)
    power = np.sum(record.tau * legs, axis=1)
    assert made.wrench_torque @ speed == pytest.approx(power, rel=1e-9, abs=1e-9)


def test_a_foot_that_leaves_its_place_is_named(robot, record):
    q = record.q.copy()
    q[700:, robot.joint_names.index("rear_left_hip")] += 0.15
    with pytest.raises(
        RecordingError, match=r"foot of 'rear_left_knee' does not stand: .* mm from"
    ):
        on_planted_feet(robot, [replace(record, q=q)])


def test_feet_that_do_not_determine_the_legs_are_refused(robot, record):
    fewer = replace(robot, contacts=robot.contacts[:3])
    with pytest.raises(RobotDescriptionError, match="nothing determines rear_right"):
        on_planted_feet(fewer, [record])


def test_the_link_of_a_foot_may_be_the_number_of_its_joint(robot, record):
    """Joints of the base are not counted, as those of force sensors are not."""
    numbers = [robot.link_index(foot.link) - 6 + 1 for foot in robot.contacts]
    assert numbers == [3, 6, 9, 12]
    feet = [replace(f, link=str(k)) for f, k in zip(robot.contacts, numbers, strict=True)]
    closed, _ = on_planted_feet(replace(robot, contacts=tuple(feet)), [record])
    named, _ = on_planted_feet(robot, [record])
    links = [closure.links for closure in closed.constraints.closures]
    assert links == [closure.links for closure in named.constraints.closures]


def test_a_standing_robot_is_stored_with_its_motors(robot, record):
    closed, _ = on_planted_feet(robot, [record])
    again = robot_of_values(robot_values(closed))
    assert again.constraints.driven == closed.constraints.driven == tuple(range(6, 18))
    feet = robot_of_values(robot_values(robot)).contacts
    assert [foot.link for foot in feet] == [foot.link for foot in robot.contacts]


def test_a_contact_is_a_point():
    with pytest.raises(RobotDescriptionError, match="three finite numbers"):
        Contact("shank", np.array([0.0, np.nan, 0.0]))


def test_the_quadruped_of_the_gallery_floats():
    robot = load_robot("quadruped")
    assert robot.base_motion == "measured" and robot.base_joints == 6
    assert robot.links[5].name == "trunk" and robot.links[5].inertia[9] == 12.0
    assert robot.on_fixed_base.size == 12


def test_the_command_line_checks_and_identifies_a_stance(robot, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    made = stance_record(robot, 2600, 1, Accuracy(2e-5, 0.0, 0.0, 5e-5, 5e-5), substeps=6)
    part = made.part(100, made.samples)
    names = robot.joint_names[6:]
    turns = Rotation.from_euler("XYZ", part.q[:, 3:6]).as_quat()
    table = np.column_stack([part.t, part.q[:, 6:], part.tau[:, 6:], part.q[:, :3], turns])
    joints = [f"{c}_{n}" for c in ("q", "tau") for n in names]
    header = ["time", *joints, "x", "y", "z", "qx", "qy", "qz", "qw"]
    np.savetxt("log.csv", table, delimiter=",", header=",".join(header), comments="")
    q, tau = ([f"{c}_{n}" for n in names] for c in ("q", "tau"))
    text = f"""[robot]
model = "quadruped"
[recording]
files = "log.csv"
[recording.columns]
t = "time"
q = {json.dumps(q)}
tau = {json.dumps(tau)}
base = {{position = ["x", "y", "z"], quaternion = ["qx", "qy", "qz", "qw"]}}
[identify]
methods = ["ls"]
"""
    feet = "".join(
        f'[[contact]]\nlink = "{foot.link}"\nat = [0.25, 0.0, 0.0]\n' for foot in robot.contacts
    )
    Path("stance.toml").write_text(text + feet, encoding="utf-8")
    assert main(["check", "stance.toml"]) == 0
    assert "138 base parameters" in capsys.readouterr().out
    assert main(["identify", "--details", "stance.toml", "--folds", "0", "--out", "out"]) == 0
    said = capsys.readouterr().out
    assert "let base_x" in said or "move base_x" in said
    Path("slipped.toml").write_text(text + feet.replace("0.25", "0.15"), encoding="utf-8")
    assert main(["check", "slipped.toml"]) != 0
    assert "does not stand" in capsys.readouterr().out
