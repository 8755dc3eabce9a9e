"""Binned maps: friction against one state or two, with intervals that count passes.

A joint that creeps through a bin for a second gives thousands of samples but one observation:
the causes of differences between passes (load, grease, position) are constant within a pass. So a
pass, a run of samples in the bin whose gaps are shorter than the correlation length D, counts as
one observation, and a pass shorter than D as a fraction of one:

    w_p = min(n_p, D)/D,   m = Σ w_p m_p / Σ w_p,   n = (Σ w_p)² / Σ w_p²,
    interval m ± t(n - 1) s/√n,   s² = Σ w_p (m_p - m)² / Σ w_p · n/(n - 1),

or the weighted median with 1.4826 times the median absolute deviation for s and a factor √(π/2).
t is the quantile of Student's distribution with the coverage of ±2σ of a normal distribution.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pivident.foundation.distributions import student

#: Probability within 2σ of a normal distribution.
TWO_SIGMA = 0.9545

#: Smallest number of effective passes for an interval.
MIN_PASSES = 2.0


@dataclass(frozen=True, eq=False)
class FrictionMap:
    """Friction in the bins of one state; arrays (bins,)."""

    state: str  # name of the state
    unit: str  # of the state
    low: np.ndarray  # lower edge of each bin
    high: np.ndarray  # upper edge
    centre: np.ndarray  # mean state of its samples; NaN in an empty bin
    value: np.ndarray  # mean or median over the passes; NaN in an empty bin
    lower: np.ndarray  # lower end of its 2σ interval; NaN with fewer than two effective passes
    upper: np.ndarray  # upper end
    passes: np.ndarray  # number of passes
    effective: np.ndarray  # effective number of independent observations n
    samples: np.ndarray  # number of samples


@dataclass(frozen=True, eq=False)
class FrictionPlane:
    """Friction in the cells of two states; arrays (bins of y, bins of x)."""

    x: np.ndarray  # centres of the bins of the first state
    y: np.ndarray  # centres of the bins of the second one
    value: np.ndarray  # mean over the passes; NaN for fewer than two effective passes
    spread: np.ndarray  # half of the 2σ interval
    effective: np.ndarray  # effective number of independent observations


def friction_map(
    values: np.ndarray,
    state: np.ndarray,
    *,
    name: str,
    unit: str,
    used: np.ndarray,
    record: np.ndarray | None = None,
    correlation: float = 1.0,
    bins: int = 24,
    statistic: Literal["mean", "median"] = "mean",
    whole_passes: bool = True,
) -> FrictionMap:
    """Average values (samples,) over their passes through ``bins`` of equal width of one state.

    Samples are in the order of time; a pass ends where the bin or the recording changes. With
    ``whole_passes`` a pass counts as one however long it takes. Over time, where each bin is passed
    only once, stretches of D samples (``correlation``) count instead.
    """
    edges = _edges(state[used], bins)
    cell = np.where(used, _bin(state, edges), -1)
    found = _passes(values, cell, record, correlation, bins, statistic, whole_passes)
    value, spread, passes, effective, samples = found
    inside = cell >= 0
    with np.errstate(invalid="ignore", divide="ignore"):
        centre = np.bincount(cell[inside], state[inside], bins) / samples
    return FrictionMap(
        name, unit, edges[:-1], edges[1:], centre, value, value - spread, value + spread, passes,
        effective, samples,
    )  # fmt: skip


def friction_plane(
    values: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    *,
    used: np.ndarray,
    record: np.ndarray | None = None,
    correlation: float = 1.0,
    bins: tuple[int, int] = (16, 12),
) -> FrictionPlane:
    """Map values over two states; arguments as in :func:`friction_map`."""
    x_edges, y_edges = _edges(x[used], bins[0]), _edges(y[used], bins[1])
    cell = np.where(used, _bin(y, y_edges) * bins[0] + _bin(x, x_edges), -1)
    size = bins[0] * bins[1]
    value, spread, _, effective, _ = _passes(values, cell, record, correlation, size, "mean")
    thin = effective < MIN_PASSES
    shape = (bins[1], bins[0])
    return FrictionPlane(
        0.5 * (x_edges[:-1] + x_edges[1:]),
        0.5 * (y_edges[:-1] + y_edges[1:]),
        np.where(thin, np.nan, value).reshape(shape),
        np.where(thin, np.nan, spread).reshape(shape),
        effective.reshape(shape),
    )


def _edges(state: np.ndarray, bins: int) -> np.ndarray:
    low, high = (float(state.min()), float(state.max())) if state.size else (0.0, 1.0)
    return np.linspace(low, high if high > low else low + 1.0, bins + 1)


def _bin(state: np.ndarray, edges: np.ndarray) -> np.ndarray:
    return np.clip(np.searchsorted(edges, state, side="right") - 1, 0, edges.size - 2)


def _passes(
    values: np.ndarray,
    cell: np.ndarray,
    record: np.ndarray | None,
    correlation: float,
    cells: int,
    statistic: str,
    whole_passes: bool = True,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Value, half interval, passes, effective passes and samples of each cell."""
    order = np.argsort(cell, kind="stable")
    order = order[cell[order] >= 0]
    own = cell[order]
    samples = np.bincount(own, minlength=cells).astype(float)
    if not order.size:
        empty = np.full(cells, np.nan)
        return empty, empty, np.zeros(cells, dtype=int), np.zeros(cells), samples
    begins = (np.diff(own) != 0) | (np.diff(order) > max(correlation, 1.0))
    if record is not None:
        begins |= np.diff(record[order]) != 0
    if not whole_passes:
        length = max(int(np.ceil(correlation)), 1)
        begins |= np.diff(order // length) != 0
    number = np.concatenate([[0], np.cumsum(begins)])
    size = np.bincount(number).astype(float)
    mean = np.bincount(number, values[order]) / size
    place = own[np.concatenate([[True], begins])]
    weight = np.minimum(size, correlation) / correlation
    total = np.bincount(place, weight, cells)
    with np.errstate(invalid="ignore", divide="ignore"):
        effective = np.nan_to_num(total**2 / np.bincount(place, weight**2, cells))
        # Many short passes carry no more information than their duration.
        effective = np.minimum(effective, np.maximum(total, 1.0))
        if statistic == "mean":
            value = np.bincount(place, weight * mean, cells) / total
            squares = np.bincount(place, weight * (mean - value[place]) ** 2, cells) / total
            std = np.sqrt(squares * effective / (effective - 1.0))
        else:
            value = _weighted_medians(mean, weight, place, cells)
            away = _weighted_medians(np.abs(mean - value[place]), weight, place, cells)
            std = np.sqrt(np.pi / 2.0) * 1.4826 * away
        factor = student.ppf(0.5 + 0.5 * TWO_SIGMA, np.maximum(effective - 1.0, 1.0))
        spread = np.where(effective >= MIN_PASSES, factor * std / np.sqrt(effective), np.nan)
    passes = np.bincount(place, minlength=cells)
    return value, spread, passes, effective, samples


def _weighted_medians(
    values: np.ndarray, weight: np.ndarray, place: np.ndarray, cells: int
) -> np.ndarray:
    """Weighted median of each cell's values, NaN in empty cells."""
    medians = np.full(cells, np.nan)
    for cell in np.unique(place):
        own = np.flatnonzero(place == cell)
        own = own[np.argsort(values[own])]
        share = (np.cumsum(weight[own]) - 0.5 * weight[own]) / weight[own].sum()
        medians[cell] = np.interp(0.5, share, values[own])
    return medians
