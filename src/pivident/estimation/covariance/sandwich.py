"""Covariance that holds for residuals that are not white: a sandwich over smooth windows.

    P = Σ_k (θ₍ₖ₎ - θ)(θ₍ₖ₎ - θ)ᵀ / c,    θ₍ₖ₎ - θ = -(ZᵀΦ - Z_kᵀΦ)⁻¹ Z_kᵀε

θ₍ₖ₎ is the estimate without window k (a jackknife, in its linear form, which frees the residuals
of the share that the estimate itself took from them). Within a window any correlation and any
change of the variance is allowed; windows are longer than the correlation.

Where parameters are restricted, Z N and Φ N stand in place of Z and Φ, and a prior adds what it
does not know itself, see `pivident.estimation.restrictions`.

How sure a variance from windows is depends on how many of them tell the parameter: with shares w_k
of what is known about it, ν = (Σ w_k)²/Σ w_k², less what neighbours have in common.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.estimation.covariance.windows import OVERLAP, freedom
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.restrictions import Freedom


@dataclass(frozen=True, eq=False)
class Jackknife:
    """What each window of time does to an estimate."""

    steps: np.ndarray  # θ₍ₖ₎ - θ up to the sign, shape (windows, parameters)
    degrees_of_freedom: np.ndarray  # ν of each parameter's variance, shape (parameters,)
    of_prior: np.ndarray | float = 0.0  # part of P that is the prior's, (parameters, parameters)

    @property
    def covariance(self) -> np.ndarray:
        """P, shape (parameters, parameters)."""
        return self.steps.T @ self.steps / OVERLAP + self.of_prior


def jackknife(
    sums: Sequence[JointSums],
    theta: np.ndarray,
    variance: np.ndarray,
    weight_power: float = 1.0,
    freedom: Freedom | None = None,
) -> Jackknife:
    """The windows of an estimate; ``freedom``: of its parameters, None: all are free."""
    count, size = len(sums[0].window_zf), theta.size
    zf, scores = np.zeros((count, size, size)), np.zeros((count, size))
    for joint, lam in zip(sums, np.asarray(variance) ** weight_power, strict=True):
        own = joint.columns
        zf[:, own[:, None], own] += joint.window_zf / lam
        scores[:, own] += (joint.window_zt - joint.window_zf @ theta[own]) / lam
    if freedom is None:
        return jackknife_of(zf, scores, zf.sum(axis=0))
    own, total = freedom.reduced(zf), zf.sum(axis=0)
    found = jackknife_of(own, scores @ freedom.basis, freedom.reduced(total + freedom.information))
    bread, basis = freedom.bread(total), freedom.basis
    certain = np.where(basis != 0.0, found.degrees_of_freedom, np.inf).min(axis=1, initial=np.inf)
    return Jackknife(
        found.steps @ basis.T,
        np.minimum(certain, found.degrees_of_freedom.max(initial=1.0)),
        bread @ freedom.information @ bread.T,
    )


def jackknife_of(zf: np.ndarray, scores: np.ndarray, total: np.ndarray) -> Jackknife:
    """The same from Z_kᵀΦ (windows, k, k), Z_kᵀε (windows, k), and ZᵀΦ (k, k) of all there is."""
    # columns of unit length: parameters differ by orders of magnitude
    scale = np.sqrt(np.maximum(np.abs(np.diag(total)), 1e-300))
    outer = np.outer(scale, scale)
    without = (total - zf) / outer
    steps = np.linalg.solve(without, (scores / scale)[:, :, None])[:, :, 0] / scale
    inverse = np.linalg.inv(total / outer)
    share = np.maximum(np.einsum("ia,kab,ib->ki", inverse, zf / outer, inverse, optimize=True), 0.0)
    windows = share.sum(axis=0) ** 2 / np.maximum(np.sum(share**2, axis=0), 1e-300)
    return Jackknife(steps, freedom(windows))


def sandwich(
    sums: Sequence[JointSums],
    theta: np.ndarray,
    variance: np.ndarray,
    weight_power: float = 1.0,
    freedom: Freedom | None = None,
) -> np.ndarray:
    """Covariance of the estimate, shape (parameters, parameters)."""
    return jackknife(sums, theta, variance, weight_power, freedom).covariance
