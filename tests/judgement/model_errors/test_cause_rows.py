"""Rows beside a standstill are left out where they show what static friction holds."""

import numpy as np
import pytest

from pivident.judgement.model_errors.cause_rows import rows_worth_using, without_neighbours


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
