"""Inertia that a joint feels, over the postures of a record: J_j of (P-12) is its largest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.dynamics.forward import mass_matrix
from pivident.estimation.identification import Identification

#: Postures of the record at which the inertia is taken.
POSTURES = 300


@dataclass(frozen=True, eq=False)
class InertiaRange:
    """Inertia of one joint over the postures of a record, M_jj."""

    lowest: float  # smallest [kg m² or kg]
    mean: float  # mean over the postures
    highest: float  # largest
    #: Standard error of each of the three, from the covariance of the estimate, shape (3,).
    std: np.ndarray
    slope: np.ndarray  # ∂(mean)/∂θ, shape (parameters,)


def inertia_ranges(identification: Identification) -> tuple[InertiaRange, ...]:
    """M_jj of every joint over the postures of the fitted recordings, with standard errors."""
    postures = np.concatenate([r.q for r in identification.recordings])
    chosen = np.linspace(0, len(postures) - 1, min(POSTURES, len(postures))).round().astype(int)
    postures = np.ascontiguousarray(postures[chosen])
    robot, parameters = identification.robot, identification.parameters
    slopes = np.zeros((len(parameters), len(postures), robot.size))
    for k, p in enumerate(parameters):
        if p.is_inertial or p.stem in ("ia", "iam"):
            mass = mass_matrix(robot, (p,), np.ones(1), postures)
            slopes[k] = np.diagonal(mass, axis1=1, axis2=2)
    inertia = np.einsum("k,ksj->sj", identification.theta, slopes)
    ranges = []
    for j in range(robot.size):
        own = inertia[:, j]
        mean = slopes[:, :, j].mean(axis=1)
        gradients = [slopes[:, own.argmin(), j], mean, slopes[:, own.argmax(), j]]
        std = np.array([_standard_error(identification, g) for g in gradients])
        ranges.append(
            InertiaRange(float(own.min()), float(own.mean()), float(own.max()), std, mean)
        )
    return tuple(ranges)


def _standard_error(identification: Identification, slope: np.ndarray) -> float:
    """√(gᵀ P g)."""
    return float(np.sqrt(max(slope @ identification.covariance @ slope, 0.0)))
