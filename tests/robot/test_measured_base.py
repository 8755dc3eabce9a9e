"""Bases that a force sensor holds, or that float: their rows against MuJoCo, their poses."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pivident as pv
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.robot_regressor import regressor_of
from pivident.foundation.errors import RobotDescriptionError
from pivident.robot import Link, with_floating_base, with_held_base, with_wrench_sensors
from pivident.robot.frames import Pose, rotation_from_rpy
from pivident.robot.measured_base import (
    BASE_JOINTS,
    base_positions,
    rotations_from_quaternions,
    rotations_from_rpy,
    wrench_torques,
)
from pivident.robot.robot_values import robot_of_values, robot_values
from pivident.robot.wrench_sensor import WrenchSensor

FLOOR = WrenchSensor(
    "floor", "base", Pose(rotation_from_rpy(0.3, -0.2, 1.0), np.array([0.1, 0.05, -0.2]))
)


def torques_of(robot, q, dq, ddq):
    """The model without friction, shape (samples, joints)."""
    parameters = standard_parameters(robot)
    theta = nominal_values(robot, parameters)
    theta[[p.friction is not None for p in parameters]] = 0.0
    phi = regressor_of(robot, parameters).matrix(q, dq, ddq)
    return (phi @ theta).reshape(robot.size, -1).T if phi.ndim == 2 else phi @ theta


def states(robot, count, seed=1):
    """Random q dq ddq, a held base at rest, a floating one away from a pitch of 90 degrees."""
    made = np.random.default_rng(seed).uniform(-1.2, 1.2, (3, count, robot.size))
    if robot.base_motion == "held":
        made[:, :, : robot.base_joints] = 0.0
    return made


@pytest.fixture(scope="module")
def bench():
    pytest.importorskip("mujoco")
    from benchmarks import base_wrench, mujoco_base, quadruped

    from tests.robot import mujoco_base_twin

    return {
        "arm": base_wrench.arm_on_sensor(),
        "quadruped": quadruped.quadruped(),
        "Push": mujoco_base.Push,
        "Twin": mujoco_base_twin.BaseTwin,
        "draw": mujoco_base.with_drawn_masses,
    }


def test_rows_of_a_held_base_are_what_mujocos_force_sensor_measures(bench):
    robot = bench["arm"]
    twin = bench["Twin"](robot, [bench["Push"](FLOOR)])
    q, dq, ddq = states(robot, 20)
    ours = torques_of(robot, q, dq, ddq)
    for k in range(len(q)):
        theirs = twin.inverse(q[k], dq[k], ddq[k])
        base = wrench_torques(robot, FLOOR, q[k : k + 1], twin.data.sensordata[None])
        np.testing.assert_allclose(ours[k, 6:], theirs[6:], atol=1e-9)
        np.testing.assert_allclose(ours[k, :6], base[0, :6], atol=1e-9)
    assert np.abs(ours[:, :6]).min(axis=0).max() > 1.0


@pytest.mark.parametrize("name", ["arm", "quadruped"])
def test_rows_of_a_floating_base_are_mujocos_inverse_dynamics(bench, name):
    robot = bench[name]
    if name == "arm":
        robot = bench["draw"](
            with_floating_base(robot.on_fixed_base), [8, 12, 9, 6, 3, 2, 1], 0.3, 6
        )
    twin = bench["Twin"](robot)
    q, dq, ddq = states(robot, 20, seed=2)
    ours = torques_of(robot, q, dq, ddq)
    for k in range(len(q)):
        np.testing.assert_allclose(ours[k], twin.inverse(q[k], dq[k], ddq[k]), atol=1e-9)


def test_a_robot_on_a_fixed_base_stays_what_it_was():
    arm = pv.load_robot("staubli_tx40")
    for made in (with_held_base(arm), with_floating_base(arm)):
        assert made.size == 12 and made.base_joints == 6 and made.joint_names[:6] == BASE_JOINTS
        back = made.on_fixed_base
        parameters = standard_parameters(arm)
        assert [p.name for p in parameters] == [p.name for p in standard_parameters(back)]
        q, dq, ddq = states(arm, 5)
        np.testing.assert_array_equal(
            regressor_of(arm, parameters).matrix(q, dq, ddq),
            regressor_of(back, parameters).matrix(q, dq, ddq),
        )
        assert [(c.motor, c.joint) for c in back.couplings] == [
            (c.motor, c.joint) for c in arm.couplings
        ]


def test_what_a_sensor_under_the_base_shows_of_it():
    held = base_parameters(with_held_base(pv.load_robot("planar_2r")))
    floating = base_parameters(with_floating_base(pv.load_robot("planar_2r")))
    own = [name for name in held.names if name.endswith("[base]")]
    # the weight of a base that stands still, and where it is, but neither its height nor inertia;
    # gravity is along y, and the arm moves in this plane
    assert sorted(own) == ["mr[base]", "mx[base]", "mzr[base]"]
    assert len([name for name in floating.names if name.endswith("[base]")]) == 10
    assert not any(p.joint < 6 and p.stem in ("ia", "fv", "fc", "off") for p in floating.standard)
    assert {f"ia{k}" for k in (1, 2)} <= {p.name for p in floating.standard}


def test_a_fixed_robot_with_a_sensor_under_its_base_is_held():
    arm = pv.load_robot("staubli_tx40")
    assert with_wrench_sensors(arm, [FLOOR]).base_motion == "held"
    tool = WrenchSensor("tool", arm.links[-1].name)
    assert with_wrench_sensors(arm, [tool]).base_joints == 0
    assert with_wrench_sensors(with_floating_base(arm), [FLOOR]).base_motion == "measured"


@pytest.mark.parametrize("make", [with_held_base, with_floating_base])
def test_a_stored_robot_comes_back(make):
    arm = make(pv.load_robot("staubli_tx40"))
    sensors = [FLOOR, WrenchSensor("tool", "6", Pose.identity(), "by_robot")]
    before = with_wrench_sensors(arm, sensors)
    after = robot_of_values(json.loads(json.dumps(robot_values(before), allow_nan=False)))
    assert after.base_motion == before.base_motion and after.joint_names == before.joint_names
    assert base_parameters(after).expressions == base_parameters(before).expressions
    for own, other in zip(before.sensors, after.sensors, strict=True):
        assert (own.name, own.link, own.acts) == (other.name, other.link, other.acts)
        np.testing.assert_array_equal(own.frame.rotation, other.frame.rotation)
        np.testing.assert_array_equal(own.frame.translation, other.frame.translation)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("rotation", [[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], "not orthonormal"),
        ("translation", [0.0, 1.0], "translation"),
    ],
)
def test_stored_sensors_without_a_frame_are_refused(key, value, message):
    stored = robot_values(with_wrench_sensors(pv.load_robot("planar_2r"), [FLOOR]))
    stored["sensors"][0]["frame"][key] = value
    with pytest.raises(RobotDescriptionError, match=message):
        robot_of_values(stored)


def test_stored_joints_without_motors_come_first():
    stored = robot_values(with_held_base(pv.load_robot("planar_2r")))
    stored["joints"][2]["motion"] = "measured"
    with pytest.raises(RobotDescriptionError, match="the six of its base, which come first"):
        robot_of_values(stored)


def test_poses_are_those_of_scipy():
    turns = Rotation.random(200, random_state=3)
    turns = turns[np.abs(turns.as_euler("XYZ")[:, 1]) < 1.4]
    position = np.random.default_rng(1).normal(size=(len(turns), 3))
    made = base_positions(position, turns.as_matrix())
    again = Rotation.from_euler("XYZ", made[:, 3:])
    assert (again * turns.inv()).magnitude().max() < 1e-12
    np.testing.assert_array_equal(made[:, :3], position)
    long = turns.as_quat() * 1.005
    np.testing.assert_allclose(rotations_from_quaternions(long), turns.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(
        rotations_from_rpy(turns.as_euler("xyz")), turns.as_matrix(), atol=1e-12
    )


def test_a_base_that_turns_round_and_round_has_no_jumps():
    angle = np.linspace(0.0, 20.0, 500)
    turns = Rotation.from_euler("XYZ", np.column_stack([0.1 * angle, 0 * angle, angle]))
    made = base_positions(np.zeros((500, 3)), turns.as_matrix())
    np.testing.assert_allclose(made[:, 5], angle, atol=1e-9)


def test_a_pitch_of_a_right_angle_is_refused_with_its_sample():
    pitch = np.array([0.0, 0.5, -1.52, 1.55])
    turns = Rotation.from_euler("XYZ", np.column_stack([0 * pitch, pitch, 0 * pitch]))
    with pytest.raises(RobotDescriptionError, match=r"sample 2: the base is pitched by -87°"):
        base_positions(np.zeros((4, 3)), turns.as_matrix())


@pytest.mark.parametrize("bad", [[0.0, 0.0, 0.0, 0.9], [0.0, 0.0, 0.0, np.nan], [0, 0, 0, 0]])
def test_quaternions_of_another_length_are_refused_with_their_sample(bad):
    values = np.tile([0.0, 0.0, 0.0, 1.0], (5, 1))
    values[3] = bad
    with pytest.raises(RobotDescriptionError, match=r"sample 3: the quaternion .* x, y, z, w"):
        rotations_from_quaternions(values)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda r: with_floating_base(with_held_base(r)), "has a measured base already"),
        (lambda r: with_held_base(pv.load_robot("five_bar")), "has closed loops"),
        (lambda r: with_held_base(r, Link(r.joint_names[0])), "rename it"),
        (lambda r: with_wrench_sensors(r, [FLOOR, FLOOR]), "floor, floor; each once"),
        (
            lambda r: with_wrench_sensors(r, [WrenchSensor("tool", "hand")]),
            "wrench sensor 'tool'.*hand",
        ),
        (
            lambda r: with_wrench_sensors(pv.load_robot("five_bar"), [FLOOR]),
            "measured wrenches on such mechanisms are not handled yet",
        ),
        (lambda r: WrenchSensor("tool", "2", acts="on_it"), "choose 'on_robot' or 'by_robot'"),
        (
            lambda r: WrenchSensor("tool", "2", Pose(2.0 * np.eye(3), np.zeros(3))),
            "'tool': the rotation of its frame is not orthonormal",
        ),
        (
            lambda r: WrenchSensor("tool", "2", Pose(np.eye(3), np.array([0.0, np.nan, 0.0]))),
            "three finite numbers in m",
        ),
        (
            lambda r: replace(r, joints=(replace(r.joints[0], motion="held"), r.joints[1])),
            "joints without motors are the six of its base",
        ),
    ],
)
def test_errors(made, message):
    with pytest.raises(RobotDescriptionError, match=message):
        made(pv.load_robot("planar_2r"))
