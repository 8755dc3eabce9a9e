"""Tests of many single columns at once, each beside the same columns that stay.

What `score_tests` computes for a cause of one column, for all of them together: every array has the
columns that are tested as its last axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.estimation.covariance.windows import OVERLAP
from pivident.model_errors.cause_sums import CauseSums, Products
from pivident.model_errors.partition import Partition


@dataclass(frozen=True, eq=False)
class Parts:
    """Normal equations of all rows, and those that leave out one window or one block."""

    all: Partition
    without_window: Partition
    without_block: Partition


@dataclass(frozen=True, eq=False)
class ColumnTests:
    """Results for each column, shape (columns,)."""

    size: np.ndarray  # δ
    variance: np.ndarray  # of δ, by the jackknife over windows
    residual: np.ndarray  # weighted sum of squares with the column
    unseen: np.ndarray  # the same on blocks that were not fitted
    theta: np.ndarray  # estimates of the columns that stay, shape (stay, columns)


def column_tests(
    sums: CauseSums, parts: Parts, stay: np.ndarray, own: np.ndarray, others: np.ndarray
) -> ColumnTests:
    """Test columns ``own``, each beside ``stay``.

    ``others``: all columns that do not stay, ascending; all three are indices.
    """
    place = np.searchsorted(others, own)
    theta, size = _joined(parts.all, place)
    return ColumnTests(
        size,
        _variance(sums.windows, parts.without_window, stay, own, place, theta, size),
        _squares(sums.blocks, sums.squares, stay, own, theta, size).sum(axis=0),
        _squares(sums.blocks, sums.squares, stay, own, *_joined(parts.without_block, place)).sum(
            axis=0
        ),
        theta,
    )


def _joined(part: Partition, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """θ, shape (…, stay, columns), and δ, shape (…, columns); zero where nothing shows it."""
    shown = part.schur_diagonal(place)
    delta = np.divide(part.rest[..., place], shown, out=np.zeros(shown.shape), where=shown != 0.0)
    return part.theta[..., None] - part.projection[..., place] * delta[..., None, :], delta


def _variance(
    windows: Products,
    without: Partition,
    stay: np.ndarray,
    own: np.ndarray,
    place: np.ndarray,
    theta: np.ndarray,
    size: np.ndarray,
) -> np.ndarray:
    """Σ_w (δ without window w - δ)² / overlap, in its linear form.

    Infinite where all that is known of a column lies within one window.
    """
    inside, across = windows.x[:, stay[:, None], stay], windows.x[:, own[:, None], stay]
    beside = windows.x[:, stay[:, None], own]
    scores = windows.tau[:, stay, None] - inside @ theta - beside * size
    rest = windows.tau[:, own] - np.einsum("wci,ic->wc", across, theta)
    rest = rest - windows.x[:, own, own] * size
    rest = rest - np.einsum("wci,wic->wc", without.cross[:, place], without.inverse @ scores)
    shown = without.schur_diagonal(place)
    steps = np.divide(rest, shown, out=np.full(shown.shape, np.inf), where=shown != 0.0)
    return np.asarray(np.sum(steps**2, axis=0) / OVERLAP)


def _squares(
    blocks: Products,
    squares: np.ndarray,
    stay: np.ndarray,
    own: np.ndarray,
    theta: np.ndarray,
    size: np.ndarray,
) -> np.ndarray:
    """‖τ - Xθ - D δ‖² on each block, shape (blocks, columns)."""
    if theta.ndim == 2:  # one estimate for all blocks
        theta, size = theta[None], size[None]
    inside, beside = blocks.x[:, stay[:, None], stay], blocks.x[:, stay[:, None], own]
    fitted = np.sum(theta * (inside @ theta + 2.0 * beside * size[:, None]), axis=1)
    fitted = fitted + blocks.x[:, own, own] * size**2
    crossed = np.sum(theta * blocks.tau[:, stay, None], axis=1) + blocks.tau[:, own] * size
    return np.maximum(squares[:, None] - 2.0 * crossed + fitted, 0.0)
