"""Tests of what the instruments claim: Durbin-Wu-Hausman, Sargan and Hansen.

Both come twice: by the sums of squares of the textbook, right for white residuals, and robust,
over windows of time, right for any correlation within a window. On real records the textbook's
reject nearly always, because model error lasts; the robust ones are those to go by.

One question is behind both: do further instruments agree with an estimate? With as many instruments
as parameters, Zᵀ(τ - Φθ) = 0 whatever they are worth. What an estimate from instruments W leaves
over on others, X, is

    m = Xᵀ(τ - Φ θ_W) = Xᵀτ - B Wᵀτ,   B = XᵀΦ (WᵀΦ)⁻¹;    U = X - W Bᵀ,  m = Uᵀ ε

zero on average where both are valid. With W = Φ and X = Z it is the test of Durbin, Wu and
Hausman, whose augmented regression has RSS₀ - RSS₁ = mᵀ(UᵀU)⁻¹m, (E2); with W = Z and further X
the one of Sargan and Hansen, (E1). Its sums over windows of time give the covariance of m.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pivident.estimation.covariance.windows import OVERLAP
from pivident.foundation.distributions import chi_square, fisher
from pivident.foundation.errors import IdentificationError
from pivident.judgement.validation.moment_sums import MomentSums
from pivident.judgement.validation.residuals.windowed_statistic import (
    WindowedStatistic,
    directions_of,
    windowed_statistic,
)

#: Probability from which on a test rejects.
LEVEL = 0.05

#: Shift of an estimate, in its own standard errors, from which on it matters: an interval of
#: two standard errors that is shifted by so much still covers the truth in 94 of 100 cases.
PRACTICAL_SHIFT = 0.25

#: Words for the further instruments.
FURTHER = {
    "reference": "Φ(q_ref)",
    "delayed": "instruments delayed by one period",
    "": "further instruments",
}


class ShiftTest:
    """A test that compares two estimates of the same parameters."""

    p_value: float
    shift: np.ndarray

    @property
    def practical_size(self) -> float:
        """Largest change of a parameter, in robust standard errors of the IV estimate."""
        return float(np.abs(self.shift).max())

    @property
    def rejects(self) -> bool:
        """Whether the two estimates differ, at 5 %."""
        return self.p_value < LEVEL

    @property
    def matters(self) -> bool:
        """Whether they do, and by a noticeable shift of a parameter."""
        return self.rejects and self.practical_size > PRACTICAL_SHIFT


@dataclass(frozen=True, eq=False)
class DurbinWuHausmanTest(ShiftTest):
    """Durbin, Wu and Hausman: do least squares and instruments differ significantly?"""

    names: tuple[str, ...]  # names of the parameters
    statistic: float  # robust F
    degrees: tuple[float, float]  # its effective degrees of freedom
    p_value: float  # probability of a larger F where the regressors carry no noise
    directions: int  # instruments that add to the regressors
    white_statistic: float  # F of the augmented regression, (E2), for white residuals
    white_degrees: tuple[int, int]  # its degrees of freedom
    white_p_value: float  # its probability
    difference: np.ndarray  # θ_LS - θ_IV of the same equations, shape (parameters,) [unit of each]
    difference_std: np.ndarray  # its standard error over windows of time, likewise
    #: The difference in robust standard errors of the IV estimate, shape (parameters,).
    shift: np.ndarray
    relative: np.ndarray  # the difference relative to the IV estimate, shape (parameters,)

    def __str__(self) -> str:
        k = int(np.argmax(np.abs(self.shift)))
        verdict = (
            "least squares and instrumental variables differ significantly: regressors and "
            "residual share noise or model error" + _smallness(self.matters)
            if self.rejects
            else "least squares and instrumental variables do not differ significantly"
        )
        return (
            f"Exogeneity (Durbin-Wu-Hausman, robust): F = {self.statistic:.3g} on "
            f"{_degrees(self.degrees)} degrees of freedom, p = {self.p_value:.2g}: {verdict}. "
            f"The largest shift is that of {self.names[k]}, {abs(self.shift[k]):.2g} standard "
            f"errors ({100 * abs(self.relative[k]):.2g} %)."
        )


@dataclass(frozen=True, eq=False)
class OveridentificationTest(ShiftTest):
    """Sargan and Hansen: do further instruments contradict the estimate?"""

    names: tuple[str, ...]  # names of the parameters
    further: str  # ``reference``, ``delayed``, or empty
    statistic: float  # robust F
    degrees: tuple[float, float]  # its effective degrees of freedom
    p_value: float  # probability of a larger F where all instruments are valid
    j: float  # J = εᵀP_Z ε/s², (E1), for white residuals
    directions: int  # its degrees of freedom, the number of further instruments
    j_p_value: float  # its probability
    #: Change of the estimate if all instruments were used, in robust standard errors of the IV
    #: estimate, shape (parameters,).
    shift: np.ndarray
    relative: np.ndarray  # the same relative to the estimate

    def __str__(self) -> str:
        k = int(np.argmax(np.abs(self.shift)))
        verdict = (
            "they contradict the estimate (a delay, a wrong loop or model error)"
            + _smallness(self.matters)
            if self.rejects
            else "they do not contradict the estimate"
        )
        return (
            f"Over-identification (Hansen, robust) with {FURTHER.get(self.further, self.further)}: "
            f"F = {self.statistic:.3g} on {_degrees(self.degrees)} degrees of freedom, p = "
            f"{self.p_value:.2g}: {verdict}. With them the estimate would change by at most "
            f"{abs(self.shift[k]):.2g} standard errors ({self.names[k]}, "
            f"{100 * abs(self.relative[k]):.2g} %)."
        )


def exogeneity_test(sums: MomentSums, names: Sequence[str]) -> DurbinWuHausmanTest:
    """Durbin-Wu-Hausman on weighted equations."""
    scaled, length = sums.scaled()
    scale = length[: sums.size]
    found = added_moments(scaled, "phi", "z")
    remainder = residual_square(scaled, estimate(scaled, "phi")) - found.square
    freedom = max(sums.rows - sums.size - found.directions, 1)
    white = found.square / max(found.directions, 1) / max(remainder / freedom, 1e-300)
    white_p = float(fisher.sf(white, max(found.directions, 1), freedom))
    theta = estimate(scaled, "z") / scale
    difference = estimate(scaled, "phi") / scale - theta
    own = estimate_steps(scaled, "z") / scale
    apart = covariance_of_steps(estimate_steps(scaled, "phi") / scale - own)
    outcome = found.statistic
    return DurbinWuHausmanTest(
        tuple(names),
        outcome.statistic,
        outcome.degrees,
        outcome.p_value,
        found.directions,
        white if found.directions else 0.0,
        (found.directions, freedom),
        white_p if found.directions else 1.0,
        difference,
        np.sqrt(np.diag(apart)),
        difference / np.sqrt(np.diag(covariance_of_steps(own))),
        _relative(difference, theta),
    )


def overidentification_test(sums: MomentSums, names: Sequence[str]) -> OveridentificationTest:
    """Sargan and Hansen on weighted equations with further instruments."""
    if not sums.extra:
        raise IdentificationError(
            "there are as many instruments as parameters, so J is zero however good they are",
            advice="give further ones (extra='reference' or extra='delayed')",
        )
    scaled, length = sums.scaled()
    scale = length[: sums.size]
    found = added_moments(scaled, "z", "extra")
    theta, all_used = estimate(scaled, "z"), _with_all_instruments(scaled)
    spread = residual_square(scaled, all_used) / sums.rows
    j = found.square / max(spread, 1e-300)
    std = np.sqrt(np.diag(covariance_of_steps(estimate_steps(scaled, "z"))))
    outcome = found.statistic
    return OveridentificationTest(
        tuple(names),
        sums.extra_kind,
        outcome.statistic,
        outcome.degrees,
        outcome.p_value,
        j,
        found.directions,
        float(chi_square.sf(j, found.directions)) if found.directions else 1.0,
        (all_used - theta) / std,
        _relative((all_used - theta) / scale, theta / scale),
    )


def _with_all_instruments(sums: MomentSums) -> np.ndarray:
    """Two-stage least squares with Z and X."""
    both = slice(sums.size, 2 * sums.size + sums.extra)
    inner = np.linalg.pinv(sums.gram[both, both], rcond=1e-11, hermitian=True)
    first = sums.gram[both, : sums.size]
    return np.linalg.solve(first.T @ inner @ first, first.T @ inner @ sums.gram[both, -1])


def _relative(change: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Change relative to a value; infinite for a value of zero."""
    size = np.abs(theta)
    return np.divide(change, size, out=np.full(size.shape, np.inf), where=size > 0)


def _smallness(matters: bool) -> str:
    return "" if matters else ", but by too little to matter"


def _degrees(degrees: tuple[float, float]) -> str:
    return f"{degrees[0]:.3g} and {degrees[1]:.3g}"


#: Share of a column's square that must be left beside the others for it to be a new instrument.
NEW_SHARE = 1e-11

Instruments = Literal["phi", "z"]


@dataclass(frozen=True, eq=False)
class AddedMoments:
    """The vector m and what belongs to it."""

    statistic: WindowedStatistic  # windowed statistic of m
    square: float  # mᵀ(UᵀU)⁻¹m, a sum of squares of the weighted residual
    directions: int  # number of instruments that U is left with


def added_moments(
    sums: MomentSums, base: Instruments, further: Literal["z", "extra"]
) -> AddedMoments:
    """What the estimate from ``base`` leaves over on ``further``."""
    base_phi, base_tau = sums.block(base, "phi"), sums.block(base, "tau")[:, 0]
    x_phi, x_tau = sums.block(further, "phi"), sums.block(further, "tau")[:, 0]
    projection = np.linalg.solve(base_phi.T, x_phi.T).T
    moment = x_tau - projection @ base_tau
    cross = projection @ sums.block(base, further)
    own = sums.block(further, further)
    gram = own - cross - cross.T + projection @ sums.block(base, base) @ projection.T
    new = np.diag(gram) > NEW_SHARE * np.diag(own)
    if not new.any():
        return AddedMoments(WindowedStatistic(0.0, 0, (0.0, 0.0), 1.0), 0.0, 0)
    steps = _window_moments(sums, base, further, projection)
    basis = directions_of(gram[np.ix_(new, new)])
    statistic = windowed_statistic(moment[new], steps[:, new], sums.shares, basis)
    return AddedMoments(statistic, float(np.sum((moment[new] @ basis) ** 2)), basis.shape[1])


def estimate(sums: MomentSums, instruments: Instruments) -> np.ndarray:
    """θ = (WᵀΦ)⁻¹Wᵀτ, shape (parameters,)."""
    return np.linalg.solve(sums.block(instruments, "phi"), sums.block(instruments, "tau")[:, 0])


def estimate_steps(sums: MomentSums, instruments: Instruments) -> np.ndarray:
    """Change of that estimate by each window, shape (windows, parameters).

    In its linear form, which an almost empty rest of the record does not upset.
    """
    theta = estimate(sums, instruments)
    parts = sums.window(instruments, "phi")
    scores = sums.window(instruments, "tau")[:, :, 0] - parts @ theta
    return np.linalg.solve(sums.block(instruments, "phi") - parts, scores[:, :, None])[:, :, 0]


def covariance_of_steps(steps: np.ndarray) -> np.ndarray:
    """Covariance by the jackknife over windows, shape (parameters, parameters).

    ``steps``: shape (windows, parameters).
    """
    return steps.T @ steps / OVERLAP


def residual_square(sums: MomentSums, theta: np.ndarray) -> float:
    """‖τ - Φθ‖² of the weighted equations."""
    tau = float(sums.block("tau", "tau")[0, 0])
    linear = float(theta @ sums.block("phi", "tau")[:, 0])
    return max(tau - 2.0 * linear + float(theta @ sums.block("phi", "phi") @ theta), 0.0)


def _window_moments(
    sums: MomentSums, base: Instruments, further: Literal["z", "extra"], projection: np.ndarray
) -> np.ndarray:
    """Uᵀε of each window, shape (windows, instruments).

    Not m without each window, which is what the standard errors use: that frees residuals of their
    leverage, and made the test of an arm in closed loop reject in 0.7 instead of 2 % of the cases.
    """
    theta = estimate(sums, base)

    def scores(instruments: Literal["phi", "z", "extra"]) -> np.ndarray:
        return sums.window(instruments, "tau")[:, :, 0] - sums.window(instruments, "phi") @ theta

    return scores(further) - scores(base) @ projection.T
