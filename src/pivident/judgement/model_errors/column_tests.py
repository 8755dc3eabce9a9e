"""Tests of many single columns at once, each beside the same columns that stay.

What `score_tests` computes for a cause of one column, for all of them together: every array has the
columns that are tested as its last axis.

The normal equations are in two parts, columns that stay, and others that join them in turn. With G
and r split into the columns B that stay and the others C,

    G_BB θ = r_B,    P = G_BB⁻¹ G_BC,    S = G_CC - G_CB P,    e = r_C - G_CB θ

columns K of C that join get δ = S_KK⁻¹ e_K and change the others to θ - P_K δ, so that one inverse
serves all of them. G is what is left of all rows without those of one part, G = G_all - G_part. Of
S, which has all columns against all, only the columns of one cause are ever asked for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.estimation.covariance.windows import OVERLAP
from pivident.judgement.model_errors.cause_sums import CauseSums, Products

#: Singular values below this share of the largest count as zero.
RCOND = 1e-14


@dataclass(frozen=True, eq=False)
class Normal:
    """G and r, for one part or several: leading axes are kept."""

    whole: Products  # of all rows, one part
    parts: Products | None = None  # of those left out in turn

    def of(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Some entries of G, by indices that are broadcast."""
        whole = self.whole.of(rows, columns)[0]
        return whole if self.parts is None else whole - self.parts.of(rows, columns)

    def right_of(self, columns: np.ndarray) -> np.ndarray:
        """Some entries of r."""
        whole = self.whole.tau[0, columns]
        return np.asarray(whole if self.parts is None else whole - self.parts.tau[:, columns])


@dataclass(frozen=True, eq=False)
class Partition:
    """The parts, for one or several G and r: leading axes are kept."""

    normal: Normal
    others: np.ndarray  # indices of C, shape (C,)
    inverse: np.ndarray  # G_BB⁻¹, shape (…, B, B)
    cross: np.ndarray  # G_CB, shape (…, C, B)
    projection: np.ndarray  # P, shape (…, B, C)
    theta: np.ndarray  # θ, shape (…, B)
    rest: np.ndarray  # e, shape (…, C)

    @classmethod
    def of(cls, normal: Normal, stay: np.ndarray, scale: np.ndarray) -> Partition:
        """Of G and r.

        ``stay``: which columns are B, shape (columns,); ``scale``: size of each column, likewise.
        """
        own, others = np.flatnonzero(stay), np.flatnonzero(~stay)
        outer = np.outer(scale[own], scale[own])
        inverse = np.linalg.pinv(normal.of(own[:, None], own) / outer, rcond=RCOND) / outer
        cross = normal.of(others[:, None], own)
        theta = np.einsum("...ij,...j->...i", inverse, normal.right_of(own))
        return cls(
            normal,
            others,
            inverse,
            cross,
            inverse @ normal.of(own[:, None], others),
            theta,
            normal.right_of(others) - np.einsum("...ij,...j->...i", cross, theta),
        )

    def schur(self, columns: np.ndarray) -> np.ndarray:
        """S_KK of some of the other columns, by their places among them, shape (…, K, K)."""
        own = self.others[columns]
        known = self.cross[..., columns, :] @ self.projection[..., columns]
        return np.asarray(self.normal.of(own[:, None], own) - known)

    def schur_diagonal(self, columns: np.ndarray) -> np.ndarray:
        """S_kk of each of them, shape (…, K)."""
        own = self.others[columns]
        rows, projected = self.cross[..., columns, :], self.projection[..., columns]
        return np.asarray(
            self.normal.of(own, own) - np.einsum("...ki,...ik->...k", rows, projected)
        )

    def joined(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """θ and δ with some of the other columns, by their places among them."""
        delta = np.linalg.solve(self.schur(columns), self.rest[..., columns, None])[..., 0]
        change = np.einsum("...ij,...j->...i", self.projection[..., columns], delta)
        return self.theta - change, delta

    def solved(self, own: np.ndarray, right: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """δ for another right side, of the columns that stay and of some others."""
        left = np.einsum("...ij,...j->...i", self.inverse, own)
        rest = right - np.einsum("...ij,...j->...i", self.cross[..., columns, :], left)
        return np.asarray(np.linalg.solve(self.schur(columns), rest[..., None])[..., 0])


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
    inside, across = windows.of(stay[:, None], stay), windows.of(own[:, None], stay)
    beside, alone = windows.of(stay[:, None], own), windows.of(own, own)
    scores = windows.tau[:, stay, None] - inside @ theta - beside * size
    rest = windows.tau[:, own] - np.einsum("wci,ic->wc", across, theta)
    rest = rest - alone * size
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
    inside, beside = blocks.of(stay[:, None], stay), blocks.of(stay[:, None], own)
    fitted = np.sum(theta * (inside @ theta + 2.0 * beside * size[:, None]), axis=1)
    fitted = fitted + blocks.of(own, own) * size**2
    crossed = np.sum(theta * blocks.tau[:, stay, None], axis=1) + blocks.tau[:, own] * size
    return np.maximum(squares[:, None] - 2.0 * crossed + fitted, 0.0)
