"""The same quantity is found whatever it is called, and no other one."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.robot.gallery import load_robot
from pivident.studies.comparison.compare import estimate_of
from pivident.studies.comparison.entry import entry_of
from pivident.studies.comparison.groups import base_of, difference_of_geometry, groups_of
from tests.studies.comparison.results import result, without


@pytest.fixture(scope="module")
def tx40():
    return groups_of(base_of(load_robot("staubli_tx40"), ()))


def test_sums_of_groups_are_recognised(tx40):
    rng = np.random.default_rng(3)
    c = np.zeros(len(tx40.names))
    c[rng.choice(c.size, 5, replace=False)] = rng.uniform(-2, 2, 5)
    target = {}
    for weight, row in zip(c, tx40.rows, strict=True):
        for key, value in row.items():
            target[key] = target.get(key, 0.0) + weight * value
    np.testing.assert_allclose(tx40.coefficients(target), c, atol=1e-12)


def test_a_part_of_a_group_is_not_determined(tx40):
    regrouped = next(row for row in tx40.rows if len(row) > 1)
    part = dict(list(regrouped.items())[1:])
    assert tx40.coefficients(part) is None


def test_every_group_is_itself(tx40):
    for k, row in enumerate(tx40.rows):
        np.testing.assert_array_equal(tx40.coefficients(row), np.eye(len(tx40.names))[k])


def test_a_sum_of_two_estimates_has_the_deviation_of_their_covariance():
    made = result(1)
    correlated = made.covariance.copy()
    correlated[0, 1] = correlated[1, 0] = -0.5 * np.sqrt(correlated[0, 0] * correlated[1, 1])
    entry = entry_of(replace(made, robust_covariance=correlated), "a")
    rows = entry.groups.rows
    target = dict(rows[0])
    for key, value in rows[1].items():
        target[key] = target.get(key, 0.0) + 2.0 * value
    found = estimate_of(entry, target)
    weights = np.array([1.0, 2.0])
    assert found.value == pytest.approx(weights @ made.theta[:2])
    variance = weights @ correlated[:2, :2] @ weights
    assert found.spread == pytest.approx(2.0 * np.sqrt(variance))
    assert found.from_groups == made.names[:2]


def test_what_was_left_out_is_not_estimated():
    entry = entry_of(without(result(1), "my2"), "a")
    assert entry.left_out == ("my2",)
    assert estimate_of(entry, entry.groups.rows[entry.groups.names.index("my2")]) is None
    assert entry.all_values[entry.groups.names.index("my2")] == 0.0


def test_what_makes_another_machine():
    planar = load_robot("planar_2r")
    assert not difference_of_geometry(planar, planar.with_gravity(np.zeros(3)))
    moved = replace(planar.joints[1], translation=planar.joints[1].translation + 1e-3)
    other = replace(planar, joints=(planar.joints[0], moved))
    assert "frame of joint elbow" in difference_of_geometry(planar, other)
    assert "joints" in difference_of_geometry(planar, load_robot("staubli_tx40"))
