"""Joints of a table that stand still, and bodies that were mounted."""

import numpy as np
import pytest

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.gallery import load_robot
from pivident.robot.mounted import with_body, with_frozen_joints
from pivident.robot.urdf import read_urdf
from tests.robot.kinematics import gravity_torque, link_poses

TOOL = """<robot name="arm"><link name="base"/>
<link name="arm"><inertial><origin xyz="0 0 0.2"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="tool0"/>
<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" velocity="1" effort="9"/></joint>
<joint name="f" type="fixed"><parent link="arm"/><child link="tool0"/>
<origin xyz="0 0 0.5"/></joint>
</robot>"""


@pytest.mark.parametrize("name", ["staubli_tx40", "mitsubishi_rv2sq"])
def test_a_joint_that_stands_still_carries_its_links_along(name):
    whole = load_robot(name)
    still = {whole.joint_names[2]: 0.7, whole.joint_names[4]: -0.4}
    kept = [n for n in whole.joint_names if n not in still and n != whole.joint_names[5]]
    if whole.couplings:  # of the fifth and sixth joint
        kept, still = (
            [n for n in whole.joint_names if n != whole.joint_names[2]],
            {whole.joint_names[2]: 0.7},
        )
    cut = with_frozen_joints(whole, kept, still)
    assert list(cut.joint_names) == kept and cut.torque_side == whole.torque_side
    rng = np.random.default_rng(5)
    q = rng.uniform(-1, 1, whole.size)
    for joint in whole.joint_names:
        if joint not in kept:
            q[whole.joint_names.index(joint)] = still.get(joint, 0.0)
    own = [whole.joint_names.index(n) for n in kept]
    np.testing.assert_allclose(link_poses(cut, q[own]), np.array(link_poses(whole, q))[own])
    np.testing.assert_allclose(
        gravity_torque(cut, q[own]), gravity_torque(whole, q)[own], atol=1e-6
    )
    np.testing.assert_array_equal(cut.rotor_inertia, whole.rotor_inertia[own])
    first = cut.joints[0].friction.terms[0].stem
    assert cut.friction_nominal.get(f"{first}1") == whole.friction_nominal.get(f"{first}1")


@pytest.mark.parametrize(
    ("robot", "joints", "frozen", "words"),
    [
        ("planar_2r", ["elbw"], {}, "there is no moving joint 'elbw'; did you mean 'elbow'"),
        ("planar_2r", ["elbow"], {"elbow": 0.1}, "cannot be kept and frozen"),
        ("planar_2r", ["elbow", "elbow"], {}, "cannot be kept twice"),
        ("planar_2r", ["elbow", "shoulder"], {}, "'elbow' precedes the joint that carries it"),
        ("planar_2r", [], {}, "no joint is kept"),
        ("staubli_tx40", ["joint_5"], {}, "'joint_6' shares a motor with 'joint_5'"),
        ("scara", ["shoulder"], {}, "closed loops"),
    ],
)
def test_what_cannot_be_cut_down_is_named(robot, joints, frozen, words):
    with pytest.raises(RobotDescriptionError, match=words):
        with_frozen_joints(load_robot(robot), joints, frozen)


def test_a_body_hangs_on_a_link_a_joint_or_the_flange():
    robot = load_robot("planar_2r")
    at, mass = [0.1, 0.2, 0.0], 2.75
    held = with_body(robot, "flange", mass, at)
    for name in (robot.links[1].name, "elbow", "2"):
        again = with_body(robot, name, mass, at)
        np.testing.assert_array_equal(again.links[1].inertia, held.links[1].inertia)
    added = held.links[1].inertia - robot.links[1].inertia
    assert added[9] == pytest.approx(mass) and added[6:9] == pytest.approx(mass * np.array(at))
    assert added[5] == pytest.approx(mass * 0.05)
    with pytest.raises(RobotDescriptionError, match="no link 'hand'"):
        with_body(robot, "hand", mass)


def test_a_body_hangs_on_a_fixed_link_of_a_urdf(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(TOOL, encoding="utf-8")
    robot = read_urdf(path)
    held = with_body(robot, "tool0", 1.0, [0.0, 0.0, 0.1])
    before, behind = (gravity_torque(r, np.array([0.5]))[0] for r in (robot, held))
    assert behind / before == pytest.approx((2 * 0.2 + 0.6) / (2 * 0.2), rel=1e-6)
    with pytest.raises(RobotDescriptionError, match="'base' does not move"):
        with_body(robot, "base", 1.0)
