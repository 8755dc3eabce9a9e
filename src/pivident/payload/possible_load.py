"""The nearest load that a real body can be, and the range of loads that the records allow.

The estimate is unconstrained: noise may give it a negative moment of inertia. Real bodies have a
positive definite pseudo-inertia P(π) (Wensing, Kim and Slotine 2018). Nearest in the metric of the
estimate is

    π* = arg min (π - π̂)ᵀ C⁻¹ (π - π̂)    with P(π) - P_small ⪰ 0,

and the interval of a parameter is its range over all real bodies with a distance of at most
d*² + χ²₁(0.95). It is finite for parameters that no torque tells, where mass and the other moments
bound them: a product of inertia cannot be larger than the moments allow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.consistency.cone_program import Requirement, solve_cone_program
from pivident.consistency.pseudo_inertia import ball, pseudo_inertia, triangle
from pivident.payload.load_estimate import NATURAL, TWO_SIDED_95, LoadEstimate

#: The smallest load: a steel ball of this diameter [m], half a gram.
SMALLEST = 0.005

#: Squared distance [σ²] below which an estimate counts as possible itself.
AT_THE_ESTIMATE = 1e-3


@dataclass(frozen=True, eq=False)
class PossibleLoad:
    """A load that a real body can be.

    Attributes:
        values: its ten parameters, shape (10,).
        was_possible: whether the estimate itself is possible.
        distance: from the estimate, in deviations (Mahalanobis).
        p_value: probability of a larger distance from a true load that lies on the boundary, by
            χ² with one degree of freedom; small: something is wrong with the records.
        intervals: 95 % range of each parameter over possible loads, shape (10, 2); infinite where
            there is no bound.
    """

    values: np.ndarray
    was_possible: bool
    distance: float
    p_value: float
    intervals: np.ndarray


def possible_load(load: LoadEstimate) -> PossibleLoad | None:
    """Nearest possible load of an estimate.

    Args:
        load: the estimate.

    Returns:
        The load; None where the solver finds none.
    """
    from scipy.stats import chi2

    centre, steps, told = load.values / NATURAL, *_whitened(load)
    weight = np.where(told, 1.0, 0.0)
    body = _real_body(centre, steps)
    nearest = solve_cone_program(weight, np.zeros(10), [body])
    if not nearest.found:
        return None
    squared = float(weight @ nearest.u**2)
    reach = np.sqrt(squared + TWO_SIDED_95**2)
    ball_of_estimates = np.vstack([np.zeros(10), np.eye(10)[told]])
    offset = np.zeros(len(ball_of_estimates))
    offset[0] = reach
    near = Requirement("second_order", offset.size, ball_of_estimates, offset)
    ends = np.array(
        [
            [
                centre[k] + _least(steps[k], [body, near]),
                centre[k] - _least(-steps[k], [body, near]),
            ]
            for k in range(10)
        ]
    )
    return PossibleLoad(
        (centre + steps @ nearest.u) * NATURAL,
        squared < AT_THE_ESTIMATE,
        float(np.sqrt(squared)),
        float(chi2.sf(squared, 1)),
        ends * NATURAL[:, None],
    )


def _whitened(load: LoadEstimate) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates w with π = π̂ + steps w, in natural sizes, whose covariance is the identity.

    Returns:
        Steps, shape (10, 10), those of undetermined directions of length one, and which
        coordinates are determined, shape (10,).
    """
    lost = load.undetermined / NATURAL[:, None]
    spread = load.covariance / np.outer(NATURAL, NATURAL)
    if lost.size:
        lost, _ = np.linalg.qr(lost)
        keep = np.eye(10) - lost @ lost.T
        spread = keep @ spread @ keep
    variances, directions = np.linalg.eigh(spread)
    count = 10 - lost.shape[1]
    told = np.arange(10) >= 10 - count
    if lost.size:
        directions[:, ~told] = lost
    lengths = np.where(told, np.sqrt(np.maximum(variances, 1e-20)), 1.0)
    return directions * lengths, told


def _real_body(centre: np.ndarray, steps: np.ndarray) -> Requirement:
    """P(π̂ + steps w) - P_small ⪰ 0, scaled to natural sizes."""
    size = np.array([0.1, 0.1, 0.1, 1.0])
    scale = np.outer(size, size)
    units = triangle(np.array([pseudo_inertia(u * NATURAL) / scale for u in np.eye(10)])).T
    offset = units @ centre - triangle(ball(SMALLEST) / scale)
    return Requirement("semidefinite", 4, units @ steps, offset)


def _least(direction: np.ndarray, requirements: list[Requirement]) -> float:
    """Smallest value of directionᵀ w; minus infinity where there is none."""
    size = float(np.linalg.norm(direction))
    found = solve_cone_program(np.zeros(10), direction / size, requirements)
    return float(direction @ found.u) if found.found else -np.inf
