"""Figures of merit of BIRDy (Leboutet et al. 2021), on a motion not used for identification.

    d_τ = 100 mean_j ‖τ̂_j - τ_j‖/‖τ_j‖        torque along the true second motion
    d_q = 100 mean_j ‖q̂_j - q_j‖/‖q_j‖        positions of the simulated loop
    d_β = 100 (2/b) Σ_i |β̂_i - β_i| / (|β̂_i| + |β_i|)

All in percent, without noise; d_q is NaN if the loop cannot be simulated with the estimates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.errors import IdentificationError
from pivident.many.study.bench import Bench


@dataclass(frozen=True)
class Merit:
    """Figures of merit of a set of parameters [%]."""

    d_tau: float  # error of the torque
    d_q: float  # error of the simulated positions, NaN if they diverge
    d_beta: float  # distance of the parameters


def figures_of_merit(bench: Bench, theta: np.ndarray) -> Merit:
    """Figures of merit on the bench's second motion."""
    true, regressor = bench.second_motion, bench.regressor
    torque = regressor.torque(true.q, true.dq, true.ddq, theta)
    try:
        made = bench.simulated(regressor.parameters, theta, bench.second_reference, clip=True)
        d_q = _distance(made.q, true.q)
    except IdentificationError:
        d_q = float("nan")
    return Merit(_distance(torque, true.tau), d_q, _parameter_distance(theta, bench.expected))


def _distance(estimated: np.ndarray, true: np.ndarray) -> float:
    """100 mean_j ‖x̂_j - x_j‖/‖x_j‖ of signals (samples, joints), over joints with a signal."""
    size = np.linalg.norm(true, axis=0)
    error = np.linalg.norm(estimated - true, axis=0)
    return float(100.0 * np.mean(error[size > 0] / size[size > 0]))


def _parameter_distance(estimated: np.ndarray, true: np.ndarray) -> float:
    size = np.abs(estimated) + np.abs(true)
    share = np.divide(np.abs(estimated - true), size, out=np.zeros(size.shape), where=size > 0)
    return float(100.0 * 2.0 / size.size * share.sum())
