"""Joint torques of measured wrenches against MuJoCo's Jacobians."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco")

from benchmarks.base_wrench import arm_on_sensor
from benchmarks.mujoco_base import Push
from benchmarks.quadruped import quadruped

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot import measured_base as module
from pivident.robot.frames import Pose, rotation_from_rpy
from pivident.robot.measured_base import link_places, sensor_link, wrench_torques
from pivident.robot.wrench_sensor import WrenchSensor
from tests.robot.mujoco_base_twin import BaseTwin

FRAME = Pose(rotation_from_rpy(0.4, -0.7, 2.0), np.array([0.05, -0.1, 0.15]))


def states(robot, seed=4, count=12):
    q = np.random.default_rng(seed).uniform(-1.3, 1.3, (count, robot.size))
    if robot.base_motion == "held":
        q[:, :6] = 0.0
    return q


def with_a_slide(robot):
    joints = list(robot.joints)
    joints[2] = replace(joints[2], kind="prismatic")
    return replace(robot, joints=tuple(joints))


CASES = {
    "tool of an arm on a fixed base": (lambda: arm_on_sensor().on_fixed_base, "joint_6"),
    "tool of an arm on a force sensor": (arm_on_sensor, "joint_6"),
    "foot of a floating base": (quadruped, "rear_left_shank"),
    "cable of a floating base": (quadruped, "base"),
    "behind a slide": (lambda: with_a_slide(arm_on_sensor().on_fixed_base), "joint_6"),
}


@pytest.mark.parametrize("case", CASES)
def test_torques_are_those_of_mujocos_jacobian(case):
    make, link = CASES[case]
    robot = make()
    sensor = WrenchSensor("sensor", link, FRAME)
    twin = BaseTwin(robot, [Push(sensor, lambda t, p, v: np.zeros(3))])
    q = states(robot)
    wrench = np.random.default_rng(5).normal(size=(len(q), 6)) * 30.0
    ours = wrench_torques(robot, sensor, q, wrench)
    moves = slice(6, None) if robot.base_motion == "held" else slice(None)
    for k, own in enumerate(ours):
        theirs = twin.applied(q[k], sensor, wrench[k])
        np.testing.assert_allclose(own[moves], theirs[moves], atol=1e-9)
        np.testing.assert_allclose(
            link_places(robot, sensor_link(robot, sensor), q[k : k + 1])[0][0]
            @ sensor.frame.rotation,
            twin.data.site("sensor").xmat.reshape(3, 3),
            atol=1e-12,
        )
    assert np.abs(ours).max() > 10.0


def test_a_wrench_on_a_held_base_is_moved_to_the_bases_origin():
    robot = arm_on_sensor()
    sensor = WrenchSensor("floor", "base", FRAME)
    wrench = np.random.default_rng(6).normal(size=(1, 6))
    force, moment = FRAME.rotation @ wrench[0, :3], FRAME.rotation @ wrench[0, 3:]
    torques = wrench_torques(robot, sensor, np.zeros((1, 12)), wrench)[0]
    np.testing.assert_allclose(torques[:3], force, atol=1e-14)
    np.testing.assert_allclose(
        torques[3:6], moment + np.cross(FRAME.translation, force), atol=1e-14
    )
    assert not torques[6:].any()


def test_what_the_robot_does_has_the_opposite_sign_and_blocks_make_no_difference(monkeypatch):
    robot, q = quadruped(), states(quadruped())
    wrench = np.random.default_rng(7).normal(size=(len(q), 6))
    on = wrench_torques(robot, WrenchSensor("a", "front_left_shank", FRAME), q, wrench)
    monkeypatch.setattr(module, "BLOCK", 5)
    by = wrench_torques(robot, WrenchSensor("a", "front_left_shank", FRAME, "by_robot"), q, wrench)
    np.testing.assert_array_equal(on, -by)
    others = [k for k, name in enumerate(robot.joint_names) if "rear" in name or "right" in name]
    assert not on[:, others].any()


def test_links_are_named_by_themselves_their_joint_or_its_number():
    arm = arm_on_sensor()
    for robot, first in ((arm, 6), (arm.on_fixed_base, 0)):
        for link in ("link_3", "joint_3", "3"):
            assert sensor_link(robot, WrenchSensor("tool", link)) == first + 2


def test_a_link_that_is_not_there_is_named():
    with pytest.raises(RobotDescriptionError, match=r"wrench sensor 'tool'.*'hand'"):
        sensor_link(quadruped(), WrenchSensor("tool", "hand"))
