"""Angles printed with few digits: the robot is the one of the full angles, in every kind of file.

An arm of three joints turns about z, then about two parallel axes across it (a shoulder, an elbow).
"""

from functools import partial

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.frames import Pose, exact_angle, rotation_from_rpy, without_residues
from pivident.robot.mjcf import read_mjcf
from pivident.robot.modified_dh import parse_modified_dh
from pivident.robot.urdf import parse_urdf

QUARTER, HALF = repr(np.pi / 2), repr(np.pi)

BODY = (
    '<inertial><origin xyz="0.1 0.02 0.03"/><mass value="2"/>'
    '<inertia ixx="0.1" ixy="0.01" ixz="0.02" iyy="0.2" iyz="0.03" izz="0.15"/></inertial>'
)


def urdf(quarter, half, axis="0 0 1", offset="0"):
    """The arm, with a fixed flange of half a turn between shoulder and elbow."""
    joints = (
        ("one", "revolute", "base", "a", "0 0 0.3", "0 0 0", "0 0 1"),
        ("two", "revolute", "a", "b", f"{offset} 0 0", f"{quarter} 0 0", axis),
        ("flange", "fixed", "b", "c", "0.4 0 0", f"{half} 0 0", "0 0 1"),
        ("three", "revolute", "c", "d", "0 0 0", f"0 {half} 0", "0 0 1"),
    )
    text = "".join(
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{along}"/>'
        '<limit lower="-1" upper="1" velocity="2" effort="9"/></joint>'
        for name, kind, parent, child, xyz, rpy, along in joints
    )
    links = "".join(f'<link name="{name}">{BODY}</link>' for name in "abcd")
    return f'<robot name="arm"><link name="base"/>{links}{text}</robot>'


def of_urdf(quarter, half, folder):
    return parse_urdf(urdf(quarter, half))


def of_table(quarter, half, folder):
    link = "link = {mass = 2, center_of_mass = [0.1, 0.02, 0.03]}"
    rows = (f"alpha = {quarter}", f"d = 0.4\nalpha = {half}")
    joints = [f'[[joints]]\nname = "j{i}"\n{row}\n{link}\n' for i, row in enumerate(("", *rows))]
    return parse_modified_dh('name = "arm"\n' + "".join(joints))


def of_mjcf(quarter, half, folder, turn="euler"):
    def body(name, pos, angle, content=""):
        euler = f'euler="{angle} 0 0"' if turn == "euler" else f'axisangle="1 0 0 {angle}"'
        return (
            f'<body name="{name}" pos="{pos}" {euler}><joint name="j{name}"/>'
            '<inertial pos="0.1 0.02 0.03" mass="2" diaginertia="0.1 0.2 0.15"/>'
            f"{content}</body>"
        )

    chain = body("a", "0 0 0.3", "0", body("b", "0 0 0", quarter, body("c", "0.4 0 0", half)))
    path = folder / "arm.xml"
    path.write_text(
        f'<mujoco><compiler angle="radian"/><worldbody>{chain}</worldbody></mujoco>', "utf-8"
    )
    return read_mjcf(path)


@pytest.mark.parametrize("read", [of_urdf, of_table, of_mjcf, partial(of_mjcf, turn="axisangle")])
@pytest.mark.parametrize(
    "quarter, half",
    [("1.57", "3.14"), ("1.5707", "3.1415"), ("1.5708", "3.1416"), ("-1.570796", "3.14159265")],
)
def test_rounded_quarter_turns_have_the_base_parameters_of_full_ones(read, quarter, half, tmp_path):
    sign = "-" if quarter.startswith("-") else ""
    full = base_parameters(read(sign + QUARTER, HALF, tmp_path))
    short = base_parameters(read(quarter, half, tmp_path))
    assert short.expressions == full.expressions
    values = [base.values(nominal_values(base.robot, base.standard)) for base in (full, short)]
    np.testing.assert_allclose(*values, rtol=0, atol=1e-9)


@pytest.mark.parametrize("quarter", ["1.5712", "1.5712345", "1.56"])
def test_an_angle_that_really_differs_stays(quarter):
    robot = parse_urdf(urdf(quarter, HALF))
    assert robot.joints[1].rotation[2, 2] == pytest.approx(np.cos(float(quarter)), abs=1e-15)
    assert "ia2" in base_parameters(robot).names  # it leans, so its rotor is no part of zz2


def test_residues_of_rounded_angles_in_axes_and_lengths_are_no_geometry():
    full = base_parameters(parse_urdf(urdf(QUARTER, HALF)))
    residues = urdf("1.5708", "-3.1416", axis="0 -3.67e-06 1", offset="2.2204E-16")
    assert base_parameters(parse_urdf(residues)).names == full.names
    tilted = base_parameters(parse_urdf(urdf(QUARTER, HALF, axis="0 0.001 1")))
    assert "ia2" in tilted.names and "ia2" not in full.names


def test_geometry_without_residues_is_bit_by_bit_the_same():
    for angles in ((np.pi / 2, 0.3, np.pi), (0.1, 0.2, 0.3), (np.pi, 0.0, 1e-3)):
        pose = Pose(rotation_from_rpy(*angles), np.array([0.3, 0.0, 1e-17]))
        same = without_residues(pose, 0.3)
        np.testing.assert_array_equal(same.rotation, pose.rotation)
        np.testing.assert_array_equal(same.translation, pose.translation)


def test_perpendicular_axes_between_frames_turned_at_will_become_perpendicular():
    turn = rotation_from_rpy(0, 0, 0.4) @ rotation_from_rpy(1.5708, 0, 0)
    turn = turn @ rotation_from_rpy(0, 0, 1.1)
    exact = without_residues(Pose(turn, np.zeros(3)), 1.0).rotation
    assert abs(turn[2, 2]) > 3e-6 and abs(exact[2, 2]) < 1e-12
    np.testing.assert_allclose(exact @ exact.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(exact, turn, atol=1e-5)


@pytest.mark.parametrize(
    "written, quarters",
    [("1.57", 1), ("1.571", 1), ("-1.5707", -1), ("3.14", 2), ("4.71", 3), ("1.570796e+00", 1)],
)
def test_an_angle_is_the_quarter_turn_that_it_was_rounded_or_cut_off_from(written, quarters):
    assert exact_angle(written) == quarters * np.pi / 2


@pytest.mark.parametrize("written", ["1.5700", "1.58", "2", "1.6", "3.2", "0.7854", "0.01", "0"])
def test_other_angles_are_as_written(written):
    assert exact_angle(written) == float(written)


def test_a_wrong_angle_is_still_refused():
    with pytest.raises(RobotDescriptionError, match="'1,57' is not a number"):
        parse_urdf(urdf("1,57", HALF))
