"""Sums over rows that suffice for every test of causes and every estimate with some corrected.

With X = (Φ, D) the columns of the model and of all causes, Y the same on the motion that makes the
instruments, and weights 1/λ_j of each joint,

    Yᵀ X,  Yᵀ τ   by window of time,
    Xᵀ X,  Xᵀ τ,  τᵀ τ   by block of the motion and by joint
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from pivident.compiled import kernel
from pivident.estimation.covariance.windows import Share, windows_of


@dataclass(frozen=True, eq=False)
class JointRows:
    """Rows of one joint in one record, on the columns that act on it; time last."""

    columns: np.ndarray  # indices, shape (k,)
    x: np.ndarray  # columns of model and causes, shape (k, rows); ``y`` their instruments
    y: np.ndarray
    tau: np.ndarray  # shape (rows,)


@dataclass(frozen=True, eq=False)
class Products:
    """Aᵀ X and Aᵀ τ of several parts of the rows."""

    x: np.ndarray  # shape (parts, columns, columns)
    tau: np.ndarray  # shape (parts, columns)

    @classmethod
    def empty(cls, parts: int, columns: int) -> Products:
        """No rows yet."""
        return cls(np.zeros((parts, columns, columns)), np.zeros((parts, columns)))

    def add(self, part: int, columns: np.ndarray, left: np.ndarray, x: np.ndarray, tau) -> None:
        """Add rows of one joint to a part; ``left``: A, shape (k, rows), weighted."""
        self.put(part, columns, left @ x.T, left @ tau)

    def put(self, part: int, columns: np.ndarray, gram: np.ndarray, right: np.ndarray) -> None:
        """Add the products of such rows."""
        _put(self.x[part], columns, gram)
        self.tau[part, columns] += right


@kernel
def _put(out, columns, gram):
    """Add products to the entries of their columns: in place, without a copy of these entries."""
    for a in range(columns.size):
        for b in range(columns.size):
            out[columns[a], columns[b]] += gram[a, b]


@dataclass(frozen=True, eq=False)
class CauseSums:
    """The sums; all columns of the model first, then those of the causes in their order."""

    parameters: int  # number of the model's columns
    windows: Products  # Yᵀ X and Yᵀ τ of each window of time
    blocks: Products  # Xᵀ X and Xᵀ τ of each block of the motion
    squares: np.ndarray  # τᵀ τ of each block
    joints: Products  # Xᵀ X and Xᵀ τ of each joint
    joint_squares: np.ndarray  # τᵀ τ of each joint
    lengths: list[int]  # rows of each record


def cause_sums(
    records: list[list[JointRows]],
    variance: np.ndarray,
    parameters: int,
    columns: int,
    blocks: int,
) -> CauseSums:
    """All sums of the rows of all records and joints.

    ``variance``: λ of each joint, shape (joints,); ``parameters``, ``columns``: number of the
    model's columns and of all; ``blocks``: blocks of the motion, of equal length.
    """
    lengths = [record[0].tau.size for record in records]
    windows = windows_of(lengths)
    made = CauseSums(
        parameters,
        Products.empty(sum(w.count for w in windows), columns),
        Products.empty(blocks, columns),
        np.zeros(blocks),
        Products.empty(len(variance), columns),
        np.zeros(len(variance)),
        lengths,
    )
    first = 0
    for record, own, length in zip(records, windows, lengths, strict=True):
        block = (first + np.arange(length)) * blocks // max(sum(lengths), 1)
        shares = list(own.shares(slice(0, length)))
        first += length
        _add_windows(made.windows, record, variance, shares)
        whole = [np.zeros((rows.columns.size, rows.columns.size)) for rows in record]
        for part in np.unique(block):
            here = block == part
            for joint, (rows, lam) in enumerate(zip(record, variance, strict=True)):
                x, tau = rows.x[:, here], rows.tau[here]
                gram, right, square = x / lam @ x.T, x / lam @ tau, tau @ tau / lam
                made.blocks.put(part, rows.columns, gram, right)
                whole[joint] += gram
                made.joints.tau[joint, rows.columns] += right
                made.squares[part] += square
                made.joint_squares[joint] += square
        for joint, rows in enumerate(record):
            _put(made.joints.x[joint], rows.columns, whole[joint])
    return made


def _add_windows(
    sums: Products, record: list[JointRows], variance: np.ndarray, shares: Iterable[Share]
) -> None:
    """Each row to the window that falls there and to the one that rises; joints innermost.

    A window of many columns is larger than what is at hand of the memory.
    """
    parts: dict[int, list[tuple[slice, np.ndarray]]] = {}
    for share in shares:
        parts.setdefault(share.window, []).append((share.part, 1.0 - share.rising))
        parts.setdefault(share.window + 1, []).append((share.part, share.rising))
    for window, own in parts.items():
        span = slice(own[0][0].start, own[-1][0].stop)
        weight = np.concatenate([part for _, part in own])
        for rows, lam in zip(record, variance, strict=True):
            y = rows.y[:, span] * (weight / lam)
            sums.add(window, rows.columns, y, rows.x[:, span], rows.tau[span])
