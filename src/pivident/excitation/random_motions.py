"""Random motions as large as the limits allow: starts of a search."""

from __future__ import annotations

import numpy as np

from pivident.excitation.constraints import Constraints

#: Times that a random motion is made smaller until it keeps clear of what is around it, and how.
SHRINKINGS, SHRINKING = 14, 0.75

#: Share of a joint's range in which a random motion begins.
INNER_RANGE = 0.7

#: Further postures among which a free one is looked for if the first one is not, and their range.
FURTHER_POSTURES, WHOLE_RANGE = 200, 0.95


def coefficient_box(constraints: Constraints) -> tuple[np.ndarray, np.ndarray]:
    """Middle of each coefficient, and the size at which its function alone reaches a limit.

    In these units the search is well scaled, and steps that leave every limit far behind are not
    tried. Shapes (size, joints).
    """
    limits = constraints.limits
    largest = np.abs(constraints.functions[:3]).max(axis=1)
    with np.errstate(divide="ignore"):
        sizes = [
            limit / size[:, None]
            for limit, size in zip(
                (limits.half, limits.speed, limits.acceleration), largest, strict=True
            )
        ]
    middle = np.zeros_like(sizes[0])
    middle[0] = limits.middle
    return middle, np.min(sizes, axis=0)


def random_coefficients(
    constraints: Constraints, rng: np.random.Generator, home: np.ndarray | None
) -> np.ndarray | None:
    """A random motion as large as the limits allow; None where even a small one breaks them.

    It is made smaller about its posture at the ends until it keeps all limits.
    """
    _, scale = coefficient_box(constraints)
    drawn = scale * rng.uniform(-1.0, 1.0, scale.shape)
    posture = _free_posture(constraints, rng) if home is None else home
    if not _keeps(constraints, np.vstack([posture, np.zeros_like(drawn[1:])])):
        return None
    drawn[1:] *= _kinematic_scale(constraints, drawn, posture)
    drawn[0] = posture
    for _ in range(SHRINKINGS):
        if _keeps(constraints, drawn):
            return drawn
        drawn[1:] *= SHRINKING
    return None


def _free_posture(constraints: Constraints, rng: np.random.Generator) -> np.ndarray:
    """A random posture, clear of everything if one of some hundred is."""
    limits, clearances = constraints.limits, constraints.clearances

    def drawn(count: int, within: float) -> np.ndarray:
        share = rng.uniform(-within, within, (count, limits.half.size))
        return limits.middle + share * limits.half

    def is_free(postures: np.ndarray) -> np.ndarray:
        assert clearances is not None
        near = clearances.distances(postures) < clearances.needed[:, None]
        return ~np.any(near, axis=0)

    (first,) = drawn(1, INNER_RANGE)
    if clearances is None or is_free(first[None])[0]:
        return first
    others = drawn(FURTHER_POSTURES, WHOLE_RANGE)
    return others[int(np.argmax(is_free(others)))]


def _keeps(constraints: Constraints, coefficients: np.ndarray) -> bool:
    return constraints.largest_ratio(coefficients) <= 1.0


def _kinematic_scale(
    constraints: Constraints, drawn: np.ndarray, posture: np.ndarray
) -> np.ndarray:
    """Factor of each joint with which its motion just keeps the limits that it has alone."""
    limits = constraints.limits
    ways = drawn.copy()
    ways[0] = 0.0
    used = np.abs(constraints.motion(ways)).max(axis=1)
    room = np.minimum(limits.high - posture, posture - limits.low)
    allowed = np.array([room, limits.speed, limits.acceleration, limits.jerk])
    return 0.98 * (allowed / np.maximum(used, 1e-12)).min(axis=0)
