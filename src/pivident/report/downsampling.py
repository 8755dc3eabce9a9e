"""Long signals with fewer points and the same look."""

from __future__ import annotations

import numpy as np


def kept_samples(y: np.ndarray, points: int) -> np.ndarray:
    """Indices of the samples to draw: first, last, and minimum and maximum of equal stretches.

    Every peak stays at its place and height, which plain decimation does not promise. NaN is never
    an extreme.
    """
    if y.size <= points:
        return np.arange(y.size)
    edges = np.linspace(0, y.size, max(1, (points - 2) // 2) + 1).astype(np.int64)
    start, stop = edges[:-1, None], edges[1:, None]
    at = np.minimum(start + np.arange(np.diff(edges).max()), stop - 1)  # a row for each stretch
    low, high = (np.where(np.isnan(y), sign * np.inf, y)[at] for sign in (1.0, -1.0))
    extremes = [low.argmin(axis=1), high.argmax(axis=1)]
    return np.unique([0, y.size - 1, *(start[:, 0] + extremes).ravel()])


def stretches(mask: np.ndarray, t: np.ndarray, pixels: int = 500) -> list[tuple[float, float]]:
    """Times (from, to) where a mask holds, at the resolution of a drawing.

    A stretch shorter than one of so many pixels shows if it fills half of it.
    """
    count = min(pixels, mask.size)
    long, shorter = mask.size % count, mask.size // count  # the first ones are longer by a sample
    borders = np.r_[0, np.cumsum(np.where(np.arange(count) < long, shorter + 1, shorter))]
    filled = np.add.reduceat(mask.astype(np.int64), borders[:-1]) >= 0.5 * np.diff(borders)
    edges = np.flatnonzero(np.diff(np.r_[False, filled, False])).reshape(-1, 2)
    return [(float(t[borders[a]]), float(t[borders[b] - 1])) for a, b in edges]
