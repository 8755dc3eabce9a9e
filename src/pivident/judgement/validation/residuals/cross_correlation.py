"""Does the motion explain what the model left, its sign or its variance?

The estimate makes Σ ζ_t ε_t zero, so instruments of the same instant say nothing about the
residual. Instruments of other instants do: friction, elasticity or a delay that the model lacks
leaves a residual that follows the motion. Both are reduced to the band of the motion first, by
sums over short stretches b of the rows in use, each divided by the root of their number m_b
so that white noise keeps its variance:

    ε̄_b = Σ_{t∈b} ε_t / √m_b,    φ̄_b, ζ̄_b likewise
    ε̄_b = φ̄_bᵀ δ + ζ̄_{b-1}ᵀ α + ζ̄_{b+1}ᵀ β + white,    F-test of α = β = 0

δ stands for the error of the estimate, which is in the residual whatever its size. The test
presumes a white residual: of a correlated one (see Ljung and Box) it finds too much, and only the
share that the motion explains says something.

Does the residual's variance change with speed, acceleration or torque?

The squared residual is regressed on a constant and the drivers s (Breusch and Pagan 1979, in
Koenker's form, which does not take the residual to be normal), or on s, their squares and their
products as well (White 1980):

    n R² / F₂  ~  χ²(columns without the constant),   F₂ = 1 + 2 Σ_k ρ_k²

F₂ allows for a correlated residual whose squares say the same thing several times; it is one
where the residual is white.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.estimation.solved_equations import Equations
from pivident.foundation.distributions import chi_square, fisher
from pivident.judgement.validation.residuals.autocorrelation import (
    WithProbability,
    probability,
    reading,
    variance_factor,
)
from pivident.loop.motion.motion import MOTION_BAND
from pivident.signals.noise_models import LaggedSums

#: Shifts of the instruments in the test, in stretches.
SHIFTS = (-1, 1)
#: Lags of the cross-correlations, in stretches to both sides.
LAGS = 20
#: Rows that must be left for the residual's variance.
MIN_ROWS = 20
#: Smallest part of a shifted instrument, beside the others, that counts as a direction.
SMALLEST = 1e-4
#: Share of the residual in the band of the motion, explained by it, below which it does not matter.
PRACTICAL_SHARE = 0.10
#: Ratio of variances, between the quarters of the samples where a driver is largest and smallest,
#: below which it does not matter: standard errors then differ by a third.
PRACTICAL_RATIO = 1.8


@dataclass(frozen=True, eq=False)
class CrossCorrelationTest(WithProbability):
    """Residual of one joint against its instruments."""

    statistic: float  # F
    degrees_of_freedom: tuple[int, int]  # directions of the shifted instruments, and rows left
    #: Probability of a larger F if the residual is white and does not follow the motion.
    p_value: float
    #: Share of the residual in the motion's band that the shifted instruments explain, their number
    #: allowed for (may be slightly negative).
    explained: float
    columns: tuple[str, ...]  # parameters of the joint, whose instruments these are
    lags: np.ndarray  # shift of the instruments [s], shape (lags,); positive: earlier instruments
    #: cross-correlations, shape (columns, lags); around lag zero small by construction.
    rho: np.ndarray
    band: float  # 2/√rows, for a white residual

    @property
    def largest(self) -> float:
        """Largest cross-correlation of any instrument at any lag."""
        return float(np.abs(self.rho).max())

    @property
    def largest_column(self) -> str:
        """Parameter whose instrument it is."""
        return self.columns[int(np.argmax(np.abs(self.rho).max(axis=1)))]

    @property
    def matters(self) -> bool:
        """Significant, and of practical size: a tenth of the residual in the band follows."""
        return self.significant and self.explained >= PRACTICAL_SHARE

    def __str__(self) -> str:
        directions, rows = self.degrees_of_freedom
        return (
            f"Residual against motion: F = {self.statistic:.3g} on {directions} and {rows} degrees "
            f"of freedom, {probability(self.p_value)}; earlier and later instruments explain "
            f"{100.0 * max(self.explained, 0.0):.2g} % of the residual below "
            f"{MOTION_BAND:g} Hz, largest correlation {self.largest:.2g} "
            f"({self.largest_column}): {reading(self.significant, self.matters)}."
        )


@dataclass(frozen=True, eq=False)
class Stretches:
    """Sums over short stretches of one joint's rows, divided by the root of their number."""

    residual: np.ndarray  # ε̄, shape (stretches,)
    phi: np.ndarray  # φ̄ of the joint's columns, shape (columns, stretches)
    z: np.ndarray  # ζ̄, likewise
    used: np.ndarray  # m_b, rows in use, shape (stretches,)


def cross_correlation_tests(
    equations: Equations, theta: np.ndarray, rate: float
) -> tuple[CrossCorrelationTest | None, ...]:
    """The test of each joint; None where there are too few rows for its parameters."""
    length = max(1, round(rate / (2.0 * MOTION_BAND)))
    names = [p.name for p in equations.regressor.parameters]
    joints = range(equations.regressor.robot.size)
    records = _stretches(equations, theta, length)
    return tuple(
        cross_correlation_test(
            [record[j] for record in records],
            tuple(names[c] for c in equations.regressor.columns_of(j)),
            length / rate,
        )
        for j in joints
    )


def cross_correlation_test(
    records: list[Stretches], columns: tuple[str, ...], duration: float
) -> CrossCorrelationTest | None:
    """Test of one joint over all recordings.

    ``duration``: of a stretch [s].
    """
    kept = [r.used > 0 for r in records]
    residual = np.concatenate([r.residual[k] for r, k in zip(records, kept, strict=True)])
    phi = np.hstack([r.phi[:, k] for r, k in zip(records, kept, strict=True)]).T
    shifted = np.hstack(
        [
            np.vstack([_shift(r.z, s) for s in SHIFTS])[:, k]
            for r, k in zip(records, kept, strict=True)
        ]
    ).T
    own = _basis(phi, 1e-10)
    further = shifted / np.maximum(np.linalg.norm(shifted, axis=0), 1e-300)
    for _ in range(2):  # twice is enough for orthogonality
        further = further - own @ (own.T @ further)
    extra = _basis(further, SMALLEST, scaled=False)
    left = residual.size - own.shape[1] - extra.shape[1]
    if left < MIN_ROWS or extra.shape[1] == 0:
        return None
    before = residual - own @ (own.T @ residual)
    gained = extra.T @ before
    rss0 = float(before @ before)
    rss1 = max(rss0 - float(gained @ gained), 1e-300)
    directions = extra.shape[1]
    statistic = (rss0 - rss1) / directions / (rss1 / left)
    lags = np.arange(-LAGS, LAGS + 1)
    return CrossCorrelationTest(
        statistic,
        (directions, left),
        float(fisher.sf(statistic, directions, left)),
        1.0 - (rss1 / left) / (rss0 / (left + directions)),
        columns,
        lags * duration,
        _correlations(records, lags),
        2.0 / np.sqrt(residual.size),
    )


def _stretches(equations: Equations, theta: np.ndarray, length: int) -> list[list[Stretches]]:
    """Sums over stretches, by recording and joint, in one pass over the equations."""
    sizes = [equations.regressor.columns_of(j).size for j in range(equations.regressor.robot.size)]
    sums = [[np.zeros((2 * k + 2, -(-n // length))) for k in sizes] for n in equations.lengths]
    for block in equations.blocks():
        rows = np.arange(block.span.start, block.span.stop)
        edges = np.flatnonzero(np.r_[True, rows[1:] % length == 0])
        place = slice(rows[0] // length, rows[-1] // length + 1)
        for j, joint in enumerate(block.joints):
            residual = joint.tau - theta[joint.columns] @ joint.phi
            stack = np.vstack([joint.phi, joint.z, residual, joint.used])
            sums[block.record][j][:, place] += np.add.reduceat(stack, edges, axis=1)
    found = []
    for record in sums:
        joints = []
        for k, total in zip(sizes, record, strict=True):
            scaled = total / np.sqrt(np.maximum(total[-1], 1.0))
            joints.append(Stretches(scaled[-2], scaled[:k], scaled[k : 2 * k], total[-1]))
        found.append(joints)
    return found


def _shift(x: np.ndarray, lag: int) -> np.ndarray:
    """Columns ``lag`` stretches earlier, zero where there are none."""
    out = np.zeros_like(x)
    if lag >= x.shape[-1] or -lag >= x.shape[-1]:
        return out
    if lag >= 0:
        out[..., lag:] = x[..., : x.shape[-1] - lag]
    else:
        out[..., :lag] = x[..., -lag:]
    return out


def _basis(columns: np.ndarray, smallest: float, scaled: bool = True) -> np.ndarray:
    """Orthonormal basis of the columns, without directions smaller than ``smallest``."""
    if scaled:
        columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    vectors, values, _ = np.linalg.svd(columns, full_matrices=False)
    return vectors[:, values > smallest * (values[0] if scaled and values.size else 1.0)]


def _correlations(records: list[Stretches], lags: np.ndarray) -> np.ndarray:
    """Correlation of the residual with all instruments so many stretches earlier.

    Shape (instruments, lags).
    """
    cross, energy, power = 0.0, 0.0, 0.0
    for r in records:
        shifted = np.array([_shift(r.residual, -lag) for lag in lags.tolist()])
        squares = np.cumsum(np.pad(r.z**2, ((0, 0), (1, 0))), axis=1)
        first, last = np.clip([-lags, r.residual.size - lags], 0, r.residual.size)
        cross = cross + r.z @ shifted.T
        energy = energy + squares[:, last] - squares[:, first]
        power += r.residual @ r.residual
    return cross / np.maximum(np.sqrt(energy * power), 1e-300)


@dataclass(frozen=True)
class VarianceTest(WithProbability):
    """Test for a variance that changes with the motion."""

    statistic: float  # n R² / F₂
    degrees_of_freedom: int  # number of independent drivers
    p_value: float  # probability of a larger one if the variance is constant
    explained: float  # R², share of the variance of the squared residual, 0 to 1
    #: Mean square where each driver is in its upper quarter over that in its lower one, by name of
    #: the driver.
    ratios: dict[str, float]
    samples: int  # n

    @property
    def driver(self) -> str:
        """The driver with the most extreme ratio."""
        return max(self.ratios, key=lambda name: abs(np.log(max(self.ratios[name], 1e-300))))

    @property
    def ratio(self) -> float:
        """Its ratio of variances."""
        return self.ratios[self.driver]

    @property
    def matters(self) -> bool:
        """Significant, and of practical size: variances differ by ``PRACTICAL_RATIO``."""
        return self.significant and max(self.ratio, 1.0 / self.ratio) >= PRACTICAL_RATIO

    def __str__(self) -> str:
        return (
            f"Constant variance (Breusch-Pagan): {self.statistic:.3g} on "
            f"{self.degrees_of_freedom} degrees of freedom, {probability(self.p_value)}; where "
            f"the {self.driver} is in its upper quarter the variance is {self.ratio:.2g} times "
            f"that in the lower one: {reading(self.significant, self.matters)}."
        )


def variance_test(
    values: np.ndarray,
    drivers: np.ndarray,
    names: Sequence[str],
    sums: LaggedSums | None = None,
    products: bool = False,
) -> VarianceTest:
    """Breusch and Pagan's or White's test.

    ``values``: residual without gaps, shape (samples,); ``drivers``: what the variance may depend
    on, shape (samples, drivers); ``sums``: the residual's lagged sums; None: it is taken to be
    white.
    """
    squares = values**2
    columns = drivers - drivers.mean(axis=0)
    columns = columns / np.maximum(columns.std(axis=0), 1e-300)
    if products:
        first, second = np.triu_indices(columns.shape[1])
        columns = np.hstack([columns, columns[:, first] * columns[:, second]])
        columns -= columns.mean(axis=0)
    centred = squares - squares.mean()
    eigenvalues, vectors = np.linalg.eigh(columns.T @ columns)
    kept = eigenvalues > 1e-10 * eigenvalues[-1]
    fitted = (vectors.T @ (columns.T @ centred))[kept] ** 2 / eigenvalues[kept]
    explained = float(fitted.sum() / (centred @ centred))
    statistic = values.size * explained / (1.0 if sums is None else variance_factor(sums, 2))
    freedom = int(np.count_nonzero(kept))
    return VarianceTest(
        statistic,
        freedom,
        float(chi_square.sf(statistic, freedom)),
        explained,
        {name: _quarters(squares, drivers[:, k]) for k, name in enumerate(names)},
        values.size,
    )


def _quarters(squares: np.ndarray, driver: np.ndarray) -> float:
    """Mean square in the upper quarter of the driver over that in the lower one."""
    low, high = np.quantile(driver, [0.25, 0.75])
    return float(squares[driver >= high].mean() / max(squares[driver <= low].mean(), 1e-300))
