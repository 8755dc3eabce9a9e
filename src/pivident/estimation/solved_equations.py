"""The equations that an estimate solved last, with their noise, kept for the tests that follow.

Sums over the whole record suffice to solve, not to test: a robust covariance needs the scores
ζ_t ε_t in their order, an over-identification test needs further instruments. Signals, simulated
motion and prefilters are kept instead, and the weighted columns

    Φ_j λ_j^(-1/2),   Z_j λ_j^(1/2 - w),   τ_j λ_j^(-1/2)         so that Zᵀ(τ - Φθ) = 0 at θ̂

are made again block by block. Nothing of the size of the observation matrix is held.

Durbin, Wu and Hausman: do the regressors carry noise that the instruments do not?

The whitened equations are fitted once by least squares on Φ and once with what the instruments
leave of Φ beside it (Janot, Vandanjon and Gautier 2016),

    τ = Φ θ + V δ + e,   V = Φ - Z (ZᵀZ)⁻¹ ZᵀΦ,    F = [(RSS₀ - RSS₁)/d] / [RSS₁/(n - b - d)]  (E2)

with d the directions of V that are left beside Φ. δ = 0 says that least squares would do as well.
F supposes white residuals. Those of real records are correlated by model error, and F rejects
nearly always; ``validation.overidentification`` has the form that holds its size for them.
A reconstructed reference that follows the noise of the record hides from this test, which is why
its freedom is reported with it.

The information of a row of each joint's equation: its noise by frequency, and the rows left out.

An estimate weighs the rows of joint j with its prefilter L_j, which holds their standard deviation.
The design of the next motion expects the same noise: what it will know of the parameters is

    I = Σ_j Σ_t (L_j Φ_j)ᵀ (L_j Φ_j)
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.equation_record import EquationRecord, JointColumns
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import Problem
from pivident.estimation.restrictions import Freedom
from pivident.foundation.distributions import fisher
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.plain_values import As, Limits, Sized
from pivident.loop.motion.motion import Motion
from pivident.signals.prefilter import Prefilter

#: Smallest eigenvalue, of the Gram matrix of unit columns, of a direction that counts.
SMALLEST = 1e-10


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
        """Weights on both sides; ``used``: roots of those of the rows, zero where not used."""
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
            used > 0,
        )


def _positive_semidefinite(lower: np.ndarray) -> np.ndarray:
    """The symmetric matrix of a lower triangle; refuses one that is no sum of squares."""
    size = (math.isqrt(8 * lower.size + 1) - 1) // 2
    if size * (size + 1) // 2 != lower.size:
        raise ValueError(f"{lower.size} numbers are no triangle")
    gram = np.zeros((size, size))
    gram[np.tril_indices(size)] = lower
    gram += np.tril(gram, -1).T
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    if size and np.linalg.eigvalsh(gram / np.outer(scale, scale))[0] < -1e-6:
        raise ValueError("it is not positive semidefinite")
    return gram


#: A symmetric matrix without negative eigenvalues, stored as its lower triangle by rows.
LowerTriangle = As(
    Annotated[np.ndarray, Sized(None)],
    lambda matrix: matrix[np.tril_indices(len(matrix))],
    _positive_semidefinite,
)


@dataclass(frozen=True, eq=False)
class TorqueSums(Displayed):
    """Torque error of any parameters from sums over the fitted record, without its signals.

    Over the rows in use, with all base parameters β as columns of Φ and W = 1/rms² of each joint,

        G = ΦᵀWΦ,   g = ΦᵀWτ,   t = τᵀWτ,        ‖τ - Φβ‖²_W = t - 2 gᵀβ + βᵀGβ

    The sums have the size of the parameters. From them follows exactly what another set of
    parameters, a consistent one for instance, costs in torque on that record.
    """

    gram: Annotated[np.ndarray, LowerTriangle, Sized("base parameters", "base parameters")]  # G
    moment: Annotated[np.ndarray, Sized("base parameters")]  # g
    square: Annotated[float, Limits(ge=0.0)]  # t
    rows: Annotated[int, Limits(ge=0)]  # number of rows, all joints together

    def squared_error(self, base: np.ndarray) -> float:
        """‖τ - Φβ‖²_W.

        ``base``: all base parameters, shape (base,).
        """
        return max(float(self.square - 2.0 * self.moment @ base + base @ self.gram @ base), 0.0)

    def relative_error(self, base: np.ndarray) -> float:
        """‖τ - Φβ‖/‖τ‖ over all joints, weighted by joint, 0 to 1 and more.

        ``base``: all base parameters, shape (base,).
        """
        return float(np.sqrt(self.squared_error(base) / max(self.square, 1e-300)))


@dataclass(frozen=True)
class ExogeneityTest:
    """The test's outcome."""

    statistic: float  # F
    directions: int  # d
    rows: int  # n
    p_value: float  # probability of a larger F where the regressors are exogenous

    def __str__(self) -> str:
        verdict = (
            "the regressors contain noise that the instruments do not, so least squares would "
            "be biased"
            if self.p_value < 0.05
            else "regressors and instruments agree, and least squares would do as well"
        )
        return (
            f"Exogeneity (Durbin-Wu-Hausman, for a white residual): F = {self.statistic:.3g} on "
            f"{self.directions} and {self.rows} degrees of freedom, p = {self.p_value:.2g}: "
            f"{verdict}."
        )


def durbin_wu_hausman(
    sums: Sequence[JointSums], variance: np.ndarray, freedom: Freedom
) -> ExogeneityTest:
    """Test on the normal equations of all joints, whose columns are whitened, as far as free."""
    size, free = freedom.basis.shape
    gram, right = np.zeros((2 * size, 2 * size)), np.zeros(2 * size)
    total, rows = 0.0, 0
    for joint, lam in zip(sums, variance, strict=True):
        both = np.r_[joint.columns, size + joint.columns]
        gram[np.ix_(both, both)] += np.block([[joint.ff, joint.zf.T], [joint.zf, joint.zz]]) / lam
        right[both] += np.r_[joint.ft, joint.zt] / lam
        total += joint.residual_sum(freedom.offset) / lam
        rows += joint.rows
    both = np.kron(np.eye(2), freedom.basis)
    right = both.T @ (right - gram[:, :size] @ freedom.offset)
    gram, size = both.T @ gram @ both, free
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    gram, right = gram / np.outer(scale, scale), right / scale
    explained, rank = _explained(gram[:size, :size], right[:size])
    more, larger_rank = _explained(gram, right)
    directions = max(larger_rank - rank, 1)
    left = max(rows - larger_rank, 1)
    statistic = max(more - explained, 0.0) / directions / max((total - more) / left, 1e-300)
    return ExogeneityTest(
        float(statistic),
        directions,
        left,
        float(fisher.sf(statistic, directions, left)),
    )


def _explained(gram: np.ndarray, right: np.ndarray) -> tuple[float, int]:
    """Sum of squares that the columns explain, and their numerical rank."""
    values, vectors = np.linalg.eigh(gram)
    kept = values > SMALLEST * values[-1]
    shares = (vectors.T @ right)[kept] ** 2 / values[kept]
    return float(shares.sum()), int(kept.sum())


@dataclass(frozen=True, eq=False)
class EquationNoise(Displayed):
    """Noise of the equations that an estimate solved.

    Attributes:
        rate: rows per second [Hz].
        standstill: speed below which rows were left out, zero where none were, shape (joints,)
            [rad/s or m/s].
        filters: prefilter of each joint with its variance: what it leaves of the residual is white
            and has the variance one.
    """

    rate: Annotated[float, Limits(gt=0.0)]
    standstill: Annotated[np.ndarray, Sized("joints")]
    filters: Annotated[tuple[Prefilter, ...], Sized("joints")]

    @classmethod
    def of(cls, problem: Problem, equations: Equations, rate: float) -> EquationNoise:
        """Noise of the equations of a problem, with so many rows per second [Hz]."""
        standstill = np.zeros(problem.robot.size)
        slow, left_out = np.zeros((2, problem.robot.size))
        for recording, record in zip(problem.recordings, equations.records, strict=True):
            limits = problem.speed_limits(recording)
            rows = np.clip(record.sample_numbers.astype(int), 0, record.kinematics.dq.shape[1] - 1)
            resting = ~limits.moving(record.kinematics.dq[:, rows])
            slow += resting.sum(axis=1)
            left_out += (resting & ~record.used).sum(axis=1)
            standstill = np.maximum(standstill, limits.joints)
        filters = equations.filters if equations.full_rate else [Prefilter()] * problem.robot.size
        return cls(
            rate,
            np.where(left_out > 0.5 * slow, standstill, 0.0),
            tuple(
                replace(f, variance=float(f.variance * v))
                for f, v in zip(filters, equations.variance, strict=True)
            ),
        )
