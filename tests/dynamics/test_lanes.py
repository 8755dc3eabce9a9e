"""Blocks of numbers in vector registers against NumPy."""

import numpy as np
import pytest

from pivident.dynamics.lanes import LANES, load, nothing, row_array, store
from pivident.foundation.compiled import kernel


@kernel
def _combine(weight, source, scratch, out):
    """Rows of weight · source, 2 (a - 3) b and (1 - a) + b of the first two, block after block."""
    for at in range(0, out.shape[1], LANES):
        for i in range(2):
            total = nothing()
            for k in range(source.shape[1]):
                total += weight[i, k] * load(source, (1, k), at)
            store(scratch, (i,), None, total)
        a, b = load(scratch, (0,), None), load(scratch, (1,), None)
        store(out, (1,), at, a)
        store(out, (2,), at, 2.0 * (a - 3.0) * b)
        a *= -1.0
        a -= -1.0
        store(out, (3,), at, a + b)


@pytest.mark.parametrize("width", [1, LANES, LANES + 1, 61])
def test_blocks_are_treated_as_rows_of_numpy(width):
    rng = np.random.default_rng(width)
    source, out, weight = row_array(2, 5, width), row_array(4, width), rng.normal(size=(2, 5))
    source[...], out[0] = rng.normal(size=source.shape), rng.normal(size=out.shape[1])
    assert out.shape[1] == -(-width // LANES) * LANES
    untouched = out[0].copy()
    _combine(weight, source, row_array(2, LANES), out)
    a, b = weight @ source[1]
    np.testing.assert_array_equal(out[0], untouched)
    np.testing.assert_allclose(out[1], a, atol=1e-14)
    np.testing.assert_allclose(out[2], 2.0 * (a - 3.0) * b, atol=1e-13)
    np.testing.assert_allclose(out[3], 1.0 - a + b, atol=1e-14)


def test_rows_begin_where_a_vector_may():
    assert all(row_array(3, width).ctypes.data % (8 * LANES) == 0 for width in (1, 7, 40))
