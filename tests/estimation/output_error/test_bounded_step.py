"""Steps within bounds against SciPy, undetermined directions against their construction."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from pivident.estimation.output_error.reduced_equations import (
    bounded_step,
    condition_of,
    to_hold,
    undetermined,
)


@pytest.mark.parametrize("seed", range(8))
def test_steps_are_those_of_least_squares_within_bounds(seed):
    rng = np.random.default_rng(seed)
    j, e = rng.standard_normal((40, 6)), rng.standard_normal(40)
    low, high = -rng.uniform(0.0, 0.1, 6), rng.uniform(0.0, 0.3, 6)
    made = bounded_step(j.T @ j, j.T @ e, low, high, np.zeros(6, bool))
    free = bounded_step(
        j.T @ j, j.T @ e, np.full(6, -np.inf), np.full(6, np.inf), made.bound * 0 > 0
    )
    np.testing.assert_allclose(free.step, np.linalg.lstsq(j, e, rcond=None)[0], atol=1e-12)
    assert not free.bound.any()
    assert (made.step >= low).all() and (made.step <= high).all()
    best = lsq_linear(j, e, (low, high), tol=1e-14)
    cost = 0.5 * np.sum((j @ made.step - e) ** 2)
    # held at a bound, an unknown does not come back in the same step
    assert cost <= 1.02 * best.cost


def test_what_is_held_stays():
    rng = np.random.default_rng(1)
    j, e = rng.standard_normal((30, 4)), rng.standard_normal(30)
    held = np.array([False, True, False, False])
    wide = np.full(4, np.inf)
    made = bounded_step(j.T @ j, j.T @ e, -wide, wide, held)
    expected = np.linalg.lstsq(j[:, ~held], e, rcond=None)[0]
    assert made.step[1] == 0.0
    np.testing.assert_allclose(made.step[~held], expected, atol=1e-12)


def test_directions_that_nothing_determines_are_named():
    rng = np.random.default_rng(2)
    j = rng.standard_normal((50, 5)) * [1e3, 1.0, 1e-4, 1.0, 0.0]
    j[:, 3] = 2.0 * j[:, 1]
    groups = [set(own.tolist()) for own in undetermined(j.T @ j)]
    assert {4} in groups and {1, 3} in groups and len(groups) == 2
    held = to_hold(j.T @ j, np.zeros(5, bool), np.zeros(5, bool))
    assert held.sum() == 2 and held[4] and (held[1] != held[3])
    rather = np.array([False, False, False, True, False])
    assert to_hold(j.T @ j, np.zeros(5, bool), rather)[3]


def test_the_condition_is_that_of_the_scaled_columns():
    rng = np.random.default_rng(3)
    j = rng.standard_normal((50, 4)) * [1e3, 1.0, 1e-4, 1.0]
    scaled = j / np.linalg.norm(j, axis=0)
    condition, share = condition_of(j.T @ j)
    assert condition == pytest.approx(np.linalg.cond(scaled), rel=1e-9)
    weakest = np.linalg.svd(scaled)[2][-1]
    np.testing.assert_allclose(share, np.abs(weakest), atol=1e-9)
