"""Set membership against dense linear programs, and draws whose errors keep to their bound."""

import numpy as np
import pytest
from scipy.optimize import linprog

from pivident.estimation.literature.set_membership import MARGIN, parameter_box
from pivident.foundation.errors import IdentificationError
from tests.estimation.literature.made_rows import COLUMNS, TRUTH, made, rows_of, stacked

BOUND = np.array([0.3, 0.5])


def bounded(seed, count=300, root=(1.0, 1.0)):
    phi, tau, _, rng = made(seed, count=count)
    errors = BOUND[:, None] * rng.uniform(-1.0, 1.0, (2, count)) ** rng.choice([1, 3])
    return rows_of(phi, [t + e for t, e in zip(tau, errors, strict=True)], root=root)


def test_intervals_are_those_of_programs_over_all_rows():
    rows = bounded(1, root=(0.2, 3.0))
    box = parameter_box(rows, BOUND, TRUTH)
    dense, torque = stacked(rows)
    bound = np.repeat(BOUND / rows.root, 300)
    upper, limits = np.vstack([dense, -dense]), np.append(torque + bound, bound - torque)
    for i in range(4):
        for sign, found in ((1.0, box.low[i]), (-1.0, box.high[i])):
            cost = np.zeros(4)
            cost[i] = sign
            made = linprog(cost, upper, limits, bounds=[(None, None)] * 4)
            assert found == pytest.approx(made.x[i], rel=1e-6)


def outside(draws):
    """Draws in which the truth is not inside all intervals."""
    found = []
    for seed in draws:
        box = parameter_box(bounded(seed, count=60), BOUND, np.zeros(4))
        if not ((box.low <= TRUTH).all() and (TRUTH <= box.high).all()):
            found.append(seed)
    return found


def test_the_truth_is_inside_in_every_draw():
    """``benchmarks/bounded_errors.py`` takes a thousand."""
    assert outside(range(250)) == []


def test_bounds_that_nothing_keeps_to_name_joint_and_row():
    phi, tau, _, _ = made(2, count=200)
    tau[1] = tau[1].copy()
    tau[1][77] += 5.0
    rows = rows_of(phi, tau)
    with pytest.raises(IdentificationError, match="joint 'joint 2' at row 77"):
        parameter_box(rows, BOUND, TRUTH)


def test_without_a_bound_it_is_the_largest_error_of_the_start_and_a_tenth():
    rows = bounded(4, root=(0.2, 3.0))
    dense, torque = stacked(rows)
    least = np.linalg.lstsq(dense, torque, rcond=None)[0]
    box = parameter_box(rows, None, least)
    errors = np.abs(torque - dense @ least).reshape(2, -1).max(axis=1)
    np.testing.assert_allclose(box.bound, MARGIN * errors * rows.root, rtol=1e-9)
    assert (box.low < least).all() and (least < box.high).all()
    assert (box.low < TRUTH).all() and (TRUTH < box.high).all()


def test_a_direction_that_nothing_bounds_has_no_interval():
    phi, tau, _, _ = made(3, count=200)
    phi[0][1] = phi[1][0] = 0.0  # the second parameter acts nowhere
    tau = [TRUTH[c] @ own for c, own in zip(COLUMNS, phi, strict=True)]
    box = parameter_box(rows_of(phi, tau), BOUND, TRUTH)
    assert box.low[1] == -np.inf and box.high[1] == np.inf
    others = [0, 2, 3]
    assert (box.low[others] < TRUTH[others]).all() and (TRUTH[others] < box.high[others]).all()
    assert np.isfinite(box.low[others]).all()
