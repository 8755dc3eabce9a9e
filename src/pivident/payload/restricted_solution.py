"""The unknowns of a loaded record, from its normal equations and prior information.

    J x = Σ_j M₂ᵀ Zᵀτ/λ_j + Λ x₀,      J = Σ_j M₂ᵀ ZᵀΦ M₂/λ_j + Λ

Λ is the prior information. The covariance consists of the loaded record's noise and of the known
arm, whose reported covariance P₁ need not be the inverse of the weight Λ₁ from its normal
equations:

    P = C_noise + R Λ₁ P₁ Λ₁ Rᵀ + (known parts),      R = J⁻¹ restricted to the arm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.estimation.covariance.sandwich import Jackknife, jackknife_of
from pivident.estimation.normal_equations import JointSums, joint_variances
from pivident.payload.arm_and_load import ArmAndLoad, reduced


@dataclass(frozen=True, eq=False)
class RestrictedSolution:
    """Solved equations."""

    x: np.ndarray  # the unknowns (θ, ΔF, ξ), shape (unknowns,)
    theta: np.ndarray  # θ_loaded = M₂ x, shape (parameters,)
    variance: np.ndarray  # λ of each joint at the estimate, shape (joints,)
    inverse: np.ndarray  # J⁻¹, shape (unknowns, unknowns)


def solve_restricted(
    sums: Sequence[JointSums], unknowns: ArmAndLoad, start: np.ndarray
) -> RestrictedSolution:
    """Solve with weights from the residual, three times, so that weights and estimate agree."""
    theta, own = start, reduced(sums, unknowns)
    for _ in range(3):
        variance = joint_variances(sums, theta)
        gradient, right = unknowns.information.copy(), unknowns.right.copy()
        for joint, lam in zip(own, variance, strict=True):
            gradient += joint.zf / lam
            right += joint.zt / lam
        inverse = _inverse(gradient)
        x = inverse @ right
        theta = unknowns.loaded_map @ x
    return RestrictedSolution(x, theta, joint_variances(sums, theta), inverse)


def noise_by_windows(
    sums: Sequence[JointSums], unknowns: ArmAndLoad, solution: RestrictedSolution
) -> Jackknife:
    """C_noise by the jackknife over windows of time, see `pivident.estimation.covariance.sandwich`.

    The known parameters belong to no window.
    """
    count, size = len(sums[0].window_zf), solution.x.size
    shares, scores = np.zeros((count, size, size)), np.zeros((count, size))
    for joint, lam in zip(reduced(sums, unknowns), solution.variance, strict=True):
        shares += joint.window_zf / lam
        scores += (joint.window_zt - joint.window_zf @ solution.x) / lam
    return jackknife_of(shares, scores, shares.sum(axis=0) + unknowns.information)


def noise_by_scores(
    scores: np.ndarray, unknowns: ArmAndLoad, solution: RestrictedSolution
) -> np.ndarray:
    """C_noise = J⁻¹ M₂ᵀ V M₂ J⁻ᵀ from the variance V of the scores Σ Zᵀε/λ."""
    gain = solution.inverse @ unknowns.loaded_map.T
    return gain @ scores @ gain.T


def with_known(
    noise: np.ndarray, unknowns: ArmAndLoad, solution: RestrictedSolution
) -> tuple[np.ndarray, np.ndarray]:
    """Covariance of x, and of θ - θ̂₁: arm of both records minus arm of the first one."""
    arm = unknowns.arm_part
    gain = solution.inverse[:, arm] @ unknowns.arm_information
    others = unknowns.information.copy()
    others[arm, arm] = 0.0
    given = solution.inverse @ others @ solution.inverse.T
    covariance = noise + given + gain @ unknowns.arm_covariance @ gain.T
    away = gain[arm] - np.eye(unknowns.arm_theta.size)
    moved = noise[arm, arm] + given[arm, arm] + away @ unknowns.arm_covariance @ away.T
    return 0.5 * (covariance + covariance.T), moved


def _inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverse with rows and columns of unit length."""
    scale = np.sqrt(np.maximum(np.abs(np.diag(matrix)), 1e-300))
    return np.linalg.inv(matrix / np.outer(scale, scale)) / np.outer(scale, scale)
