"""Normal equations of the blocks of a motion, which add up to those of any training set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pivident.signals.noise_models import lagged_products


@dataclass(frozen=True)
class Segments:
    """Which part of the records each row belongs to."""

    #: For each record and row: block k has 2k, the gap after it 2k + 1, -1 neither.
    labels: tuple[np.ndarray, ...]
    folds: int  # number of blocks

    @property
    def count(self) -> int:
        """Number of blocks and gaps."""
        return 2 * self.folds - 1

    def training(self, fold: int) -> np.ndarray:
        """Segments that may be fitted when a block is held out: not it, nor the gaps beside."""
        return np.array([s for s in range(self.count) if abs(s - 2 * fold) > 1], int)

    def parts(self, record: int) -> list[tuple[int, slice]]:
        """Segments of one record as slices."""
        label = self.labels[record]
        borders = np.flatnonzero(np.diff(label, prepend=-2, append=-2))
        return [
            (int(label[a]), slice(int(a), int(b))) for a, b in pairwise(borders) if label[a] >= 0
        ]


@dataclass(eq=False)
class SegmentSums:
    """Normal equations of one joint in each segment: arrays (segments, …)."""

    zf: np.ndarray
    ff: np.ndarray
    zt: np.ndarray
    ft: np.ndarray
    tt: np.ndarray
    rows: np.ndarray

    @classmethod
    def of(
        cls,
        parts: Sequence[tuple[np.ndarray, np.ndarray | None, np.ndarray, np.ndarray]],
        segments: Segments,
    ) -> SegmentSums:
        """Sums over the rows of all records.

        ``parts``: Φ, Z or None, τ and used of each record.
        """
        k, n = parts[0][0].shape[0], segments.count
        s = cls(
            np.zeros((n, k, k)), np.zeros((n, k, k)), np.zeros((n, k)), np.zeros((n, k)),
            np.zeros(n), np.zeros(n),
        )  # fmt: skip
        for number, (phi, z, tau, used) in enumerate(parts):
            for label, span in segments.parts(number):
                f, t = phi[:, span], tau[span]
                instruments = f if z is None else z[:, span]
                s.zf[label] += instruments @ f.T
                s.zt[label] += instruments @ t
                s.ff[label] += f @ f.T
                s.ft[label] += f @ t
                s.tt[label] += t @ t
                s.rows[label] += used[span].sum()
        return s

    def squares(self, theta: np.ndarray) -> np.ndarray:
        """‖τ - Φθ‖² in each segment, shape (segments,)."""
        return np.maximum(self.tt - 2.0 * self.ft @ theta + (self.ff @ theta) @ theta, 0.0)


def effective_rows(residuals: Sequence[np.ndarray]) -> float:
    """Number of independent rows that determine a mean as well: n/(1 + 2 Σ ρ_k).

    Correlations are summed as long as neighbouring pairs of them are positive (Geyer 1992).
    """
    total = 0.0
    for x in residuals:
        x = x - x.mean()
        rho = lagged_products(x, x.size - 1)
        rho = rho / max(rho[0], 1e-300)
        pairs = rho[: 2 * (x.size // 2)].reshape(-1, 2).sum(axis=1)
        last = int(np.argmax(pairs <= 0.0)) if (pairs <= 0.0).any() else pairs.size
        total += x.size / max(2.0 * pairs[:last].sum() - 1.0, 1.0)
    return max(total, 2.0)
