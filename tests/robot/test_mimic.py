"""URDF joints that mimic others: passive, in proportion."""

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.foundation.errors import RobotDescriptionError
from pivident.robot import parse_urdf

INERTIAL = (
    '<inertial><mass value="{m}"/><origin xyz="0.2 0.01 0.03"/><inertia ixx="0.02" iyy="0.03" '
    'izz="0.04" ixy="0.001" ixz="0" iyz="0.002"/></inertial>'
)


def arm(mimic: str) -> str:
    links = "".join(f'<link name="l{k}">{INERTIAL.format(m=k + 1)}</link>' for k in range(4))
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        f'<origin xyz="0.3 0 0.1" rpy="0.4 0 0.2"/><axis xyz="0 1 0"/>'
        f'<limit lower="-2" upper="2" effort="9" velocity="2"/>{follows}</joint>'
        for k, follows in enumerate(("", "", mimic))
    )
    return f'<robot name="arm">{links}{joints}</robot>'


FOLLOWS = '<mimic joint="j1" multiplier="-0.5" offset="0.3"/>'


def test_a_mimicking_joint_moves_in_proportion():
    robot = parse_urdf(arm(FOLLOWS))
    assert robot.joint_names == ("j0", "j1") and robot.tree.joint_names == ("j0", "j1", "j2")
    assert ClosedChains(robot).start(np.array([0.4, 0.8])).q[2] == pytest.approx(-0.1, abs=1e-14)


def test_its_torques_are_those_of_the_tree_by_virtual_work():
    robot = parse_urdf(arm(FOLLOWS))
    base = base_parameters(robot)
    rng = np.random.default_rng(5)
    q, dq, ddq = rng.uniform(-1.0, 1.0, (3, 30, 2))
    follow = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, -0.5]])
    whole = q @ follow.T + [0.0, 0.0, 0.3], dq @ follow.T, ddq @ follow.T
    theta = nominal_values(robot, base.standard)
    tree = Regressor.build(robot.tree, base.standard).torque(*whole, theta)
    own = regressor_of(robot, base.parameters).torque(q, dq, ddq, base.values(theta))
    np.testing.assert_allclose(own, tree @ follow, rtol=0.0, atol=1e-10 * np.abs(tree).max())


def test_a_frozen_follower_is_no_constraint():
    robot = parse_urdf(arm(FOLLOWS), frozen={"j2": 0.1})
    assert robot.constraints is None and robot.tree is robot


def test_a_follower_of_a_joint_that_stands_still_stands_where_that_holds_it():
    robot = parse_urdf(arm(FOLLOWS), frozen={"j1": 0.4})
    assert robot.constraints is None and robot.joint_names == ("j0",)
    assert robot.urdf.frozen == pytest.approx({"j1": 0.4, "j2": -0.5 * 0.4 + 0.3})
    assert parse_urdf(arm(FOLLOWS), joints=["j0"]).urdf.frozen == {"j1": 0.0, "j2": 0.3}
    with pytest.raises(RobotDescriptionError, match=r"mimic multiplier = 'x' is not a number"):
        parse_urdf(arm(FOLLOWS.replace("-0.5", "x")))


def test_a_range_from_zero_to_zero_is_unknown():
    text = arm("").replace('lower="-2" upper="2"', 'lower="0" upper="0"', 1)
    assert [j.position_limits for j in parse_urdf(text).joints] == [None, (-2.0, 2.0), (-2.0, 2.0)]


def test_a_follower_that_is_not_listed_moves_along_with_its_leader():
    robot = parse_urdf(arm(FOLLOWS), joints=["j1", "j0"])
    assert robot.joint_names == ("j1", "j0") and robot.tree.joint_names == ("j0", "j1", "j2")
    assert parse_urdf(arm(FOLLOWS), joints=["j0"]).constraints is None
    still = parse_urdf(arm(FOLLOWS), joints=["j0", "j1"], frozen={"j2": 0.1})
    assert still.constraints is None and still.urdf.frozen == {"j2": 0.1}
