"""The nearest physically possible load, and the range of possible loads that the records allow.

The estimate is unconstrained: noise may give it a negative moment of inertia. Real bodies have a
positive definite pseudo-inertia P(π) (Wensing, Kim and Slotine 2018). Nearest in the metric of the
estimate is

    π* = arg min (π - π̂)ᵀ C⁻¹ (π - π̂)    with P(π) - diag(e, e, e, 0) ⪰ 0,  m ≥ m_b,

where m_b is the mass of the smallest load, a ball, and e its second moment. The two conditions hold
for a body whose mass and second moments about its own centre of mass are not smaller, wherever it
lies and in any frame (`pivident.models.consistency.pseudo_inertia.least_body`).

The interval of a parameter is its range over all real bodies with a squared distance of at most
d*² + χ²₁(0.95). It is finite even for parameters that no torque determines if mass and the other
moments bound them: a product of inertia cannot exceed what the moments allow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.foundation.distributions import chi_square
from pivident.models.consistency.cone_program import Requirement, Solved, solve_cone_program
from pivident.models.consistency.pseudo_inertia import least_body, pseudo_inertia, triangle
from pivident.robot.description import INERTIAL
from pivident.studies.payload.load_estimate import NATURAL, TWO_SIDED_95, LoadEstimate

#: The smallest load: a steel ball of this diameter [m], half a gram.
SMALLEST = 0.005

#: Scales of pseudo-inertias: a body's coordinates (0.1 m) and 1.
COORDINATES = np.array([0.1, 0.1, 0.1, 1.0])

#: Accuracies of the solver: the usual one, and a fallback.
GAPS = (1e-8, 1e-5)

#: Range of the search along undetermined directions, in natural sizes, and the relative growth of
#: an end with the logarithm of this range above which the parameter is unbounded.
SEARCHED, GROWS = 1e3, 0.1

#: Squared distance [σ²] below which an estimate counts as possible itself.
AT_THE_ESTIMATE = 1e-3


@dataclass(frozen=True, eq=False)
class PossibleLoad:
    """A physically possible load."""

    values: np.ndarray  # its ten parameters, shape (10,)
    was_possible: bool  # whether the estimate itself is possible
    distance: float  # Mahalanobis distance from the estimate
    # probability of a larger distance from a true load on the boundary, by χ² with one degree of
    # freedom; a small value indicates an error in the records
    p_value: float
    # 95 % range of each parameter over possible loads, shape (10, 2); infinite if unbounded, NaN
    # if the solver found no end
    intervals: np.ndarray

    @property
    def not_found(self) -> tuple[str, ...]:
        """Parameters whose range the solver did not find."""
        missing = np.isnan(self.intervals).any(axis=1)
        return tuple(name for name, one in zip(INERTIAL, missing, strict=True) if one)


def possible_load(load: LoadEstimate) -> PossibleLoad | None:
    """Nearest possible load of an estimate; None where the solver fails."""
    centre, steps, determined = load.values / NATURAL, *_whitened(load)
    body = _real_body(load, steps)
    nearest = _solved(np.where(determined, 1.0, 0.0), np.zeros(10), body)
    if not nearest.found:
        return None
    squared = float(np.sum(nearest.u[determined] ** 2))
    near = [*body, _within(determined, np.sqrt(squared + TWO_SIDED_95**2))]
    if not determined.all():
        near.append(_within(~determined, SEARCHED))
    ends = centre[:, None] + np.array(
        [
            [_least(steps[k], near, determined), -_least(-steps[k], near, determined)]
            for k in range(10)
        ]
    )
    return PossibleLoad(
        (centre + steps @ nearest.u) * NATURAL,
        squared < AT_THE_ESTIMATE,
        float(np.sqrt(squared)),
        float(chi_square.sf(squared, 1)),
        ends * NATURAL[:, None],
    )


def _whitened(load: LoadEstimate) -> tuple[np.ndarray, np.ndarray]:
    """Steps (10, 10) and determined coordinates (10,) of π = π̂ + steps w with Cov w = 1.

    In natural sizes; steps of undetermined directions have length one.
    """
    lost = load.undetermined / NATURAL[:, None]
    spread = load.covariance / np.outer(NATURAL, NATURAL)
    if lost.size:
        lost, _ = np.linalg.qr(lost)
        keep = np.eye(10) - lost @ lost.T
        spread = keep @ spread @ keep
    variances, directions = np.linalg.eigh(spread)
    determined = np.arange(10) >= lost.shape[1]
    if lost.size:
        directions[:, ~determined] = lost
    lengths = np.where(determined, np.sqrt(np.maximum(variances, 1e-20)), 1.0)
    return directions * lengths, determined


def _real_body(load: LoadEstimate, steps: np.ndarray) -> list[Requirement]:
    """P(π̂ + steps w) - E ⪰ 0 and m ≥ m_b, scaled to natural sizes.

    P is that in a frame beside the load's centre of mass, T P Tᵀ, where it is well conditioned; E
    is the same in every frame.
    """
    shift = np.eye(4)
    if load.is_seen:
        shift[:3, 3] = -load.center_of_mass
    scaled = shift / COORDINATES[:, None]
    units = np.array([scaled @ pseudo_inertia(unit) @ scaled.T for unit in np.eye(10)])
    units = triangle(units).T * NATURAL
    least, least_mass = least_body(SMALLEST)
    offset = units @ (load.values / NATURAL) - triangle(least / np.outer(COORDINATES, COORDINATES))
    return [
        Requirement("semidefinite", 4, units @ steps, offset),
        Requirement("nonnegative", 1, steps[9:], load.values[9:] - least_mass),
    ]


def _within(which: np.ndarray, radius: float) -> Requirement:
    """The selected coordinates lie within a ball."""
    rows = np.vstack([np.zeros(10), np.eye(10)[which]])
    return Requirement("second_order", len(rows), rows, np.r_[radius, np.zeros(len(rows) - 1)])


def _solved(quadratic: np.ndarray, linear: np.ndarray, requirements: list[Requirement]) -> Solved:
    """The solution, at reduced accuracy if the solver does not converge."""
    for gap in GAPS:
        solved = solve_cone_program(quadratic, linear, requirements, gap)
        if solved.found or solved.unbounded:
            break
    return solved


def _least(direction: np.ndarray, requirements: list[Requirement], determined: np.ndarray) -> float:
    """Minimum of directionᵀ w; minus infinity if unbounded, NaN if not found.

    It is unbounded if it still falls at the end of the range along undetermined directions; that
    condition is the last one.
    """
    solved = _solved(np.zeros(10), direction / np.linalg.norm(direction), requirements)
    if solved.unbounded:
        return -np.inf
    if not solved.found:
        return np.nan
    if not determined.all():
        if SEARCHED * float(solved.multipliers[-1][0]) > GROWS * max(abs(solved.value), 1.0):
            return -np.inf
    return float(direction @ solved.u)
