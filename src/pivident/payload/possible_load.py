"""The nearest load that a real body can be, and the range of loads that the records allow.

The estimate is unconstrained: noise may give it a negative moment of inertia. Real bodies have a
positive definite pseudo-inertia P(π) (Wensing, Kim and Slotine 2018). Nearest in the metric of the
estimate is

    π* = arg min (π - π̂)ᵀ C⁻¹ (π - π̂)    with P(π) - diag(e, e, e, 0) ⪰ 0,  m ≥ m_b,

where m_b is the mass of the smallest load, a ball, and e its second moment. The two conditions are
those of a body whose mass and second moments about its own centre of mass are not smaller,
wherever it lies and in whichever frame (`pivident.consistency.pseudo_inertia.least_body`).

The interval of a parameter is its range over all real bodies with a squared distance of at most
d*² + χ²₁(0.95). It is finite for parameters that no torque tells, where mass and the other moments
bound them: a product of inertia cannot be larger than the moments allow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.consistency.cone_program import Requirement, Solved, solve_cone_program
from pivident.consistency.pseudo_inertia import least_body, pseudo_inertia, triangle
from pivident.payload.load_estimate import NATURAL, TWO_SIDED_95, LoadEstimate
from pivident.robot.description import INERTIAL

#: The smallest load: a steel ball of this diameter [m], half a gram.
SMALLEST = 0.005

#: Sizes of a body's coordinates (0.1 m) and of one, by which pseudo-inertias are scaled.
COORDINATES = np.array([0.1, 0.1, 0.1, 1.0])

#: Accuracies of the solver: the usual one, and that which is asked for where it gets stuck.
GAPS = (1e-8, 1e-5)

#: How far what no torque tells is searched, in natural sizes, and the growth of an end with this
#: distance (derivative by its logarithm, relative) from which on there is no bound.
SEARCHED, GROWS = 1e3, 0.1

#: Squared distance [σ²] below which an estimate counts as possible itself.
AT_THE_ESTIMATE = 1e-3


@dataclass(frozen=True, eq=False)
class PossibleLoad:
    """A load that a real body can be."""

    values: np.ndarray  # its ten parameters, shape (10,)
    was_possible: bool  # whether the estimate itself is possible
    distance: float  # from the estimate, in deviations (Mahalanobis)
    # probability of a larger distance from a true load that lies on the boundary, by χ² with one
    # degree of freedom; small: something is wrong with the records
    p_value: float
    # 95 % range of each parameter over possible loads, shape (10, 2); infinite where there is no
    # bound, NaN where the solver found no end
    intervals: np.ndarray

    @property
    def not_found(self) -> tuple[str, ...]:
        """Parameters whose range the solver has not found."""
        missing = np.isnan(self.intervals).any(axis=1)
        return tuple(name for name, one in zip(INERTIAL, missing, strict=True) if one)


def possible_load(load: LoadEstimate) -> PossibleLoad | None:
    """Nearest possible load of an estimate; None where the solver fails."""
    from scipy.stats import chi2

    centre, steps, told = load.values / NATURAL, *_whitened(load)
    body = _real_body(load, steps)
    nearest = _solved(np.where(told, 1.0, 0.0), np.zeros(10), body)
    if not nearest.found:
        return None
    squared = float(np.sum(nearest.u[told] ** 2))
    near = [*body, _within(told, np.sqrt(squared + TWO_SIDED_95**2))]
    if not told.all():
        near.append(_within(~told, SEARCHED))
    ends = centre[:, None] + np.array(
        [[_least(steps[k], near, told), -_least(-steps[k], near, told)] for k in range(10)]
    )
    return PossibleLoad(
        (centre + steps @ nearest.u) * NATURAL,
        squared < AT_THE_ESTIMATE,
        float(np.sqrt(squared)),
        float(chi2.sf(squared, 1)),
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
    count = 10 - lost.shape[1]
    told = np.arange(10) >= 10 - count
    if lost.size:
        directions[:, ~told] = lost
    lengths = np.where(told, np.sqrt(np.maximum(variances, 1e-20)), 1.0)
    return directions * lengths, told


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
    """The coordinates of these places are within a ball."""
    rows = np.vstack([np.zeros(10), np.eye(10)[which]])
    return Requirement("second_order", len(rows), rows, np.r_[radius, np.zeros(len(rows) - 1)])


def _solved(quadratic: np.ndarray, linear: np.ndarray, requirements: list[Requirement]) -> Solved:
    """The solution, of less accuracy where the solver gets stuck; not found where it fails."""
    for gap in GAPS:
        solved = solve_cone_program(quadratic, linear, requirements, gap)
        if solved.found or solved.unbounded:
            break
    return solved


def _least(direction: np.ndarray, requirements: list[Requirement], told: np.ndarray) -> float:
    """Smallest value of directionᵀ w; minus infinity where it has none, NaN where it is not found.

    There is none where it goes on falling at the end of the search along what no torque tells;
    that condition is the last one.
    """
    solved = _solved(np.zeros(10), direction / np.linalg.norm(direction), requirements)
    if solved.unbounded:
        return -np.inf
    if not solved.found:
        return np.nan
    if not told.all():
        growth = SEARCHED * float(solved.multipliers[-1][0])
        if growth > GROWS * max(abs(solved.value), 1.0):
            return -np.inf
    return float(direction @ solved.u)
