"""Known gains, known ratios of gains, and undetermined scales.

Rows of several motors share inertial parameters: a mass on the forearm acts on shoulder and elbow.
In the units of their logs each row determines such a parameter in its own unit, and its value in
one row over that in another is the ratio of two gains. A known payload, a trusted gain or a trusted
parameter is given in N m, and is an additional node, *ground*.

Motors (and ground) are nodes of a graph; two are connected where the ratio of their gains is known
to within a given fraction at 2σ. Within a connected component all ratios are known. Each component
without ground has exactly one scale that the record does not determine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

#: Largest relative half width of the 2σ interval of a known ratio.
KNOWN_WITHIN = 0.25


@dataclass(frozen=True, eq=False)
class GainGroup:
    """Motors whose gains are known relative to each other.

    Ratios of a group without anchor are relative to ``reference``, the motor against which the
    others are known best.
    """

    motors: tuple[int, ...]  # indices, ascending
    anchored: bool  # whether the gains themselves are known, not only their ratios
    reference: int


def gain_groups(log_covariance: np.ndarray, known_within: float = KNOWN_WITHIN) -> list[GainGroup]:
    """Connected components of the graph of known ratios, the anchored one first."""
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
    """κ_motor/κ_reference and its standard error."""
    value = float(kappa[motor] / kappa[reference])
    pair: Sequence[int] = (motor, reference)
    block = log_covariance[np.ix_(pair, pair)]
    variance = block[0, 0] + block[1, 1] - 2.0 * block[0, 1] if motor != reference else 0.0
    return value, abs(value) * float(np.sqrt(max(variance, 0.0)))
