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
    low, high = np.where(np.isnan(y), np.inf, y), np.where(np.isnan(y), -np.inf, y)
    extremes = [
        start + part.argmin() if sign > 0 else start + part.argmax()
        for sign, values in ((1, low), (-1, high))
        for start, part in zip(edges[:-1], np.split(values, edges[1:-1]), strict=True)
    ]
    return np.unique([0, y.size - 1, *extremes])


def stretches(mask: np.ndarray, t: np.ndarray, pixels: int = 500) -> list[tuple[float, float]]:
    """Times (from, to) where a mask holds, at the resolution of a drawing.

    A stretch shorter than one of so many pixels shows if it fills half of it.
    """
    parts = np.array_split(np.arange(mask.size), min(pixels, mask.size))
    filled = np.array([mask[part].mean() >= 0.5 for part in parts])
    edges = np.flatnonzero(np.diff(np.r_[False, filled, False])).reshape(-1, 2)
    return [(float(t[parts[a][0]]), float(t[parts[b - 1][-1]])) for a, b in edges]
