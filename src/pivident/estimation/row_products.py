"""Sums of products of rows over samples, compiled: what the normal equations are made of.

Products of few rows over many samples are too thin for libraries of linear algebra, which are made
for large matrices. Here sixteen sums are formed at a time, four rows by four, so that each sample
that is loaded serves four products; of a symmetric result only the lower half is formed.
"""

from __future__ import annotations

import numpy as np
from numba import njit

#: Rows that are multiplied with each other at a time.
_SIDE = 4

#: Samples of a tile, whose rows stay in the first-level cache.
_TILE = 512


def gram(rows: np.ndarray, part: slice) -> np.ndarray:
    """Σ_t x_i x_j of all pairs of rows, shape (rows, rows), symmetric.

    Args:
        rows: time last, shape (rows, samples), C order.
        part: samples to sum over.
    """
    start, stop, _ = part.indices(rows.shape[1])
    out = np.zeros((len(rows), len(rows)))
    _add_products(rows, rows, start, start, stop - start, True, out)
    return out


def products(left: np.ndarray, right: np.ndarray, part: slice) -> np.ndarray:
    """Σ_t x_i y_j of the rows of two signals, shape (rows of left, rows of right).

    Args:
        left: x, time last, shape (rows, samples of the part), C order.
        right: y, time last, shape (rows, samples), C order.
        part: samples of y that x stands beside.
    """
    start, stop, _ = part.indices(right.shape[1])
    out = np.zeros((len(left), len(right)))
    _add_products(left, right, 0, start, stop - start, False, out)
    return out


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _add_products(left, right, left_start, right_start, samples, lower, out):
    """Add the products; with ``lower`` only those of the lower half, of which the upper is a copy.

    Sums may be formed in another order than written, so that they become vectors; nothing else of
    fast arithmetic is allowed, NaN is kept.
    """
    for first in range(0, samples, _TILE):
        count = min(_TILE, samples - first)
        t, u = left_start + first, right_start + first
        for i in range(0, left.shape[0], _SIDE):
            for j in range(0, i + 1 if lower else right.shape[0], _SIDE):
                if i + _SIDE <= left.shape[0] and j + _SIDE <= right.shape[0]:
                    _add_block(left, right, i, j, t, u, count, out)
                    continue
                for a in range(i, min(i + _SIDE, left.shape[0])):
                    x = left[a, t : t + count]
                    for b in range(j, min(j + _SIDE, right.shape[0])):
                        y = right[b, u : u + count]
                        total = 0.0
                        for k in range(count):
                            total += x[k] * y[k]
                        out[a, b] += total

    if lower:
        for a in range(out.shape[0]):
            for b in range(a):
                out[b, a] = out[a, b]


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _add_block(left, right, i, j, t, u, count, out):
    """Four rows by four over a tile; views that begin at zero, or nothing becomes a vector."""
    a0, a1 = left[i, t : t + count], left[i + 1, t : t + count]
    a2, a3 = left[i + 2, t : t + count], left[i + 3, t : t + count]
    b0, b1 = right[j, u : u + count], right[j + 1, u : u + count]
    b2, b3 = right[j + 2, u : u + count], right[j + 3, u : u + count]
    s00 = s01 = s02 = s03 = s10 = s11 = s12 = s13 = 0.0
    s20 = s21 = s22 = s23 = s30 = s31 = s32 = s33 = 0.0
    for k in range(count):
        x0, x1, x2, x3 = a0[k], a1[k], a2[k], a3[k]
        y0, y1, y2, y3 = b0[k], b1[k], b2[k], b3[k]
        s00 += x0 * y0
        s01 += x0 * y1
        s02 += x0 * y2
        s03 += x0 * y3
        s10 += x1 * y0
        s11 += x1 * y1
        s12 += x1 * y2
        s13 += x1 * y3
        s20 += x2 * y0
        s21 += x2 * y1
        s22 += x2 * y2
        s23 += x2 * y3
        s30 += x3 * y0
        s31 += x3 * y1
        s32 += x3 * y2
        s33 += x3 * y3
    for a, row in enumerate(
        (
            (s00, s01, s02, s03),
            (s10, s11, s12, s13),
            (s20, s21, s22, s23),
            (s30, s31, s32, s33),
        )
    ):
        for b, total in enumerate(row):
            out[i + a, j + b] += total
