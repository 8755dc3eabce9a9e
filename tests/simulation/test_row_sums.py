"""Weighted sums of rows in vector registers against NumPy."""

import numpy as np
import pytest
from numba import njit

from pivident.simulation.row_sums import LANES, add_rows, add_rows_twice, row_array


@njit
def _sums(out, base, weights, source, more_weights, more_source):
    add_rows(out, 1, base, 2, -0.3, 4, weights, 3, source, 5, 2)
    add_rows_twice(
        out, 2, base, 0, 1.7, 3, weights, 1, source, 0, 1, more_weights, 4, more_source, 2, 1
    )


@pytest.mark.parametrize("width", [1, 8, 9, 24, 61])
def test_sums_are_those_of_numpy(width):
    rng = np.random.default_rng(width)
    out, base, source = row_array(3, width), row_array(3, width), row_array(3, 4, width)
    more_source, weights, more = row_array(5, width), rng.normal(size=9), rng.normal(size=(3, 3))
    assert out.shape[1] == -(-width // LANES) * LANES
    assert out.ctypes.data % (8 * LANES) == 0
    for array in (out, base, source, more_source):
        array[...] = rng.normal(size=array.shape)
    untouched = out[0].copy()
    _sums(out, base, weights, source, more, more_source)
    rows = source.reshape(12, -1)
    first = base[2] - 0.3 * weights[3:7] @ rows[5:12:2]
    second = base[0] + 1.7 * (weights[1:4] @ rows[:3] + more.ravel()[4:7] @ more_source[2:5])
    np.testing.assert_array_equal(out[0], untouched)
    np.testing.assert_allclose(out[1], first, atol=1e-14)
    np.testing.assert_allclose(out[2], second, atol=1e-14)
