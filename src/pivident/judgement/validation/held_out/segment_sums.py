"""Normal equations of the cells of a motion, which add up to those of any training set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pivident.signals.noise_models import lagged_products


@dataclass(frozen=True)
class Segments:
    """Which part of the records each row belongs to."""

    #: For each record and row: cell k has 2k, the gap between cells k and k + 1 has 2k + 1, -1
    #: neither. Cells of different records have no gap between them.
    labels: tuple[np.ndarray, ...]
    cells: int  # number of cells

    @property
    def count(self) -> int:
        """Number of cells and gaps."""
        return 2 * self.cells - 1

    def training(self, held_out: np.ndarray) -> np.ndarray:
        """Segments that may be fitted: cells that are not held out, gaps between two of them.

        ``held_out``: True for cells that are, shape (cells,).
        """
        fitted = np.zeros(self.count, bool)
        fitted[::2] = ~held_out
        fitted[1::2] = ~(held_out[:-1] | held_out[1:])
        return np.flatnonzero(fitted)

    def parts(self, record: int) -> list[tuple[int, slice]]:
        """Segments of one record as slices."""
        label = self.labels[record]
        borders = np.flatnonzero(np.diff(label, prepend=-2, append=-2))
        return [
            (int(label[a]), slice(int(a), int(b))) for a, b in pairwise(borders) if label[a] >= 0
        ]


#: Φ, Z or None, τ and used of each record, time last.
Rows = Sequence[tuple[np.ndarray, np.ndarray | None, np.ndarray, np.ndarray]]


@dataclass(eq=False)
class SegmentSums:
    """Normal equations of one joint in each segment: arrays (segments, …)."""

    zf: np.ndarray
    ff: np.ndarray  # the same array as ``zf`` where there are no instruments
    zt: np.ndarray
    ft: np.ndarray
    tt: np.ndarray
    rows: np.ndarray

    @classmethod
    def of(cls, parts: Rows, segments: Segments) -> SegmentSums:
        """Sums over the rows of all records."""
        fixed = [(phi[:0], None if z is None else z[:0], tau, used) for phi, z, tau, used in parts]
        n, plain = segments.count, all(z is None for _, z, _, _ in parts)
        ff, none = np.zeros((n, 0, 0)), np.zeros((n, 0))
        s = cls(ff if plain else ff.copy(), ff, none, none, np.zeros(n), np.zeros(n))
        for number, (_, _, tau, used) in enumerate(parts):
            for label, span in segments.parts(number):
                s.tt[label] += tau[span] @ tau[span]
                s.rows[label] += used[span].sum()
        return s.with_columns(fixed, [(phi, z) for phi, z, _, _ in parts], segments)

    def with_columns(
        self,
        rows: Rows,
        new: Sequence[tuple[np.ndarray, np.ndarray | None]],
        segments: Segments,
    ) -> SegmentSums:
        """The same with further columns; only products with these are computed.

        Args:
            rows: the rows that these sums are of.
            new: further columns of Φ and Z of each record, shape (columns, rows).
            segments: what each row belongs to.
        """
        k, m, n = self.ft.shape[1], len(new[0][0]), segments.count
        plain = self.zf is self.ff
        ff, ft = _grown(self.ff, m), _grown_vectors(self.ft, m)
        zf, zt = (ff, ft) if plain else (_grown(self.zf, m), _grown_vectors(self.zt, m))
        assert len(ff) == n
        for number, ((phi, z, tau, _), (own, own_z)) in enumerate(zip(rows, new, strict=True)):
            for label, span in segments.parts(number):
                f, g, t = phi[:, span], own[:, span], tau[span]
                cross = f @ g.T
                ff[label, :k, k:] += cross
                ff[label, k:, :k] += cross.T
                ff[label, k:, k:] += g @ g.T
                ft[label, k:] += g @ t
                if plain:
                    continue
                a = f if z is None else z[:, span]
                b = g if own_z is None else own_z[:, span]
                zf[label, :k, k:] += a @ g.T
                zf[label, k:, :k] += b @ f.T
                zf[label, k:, k:] += b @ g.T
                zt[label, k:] += b @ t
        return SegmentSums(zf, ff, zt, ft, self.tt, self.rows)

    def squares(self, theta: np.ndarray) -> np.ndarray:
        """‖τ - Φθ‖² in each segment, shape (segments,)."""
        return np.maximum(self.tt - 2.0 * self.ft @ theta + (self.ff @ theta) @ theta, 0.0)


def _grown(sums: np.ndarray, more: int) -> np.ndarray:
    n, k, _ = sums.shape
    out = np.zeros((n, k + more, k + more))
    out[:, :k, :k] = sums
    return out


def _grown_vectors(sums: np.ndarray, more: int) -> np.ndarray:
    return np.hstack([sums, np.zeros((len(sums), more))])


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
