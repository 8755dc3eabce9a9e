"""Intervals of masses, centres of mass and moments over the consistent sets."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pivident.dynamics.parameters import nominal_values
from pivident.judgement.diagnostics.consistent_estimate import consistent_estimate
from pivident.judgement.diagnostics.stored_consistent import consistent_json
from pivident.models.consistency import cone_program, profile_intervals as intervals_module
from pivident.models.consistency.consistent_model import make_consistent
from pivident.models.consistency.constraints import Bounds
from pivident.models.consistency.link_intervals import link_rows
from pivident.models.consistency.options import ConsistencyOptions
from pivident.models.consistency.profile_intervals import profile_intervals
from pivident.models.consistency.pseudo_inertia import moment_about_axis
from tests.synthetic_identification import synthetic_identification

BOUNDS = Bounds(mass={"upper_arm": (3.0, 5.0), "forearm": (2.0, 3.0)})


@pytest.fixture(scope="module")
def model():
    return make_consistent(synthetic_identification(relative_std=0.02, seed=4), bounds=BOUNDS)


@pytest.fixture(scope="module")
def rows(model):
    return link_rows(model)


def test_values_are_those_of_the_model_inside_their_intervals(model, rows):
    assert [r.name for r in rows] == ["upper_arm", "forearm"]
    for row in rows:
        body = model.link(row.name)
        assert row.mass.value == pytest.approx(body.mass)
        np.testing.assert_allclose([c.value for c in row.center_of_mass], body.center_of_mass)
        np.testing.assert_allclose([m.value for m in row.moments], body.principal_moments)
        for one in (row.mass, *row.center_of_mass, *row.moments):
            assert one.low <= one.value <= one.high


def test_bounds_of_the_masses_bound_their_intervals(rows):
    upper, fore = (r.mass for r in rows)
    assert 3.0 - 1e-4 <= upper.low and upper.high <= 5.0 + 1e-4
    assert 2.0 - 1e-4 <= fore.low and fore.high <= 3.0 + 1e-4


def test_centre_of_mass_ends_solve_the_linear_program_of_their_ratio(model, rows):
    """At the largest ratio t = h/m the largest h - t m is zero."""
    space, constraints = model._space, model._constraints
    checked = 0
    for row, place in zip(rows, space.links, strict=True):
        for axis in range(2):
            one = row.center_of_mass[axis]
            for end, k in ((one.low, 0), (one.high, 1)):
                if not np.isfinite(end):
                    continue
                direction = np.zeros((1, model.values.size))
                direction[0, place[6 + axis]], direction[0, place[9]] = 1.0, -end
                ends = profile_intervals(space, constraints, model.least_distance, direction, 0.95)
                assert ends[k][0] == pytest.approx(0.0, abs=2e-4)
                checked += 1
    assert checked >= 4


def test_moments_are_about_the_axes_of_the_body_held_fixed(model, rows):
    place = model._space.links[1]
    direction = np.zeros((1, model.values.size))
    direction[0, place] = moment_about_axis(model.links[1].center_of_mass, rows[1].axes[:, 2])
    low, high = profile_intervals(
        model._space, model._constraints, model.least_distance, direction, 0.95
    )
    assert rows[1].moments[2].low == pytest.approx(low[0], rel=1e-5, abs=1e-7)
    assert rows[1].moments[2].high == pytest.approx(high[0], rel=1e-5, abs=1e-7)


def test_truth_lies_inside(model):
    """The nominal bodies are the truth of the made-up record."""
    rows = link_rows(model, 0.9999)
    nominal = nominal_values(model.robot, model.parameters)
    for row, place in zip(rows, model._space.links, strict=True):
        mass, first = nominal[place[9]], nominal[place[6:9]]
        assert row.mass.low <= mass <= row.mass.high
        for c, h in zip(row.center_of_mass, first, strict=True):
            assert c.low - 1e-9 <= h / mass <= c.high + 1e-9


def test_masses_that_no_torque_tells_are_open():
    rows = link_rows(make_consistent(synthetic_identification(relative_std=0.02, seed=4)))
    assert rows[0].mass.high == np.inf


def failing(status, gaps):
    """A solver that ends with a status whenever it is asked for one of the accuracies."""
    true = cone_program.solve_cone_program

    def solve(quadratic, linear, requirements, gap=1e-8):
        found = true(quadratic, linear, requirements, gap)
        if gap in gaps:
            wrong = np.full(found.u.size, 1e9)
            return replace(found, u=wrong, status=status)
        return found

    return solve


def test_where_the_solver_fails_an_end_is_not_found_and_not_open(monkeypatch, tmp_path):
    free = synthetic_identification(relative_std=0.02, seed=4)
    solve = failing("NumericalError", (1e-6, 1e-3))
    monkeypatch.setattr(intervals_module, "solve_cone_program", solve)
    found = consistent_estimate(free, ConsistencyOptions(bounds=BOUNDS))
    for row in found.links:
        for one in (row.mass, *row.center_of_mass, *row.moments):
            assert np.isnan(one.low) and np.isnan(one.high)
    assert not found.standard.unbounded
    assert set(found.standard.not_found) == {p.name for p in found.model.parameters}
    text = str(found)
    assert "not found" in text and "open" not in str(found.link_table())
    assert "The solver found no end of the interval of" in text
    assert "the centre of mass of forearm" in text
    assert "no end of the interval of" in str(found.standard)
    free.save(tmp_path)
    content = json.loads(consistent_json(found, tmp_path / "identification.json"))
    assert "the mass of forearm" in content["not_found"]
    assert content["links"][0]["mass_interval"] == [None, None]


def test_a_poorer_accuracy_is_tried_before_an_end_is_given_up(monkeypatch, model, rows):
    solve = failing("InsufficientProgress", (1e-6,))
    monkeypatch.setattr(intervals_module, "solve_cone_program", solve)
    for row, again in zip(rows, link_rows(model), strict=True):
        before, after = ((r.mass, *r.center_of_mass) for r in (row, again))
        for one, other in zip(before, after, strict=True):
            assert other.low == pytest.approx(one.low, rel=2e-2, abs=2e-2)
            assert other.high == pytest.approx(one.high, rel=2e-2, abs=2e-2)


def test_what_the_solver_proves_unbounded_is_open(monkeypatch, model):
    solve = failing("DualInfeasible", (1e-6, 1e-3))
    monkeypatch.setattr(intervals_module, "solve_cone_program", solve)
    for row in link_rows(model):
        for one in (row.mass, *row.center_of_mass, *row.moments):
            assert (one.low, one.high) == (-np.inf, np.inf)
