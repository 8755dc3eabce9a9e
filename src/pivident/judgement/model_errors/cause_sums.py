"""Sums over rows that suffice for every test of causes and every estimate with some corrected.

With X = (Z, D) the columns of the model and of all causes, and weights 1/λ_j of each joint,

    Xᵀ X,  Xᵀ τ   by window of time, and by block of the motion

Of the products only those are made that a test asks for: of all columns with those that stay in the
equations, which are the model's and those of corrected causes, and of the columns of each cause
with one another. Two causes meet only once one of them is corrected.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pivident.estimation.covariance.sandwich import jackknife_of
from pivident.estimation.covariance.windows import Share, windows_of
from pivident.foundation.compiled import kernel


@dataclass(frozen=True, eq=False)
class JointRows:
    """Rows of one joint in one record, on the columns that act on it; time last."""

    columns: np.ndarray  # indices, shape (k,)
    x: np.ndarray  # columns of model and causes, shape (k, rows)
    tau: np.ndarray  # shape (rows,)

    def residual(self, theta: np.ndarray) -> np.ndarray:
        """τ - Xθ, shape (rows,); ``theta``: of all columns, zero from some on."""
        weights = theta[self.columns]
        # in fours, as libraries sum: then the last bit is that of the product of all
        last = -(-np.trim_zeros(weights, "b").size // 4) * 4
        return np.asarray(self.tau - weights[:last] @ self.x[:last])


#: Columns of several causes, as many of each: places among those of a joint, shape (causes, n), and
#: of their products among all such, shape (causes, n, n).
Group = tuple[np.ndarray, np.ndarray]


#: Columns for which there is room beside those that stay.
SPARE = 16


class Products:
    """Xᵀ X and Xᵀ τ of several parts of the rows, as far as they are asked for.

    Args:
        parts: number of parts.
        first: first column of each cause, and behind the last one; the model's are before them.
    """

    def __init__(self, parts: int, first: np.ndarray) -> None:
        columns, sizes = int(first[-1]), np.diff(first)
        self.tau = np.zeros((parts, columns))
        # of the columns that stay with all; with room for a few more
        self._left = np.zeros((parts, 0, columns))
        self._own = np.zeros((parts, int(np.sum(sizes**2))))  # of each cause's with one another
        self._place = np.full(columns, -1)  # of a column among those that stay
        # The cause of a column, -1 for the model; its place there; where its products begin
        self._cause = np.r_[np.zeros(first[0], int) - 1, np.repeat(np.arange(sizes.size), sizes)]
        self._within = np.arange(columns) - np.r_[0, first][self._cause + 1]
        begin = np.r_[0, np.cumsum(sizes**2)][self._cause]
        self._row = begin + self._within * np.r_[sizes, 0][self._cause]

    @property
    def total(self) -> Products:
        """Of all parts together, as one part."""
        whole = copy(self)
        for name in ("tau", "_left", "_own"):
            setattr(whole, name, getattr(self, name).sum(axis=0, keepdims=True))
        return whole

    def of(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Some entries of Xᵀ X by indices that are broadcast, shape (parts, …)."""
        down, across = self._place[rows], self._place[columns]
        if across.size and across.min() >= 0:
            return self._staying(across, rows)
        if down.size and down.min() >= 0:
            return self._staying(down, columns)
        rows, columns, down, across = np.broadcast_arrays(rows, columns, down, across)
        out = np.empty((len(self.tau), *rows.shape))
        right, left = across >= 0, (across < 0) & (down >= 0)
        own = ~(right | left)
        if not np.array_equal(self._cause[rows[own]], self._cause[columns[own]]):
            raise ValueError("products of two causes neither of which stays were not made")
        out[:, right] = self._left[:, across[right], rows[right]]
        out[:, left] = self._left[:, down[left], columns[left]]
        out[:, own] = self._own[:, self._row[rows[own]] + self._within[columns[own]]]
        return out

    def _staying(self, place: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Products of columns that stay, by their places, with others; indices are broadcast."""
        parts, _, every = self._left.shape
        return np.take(self._left.reshape(parts, -1), place * every + columns, axis=1)

    def border(self, columns: np.ndarray) -> None:
        """Make room for the products of more columns, which stay from now on, with all."""
        (parts, every), stay = self.tau.shape, int(self._place.max()) + 1
        self._place[columns] = stay + np.arange(columns.size)
        if stay + columns.size > self._left.shape[1]:
            left = self._left
            self._left = np.zeros((parts, stay + columns.size + SPARE, every))
            self._left[:, :stay] = left[:, :stay]

    def stays(self, columns: np.ndarray) -> np.ndarray:
        """Which columns' products with all others are there."""
        return np.asarray(self._place[columns] >= 0)

    def add(
        self,
        part: int,
        columns: np.ndarray,
        x: np.ndarray,
        weight: np.ndarray | float,
        chosen: np.ndarray,
    ) -> None:
        """Add products of rows of one joint: of ``chosen`` places among ``columns`` with all.

        ``weight``: of the rows, shape (rows,), or of all.
        """
        place = self._place[columns[chosen]]
        _put(self._left[part], place, columns, (x[chosen] * weight) @ x.T)

    def add_own(
        self, part: int, groups: Sequence[Group], x: np.ndarray, weight: np.ndarray | float
    ) -> None:
        """Add products of the columns of each cause with one another."""
        for chosen, place in groups:
            own = x[chosen]
            self._own[part, place] += own @ (own * weight).transpose(0, 2, 1)

    def groups(self, columns: np.ndarray) -> list[Group]:
        """The columns of a joint by cause, causes of as many columns together."""
        causes, number, count = np.unique(
            self._cause[columns], return_index=True, return_counts=True
        )
        number, count = number[causes >= 0], count[causes >= 0]
        out = []
        for n in np.unique(count):
            chosen = number[count == n][:, None] + np.arange(n)
            own = columns[chosen]
            out.append((chosen, self._row[own][:, :, None] + self._within[own][:, None, :]))
        return out


@kernel
def _put(out, rows, columns, products):
    """Add products to the entries of their rows and columns: in place, without a copy of these."""
    for a in range(rows.size):
        for b in range(columns.size):
            out[rows[a], columns[b]] += products[a, b]


class CauseSums:
    """The sums; all columns of the model first, then those of the causes in their order.

    Attributes:
        parameters: number of the model's columns.
        windows: Xᵀ X and Xᵀ τ of each window of time.
        blocks: Xᵀ X and Xᵀ τ of each block of the motion.
        squares: τᵀ τ of each block.
        torque_squares: τᵀ τ of each joint.
        lengths: rows of each record.
        spans: windows of each record, with their samples and weights.
    """

    def __init__(
        self, records: list[list[JointRows]], variance: np.ndarray, first: np.ndarray, blocks: int
    ) -> None:
        """Of the rows of all records and joints.

        ``variance``: λ of each joint, shape (joints,); ``first``: first column of each cause, and
        behind the last one; ``blocks``: blocks of the motion, of equal length.
        """
        self.records, self.variance, self.parameters = records, variance, int(first[0])
        self.lengths = [record[0].tau.size for record in records]
        every = windows_of(self.lengths)
        self.windows = Products(sum(w.count for w in every), first)
        self.blocks = Products(blocks, first)
        self.squares = np.zeros(blocks)
        self.spans = [_spans(w.shares(slice(0, w.samples))) for w in every]
        ends = -(-np.arange(blocks + 1) * sum(self.lengths) // blocks)
        begin = np.r_[0, np.cumsum(self.lengths)]
        self._blocks = [
            [
                (part, slice(max(ends[part] - start, 0), min(ends[part + 1], stop) - start))
                for part in range(blocks)
                if max(ends[part], start) < min(ends[part + 1], stop)
            ]
            for start, stop in pairwise(begin)
        ]
        self.stay(np.arange(self.parameters))
        self._add_own()
        self.torque_squares = self.joint_squares(np.zeros(0, int), np.zeros(0))

    def stay(self, columns: np.ndarray) -> None:
        """Make the products of some columns with all others, as far as they are not there."""
        columns = columns[~self.windows.stays(columns)]
        if not columns.size:
            return
        self.windows.border(columns)
        self.blocks.border(columns)
        for number, record in enumerate(self.records):
            for rows, lam in zip(record, self.variance, strict=True):
                chosen = np.flatnonzero(np.isin(rows.columns, columns))
                if not chosen.size:
                    continue
                for window, span, weight in self.spans[number]:
                    self.windows.add(window, rows.columns, rows.x[:, span], weight / lam, chosen)
                for block, span in self._blocks[number]:
                    self.blocks.add(block, rows.columns, rows.x[:, span], 1.0 / lam, chosen)

    def _add_own(self) -> None:
        """Products of the columns of each cause, and those of all with the torques."""
        for number, record in enumerate(self.records):
            for rows, lam in zip(record, self.variance, strict=True):
                groups = self.windows.groups(rows.columns)
                for window, span, weight in self.spans[number]:
                    x, tau = rows.x[:, span], rows.tau[span]
                    self.windows.add_own(window, groups, x, weight / lam)
                    self.windows.tau[window, rows.columns] += x @ (weight / lam * tau)
                for block, span in self._blocks[number]:
                    x, tau = rows.x[:, span], rows.tau[span]
                    self.blocks.add_own(block, groups, x, 1.0 / lam)
                    self.blocks.tau[block, rows.columns] += x @ tau / lam
                    self.squares[block] += tau @ tau / lam

    def joint_squares(self, columns: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Sum of squares of each joint's τ - Xθ with some columns, weighted, shape (joints,)."""
        whole, squares = np.zeros(self.blocks.tau.shape[1]), np.zeros(len(self.variance))
        whole[columns] = theta
        for record in self.records:
            for joint, (rows, lam) in enumerate(zip(record, self.variance, strict=True)):
                squares[joint] += np.sum(rows.residual(whole) ** 2) / lam
        return squares


class InstrumentalSums:
    """Xᵀ X_m and Xᵀ τ by window of time, with X_m the columns on the measured motion.

    The size in a score test is too small by the share of its column that the motion of the
    instruments misses; (Xᵀ X_m)⁻¹ Xᵀ τ is not. Made for few columns.

    Args:
        sums: of all causes, on the motion of the instruments.
        measured: rows of some causes on the measured motion.
        columns: indices of their columns among those of all, the model's first.
    """

    def __init__(
        self, sums: CauseSums, measured: Sequence[Sequence[JointRows]], columns: np.ndarray
    ) -> None:
        self.columns, n, parts = columns, columns.size, len(sums.windows.tau)
        self.gram, self.right = np.zeros((parts, n, n)), np.zeros((parts, n))
        place = np.full(sums.windows.tau.shape[1], -1)
        place[columns] = np.arange(n)
        for windows, record, regressors in zip(sums.spans, sums.records, measured, strict=True):
            for own, other, lam in zip(record, regressors, sums.variance, strict=True):
                chosen = np.flatnonzero(place[own.columns] >= 0)
                rows = place[own.columns[chosen]]
                for window, span, weight in windows:
                    instruments = own.x[chosen, span] * (weight / lam)
                    products = instruments @ other.x[:, span].T
                    self.gram[window, rows[:, None], other.columns] += products
                    self.right[window, rows] += instruments @ other.tau[span]

    def estimate(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """θ and δ of some of the columns, and their covariance by the jackknife over windows.

        Raises:
            LinAlgError: all that is known of one lies within one window.
        """
        own = np.flatnonzero(np.isin(self.columns, columns))
        grams, right = self.gram[:, own[:, None], own], self.right[:, own]
        whole = grams.sum(axis=0)
        scale = np.sqrt(np.maximum(np.abs(np.diag(whole)), 1e-300))
        solved = np.linalg.solve(whole / np.outer(scale, scale), right.sum(axis=0) / scale)
        theta = solved / scale
        return theta, jackknife_of(grams, right - grams @ theta, whole).covariance


def _spans(shares: Iterable[Share]) -> list[tuple[int, slice, np.ndarray]]:
    """Each window of a record with its samples and weights: where it falls and where it rises."""
    parts: dict[int, list[tuple[slice, np.ndarray]]] = {}
    for share in shares:
        parts.setdefault(share.window, []).append((share.part, 1.0 - share.rising))
        parts.setdefault(share.window + 1, []).append((share.part, share.rising))
    return [
        (window, slice(own[0][0].start, own[-1][0].stop), np.concatenate([w for _, w in own]))
        for window, own in parts.items()
    ]
