"""Grouping, names, values and lifting of base parameters."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters, preference
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.robot.gallery import load_robot
from pivident.robot.urdf import parse_urdf

BRANCHES = """<robot name="tree"><link name="base"/>
<link name="left"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0"
 izz="1"/></inertial></link>
<link name="right"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0"
 izz="1"/></inertial></link>
<joint name="left_hip" type="revolute"><parent link="base"/><child link="left"/>
 <axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<joint name="right_hip" type="revolute"><parent link="base"/><child link="right"/>
 <axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""


def expression(base, name):
    return base.expressions[base.index(name)]


def test_sizes_of_the_tx40_sets(tx40, tx40_without_iam6, tx40_of_the_reference):
    assert len(base_parameters(tx40_of_the_reference)) == 54
    assert len(base_parameters(tx40_without_iam6)) == 60
    assert len(base_parameters(tx40)) == 61


def test_groups_of_the_tx40_print_as_expressions(tx40):
    base = base_parameters(tx40)
    assert expression(base, "zz1r").startswith("zz1 + ia1 + yy2 + ")
    assert "0.05185 m6" in expression(base, "zz1r")
    assert expression(base, "mx2r") == "mx2 + 0.225 m3 + 0.225 m4 + 0.225 m5 + 0.225 m6"
    assert expression(base, "my3r") == "my3 - mz4 - 0.225 m4 - 0.225 m5 - 0.225 m6"
    assert expression(base, "my5r") == "my5 - mz6"
    assert expression(base, "ia4") == "ia4"


def test_a_name_ends_in_r_exactly_where_something_was_regrouped(tx40):
    base = base_parameters(tx40)
    assert len(set(base.names)) == len(base)
    for name, text in zip(base.names, base.expressions, strict=True):
        assert name.endswith("r") == (text != name)


def test_a_parameter_is_found_with_and_without_its_r(tx40):
    base = base_parameters(tx40)
    assert base.index("zz1") == base.index("ZZ1R") == base.index("zz1r") == 0
    assert base.names[base.index("fcm6")] == "fcm6"
    with pytest.raises(KeyError):
        base.index("yy6")


def test_base_parameters_are_deterministic(tx40):
    one, two = base_parameters(tx40), base_parameters(tx40)
    np.testing.assert_array_equal(one.kept, two.kept)
    np.testing.assert_array_equal(one.regrouping, two.regrouping)
    assert one.expressions == two.expressions


def test_coefficients_are_clean_numbers(tx40):
    regrouping = base_parameters(tx40).regrouping
    small = np.abs(regrouping[regrouping != 0.0])
    assert small.min() > 1e-3  # d² and products of lengths, no rounding dust
    assert (regrouping == 1.0).sum() + (regrouping == -1.0).sum() > 15


def test_the_mass_of_a_prismatic_axis_takes_up_its_rotor_inertia():
    base = base_parameters(load_robot("emps"))
    assert base.names == ("m1r", "fv1", "fc1", "off1")
    assert base.expressions == ("m1 + ia1", "fv1", "fc1", "off1")
    without = {base.standard[i].name for i in base.without_effect}
    assert without == {f"{stem}1" for stem in "xx xy xz yy yz zz mx my mz".split()}


def test_the_planar_arm_has_its_textbook_set():
    base = base_parameters(load_robot("planar_2r"))
    inertial = [n for n in base.names if n[:2] in ("zz", "mx", "my", "ia")]
    assert inertial == ["zz1r", "mx1r", "my1", "zz2", "mx2", "my2", "ia2"]
    assert expression(base, "zz1r") == "zz1 + ia1 + 0.16 m2"
    assert expression(base, "mx1r") == "mx1 + 0.4 m2"


def test_without_gravity_the_planar_arm_loses_the_first_moments_of_its_first_link():
    robot = load_robot("planar_2r").with_gravity([0.0, 0.0, 0.0])
    base = base_parameters(robot)
    assert "mx1r" not in base.names and "my1" not in base.names
    assert {"zz1r", "zz2", "mx2", "my2", "ia2"} <= set(base.names)


def test_on_a_tree_names_carry_the_joint():
    base = base_parameters(parse_urdf(BRANCHES))
    assert "zzr[left_hip]" in base.names and "fv[right_hip]" in base.names
    # each hip's rotor turns like its link: grouped with the inertia about the axis
    assert expression(base, "zzr[right_hip]") == "zz[right_hip] + ia[right_hip]"
    assert base.index("zz[left_hip]") == base.index("zzr[left_hip]")


def test_values_of_lifted_base_parameters_are_the_same_base_parameters(tx40):
    base = base_parameters(tx40)
    values = base.values(nominal_values(tx40, base.standard))
    np.testing.assert_array_equal(base.values(base.standard_from_base(values)), values)
    assert np.count_nonzero(base.standard_from_base(values)) <= len(base)


def test_a_coupling_of_another_ratio_keeps_its_columns_apart(tx40):
    robot = replace(tx40, couplings=tuple(replace(c, ratio=0.4) for c in tx40.couplings))
    base = base_parameters(robot)
    assert len(base) == 61
    phi = Regressor.build(robot, base.parameters).matrix(
        *np.random.default_rng(0).normal(size=(3, 90, 6))
    )
    assert np.linalg.matrix_rank(phi.reshape(-1, 61)) == 61


def test_what_others_take_up_comes_last(tx40):
    """Friction and first moments are kept, yy, mz and m regrouped, rotor inertias with them."""
    standard = standard_parameters(tx40)
    order = [standard[k] for k in preference(tx40, standard)]
    kept, last = order[: len(order) // 2], order[-6:]
    assert {"fv", "fc", "mx", "my", "xx"} <= {p.stem for p in kept}
    late = {p.stem for p in order[-4 * 6 :]}
    assert late == {"yy", "mz", "m", "ia"} and all(p.stem in late for p in last)
