"""Closed-form base parameters: against the numeric ones, textbook groups, special rules."""

import gzip
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.grouping.closed_form import closed_form_base_parameters
from pivident.dynamics.regressor import Regressor
from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.description import Coupling, Joint, Link, Robot
from pivident.robot.frames import rotation_x, rotation_z
from pivident.robot.friction import (
    FrictionLaw,
    asymmetric_coulomb,
    asymmetric_viscous,
    coulomb,
    counterbalance,
    load_dependent,
    lugre,
    offset,
    power_viscous,
    ripple,
    spring,
    stribeck,
    viscous,
)
from pivident.robot.gallery import load_robot
from pivident.robot.transmission import Transmission
from pivident.robot.urdf import parse_urdf
from tests.models.symbolic.robots import modified_dh, random_robot, robot_of, scara, seven_axes

LAWS = (
    (viscous(), coulomb(), offset()),
    (offset(),),
    asymmetric_coulomb(),
    (*asymmetric_viscous(), coulomb()),
    (viscous(), offset(), *ripple(1.0), *ripple(7.0)),
    (*counterbalance(0.4, 0.7), spring()),
    (*counterbalance(0.4, 0.0), *ripple(1.0), offset()),
    (stribeck(0.3), coulomb(), viscous()),
    (viscous(), power_viscous(2.0), load_dependent(), offset()),
    (*lugre(0.01, 0.2, 0.1), viscous()),
    (),
)
GRAVITIES = ([0, 0, -9.81], [0, -9.81, 0], [0, 0, 0], [3.0, 0, -9.0], [1.0, -2.0, -9.0])


def assert_same_groups(robot):
    """Rules and observation matrix agree: heads, what has no effect, every coefficient."""
    numeric = base_parameters(robot)
    for geometry in ("numbers", "names"):
        closed = closed_form_base_parameters(robot, geometry)
        ours = closed.numeric()
        assert ours.names == numeric.names == closed.names
        np.testing.assert_array_equal(ours.dropped, numeric.dropped)
        np.testing.assert_array_equal(ours.without_effect, numeric.without_effect)
        np.testing.assert_allclose(ours.regrouping, numeric.regrouping, atol=1e-9)
        theta = np.random.default_rng(1).normal(size=len(closed.standard))
        np.testing.assert_allclose(closed.values(theta), numeric.values(theta), atol=1e-8)
    return closed


def text(closed, name):
    return str(closed.groups[closed.names.index(name)])


@st.composite
def table_robots(draw):
    """Chains and trees whose axes are often parallel, at right angles or intersecting."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, tree, general = (
        draw(st.integers(1, 6)),
        draw(st.booleans()),
        draw(st.sampled_from((0, 3, 10))),
    )
    quarter, joints = np.pi / 2, []
    for i in range(n):
        if 10 * rng.random() >= general:
            alpha, theta = (
                rng.choice([0, 0, quarter, -quarter, np.pi]),
                rng.choice([0, quarter, 0.3]),
            )
        else:
            alpha, theta = rng.choice([0, 0.4, -1.1]), rng.choice([0, 0.6, 2.0])
        gamma, b = rng.choice([0, 0, 0, quarter, 0.7]), rng.choice([0, 0, 0, 0.15])
        d, r = rng.choice([0, 0, 0.3, -0.25]), rng.choice([0, 0, 0.2, 0.17])
        turn = rotation_z(gamma) @ rotation_x(alpha)
        origin = turn @ [d, 0, r] + [0, 0, b]
        kind = "prismatic" if rng.random() < 0.35 else "revolute"
        parent = int(rng.integers(-1, i)) if tree and i else i - 1
        law = LAWS[rng.integers(len(LAWS))] if rng.random() < 0.5 else LAWS[0]
        joint = Joint(f"j{i}", kind, parent, turn @ rotation_z(theta), origin)
        joints.append(joint.with_friction(FrictionLaw(law)))
    couplings = []
    for motor in range(n - 1, 0, -1):
        if rng.random() < 0.2:
            ratio = float(rng.choice([1.0, 0.5, -1.0, 0.0]))
            couplings.append(Coupling(motor, int(rng.integers(motor)), ratio))
    return Robot(
        "table",
        tuple(joints),
        tuple(Link(f"l{i}") for i in range(n)),
        np.array(draw(st.sampled_from(GRAVITIES)), dtype=float),
        np.zeros(n),
        Transmission.direct(n),
        couplings=tuple(couplings),
    )


@pytest.mark.parametrize("name", ["staubli_tx40", "mitsubishi_rv2sq", "emps", "planar_2r"])
def test_robots_of_the_gallery_have_the_same_groups_by_rule_and_by_number(name):
    assert_same_groups(load_robot(name))


def test_a_seven_axis_arm_and_a_scara_have_the_same_groups_by_rule_and_by_number():
    assert len(assert_same_groups(seven_axes())) == 43 + 7 + 3 * 7 - 2
    closed = assert_same_groups(scara())
    # the slide feels m3 + ia3 and g m3 + off3, so its rotor is in every group that m3 is known by
    assert text(closed, "zz1r") == "zz1r = zz1 + ia1 + d2²·m2 - d2²·ia3"
    assert text(closed, "m3r") == "m3r = m3 + ia3 + m4"


@settings(max_examples=60, deadline=None)
@given(table_robots())
def test_random_tables_have_the_same_groups_by_rule_and_by_number(robot):
    assert_same_groups(robot)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_random_poses_have_the_same_groups_by_rule_and_by_number(seed):
    assert_same_groups(random_robot(seed, largest=6))


@pytest.mark.record
def test_a_humanoid_of_58_joints_has_groups_that_make_the_same_torque(data_dir):
    robot = parse_urdf(gzip.decompress((data_dir / "tiago/tiago_48_hey5.urdf.gz").read_bytes()))
    base = closed_form_base_parameters(robot, "numbers").numeric()
    assert len(base) == 559
    theta = np.random.default_rng(0).normal(size=len(base.standard))
    motion = np.random.default_rng(1).uniform(-2.0, 2.0, (3, 4, robot.size))
    tau = Regressor.build(robot, base.standard).torque(*motion, theta)
    grouped = Regressor.build(robot, base.parameters).torque(*motion, base.values(theta))
    np.testing.assert_allclose(grouped, tau, atol=1e-10 * np.abs(tau).max())


def test_groups_of_the_tx40_are_those_of_the_textbook():
    robot = load_robot("staubli_tx40")
    closed = closed_form_base_parameters(robot)
    assert text(closed, "zz1r") == (
        "zz1r = zz1 + ia1 + yy2 + yy3 + 2·r3·mz3 + (d3² + r3²)·(m3 + m4 + m5 + m6)"
    )
    assert text(closed, "xx2r") == "xx2r = xx2 - yy2 - d3²·(m3 + m4 + m5 + m6)"
    assert text(closed, "xz2r") == "xz2r = xz2 - d3·mz3 - d3·r3·(m3 + m4 + m5 + m6)"
    assert text(closed, "xx3r") == "xx3r = xx3 - yy3 + yy4 + 2·r4·mz4 + r4²·(m4 + m5 + m6)"
    assert text(closed, "my3r") == "my3r = my3 - mz4 - r4·(m4 + m5 + m6)"
    assert text(closed, "my5r") == "my5r = my5 - mz6"
    assert closed.constants == pytest.approx({"d3": 0.225, "r3": 0.035, "r4": 0.225})
    assert len(closed) == 61
    plain = robot.with_friction(FrictionLaw((viscous(), coulomb())))
    bare = replace(plain, couplings=tuple(replace(c, inertia=False) for c in plain.couplings))
    assert len(closed_form_base_parameters(bare)) == 54


def test_expressions_hold_for_other_lengths_than_those_they_came_from():
    rows = [
        ("revolute", 0, 0.0, 0, 0.3),
        ("revolute", -1, 0.1, 0, 0.2),
        ("revolute", 0, 0.4, 0, 0.15),
    ]
    rows += [("prismatic", 1, 0.05, 1, 0.2), ("revolute", -1, 0.07, 0, 0.35)]
    one = modified_dh(rows)
    other = modified_dh([(k, a, 1.7 * d, t, 0.6 * r) for k, a, d, t, r in rows])
    closed, wanted = closed_form_base_parameters(one), base_parameters(other)
    theta = np.random.default_rng(0).normal(size=len(closed.standard))
    values = closed_form_base_parameters(other).constants
    assert values.keys() == closed.constants.keys()
    assert values != closed.constants
    values |= {p.name: x for p, x in zip(closed.standard, theta, strict=True)}
    found = [expression.evaluate(values) for expression in closed.expressions.values()]
    np.testing.assert_allclose(found, wanted.values(theta), atol=1e-12)


def test_angles_that_are_not_right_appear_by_name():
    robot = robot_of(
        [
            ("revolute", -1, 0.0, 0.0, 0.0, [0, 0, 0]),
            ("revolute", 0, 0.0, 0.5, 0.0, [0.3, 0, 0]),
        ]
    )
    closed = assert_same_groups(robot)
    assert "sin(alpha2)²·yy2" in text(closed, "zz1r")
    assert "cos(alpha2)²·zz2" not in text(closed, "zz1r")  # zz2 is kept on its own link
    assert closed.constants == pytest.approx({"alpha2": 0.5, "d2": 0.3})


def test_a_vertical_first_axis_feels_its_inertia_only():
    closed = closed_form_base_parameters(load_robot("staubli_tx40"))
    nothing = {p.name for p in closed.without_effect}
    assert nothing == set("xx1 xy1 xz1 yy1 yz1 mx1 my1 mz1 m1 mz2 m2".split())
    assert closed.reasons["xx1"] == "the link never turns about a direction across its axis"
    assert closed.reasons["mx1"].startswith("neither motion nor gravity accelerates")
    assert closed.reasons["yy2"].startswith("only xx - yy is felt here")
    assert closed.reasons["ia1"].startswith("turns like zz")


def test_axes_that_cross_without_gravity_feel_first_moments_as_inertia_about_the_crossing():
    rows = [("revolute", 0, 0.0, 0, 0.0), ("revolute", 1, 0.0, 0, 0.2)]
    robot = modified_dh(rows, gravity=(0, 0, 0))
    closed = assert_same_groups(robot)
    assert text(closed, "xz2r") == "xz2r = xz2 - r2·mx2"
    assert text(closed, "yz2r") == "yz2r = yz2 - r2·my2"
    assert "cross this axis in one point" in closed.reasons["mx2"]
    # with gravity across the second axis, or a distance between the axes, they are felt
    assert "mx2" in assert_same_groups(modified_dh(rows)).names
    rows[1] = ("revolute", 1, 0.1, 0, 0.2)
    assert "mx2r" not in assert_same_groups(modified_dh(rows, gravity=(0, 0, 0))).names
    assert "mx2" in closed_form_base_parameters(modified_dh(rows, gravity=(0, 0, 0))).names


def test_a_slide_on_a_turntable_feels_moments_across_the_one_axis_of_turning():
    # Khalil and Dombre: prismatic axis neither parallel nor perpendicular to the revolute one
    robot = robot_of(
        [
            ("revolute", -1, 0.0, 0.0, 0.0, [0, 0, 0]),
            ("prismatic", 0, 0.0, 0.6, 0.4, [0.1, 0, 0]),
        ]
    )
    closed = assert_same_groups(robot)
    kept = {g.head.name for g in closed.groups if g.head.joint == 1 and g.head.is_inertial}
    assert kept == {"mx2", "my2", "m2"}
    assert "one direction" in closed.reasons["mz2"]
    assert text(closed, "my2r") == "my2r = my2 - sin(alpha2)·cos(theta2)/cos(alpha2)·mz2"
    across = modified_dh([("revolute", 0, 0.0, 0, 0.0), ("prismatic", 1, 0.1, 0, 0.0)])
    kept = {g.head.name for g in assert_same_groups(across).groups}
    assert {"mx2", "mz2", "m2"} <= kept and not {"my2"} & kept
    along = modified_dh([("revolute", 0, 0.0, 0, 0.0), ("prismatic", 0, 0.1, 0, 0.0)])
    kept = {g.head.name for g in assert_same_groups(along).groups}
    assert "m2" in kept and not {"mx2", "my2", "mz2"} & kept


def test_a_vertical_slide_with_offset_keeps_mass_and_offset_together_apart_from_its_rotor():
    slide = modified_dh([("prismatic", 0, 0.0, 0, 0.0)])
    closed = assert_same_groups(slide)
    # m + ia and g m + off are felt: ia = m + ia - m shows in both
    assert text(closed, "m1r") == "m1r = m1 + ia1"
    assert text(closed, "off1r") == "off1r = off1 - g·ia1"
    closed = assert_same_groups(slide.with_friction(FrictionLaw((viscous(),))))
    assert closed.names == ("m1", "ia1", "fv1")


def test_a_ripple_of_order_one_cannot_be_told_from_a_pendulum():
    law = FrictionLaw((viscous(), *ripple(1.0)))
    closed = assert_same_groups(robot_of(
        [("revolute", -1, 0.0, np.pi / 2, 0.0, [0, 0, 0])]
    ).with_friction(law))  # fmt: skip
    assert text(closed, "my1r") == "my1r = my1 - 1/g·rs_1_1"
    assert closed.reasons["rc_1_1"] == "its torque is indistinguishable from that of mx1"
    # a second axis before it changes the direction of gravity, and tells them apart
    before = ("revolute", -1, 0.0, np.pi / 2, 0.0, [0, 0, 0])
    two = robot_of([before, ("revolute", 0, 0.0, np.pi / 2, 0.0, [0.2, 0, 0])])
    names = assert_same_groups(two.with_friction(law)).names
    assert "rc_1_2" in names and "rc_1_1" not in names


def test_the_inertia_of_a_coupled_rotor_takes_part_in_the_groups_of_parallel_axes():
    rows = [("revolute", 0, 0.0, 0, 0.0), ("revolute", 0, 0.4, 0, 0.0)]
    closed = assert_same_groups(modified_dh(rows, couplings=(Coupling(1, 0, 0.5),)))
    assert text(closed, "zz2r") == "zz2r = zz2 + ia2"
    assert text(closed, "iam2r") == "iam2r = iam2 - 2·ia2"
    assert_same_groups(modified_dh(rows, couplings=(Coupling(0, 1, -2.0),)))


def test_siblings_on_a_tree_do_not_share_and_are_named_after_their_joint():
    frames = [("revolute", -1, 0.0, 0.0, 0.0, [0, 0, 0.5])]
    frames += [("revolute", 0, 0.0, np.pi / 2, 0.0, [x, 0, 0]) for x in (0.2, -0.2)]
    closed = assert_same_groups(robot_of(frames))
    assert "d[joint_2]²·m[joint_2] + d[joint_3]²·m[joint_3]" in text(closed, "zzr[joint_1]")
    assert not any("[joint_3]" in str(g) for g in closed.groups if g.head.joint == 1)


def test_sympy_gives_the_same_numbers():
    import sympy

    closed = closed_form_base_parameters(load_robot("mitsubishi_rv2sq"))
    values = {sympy.Symbol(k, real=True): x for k, x in closed.constants.items()}
    for group in closed.groups:
        polynomial = group.to_sympy().subs(values)
        for member in group.members:
            symbol = sympy.Symbol(member.parameter.name, real=True)
            assert float(sympy.diff(polynomial, symbol)) == pytest.approx(member.value, abs=1e-12)
    zz1 = closed.to_sympy()["zz1r"]
    d3, d4 = sympy.symbols("d3 d4", real=True)
    m6 = sympy.diff(zz1, sympy.Symbol("m6", real=True))
    assert sympy.simplify(m6 - d3**2 - d4**2) == 0


def test_latex_has_a_line_for_each_group():
    closed = closed_form_base_parameters(load_robot("staubli_tx40"))
    latex = closed.to_latex()
    assert latex.startswith(r"\begin{align*}") and latex.count(r"\\" + "\n") == len(closed) - 1
    line = closed.groups[closed.names.index("my3r")].to_latex()
    assert line == (
        r"\mathit{my}_{3r} &= \mathit{my}_{3} - \mathit{mz}_{4} - r_{4} \, "
        r"\left(m_{4} + m_{5} + m_{6}\right)"
    )


def test_the_whole_set_prints_with_constants_and_what_has_no_effect():
    printed = str(closed_form_base_parameters(load_robot("planar_2r")))
    assert "zz1r = zz1 + ia1 + d2²·m2" in printed
    assert "mz1, m1, mz2: lies on the axis: it acts as part of the link before" in printed
    assert "Constants (m, rad, m/s²): d2 = 0.4" in printed
    numbers = str(closed_form_base_parameters(load_robot("planar_2r"), "numbers"))
    assert "zz1r = zz1 + ia1 + 0.16·m2" in numbers and "Constants" not in numbers


URDF = """<robot name="two"><link name="base"/>
<link name="a"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0"
 izz="1"/></inertial></link>
<link name="b"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0"
 izz="1"/></inertial></link>
<joint name="j1" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
 <limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<joint name="j2" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
 <origin xyz="0 0 0.3" rpy="1.5708 0 0"/>
 <limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""


def test_axes_that_are_nearly_perpendicular_are_so_with_a_wider_tolerance():
    exact = parse_urdf(URDF.replace("1.5708", repr(np.pi / 2)))
    names = closed_form_base_parameters(exact).names
    assert (
        closed_form_base_parameters(parse_urdf(URDF)).names == names == base_parameters(exact).names
    )
    robot = parse_urdf(URDF.replace("1.5708", "1.5712"))
    assert "ia2" in closed_form_base_parameters(robot).names  # the axes are not perpendicular
    assert closed_form_base_parameters(robot, tolerance=1e-3).names == names


@pytest.mark.parametrize(
    "wrong", [{"geometry": "letters"}, {"tolerance": np.nan}, {"tolerance": 1}]
)
def test_a_wrong_option_is_refused_by_name(wrong):
    with pytest.raises(RobotDescriptionError, match=next(iter(wrong))):
        closed_form_base_parameters(load_robot("emps"), **wrong)
