"""Regressor, mass matrix and acceleration against Pinocchio on random trees."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import mass_matrix
from pivident.dynamics.inverse_derivatives import inverse_dynamics_derivatives
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.robot.description import INERTIAL
from tests.forward_dynamics import acceleration

pytest.importorskip("pinocchio")
from tests.dynamics.trees import RandomTree

SEEDS = st.integers(0, 2**32 - 1)


def assert_close(ours, theirs, tolerance=1e-10):
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=tolerance * max(1.0, abs(theirs).max()))


def theta_of(tree, parameters):
    """Values of the inertial parameters, everything else zero."""
    return np.array(
        [tree.inertia[p.joint, INERTIAL.index(p.stem)] if p.is_inertial else 0 for p in parameters]
    )


@settings(max_examples=60, deadline=None)
@given(SEEDS)
def test_regressor_times_any_parameters_is_rnea(seed):
    tree = RandomTree(seed)
    tree.draw_inertias()
    parameters = standard_parameters(tree.robot)
    q, dq, ddq = tree.states(5)
    phi = Regressor.build(tree.robot, parameters).matrix(q, dq, ddq)
    assert_close(phi @ theta_of(tree, parameters), tree.rnea(q, dq, ddq))


@settings(max_examples=40, deadline=None)
@given(SEEDS)
def test_mass_matrix_is_crba(seed):
    tree = RandomTree(seed)
    tree.draw_inertias()
    parameters = standard_parameters(tree.robot)
    q, _, _ = tree.states(3)
    assert_close(mass_matrix(tree.robot, parameters, theta_of(tree, parameters), q), tree.crba(q))


@settings(max_examples=40, deadline=None)
@given(SEEDS)
def test_acceleration_is_aba(seed):
    tree = RandomTree(seed)
    parameters = standard_parameters(tree.robot)
    theta = nominal_values(tree.robot, parameters)
    q, dq, tau = tree.states(3)
    theirs = tree.aba(q, dq, tau)
    assert_close(acceleration(tree.robot, parameters, theta, q, dq, tau), theirs)


@settings(max_examples=40, deadline=None)
@given(SEEDS)
def test_base_parameters_give_the_torques_and_accelerations_of_all(seed):
    tree = RandomTree(seed)
    base = base_parameters(tree.robot)
    theta = tree.rng.uniform(-1.0, 1.0, len(base.standard))
    groups = base.values(theta)
    q, dq, ddq = tree.states(5)
    everything = Regressor.build(tree.robot, base.standard)
    tau = everything.torque(q, dq, ddq, theta)
    columns = Regressor.build(tree.robot, base.parameters)
    assert_close(columns.torque(q, dq, ddq, groups), tau, 1e-9)
    assert_close(everything.torque(q, dq, ddq, base.standard_from_base(groups)), tau, 1e-9)

    true = base.standard_from_base(base.values(nominal_values(tree.robot, base.standard)))
    theirs = tree.aba(q, dq, tau)
    assert_close(acceleration(tree.robot, base.standard, true, q, dq, tau), theirs, 1e-9)


@settings(max_examples=40, deadline=None)
@given(SEEDS)
def test_number_of_base_parameters_is_the_rank_of_the_regressor(seed):
    tree = RandomTree(seed)
    base = base_parameters(tree.robot)
    q, dq, ddq = tree.states(4 * len(base.standard) // tree.robot.size + 20)
    phi = Regressor.build(tree.robot, base.standard).matrix(q, dq, ddq)
    phi = phi.reshape(-1, len(base.standard))
    assert len(base) == np.linalg.matrix_rank(phi / np.maximum(np.linalg.norm(phi, axis=0), 1e-9))
    assert len(base) + base.dropped.size + base.without_effect.size == len(base.standard)


def assert_derivatives_are_those_of_rnea(tree):
    parameters = tuple(p for p in standard_parameters(tree.robot) if p.is_inertial)
    motion = tree.states(3)
    theta = theta_of(tree, parameters)
    ours = inverse_dynamics_derivatives(tree.robot, parameters, theta, *motion)
    for mine, theirs in zip(ours, tree.rnea_derivatives(*motion), strict=True):
        assert_close(mine, theirs, 1e-9)


@settings(max_examples=60, deadline=None)
@given(SEEDS)
def test_derivatives_are_those_of_rnea(seed):
    tree = RandomTree(seed)
    tree.draw_inertias()
    assert_derivatives_are_those_of_rnea(tree)


@pytest.mark.record
def test_derivatives_of_a_serial_arm_are_those_of_rnea(data_dir):
    path = data_dir / "staubli_tx40" / "tx40_mdh_modified.urdf"
    assert_derivatives_are_those_of_rnea(RandomTree(0, text=path.read_text(encoding="utf-8")))
