"""Branches as robots of their own, against the whole robot."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.dynamics.forward import mass_matrix
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.loop.simulation.controllers import PD, PID, Cascade
from pivident.robot.description import Coupling
from pivident.robot.gallery import load_robot
from pivident.robot.urdf import parse_urdf
from pivident.studies.simulators.branches import branch_of, branches, law_of
from tests.models.export.robots import random_tree


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_branches_move_as_in_the_whole_robot(seed):
    rng = np.random.default_rng(seed)
    robot = parse_urdf(random_tree(rng, 8))
    parameters = standard_parameters(robot)
    values = nominal_values(robot, parameters)
    motion = rng.uniform(-2, 2, (3, 4, robot.size))
    whole = Regressor.build(robot, parameters).torque(*motion, values)
    mass = mass_matrix(robot, parameters, values, motion[0])
    parts = branches(robot)
    assert sorted(j for part in parts for j in part) == list(range(robot.size))
    seen = np.zeros_like(mass[0])
    for part in parts:
        own, at = branch_of(robot, part), list(part)
        mine = standard_parameters(own)
        theta = nominal_values(own, mine)
        found = Regressor.build(own, mine).torque(*motion[..., at], theta)
        np.testing.assert_allclose(found, whole[:, at], atol=1e-10)
        seen[np.ix_(at, at)] = 1.0
    assert not mass[:, seen == 0.0].any()  # no branch moves another


def test_a_chain_is_one_branch_and_itself():
    robot = load_robot("staubli_tx40")
    assert branches(robot) == [tuple(range(6))]
    assert branch_of(robot, range(6)) is robot


def test_a_coupled_motor_joins_branches():
    text = """<robot name="r"><link name="b"/>{}</robot>""".format(
        "".join(
            f'<link name="{n}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" '
            f'ixz="0" iyz="0"/></inertial></link><joint name="j{n}" type="continuous">'
            f'<parent link="b"/><child link="{n}"/></joint>'
            for n in "xyz"
        )
    )
    from dataclasses import replace

    robot = parse_urdf(text)
    assert branches(robot) == [(0,), (1,), (2,)]
    assert branches(replace(robot, couplings=(Coupling(2, 0),))) == [(0, 2), (1,)]


@pytest.mark.parametrize(
    "law", [PD([1.0, 2, 3], 4.0), PID(1.0, [1, 2, 3], [3, 4, 5.0], 1e-3), Cascade(2.0, [5, 6, 7.0])]
)
def test_a_law_of_some_joints_is_that_of_the_whole(law):
    q = np.random.default_rng(1).normal(size=(5, 3))
    whole = law.law(100.0, q, None)
    part = law_of(law, (0, 2), 3).law(100.0, q[:, [0, 2]], None)
    np.testing.assert_array_equal(part.feedback, whole.feedback[[0, 2]])
    np.testing.assert_array_equal(part.reference, whole.reference[:, [0, 2]])
    np.testing.assert_array_equal(part.integral_gain, whole.integral_gain[[0, 2]])
