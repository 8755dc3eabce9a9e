"""Correlations of the parameters: values, order, and what cannot be known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.cluster.hierarchy import leaves_list, linkage

from pivident.judgement.validation.parameter_correlation import (
    _neighbours_first,
    parameter_correlation,
)
from tests.synthetic_identification import synthetic_identification


def correlated(pairs):
    found = synthetic_identification()
    n = len(found.names)
    rho = np.eye(n)
    for i, k, value in pairs:
        rho[i, k] = rho[k, i] = value
    return replace(found, covariance=rho * np.outer(found.method_std, found.method_std))


def test_correlations_are_those_of_the_covariance():
    found = correlated([(0, 7, -0.95), (2, 11, 0.6)])
    own = parameter_correlation(found)
    assert sorted(own.names) == sorted(found.names)
    place = {name: k for k, name in enumerate(own.names)}
    i, k = place[found.names[0]], place[found.names[7]]
    assert own.matrix[i, k] == pytest.approx(-0.95)
    np.testing.assert_allclose(np.diag(own.matrix), 1.0)
    largest = own.largest(2)
    assert {*largest[0][:2]} == {found.names[0], found.names[7]}
    assert [round(rho, 6) for *_, rho in largest] == [-0.95, 0.6]
    assert own.strong == 1


def test_parameters_stand_next_to_those_they_are_confused_with():
    own = parameter_correlation(correlated([(0, 7, -0.95), (2, 11, 0.6)]))
    place = {name: k for k, name in enumerate(own.names)}
    names = synthetic_identification().names
    for i, k in ((0, 7), (2, 11)):
        assert abs(place[names[i]] - place[names[k]]) == 1


def test_those_that_are_alike_are_neighbours_as_in_a_tree():
    """|ρ| of neighbours, summed, is about that of the leaves of a tree in their best order."""
    rng = np.random.default_rng(3)
    groups = np.kron(np.eye(8), np.ones((1, 3)))  # 24 parameters, three of each share an error
    errors = rng.standard_normal((500, 8)) @ groups + rng.standard_normal((500, 24))
    errors = errors[:, rng.permutation(24)]
    rho = np.abs(np.corrcoef(errors.T))
    tree = linkage(rho[np.triu_indices(24, 1)] * -1.0 + 1.0, "average", optimal_ordering=True)
    leaves, own = leaves_list(tree), _neighbours_first(np.corrcoef(errors.T))
    assert sorted(own) == list(range(24))
    assert rho[own[:-1], own[1:]].sum() > 0.97 * rho[leaves[:-1], leaves[1:]].sum()


def test_parameters_without_a_deviation_are_left_out():
    found = synthetic_identification()
    covariance = found.covariance.copy()
    covariance[3], covariance[:, 3] = 0.0, 0.0
    own = parameter_correlation(replace(found, covariance=covariance))
    assert found.names[3] not in own.names and len(own.names) == len(found.names) - 1
    for bad in (np.zeros_like(covariance), np.full_like(covariance, np.nan)):
        assert parameter_correlation(replace(found, covariance=bad)) is None
