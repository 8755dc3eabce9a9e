"""Robust covariances of an estimate: White, Newey-West, smooth windows, block bootstrap.

The estimate solves Σ_t s_t = 0 with scores s_t = Σ_j ζ_tj ε_tj/λ_j, and

    P = (ZᵀΦ)⁻¹ S (ΦᵀZ)⁻¹,    S = Γ₀ + Σ_l k(l) (Γ_l + Γ_lᵀ),   Γ_l = Σ_t s_t s_{t-l}ᵀ     (E3)

White's S is Γ₀ alone. A kernel k that is the autocorrelation of a taper w makes S = Y ᵀY/Σw² of
the tapered sums Y_k = Σ_t w_{t-k} s_t at all positions k. A flat taper of L + 1 samples is Newey
and West's, a raised cosine the windows of ``estimation.sandwich`` at every offset.

Two cautions for records at the full rate. Andrews' rule fits an AR(1) to the scores; those of
unfiltered residuals have a weak, long correlation behind a white or negative short one, and the
rule finds 37 samples where 600 are needed. The lags are therefore those of the sandwich's windows
unless Andrews asks for more. And a flat taper has hard edges: where the residual's spectrum rises
with frequency, as that of differentiated encoder noise does, they leak, and Newey-West is too wide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from pivident.estimation.covariance.windows import WINDOWS
from pivident.foundation.errors import IdentificationError
from pivident.judgement.validation.moment_sums import kept_equations

if TYPE_CHECKING:
    from pivident.estimation.identification import Identification
    from pivident.estimation.solved_equations import Block

Taper = Literal["flat", "raised cosine"]

CovarianceEstimate = Literal[
    "formula", "white", "white_hc3", "newey_west", "smooth", "bootstrap", "windows"
]

#: Scores kept in order; of longer records, sums of neighbours are.
MAX_ROWS = 2**16

#: Largest AR(1) coefficient that Andrews' rule believes, as in his paper.
MAX_RHO = 0.97


@dataclass(frozen=True, eq=False)
class Scores:
    """Scores of an estimate in their order."""

    #: Of each record, shape (rows, parameters); rows that are not used are zero.
    records: tuple[np.ndarray, ...]
    bread: np.ndarray  # ZᵀΦ, shape (parameters, parameters)
    white: np.ndarray  # Σ s_t s_tᵀ over samples
    white_hc3: np.ndarray  # the same with ε/(1 - h), h the leverage of its row
    thinning: int = 1  # samples summed into one row

    @classmethod
    def from_rows(cls, phi: np.ndarray, z: np.ndarray, residual: np.ndarray) -> Scores:
        """Scores of one record whose rows are all there, for estimators of your own.

        ``phi``: regressors, shape (samples, parameters).
        """
        bread = z.T @ phi
        leverage = np.sum(phi * np.linalg.solve(bread, z.T).T, axis=1)
        scores = z * residual[:, None]
        freed = scores / (1.0 - leverage)[:, None]
        return cls((scores,), bread, scores.T @ scores, freed.T @ freed)

    @property
    def rows(self) -> int:
        """Rows of all records."""
        return sum(len(s) for s in self.records)

    def covariance(self, meat: np.ndarray) -> np.ndarray:
        """(ZᵀΦ)⁻¹ S (ΦᵀZ)⁻¹, shape (parameters, parameters)."""
        scale = np.sqrt(np.maximum(np.abs(np.diag(self.bread)), 1e-300))
        outer = np.outer(scale, scale)
        inverse = np.linalg.inv(self.bread / outer)
        return inverse @ (meat / outer) @ inverse.T / outer


def scores_of(identification: Identification) -> Scores:
    """Scores of the equations that an identification solved last, in two passes over its data."""
    equations, theta = kept_equations(identification), identification.theta
    size, lengths = equations.size, equations.lengths
    thinning = max(1, -(-sum(lengths) // MAX_ROWS))
    bread = np.zeros((size, size))
    for block in equations.blocks():
        for r in block.joints:
            bread[np.ix_(r.columns, r.columns)] += r.z @ r.phi.T
    inverse = np.linalg.inv(bread)
    records = [np.zeros((-(-n // thinning), size)) for n in lengths]
    white, white_hc3 = np.zeros((2, size, size))
    for block in equations.blocks():
        plain, freed = _block_scores(block, theta, inverse)
        white += plain.T @ plain
        white_hc3 += freed.T @ freed
        rows = np.arange(block.span.start, block.span.stop) // thinning
        first = np.flatnonzero(np.diff(rows, prepend=-1))
        records[block.record][rows[first]] += np.add.reduceat(plain, first, axis=0)
    return Scores(tuple(records), bread, white, white_hc3, thinning)


def _block_scores(
    block: Block, theta: np.ndarray, inverse: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Scores of a block's samples, plain and freed of leverage, each (samples, parameters)."""
    plain, freed = np.zeros((2, block.span.stop - block.span.start, theta.size))
    for r in block.joints:
        own = r.columns
        residual = r.tau - theta[own] @ r.phi
        leverage = np.einsum("it,it->t", r.phi, inverse[np.ix_(own, own)] @ r.z)
        plain[:, own] += (r.z * residual).T
        freed[:, own] += (r.z * (residual / (1.0 - leverage))).T
    return plain, freed


def taper_of(kind: Taper, length: int) -> np.ndarray:
    """Weights of a window, shape (length,)."""
    if kind == "flat":
        return np.ones(length)
    phase = (np.arange(length) + 0.5) / length
    return 0.5 - 0.5 * np.cos(2.0 * np.pi * phase)


def tapered_sums(scores: np.ndarray, taper: np.ndarray) -> np.ndarray:
    """Y_k = Σ_t w_{t-k} s_t at all positions that touch the record.

    ``scores``: shape (rows, parameters); ``taper``: w, shape (length,).
    """
    from scipy.signal import oaconvolve

    return oaconvolve(scores, taper[:, None], axes=0)


def long_run_sum(records: Sequence[np.ndarray], length: int, taper: Taper = "flat") -> np.ndarray:
    """S of all records, shape (parameters, parameters).

    ``records``: scores of each, shape (rows, parameters).
    """
    weights = taper_of(taper, max(length, 1))
    total = np.zeros((records[0].shape[1],) * 2)
    for scores in records:
        sums = tapered_sums(scores, weights)
        total += sums.T @ sums / np.sum(weights**2)
    return total


def newey_west(scores: Scores, lags: int) -> np.ndarray:
    """Covariance of Newey and West (1987), (E3), shape (parameters, parameters)."""
    return scores.covariance(long_run_sum(scores.records, lags + 1))


def andrews_lags(scores: Scores) -> int:
    """L of Bartlett's kernel by the AR(1) plug-in of Andrews (1991), in rows.

    1.1447 (α n)^(1/3), α = Σ_i 4ρ²σ⁴/((1-ρ)⁶(1+ρ)²) / Σ_i σ⁴/(1-ρ)⁴, with scores of unit variance.
    """
    values = np.concatenate(scores.records)
    values = values / np.maximum(values.std(axis=0), 1e-300)
    square = np.maximum(np.sum(values[:-1] ** 2, axis=0), 1e-300)
    rho = np.sum(values[1:] * values[:-1], axis=0) / square
    rho = np.clip(rho, -MAX_RHO, MAX_RHO)
    power = np.mean((values[1:] - rho * values[:-1]) ** 2, axis=0) ** 2
    curvature = np.sum(4 * rho**2 * power / ((1 - rho) ** 6 * (1 + rho) ** 2))
    alpha = curvature / np.sum(power / (1 - rho) ** 4)
    return int(np.ceil(1.1447 * (alpha * len(values)) ** (1 / 3)))


def window_lags(scores: Scores) -> int:
    """Length of the sandwich's windows in rows, two of their spacings."""
    return max(1, 2 * scores.rows // (WINDOWS - 1))


@dataclass(frozen=True, eq=False)
class BlockBootstrap:
    """Estimates from resampled blocks of scores."""

    steps: np.ndarray  # θ* - θ of each draw, shape (draws, parameters)
    length: int  # of a block in rows

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the draws, shape (parameters, parameters)."""
        return self.steps.T @ self.steps / len(self.steps)

    def interval(self, theta: np.ndarray, level: float = 0.954) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper ends of the intervals by the draws' quantiles, each (parameters,)."""
        low, high = np.quantile(self.steps, [(1 - level) / 2, (1 + level) / 2], axis=0)
        return theta - high, theta - low


def block_bootstrap(
    scores: Scores,
    length: int,
    draws: int = 1000,
    seed: int = 0,
    taper: Taper = "raised cosine",
) -> BlockBootstrap:
    """Moving block bootstrap of the scores in one step, θ* = θ + (ZᵀΦ)⁻¹ Σ s*.

    Blocks begin anywhere and are drawn with replacement (Künsch 1989), tapered unless set
    otherwise (Paparoditis and Politis 2001). Nothing is simulated again.
    """
    shortest = min(len(s) for s in scores.records)
    if not 1 <= length <= shortest:
        raise IdentificationError(
            f"blocks of {length} rows cannot be drawn from a record of {shortest}; choose a "
            f"length between 1 and {shortest}"
        )
    rng = np.random.default_rng(seed)
    weights = taper_of(taper, length)
    square = float(np.sum(weights**2))
    total = np.zeros((draws, len(scores.bread)))
    for record in scores.records:
        sums = tapered_sums(record, weights)
        sums -= sums.mean(axis=0)  # the scores of one record of several need not sum to zero
        count = max(1, round(len(record) / length))
        factor = np.sqrt(len(sums) / (count * square))
        for _ in range(count):
            total += factor * sums[rng.integers(len(sums), size=draws)]
    return BlockBootstrap(np.linalg.solve(scores.bread, total.T).T, length)


@dataclass(frozen=True, eq=False)
class RobustCovariances:
    """Covariances of one estimate under different beliefs about its residual."""

    names: tuple[str, ...]  # names of the parameters
    formula: np.ndarray  # (ΣZᵀZ/λ)⁻¹, for white residuals, shape (parameters, parameters)
    #: White's HC0: uncorrelated residuals of any variance; joints may be correlated.
    white: np.ndarray
    white_hc3: np.ndarray  # HC3, which frees residuals of their leverage
    newey_west: np.ndarray  # correlation over up to ``lags``, flat windows
    smooth: np.ndarray  # the same by windows without edges
    bootstrap: np.ndarray  # by resampled blocks as long as those windows
    #: The estimate's own sandwich, a jackknife over smooth windows: the one to use.
    windows: np.ndarray
    lags: int  # lags of Newey-West [samples]
    andrews_lags: int  # what Andrews' AR(1) plug-in asks for [samples]

    def std(self, estimate: CovarianceEstimate = "windows") -> np.ndarray:
        """Standard errors, shape (parameters,) [unit of each]."""
        return np.sqrt(np.diag(getattr(self, estimate)))

    def ratio(self, estimate: CovarianceEstimate) -> float:
        """Standard errors over those of the windows, geometric mean over the parameters."""
        return float(np.exp(np.mean(np.log(self.std(estimate) / self.std()))))

    def __str__(self) -> str:
        others: tuple[tuple[CovarianceEstimate, str], ...] = (
            ("formula", "white noise"),
            ("white", "White"),
            ("newey_west", f"Newey-West over {self.lags} samples"),
            ("smooth", "smooth windows at all offsets"),
            ("bootstrap", "block bootstrap"),
        )
        parts = ", ".join(f"{words} {self.ratio(name):.2f}" for name, words in others)
        return f"Standard errors relative to the jackknife over windows of time: {parts}."


def robust_covariances(
    identification: Identification, lags: int | None = None, draws: int = 1000, seed: int = 0
) -> RobustCovariances:
    """All robust covariances of an identification.

    ``lags``: of Newey-West [samples]; None: those of the sandwich's windows, or Andrews' if more.
    """
    scores = scores_of(identification)
    andrews = andrews_lags(scores)
    rows = max(window_lags(scores), andrews) if lags is None else -(-lags // scores.thinning)
    length = min(rows + 1, min(len(s) for s in scores.records))
    return RobustCovariances(
        identification.names,
        identification.formula_covariance,
        scores.covariance(scores.white),
        scores.covariance(scores.white_hc3),
        newey_west(scores, length - 1),
        scores.covariance(long_run_sum(scores.records, length, "raised cosine")),
        block_bootstrap(scores, length, draws, seed).covariance,
        identification.robust_covariance,
        (length - 1) * scores.thinning,
        andrews * scores.thinning,
    )
