"""Linear equations of a few unknowns in compiled code."""

import numpy as np
import pytest

from pivident.dynamics.elimination import eliminate, factor, solve


@pytest.mark.parametrize("n", [1, 2, 5, 12])
def test_both_ways_solve_like_numpy(n):
    rng = np.random.default_rng(n)
    for _ in range(20):
        matrix, right = rng.normal(size=(n, n)), rng.normal(size=(n, 3))
        matrix[np.arange(n), np.arange(n)] = 0.0 if n > 1 else 1.0  # rows have to be exchanged
        wanted = np.linalg.solve(matrix, right)
        one, at_once = matrix.copy(), right.copy()
        assert eliminate(one, at_once)
        lower, order, later = matrix.copy(), np.zeros(n, dtype=np.int64), right.copy()
        assert factor(lower, order)
        solve(lower, order, later)
        scale = 1e-12 * np.abs(wanted).max() * np.linalg.cond(matrix)
        np.testing.assert_allclose(at_once, wanted, rtol=0.0, atol=scale)
        np.testing.assert_allclose(later, wanted, rtol=0.0, atol=scale)


def test_a_singular_matrix_is_said():
    matrix = np.ones((3, 3))
    assert not eliminate(matrix.copy(), np.ones((3, 1)))
    assert not factor(matrix.copy(), np.zeros(3, dtype=np.int64))
