"""Which gains are known, which ratios of gains, and which scale is not.

Rows of several motors share inertial parameters: a mass on the forearm is felt by shoulder and
elbow. Written in the units of their logs the rows know such a parameter each in its own unit, and
its size in one row over that in another is the ratio of two gains. A known payload, a trusted gain
or a trusted parameter is felt in N m, and is a node of its own, *ground*.

Motors (and ground) are nodes of a graph; two are connected where the ratio of their gains is known
to within a stated share at 2σ. Within a connected component all ratios are known. Each component
without ground has exactly one scale that the record cannot know.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

#: A ratio is called known from this half width of its 2σ interval on, as a share of it.
KNOWN_WITHIN = 0.25


@dataclass(frozen=True, eq=False)
class GainGroup:
    """Motors whose gains are known relative to each other.

    Attributes:
        motors: indices of the motors, ascending.
        anchored: whether the gains themselves are known, and not only their ratios.
        reference: the motor that the ratios of a group without anchor are relative to: the one
            that the others are known best against.
    """

    motors: tuple[int, ...]
    anchored: bool
    reference: int


def gain_groups(log_covariance: np.ndarray, known_within: float = KNOWN_WITHIN) -> list[GainGroup]:
    """Connected components of the graph of known ratios, the anchored one first.

    Args:
        log_covariance: covariance of the log gains, shape (motors, motors).
        known_within: half width of the 2σ interval from which on a ratio is known, relative.

    Returns:
        The groups; every motor is in one.
    """
    n = len(log_covariance)
    own = np.diag(log_covariance)
    spread = np.full((n + 1, n + 1), np.inf)
    spread[:n, :n] = own[:, None] + own[None, :] - 2.0 * log_covariance
    spread[n, :n] = spread[:n, n] = own
    known = 2.0 * np.sqrt(np.maximum(spread, 0.0)) <= known_within
    groups, left = [], set(range(n))
    for first in (n, *range(n)):
        if first not in left and first != n:
            continue
        reached, front = {first}, [first]
        while front:
            node = front.pop()
            new = {int(k) for k in np.flatnonzero(known[node])} - reached
            reached |= new
            front.extend(new)
        motors = tuple(sorted(reached - {n}))
        left -= reached
        if motors:
            inside = spread[np.ix_(motors, motors)]
            reference = motors[int(np.argmin(inside.sum(axis=1)))]
            groups.append(GainGroup(motors, n in reached, reference))
    return groups


def ratio(
    kappa: np.ndarray, log_covariance: np.ndarray, motor: int, reference: int
) -> tuple[float, float]:
    """κ_motor/κ_reference and its standard deviation.

    Args:
        kappa: gains, shape (motors,).
        log_covariance: covariance of their logarithms, shape (motors, motors).
        motor: index of the motor.
        reference: index of the motor it is compared with.
    """
    value = float(kappa[motor] / kappa[reference])
    pair: Sequence[int] = (motor, reference)
    block = log_covariance[np.ix_(pair, pair)]
    variance = block[0, 0] + block[1, 1] - 2.0 * block[0, 1] if motor != reference else 0.0
    return value, abs(value) * float(np.sqrt(max(variance, 0.0)))
