"""Linear equations of a few unknowns in compiled code."""

import numpy as np
import pytest

from pivident.dynamics.elimination import (
    eliminate,
    factor,
    right_sides,
    solve,
    solve_all,
    sparse_factors,
)
from pivident.foundation.compiled import kernel


@kernel
def _factor(factors):
    return factor(factors)


@kernel
def _solve(factors, right, sides):
    solve(factors, right)
    solve_all(factors, sides)


def _solutions(factors, matrix, right):
    """Of one right side, and of all; rows of unknowns in their order."""
    factors.matrix[:] = matrix
    assert _factor(factors)
    n, columns = right.shape
    one, sides = right[:, 0].copy(), right_sides(n, columns)
    for c in range(columns):
        sides[c // 4, :, c % 4] = right[:, c]
    _solve(factors, one, sides)
    return one[factors.row], np.concatenate(sides, axis=1)[factors.row, :columns]


@pytest.mark.parametrize("n", [1, 2, 5, 12])
def test_both_ways_solve_like_numpy(n):
    rng = np.random.default_rng(n)
    for _ in range(20):
        matrix, right = rng.normal(size=(n, n)), rng.normal(size=(n, 6))
        matrix[np.arange(n), np.arange(n)] = 0.0 if n > 1 else 1.0  # rows have to be exchanged
        wanted = np.linalg.solve(matrix, right)
        one, at_once = matrix.copy(), right.copy()
        assert eliminate(one, at_once)
        first, later = _solutions(sparse_factors(matrix != 0.0), matrix, right)
        scale = 1e-12 * np.abs(wanted).max() * np.linalg.cond(matrix)
        np.testing.assert_allclose(at_once, wanted, rtol=0.0, atol=scale)
        np.testing.assert_allclose(later, wanted, rtol=0.0, atol=scale)
        np.testing.assert_allclose(first, wanted[:, 0], rtol=0.0, atol=scale)


def test_zeros_cost_nothing_and_other_numbers_find_another_order():
    rng, n = np.random.default_rng(5), 9
    pattern = np.zeros((n, n), bool)
    for leg in range(3):  # three legs that meet in the last three unknowns
        pattern[3 * leg : 3 * leg + 3, 2 * leg : 2 * leg + 2] = True
    pattern[:, 6:] = True
    factors = sparse_factors(pattern)
    for k in range(30):
        matrix = np.where(pattern, rng.normal(size=(n, n)), 0.0)
        if k % 3 == 2:  # the pivots of the matrix before would be next to nothing
            row, column = factors.pivot[0]
            matrix[row, column] = 1e-9
        right = rng.normal(size=(n, 4))
        wanted = np.linalg.solve(matrix, right)
        scale = 1e-11 * np.abs(wanted).max() * np.linalg.cond(matrix)
        first, later = _solutions(factors, matrix, right)
        np.testing.assert_allclose(later, wanted, rtol=0.0, atol=scale)
        np.testing.assert_allclose(first, wanted[:, 0], rtol=0.0, atol=scale)
        if k == 0:  # 36 and 204 where nothing is known to be zero
            assert factors.end[-1, :2].tolist() == [12, 38]


def test_a_singular_matrix_is_said():
    matrix = np.ones((3, 3))
    assert not eliminate(matrix.copy(), np.ones((3, 1)))
    factors = sparse_factors(matrix > 0.0)
    factors.matrix[:] = matrix
    assert not _factor(factors)
    factors.matrix[:] = np.diag([1.0, 2.0, 3.0])  # what follows is not harmed
    assert _factor(factors)
