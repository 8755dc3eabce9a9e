"""The equations that an estimate solved last, kept for the tests that follow.

Sums over the whole record suffice to solve, not to test: a robust covariance needs the scores
ζ_t ε_t in their order, an over-identification test needs further instruments. Signals, simulated
motion and prefilters are kept instead, and the weighted columns

    Φ_j λ_j^(-1/2),   Z_j λ_j^(1/2 - w),   τ_j λ_j^(-1/2)         so that Zᵀ(τ - Φθ) = 0 at θ̂

are made again block by block. Nothing of the size of the observation matrix is held.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters
from pivident.dynamics.regressor import Regressor
from pivident.errors import UnusableValue
from pivident.estimation.equation_record import EquationRecord, JointColumns
from pivident.motion.motion import Motion
from pivident.signals.prefilter import Prefilter


@dataclass(frozen=True, eq=False)
class JointRows:
    """Weighted and prefiltered rows of one joint in one block; zero where a sample is not used."""

    columns: np.ndarray  # parameters that act on the joint, shape (k,)
    phi: np.ndarray  # observation matrix, shape (k, samples), time last
    z: np.ndarray  # instruments, likewise; the observation matrix itself for least squares
    extra: np.ndarray | None  # further instruments, likewise, or None
    tau: np.ndarray  # torque, shape (samples,)
    used: np.ndarray  # samples that the estimate uses, shape (samples,)


@dataclass(frozen=True, eq=False)
class Block:
    """A stretch of one record."""

    record: int  # its number
    span: slice  # rows of the record
    joints: tuple[JointRows, ...]  # rows of each joint


@dataclass(frozen=True, eq=False)
class Equations:
    """Everything that the last pass of an estimator was made of."""

    regressor: Regressor  # the observation matrix
    records: tuple[EquationRecord, ...]  # recordings with instruments
    filters: tuple[Prefilter, ...]  # prefilter of each joint; of no use to decimated records
    variance: np.ndarray  # λ of each joint, shape (joints,)
    weight_power: float = 1.0  # w, power of λ in the weights

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
        """The rows of all records in order."""
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


@dataclass(frozen=True, eq=False)
class TorqueSums:
    """Torque error of any parameters from sums over the fitted record, without its signals.

    Over the rows in use, with all base parameters β as columns of Φ and W = 1/rms² of each joint,

        G = ΦᵀWΦ,   g = ΦᵀWτ,   t = τᵀWτ,        ‖τ - Φβ‖²_W = t - 2 gᵀβ + βᵀGβ

    The sums have the size of the parameters. From them follows exactly what another set of
    parameters, a consistent one for instance, costs in torque on that record.
    """

    gram: np.ndarray  # G, shape (base, base)
    moment: np.ndarray  # g, shape (base,)
    square: float  # t
    rows: int  # number of rows, all joints together

    def squared_error(self, base: np.ndarray) -> float:
        """‖τ - Φβ‖²_W.

        ``base``: all base parameters, shape (base,).
        """
        value = self.square - 2.0 * self.moment @ base + base @ self.gram @ base
        return max(float(value), 0.0)

    def relative_error(self, base: np.ndarray) -> float:
        """‖τ - Φβ‖/‖τ‖ over all joints, weighted by joint, 0 to 1 and more.

        ``base``: all base parameters, shape (base,).
        """
        return float(np.sqrt(self.squared_error(base) / max(self.square, 1e-300)))

    def to_values(self) -> dict[str, Any]:
        """Plain values for a file; of G the lower triangle by rows."""
        lower = np.tril_indices(self.moment.size)
        return {
            "gram": self.gram[lower].tolist(),
            "moment": self.moment.tolist(),
            "square": self.square,
            "rows": self.rows,
        }

    @classmethod
    def from_values(cls, values: Mapping[str, Any], base: BaseParameters) -> TorqueSums:
        """The sums of :meth:`to_values`."""
        size = len(base)
        numbers = {}
        for key, wanted in (
            ("gram", (size * (size + 1) // 2,)),
            ("moment", (size,)),
            ("square", ()),
            ("rows", ()),
        ):
            try:
                numbers[key] = np.asarray(values[key], dtype=float)
            except (KeyError, TypeError, ValueError) as error:
                raise ValueError(f"torque_sums: {key!r} is missing or not a number") from error
            if numbers[key].shape != wanted or not np.isfinite(numbers[key]).all():
                raise UnusableValue(
                    f"torque_sums: {key!r} has shape {numbers[key].shape} or is not finite",
                    advice=f"{size} base parameters need {wanted}",
                )
        if min(numbers["square"], numbers["rows"]) < 0.0:
            raise ValueError("torque_sums: square and rows cannot be negative")
        gram = np.zeros((size, size))
        gram[np.tril_indices(size)] = numbers["gram"]
        gram += np.tril(gram, -1).T
        scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        if np.linalg.eigvalsh(gram / np.outer(scale, scale))[0] < -1e-6:
            raise ValueError("torque_sums: 'gram' is not positive semidefinite")
        return cls(gram, numbers["moment"], float(numbers["square"]), int(numbers["rows"]))
