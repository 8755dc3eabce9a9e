"""Loops and gears in modified DH files."""

import numpy as np
import pytest

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot import parse_modified_dh
from pivident.robot.closed_chains import equations
from pivident.robot.gallery import load_robot

FOUR_BAR = """
name = "four-bar"
units = "degrees"
gravity = "-y"

[[joints]]
name = "crank"
posture = 60

[[joints]]
name = "coupler"
parent = "crank"
passive = true
d = 0.3
posture = -60

[[joints]]
name = "rocker"
parent = "base"
passive = true
d = 0.5
posture = 60

[[loops]]
name = "pin"
closes = "axis"
first = {link = "coupler", at = [0.5, 0, 0]}
second = {link = "rocker", at = [0.3, 0, 0]}
"""


def test_a_parallelogram_is_assembled():
    robot = parse_modified_dh(FOUR_BAR)
    assert robot.joint_names == ("crank",) and robot.tree.size == 3
    np.testing.assert_allclose(np.degrees(robot.constraints.posture), [60, -60, 60], atol=1e-9)
    assert robot.constraints.redundant == ("3 of 'pin'",)


@pytest.mark.parametrize(
    ("name", "joints", "tree", "inertial"),
    [
        ("five_bar", 2, 4, 11),
        ("parallelogram_palletizer", 4, 10, 25),
        ("delta", 3, 12, 34),
        ("orthoglide", 3, 12, 27),
        ("scara", 4, 6, 11),
    ],
)
def test_mechanisms_of_the_gallery(name, joints, tree, inertial):
    from pivident.dynamics.base_parameters import base_parameters

    robot = load_robot(name)
    assert (robot.size, robot.tree.size) == (joints, tree)
    gaps, slopes = equations(robot.tree, robot.constraints, robot.constraints.posture)
    assert np.abs(gaps).max() < 1e-10
    passive = [i for i in range(tree) if i not in robot.places]
    assert np.linalg.matrix_rank(slopes[:, passive], tol=1e-7) == tree - joints
    own = [p for p in base_parameters(robot).parameters if p.friction is None]
    assert len(own) == inertial


def test_a_ball_screw_lifts_by_its_pitch():
    scara = load_robot("scara")
    from pivident.dynamics.closed_chains.closed_motion import ClosedChains

    place = ClosedChains(scara).start(np.array([0.2, -0.3, 2.0 * np.pi, 0.0]))
    lift, quill = (scara.tree.joint_names.index(name) for name in ("lift", "quill"))
    assert place.q[lift] == pytest.approx(0.02, abs=1e-12)
    assert place.q[quill] == pytest.approx(0.0, abs=1e-12)
    both = ClosedChains(scara).start(np.array([0.2, -0.3, 1.0, 1.0]))
    assert both.q[lift] == pytest.approx(0.0, abs=1e-12)
    assert both.q[quill] == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("at = [0.5, 0, 0]", "at = [1.5, 0, 0]", r"'pin' does not close: its ends are 0\.\d+ m"),
        ('link = "rocker"', 'link = "rokcer"', r"loop 'pin': key 'second': .*'rokcer'; .*'rocker'"),
        ('link = "rocker"', 'link = "coupler"', "loop 'pin': both ends are in 'coupler'"),
        ('closes = "axis"', 'closes = "hinge"', "loop 'pin': key 'closes' = 'hinge'"),
        ('closes = "axis"', "", "loop 'pin': key 'closes' is missing; add it, one of 'point'"),
        ("posture = 60\n\n[[loops]]", "posture = 60\ntorque_limit = 3\n\n[[loops]]", "no torque_"),
        ("posture = -60", 'posture = -60\nbody = false\nlink = {mass = 1}', "contradict"),
        ("passive = true\nd = 0.3", "d = 0.3", "cannot move: its loops hold crank, coupler"),
        ('name = "crank"', 'name = "crank"\npassive = true', "independent joints are missing"),
        ("[[loops]]", "[[gears]]\nname = 'pin'\nratios = {crank = 1, rocker = -1}\n[[loops]]",
         "names of loops and gears"),
    ],
)  # fmt: skip
def test_tables_that_contradict_are_named(old, new, message):
    assert old in FOUR_BAR
    with pytest.raises(RobotDescriptionError, match=message):
        parse_modified_dh(FOUR_BAR.replace(old, new, 1))


def test_passive_joints_need_something_that_moves_them():
    open_ = FOUR_BAR[: FOUR_BAR.index("[[loops]]")]
    with pytest.raises(RobotDescriptionError, match="'coupler' is passive, but nothing moves it"):
        parse_modified_dh(open_)
    driven = FOUR_BAR.replace("passive = true\n", "")
    with pytest.raises(RobotDescriptionError, match="but no joint is passive"):
        parse_modified_dh(driven)


def test_gears_name_unknown_joints():
    gear = '\n[[gears]]\nname = "belt"\nratios = {crank = 1, roker = -1}\n'
    text = FOUR_BAR[: FOUR_BAR.index("[[loops]]")] + gear
    with pytest.raises(RobotDescriptionError, match=r"gear 'belt': .*'roker'"):
        parse_modified_dh(text)


def test_joints_that_nothing_determines_are_named():
    loose = FOUR_BAR.replace("[[loops]]", '[[joints]]\nname = "tail"\npassive = true\n\n[[loops]]')
    with pytest.raises(RobotDescriptionError, match="nothing determines tail"):
        parse_modified_dh(loose)


def test_passive_joints_have_no_friction_unless_it_is_given():
    robot = parse_modified_dh(FOUR_BAR)
    assert [len(joint.friction.terms) for joint in robot.passive_joints] == [0, 0]
    given = FOUR_BAR.replace(
        "d = 0.3", 'd = 0.3\nfriction = ["viscous"]\nnominal_friction = {fv = 2}'
    )
    robot = parse_modified_dh(given)
    assert robot.friction_nominal == {"fv2": 2.0} or robot.friction_nominal == {"fv[coupler]": 2.0}
