import gzip

import numpy as np
import pytest

from pivident.robot.friction import FrictionLaw, asymmetric_coulomb, coulomb, viscous
from pivident.robot.urdf import parse_urdf, read_urdf
from tests.robot.kinematics import link_poses

ARM = """<?xml version="1.0" encoding="utf-8"?>
<robot name="arm">
  <link name="base"/>
  <link name="upper">
    <inertial>
      <origin xyz="0 0.2 0"/><mass value="2"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.3"/>
    </inertial>
  </link>
  <link name="lower"/>
  <link name="tool">
    <inertial>
      <mass value="1"/>
      <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>
    </inertial>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 2 0"/>
    <limit lower="-1" upper="2" velocity="3" effort="40"/>
    <dynamics damping="0.5" friction="1.5"/>
  </joint>
  <joint name="elbow" type="continuous">
    <origin xyz="0 0.4 0"/>
    <parent link="upper"/><child link="lower"/>
    <limit velocity="0" effort="0"/>
    <dynamics damping="0.7"/>
  </joint>
  <joint name="flange" type="fixed">
    <origin xyz="0.1 0 0"/>
    <parent link="lower"/><child link="tool"/>
  </joint>
</robot>
"""


def test_limits_and_nominal_friction_come_from_the_file():
    robot = parse_urdf(ARM)
    shoulder = robot.joints[0]
    assert robot.name == "arm"
    assert shoulder.position_limits == (-1.0, 2.0)
    assert (shoulder.rated_speed, shoulder.torque_limit) == (3.0, 40.0)
    assert robot.friction_nominal == {"fv1": 0.5, "fc1": 1.5, "fv2": 0.7}


def test_a_zero_limit_counts_as_unknown_and_a_continuous_joint_has_no_range():
    elbow = parse_urdf(ARM).joints[1]
    assert elbow.kind == "revolute"
    assert (elbow.position_limits, elbow.rated_speed, elbow.torque_limit) == (None, None, None)


def test_the_link_frame_has_the_joint_axis_as_z_and_the_inertia_turns_with_it():
    upper = parse_urdf(ARM).links[0].inertia
    # The axis is y, so the new frame is x, -z, y of the URDF frame; inertia about the origin.
    np.testing.assert_allclose(upper[6:], [0, 0, 0.4, 2.0], atol=1e-15)
    np.testing.assert_allclose(upper[:6], [0.18, 0, 0, 0.38, 0, 0.2], atol=1e-15)


def test_the_default_axis_is_x():
    robot = parse_urdf(ARM)
    pose = link_poses(robot, [0.0, 0.0])[1]
    np.testing.assert_allclose(pose[:3, 2], [1, 0, 0], atol=1e-15)


def test_the_body_behind_a_fixed_joint_belongs_to_its_carrier():
    lower = parse_urdf(ARM).links[1]
    assert lower.name == "lower"
    # 0.1 m along the joint's axis: a first moment along z and inertia about x and y.
    np.testing.assert_allclose(lower.inertia, [0.01, 0, 0, 0.01, 0, 0, 0, 0, 0.1, 1], atol=1e-15)


def test_the_friction_law_and_gravity_are_chosen_by_the_caller():
    law = FrictionLaw((viscous(), *asymmetric_coulomb()))
    robot = parse_urdf(ARM, friction=law, gravity=[0, -9.81, 0])
    assert [term.stem for term in robot.joints[0].friction.terms] == ["fv", "fcp", "fcn"]
    assert robot.joints[0].friction.terms[1].gamma == 250.0
    assert robot.friction_nominal == {"fv1": 0.5, "fv2": 0.7}
    np.testing.assert_array_equal(robot.gravity, [0, -9.81, 0])


def test_open_slopes_follow_from_the_rated_speed_and_given_ones_stay():
    assert parse_urdf(ARM).joints[0].friction.terms[1].gamma == 250.0
    given = parse_urdf(ARM, friction=FrictionLaw((coulomb(gamma=99.0),)))
    assert given.joints[0].friction.terms[0].gamma == 99.0


def test_frozen_joints_carry_their_bodies_like_fixed_ones():
    robot = parse_urdf(ARM, frozen={"elbow": 0.3})
    assert robot.joint_names == ("shoulder",)
    assert robot.links[0].inertia[9] == 3.0
    assert parse_urdf(ARM, joints=["shoulder"]).joint_names == ("shoulder",)


def test_a_joint_frozen_before_the_kept_one_only_moves_its_frame():
    robot = parse_urdf(ARM, joints=["elbow"], frozen={"shoulder": np.pi / 2})
    np.testing.assert_allclose(robot.joints[0].translation, [0, 0.4, 0], atol=1e-15)
    np.testing.assert_allclose(robot.joints[0].rotation @ [0, 0, 1], [0, 0, -1], atol=1e-15)
    assert robot.joints[0].parent == -1


TWO_ARMS = """<robot name="two_arms">
  <link name="torso"/><link name="a"/><link name="b"/><link name="c"/>
  <joint name="left" type="revolute"><parent link="torso"/><child link="a"/></joint>
  <joint name="right" type="prismatic"><parent link="torso"/><child link="b"/></joint>
  <joint name="hand" type="revolute"><parent link="a"/><child link="c"/></joint>
</robot>"""


def test_joints_come_depth_first_in_the_order_of_the_file():
    robot = parse_urdf(TWO_ARMS)
    assert robot.joint_names == ("left", "hand", "right")
    assert [joint.parent for joint in robot.joints] == [-1, 0, -1]
    assert robot.joints[2].kind == "prismatic"


def test_chosen_joints_come_in_the_order_in_which_they_are_named():
    robot = parse_urdf(TWO_ARMS, joints=["right", "left", "hand"])
    assert robot.joint_names == ("right", "left", "hand")
    assert [joint.parent for joint in robot.joints] == [-1, -1, 1]
    assert [link.name for link in robot.links] == ["b", "a", "c"]


def test_a_mimic_or_floating_joint_may_be_frozen():
    mimic = TWO_ARMS.replace('<child link="c"/>', '<child link="c"/><mimic joint="left"/>')
    floating = TWO_ARMS.replace('"hand" type="revolute"', '"hand" type="floating"')
    for text in (mimic, floating):
        assert parse_urdf(text, frozen={"hand": 0.0}).joint_names == ("left", "right")
        assert parse_urdf(text, joints=["right"]).joint_names == ("right",)


@pytest.mark.parametrize("suffix", [".urdf", ".urdf.gz"])
def test_a_file_may_be_compressed(tmp_path, suffix):
    path = tmp_path / f"arm{suffix}"
    path.write_bytes(gzip.compress(ARM.encode()) if suffix.endswith("gz") else ARM.encode())
    robot = read_urdf(path, joints=["shoulder"])
    assert robot.joint_names == ("shoulder",)
    assert robot.description == str(path)
