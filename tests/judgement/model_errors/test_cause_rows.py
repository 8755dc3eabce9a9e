"""Rows of causes: which of them are used, and that those known already are taken over."""

import numpy as np
import pytest

from pivident.judgement.model_errors.cause_rows import (
    CauseRows,
    instrument_motions,
    rows_worth_using,
    smoothed,
    without_neighbours,
)

from .faulty_tx40 import causes, right_estimate, right_problem


def test_samples_near_a_standstill_are_left_out():
    """And those near the ends, before and behind which nothing is known."""
    used = np.ones(100, bool)
    used[50] = False
    alone = without_neighbours(used, 10)
    assert np.flatnonzero(~alone).tolist() == [*range(10), *range(40, 61), *range(90, 100)]


def test_all_of_them_where_too_few_would_be_left():
    used = np.ones(100, bool)
    used[::20] = False  # 19 samples in use between two stops
    assert without_neighbours(used, 5).sum() == 4 * 9 + 9
    assert np.array_equal(without_neighbours(used, 9), used)


@pytest.mark.parametrize(("size", "kept"), [(0.0, True), (1.0, True), (3.0, False)])
def test_rows_that_show_standstill_are_left_out(size, kept):
    """Where what they show is larger than the residual far from it; not for their own errors."""
    near, far = np.ones(300, bool), np.ones(300, bool)
    near[:20], far[:100] = False, False
    residual, rest = np.random.default_rng(1).standard_normal((2, 300))
    residual[20:100] *= 5.0
    worth = rows_worth_using(residual, size * rest, near, far)
    assert np.array_equal(worth, near if kept else far)


def test_rows_that_are_known_are_those_made_anew():
    """To the last bit: of causes that stay and of new ones, in another order."""
    problem, found = right_problem()[0], right_estimate()
    motion = smoothed(problem, found)
    given = motion, instrument_motions(problem, found, motion)
    every = list(causes().values())
    few, others = every[::5], [*every[::7][::-1], *every[:3]]
    known = CauseRows(problem, found, few, *given).with_causes(others)
    anew = CauseRows(problem, found, others, *given)
    assert set(few) & set(others)
    assert not set(others) <= set(few)
    np.testing.assert_array_equal(known.first, anew.first)
    for one, other in zip(known.joints, anew.joints, strict=True):
        for row, same in zip(one, other, strict=True):
            np.testing.assert_array_equal(row.columns, same.columns)
            np.testing.assert_array_equal(row.x, same.x)
            np.testing.assert_array_equal(row.tau, same.tau)
