"""The equations that an estimate solved last, kept for the tests that follow.

Sums over the whole record suffice to solve, not to test: a robust covariance needs the scores
ζ_t ε_t in their order, an over-identification test needs further instruments. Signals, simulated
motion and prefilters are kept instead, and the weighted columns

    Φ_j λ_j^(-1/2),   Z_j λ_j^(1/2 - w),   τ_j λ_j^(-1/2)         so that Zᵀ(τ - Φθ) = 0 at θ̂

are made again block by block. Nothing of the size of the observation matrix is held.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.equation_record import EquationRecord, JointColumns
from pivident.estimation.motion import Motion
from pivident.signals.prefilter import Prefilter


@dataclass(frozen=True, eq=False)
class JointRows:
    """Weighted and prefiltered rows of one joint in one block; zero where a sample is not used.

    Attributes:
        columns: parameters that act on the joint, shape (k,).
        phi: observation matrix, shape (k, samples), time last.
        z: instruments, likewise; the observation matrix itself for least squares.
        extra: further instruments, likewise, or None.
        tau: torque, shape (samples,).
        used: samples that the estimate uses, shape (samples,).
    """

    columns: np.ndarray
    phi: np.ndarray
    z: np.ndarray
    extra: np.ndarray | None
    tau: np.ndarray
    used: np.ndarray


@dataclass(frozen=True, eq=False)
class Block:
    """A stretch of one record.

    Attributes:
        record: its number.
        span: rows of the record.
        joints: rows of each joint.
    """

    record: int
    span: slice
    joints: tuple[JointRows, ...]


@dataclass(frozen=True, eq=False)
class Equations:
    """Everything that the last pass of an estimator was made of.

    Attributes:
        regressor: the observation matrix.
        records: recordings with instruments.
        filters: prefilter of each joint; of no use to decimated records.
        variance: λ of each joint, shape (joints,).
        weight_power: w, power of λ in the weights.
    """

    regressor: Regressor
    records: tuple[EquationRecord, ...]
    filters: tuple[Prefilter, ...]
    variance: np.ndarray
    weight_power: float = 1.0

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.regressor.parameters)

    @property
    def lengths(self) -> list[int]:
        """Rows of each record."""
        return [r.used.shape[1] for r in self.records]

    @property
    def has_instruments(self) -> bool:
        """Whether instruments differ from the observation matrix."""
        return self.records[0].has_instruments

    @property
    def full_rate(self) -> bool:
        """Whether rows are all samples, behind prefilters, rather than decimated."""
        return self.records[0].full_rate

    def blocks(
        self, extra: Sequence[Motion] | Sequence[np.ndarray] | None = None
    ) -> Iterator[Block]:
        """The rows of all records in order.

        Args:
            extra: for each record another motion (of decimated records its packed columns),
                whose columns less the instruments' own are further instruments. The difference
                spans with Z what the columns themselves do, and keeps its digits where they are
                almost alike.
        """
        for number, record in enumerate(self.records):
            other: Any = None if extra is None else extra[number]
            made = record.blocks(self.regressor, self.filters, other, self._weighted)
            for span, rows in made:
                yield Block(number, span, rows)

    def _weighted(self, j: int, columns: JointColumns, used: np.ndarray) -> JointRows:
        """Weights on both sides, and zeros where a sample is not used."""
        phi, z, extra, tau = columns
        root = np.sqrt(self.variance[j])
        left = used / root
        right = left * root ** (2.0 - 2.0 * self.weight_power)
        return JointRows(
            self.regressor.columns_of(j),
            phi * left,
            (phi if z is None else z) * right,
            None if extra is None else extra * right,
            tau * left,
            used,
        )
