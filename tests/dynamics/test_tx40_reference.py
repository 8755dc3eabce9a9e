"""Torques, mass matrix, accelerations and base table of the TX40 by another implementation."""

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import mass_matrix
from pivident.dynamics.parameters import standard_parameters
from pivident.dynamics.regressor import Regressor
from tests.forward_dynamics import acceleration

pytestmark = pytest.mark.record


@pytest.fixture(scope="module")
def base(tx40_of_the_reference):
    return base_parameters(tx40_of_the_reference)


def test_torques_to_rounding(tx40_of_the_reference, reference_theta, reference_states):
    q, dq, ddq, tau = reference_states
    regressor = Regressor.build(tx40_of_the_reference, standard_parameters(tx40_of_the_reference))
    np.testing.assert_allclose(
        regressor.torque(q, dq, ddq, reference_theta), tau, rtol=1e-12, atol=1e-12
    )
    np.testing.assert_allclose(
        regressor.matrix(q, dq, ddq) @ reference_theta, tau, rtol=1e-12, atol=1e-12
    )


def test_mass_matrices_to_rounding(
    tx40_of_the_reference, reference, reference_theta, reference_states
):
    parameters = standard_parameters(tx40_of_the_reference)
    ours = mass_matrix(tx40_of_the_reference, parameters, reference_theta, reference_states[0])
    np.testing.assert_allclose(ours, np.array(reference["mass_matrix"]), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(ours, ours.transpose(0, 2, 1))


def test_accelerations_to_rounding(tx40_of_the_reference, reference_theta, reference_states):
    q, dq, ddq, tau = reference_states
    parameters = standard_parameters(tx40_of_the_reference)
    ours = acceleration(tx40_of_the_reference, parameters, reference_theta, q, dq, tau)
    # the wrist's inertias are small: an error of the torque is magnified by up to 100
    np.testing.assert_allclose(ours, ddq, rtol=1e-12, atol=1e-11)


def test_base_parameters_are_enough_for_all_of_it(
    base, reference, reference_theta, reference_states
):
    q, dq, ddq, tau = reference_states
    lifted = base.standard_from_base(base.values(reference_theta))
    masses = mass_matrix(base.robot, base.standard, lifted, q)
    np.testing.assert_allclose(masses, np.array(reference["mass_matrix"]), rtol=0, atol=1e-12)
    forward = acceleration(base.robot, base.standard, lifted, q, dq, tau)
    np.testing.assert_allclose(forward, ddq, rtol=1e-12, atol=1e-11)
    columns = Regressor.build(base.robot, base.parameters)
    torque = columns.torque(q, dq, ddq, base.values(reference_theta))
    np.testing.assert_allclose(torque, tau, rtol=1e-12, atol=1e-12)


def test_heads_of_the_groups_are_those_of_the_table(base, reference):
    assert [p.name for p in base.parameters] == sorted(
        (row["name"].lower() for row in reference["base_parameters"]),
        key=[p.name for p in base.standard].index,
    )


def test_every_value_of_the_base_table(base, reference, reference_theta):
    values = base.values(reference_theta)
    for row in reference["base_parameters"]:
        assert values[base.index(row["name"])] == pytest.approx(row["value"], rel=1e-12, abs=1e-12)


def test_every_regrouping_coefficient_of_the_base_table(base, reference):
    table = np.zeros((len(base), base.dropped.size))
    dropped = {base.standard[i].name: k for k, i in enumerate(base.dropped)}
    for row in reference["base_parameters"]:
        for name, coefficient in row["regrouped"].items():
            table[base.index(row["name"]), dropped[name.lower()]] = coefficient
    np.testing.assert_allclose(base.regrouping, table, rtol=0, atol=1e-12)
