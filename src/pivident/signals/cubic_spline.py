"""Cubic splines through samples, as ``scipy.interpolate.CubicSpline`` makes them.

Between neighbouring knots c₀ s³ + c₁ s² + c₂ s + c₃ with s = x - x_i, twice continuously
differentiable; the first two pieces are one polynomial, and so are the last two ("not a knot").
The slopes at the knots solve tridiagonal equations (de Boor, A Practical Guide to Splines, 1978,
chapter IV). Operations and their order are those of SciPy, whose module of splines loads its
optimisers and takes half as long to import as numba.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded

from pivident.foundation.errors import RecordingTooShort


@dataclass(frozen=True, eq=False)
class CubicSpline:
    """A piecewise cubic polynomial; beyond its ends the outer pieces go on.

    Attributes:
        x: knots, increasing, shape (knots,).
        c: coefficients, the highest power first, shape (4, knots - 1, …).
    """

    x: np.ndarray
    c: np.ndarray

    def __call__(self, at: np.ndarray) -> np.ndarray:
        """Values, shape (points, …)."""
        at = np.asarray(at, dtype=float)
        piece = np.clip(np.searchsorted(self.x, at, side="right") - 1, 0, len(self.x) - 2)
        s = (at - self.x[piece]).reshape(at.shape + (1,) * (self.c.ndim - 2))
        value, power = self.c[3, piece] + 0.0, s
        for row in (2, 1, 0):
            value += self.c[row, piece] * power
            power = power * s
        return value

    def derivative(self) -> CubicSpline:
        """The slope as a piecewise polynomial with the same knots."""
        weights = np.array([3.0, 2.0, 1.0]).reshape((3,) + (1,) * (self.c.ndim - 1))
        return CubicSpline(self.x, np.concatenate((0.0 * self.c[:1], weights * self.c[:3])))


def cubic_spline(x: np.ndarray, y: np.ndarray) -> CubicSpline:
    """The spline through y, shape (knots, …), at increasing x, shape (knots,).

    Raises:
        RecordingTooShort: fewer than four knots.
    """
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if len(x) < 4:
        raise RecordingTooShort(len(x), 4)
    step = np.diff(x)
    wide = step.reshape((-1,) + (1,) * (y.ndim - 1))
    slope = np.diff(y, axis=0) / wide
    matrix, right = np.zeros((3, len(x))), np.empty_like(y)
    matrix[1, 1:-1] = 2 * (step[:-1] + step[1:])
    matrix[0, 2:], matrix[2, :-2] = step[:-1], step[1:]
    right[1:-1] = 3 * (wide[1:] * slope[:-1] + wide[:-1] * slope[1:])
    both = x[2] - x[0]
    matrix[1, 0], matrix[0, 1] = step[1], both
    right[0] = ((wide[0] + 2 * both) * wide[1] * slope[0] + wide[0] ** 2 * slope[1]) / both
    both = x[-1] - x[-3]
    matrix[1, -1], matrix[2, -2] = step[-2], both
    right[-1] = (wide[-1] ** 2 * slope[-2] + (2 * both + wide[-1]) * wide[-2] * slope[-1]) / both
    flat = right.reshape(len(x), -1)
    slopes = solve_banded((1, 1), matrix, flat, overwrite_ab=True, overwrite_b=True)
    slopes = slopes.reshape(y.shape)
    bend = (slopes[:-1] + slopes[1:] - 2 * slope) / wide
    c = np.stack((bend / wide, (slope - slopes[:-1]) / wide - bend, slopes[:-1], y[:-1]))
    return CubicSpline(x, c)
