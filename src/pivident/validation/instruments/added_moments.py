"""Do further instruments agree with an estimate? One question behind two tests.

With as many instruments as parameters, Zᵀ(τ - Φθ) = 0 whatever they are worth. What an estimate
from instruments W leaves over on others, X, is

    m = Xᵀ(τ - Φ θ_W) = Xᵀτ - B Wᵀτ,   B = XᵀΦ (WᵀΦ)⁻¹;    U = X - W Bᵀ,  m = Uᵀ ε

zero on average where both are valid. With W = Φ and X = Z it is the test of Durbin, Wu and
Hausman, whose augmented regression has RSS₀ - RSS₁ = mᵀ(UᵀU)⁻¹m, (E2); with W = Z and further X
the one of Sargan and Hansen, (E1). Its sums over windows of time give the covariance of m.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pivident.estimation.covariance.windows import OVERLAP
from pivident.validation.instruments.moment_sums import MomentSums
from pivident.validation.residuals.windowed_statistic import (
    WindowedStatistic,
    directions_of,
    windowed_statistic,
)

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
        nothing = WindowedStatistic(0.0, 0, (0.0, 0.0), 1.0)
        return AddedMoments(nothing, 0.0, 0)
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
