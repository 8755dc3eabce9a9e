"""The last word on a motion: every limit on a grid ten times finer than that of the search.

Positions, speeds and accelerations are smooth, and so fine a grid shows them. Torques are not,
where a joint turns round and friction changes sides, and neither are distances, where another
corner becomes the nearest: both are bounded between its samples, too.

A distance d changes no faster than the joints allow, |ḋ| ≤ L = Σ_i |dq_i| |∂d/∂q_i|, with bounds of
the slopes that hold in every posture. Between samples h apart it is therefore at least

    (d_k + d_{k+1} - L h) / 2

(Lipschitz; Piyavskii 1972, Shubert 1972). Where this leaves a distance in doubt, samples are taken
in between, until it does not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from pivident.robot.description import Robot
from pivident.studies.collision.clearances import Clearances
from pivident.studies.excitation.constraints import Constraints
from pivident.studies.excitation.design import ClearanceUse, Limited, LimitUse

#: Parts into which an interval in doubt is cut, and how often.
PARTS, LEVELS = 8, 5

#: What may remain in doubt [m].
TOLERANCE = 5e-5

#: Pairs that keep so much more than needed are not followed between the samples [m].
AMPLE = 0.03

#: Positions, speeds and accelerations at times, (3, samples, joints).
Motion = Callable[[np.ndarray], np.ndarray]


def least_clearances(
    clearances: Clearances, motion: Motion, t: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Least distance of every pair along a motion.

    Args:
        clearances: the pairs.
        motion: its positions, speeds and accelerations at times [s].
        t: samples to begin with, evenly spaced [s], shape (samples,).

    Returns:
        Distances [m] and instants [s], each (pairs,): at most `TOLERANCE` above the least distance
        for pairs that come near to what they need, those at the samples for others.
    """
    rows, needed = np.arange(len(clearances.names)), clearances.needed
    least, instant = np.full(rows.size, np.inf), np.full(rows.size, t[0])
    cuts = t[:, None]  # samples of each interval, one interval in each column
    for _ in range(LEVELS + 1):
        moved = motion(cuts.ravel())
        distance = clearances.distances(moved[0])
        nearest = distance.argmin(axis=1)
        closer = distance[rows, nearest] < least
        least = np.where(closer, distance[rows, nearest], least)
        instant = np.where(closer, cuts.ravel()[nearest], instant)
        low = _lowest_between(clearances, moved, distance, cuts)
        doubtful = low < np.minimum(least - TOLERANCE, needed + AMPLE)[:, None, None]
        own = doubtful.any(axis=0)
        if not own.any():
            return least, instant
        left, right = cuts[:-1][own], cuts[1:][own]
        cuts = left + np.linspace(0.0, 1.0, PARTS + 1)[:, None] * (right - left)
    # what is still in doubt counts as its bound
    return np.minimum(least, np.where(doubtful, low, np.inf).min(axis=(1, 2))), instant


def _lowest_between(
    clearances: Clearances, moved: np.ndarray, distance: np.ndarray, cuts: np.ndarray
) -> np.ndarray:
    """(d_k + d_{k+1} - L h)/2 of samples in each column, shape (pairs, samples - 1, columns).

    Within half a step of a sample a speed is at most |dq| + h/2 max |ddq|.
    """
    step = cuts[1, 0] - cuts[0, 0]
    speed = np.abs(moved[1]) + 0.5 * step * np.abs(moved[2]).max(axis=0)
    pace = (speed @ clearances.steepest.T).T.reshape(-1, *cuts.shape)
    d = distance.reshape(-1, *cuts.shape)
    return 0.5 * (d[:, :-1] + d[:, 1:] - step * np.maximum(pace[:, :-1], pace[:, 1:]))


#: The grid is so many times finer than that of the search.
FINER = 10

#: Shares to which a motion that breaks a limit between samples is made smaller, one after another.
SHRINKING = tuple(0.995**k for k in range(1, 60))

#: Ratio up to which a limit counts as kept: rounding.
ROUNDING = 1.0 + 1e-9


@dataclass(frozen=True, eq=False)
class FineCheck:
    """Constraints on the fine grid."""

    constraints: Constraints

    @classmethod
    def of(cls, search: Constraints) -> FineCheck:
        """The constraints of a search, on its finer grid."""
        return cls(
            Constraints.of(
                search.family,
                FINER * search.rate,
                search.limits,
                search.torques,
                search.clearances,
            )
        )

    def keeps_all(self, coefficients: np.ndarray) -> bool:
        """Whether no limit is broken at any sample, and no torque or clearance between them."""
        c = self.constraints
        if c.largest_ratio(coefficients) > ROUNDING:
            return False
        if self._largest_torque_ratio(coefficients) > ROUNDING:
            return False
        if c.clearances is None or not c.clearances.needed.size:
            return True
        least, _ = self._least(coefficients)
        return bool((least >= c.clearances.needed).all())

    def _largest_torque_ratio(self, coefficients: np.ndarray) -> float:
        """Largest of r_k + ½ min(|r_k - r_{k-1}|, |r_{k+1} - r_k|), r the torque over its limit.

        What lies between two samples is no further from the nearer one than half a step of the side
        on which the torque does not jump.
        """
        c, largest = self.constraints, 0.0
        q, dq, ddq, _ = c.motion(coefficients)
        for model in c.torques:
            torque, margin = model.torque_and_margin((q, dq, ddq))
            ratio = (np.abs(torque) + margin) / c.limits.torque
            step = np.abs(np.diff(ratio, axis=0))
            smaller = np.minimum(step[:-1], step[1:])
            largest = max(largest, float((ratio[1:-1] + 0.5 * smaller).max()))
        return largest

    def _least(self, coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Least clearances and their instants."""
        c = self.constraints
        assert c.clearances is not None
        return least_clearances(
            c.clearances, lambda t: c.family.functions(t)[:3] @ coefficients, self.times
        )

    def repaired(self, coefficients: np.ndarray) -> np.ndarray | None:
        """The motion itself, or made smaller about its ends until it keeps all limits; or None."""
        if self.keeps_all(coefficients):
            return coefficients
        for share in SHRINKING:
            smaller = share * coefficients
            smaller[0] = coefficients[0]
            if self.keeps_all(smaller):
                return smaller
        return None

    @property
    def times(self) -> np.ndarray:
        """Instants of the grid [s]."""
        samples = self.constraints.functions.shape[1]
        return np.linspace(0.0, self.constraints.family.duration, samples)

    def limit_uses(self, robot: Robot, coefficients: np.ndarray) -> tuple[LimitUse, ...]:
        """Use of each limit of each joint."""
        c, t = self.constraints, self.times
        moved = c.motion(coefficients)
        limits = c.limits
        quantities: list[tuple[Limited, np.ndarray, np.ndarray, np.ndarray, str]] = [
            ("position", moved[0], limits.low, limits.high, "{}"),
            ("speed", moved[1], -limits.speed, limits.speed, "{}/s"),
            ("acceleration", moved[2], -limits.acceleration, limits.acceleration, "{}/s²"),
            ("jerk", moved[3], -limits.jerk, limits.jerk, "{}/s³"),
        ]
        uses: list[LimitUse] = []
        for j, joint in enumerate(robot.joints):
            for name, signal, low, high, unit in quantities:
                if np.isinf(high[j]):
                    continue
                own = signal[:, j]
                middle = 0.5 * (low[j] + high[j])
                nearest = t[int(np.argmax(np.abs(own - middle)))]
                uses.append(
                    LimitUse(
                        joint.name,
                        name,
                        unit.format(joint.position_unit),
                        float(low[j]),
                        float(high[j]),
                        float(own.min()),
                        float(own.max()),
                        float(nearest),
                        limits.source.get(name, ("description",) * robot.size)[j],
                    )
                )
        uses += self._torque_uses(robot, moved)
        order = {joint.name: j for j, joint in enumerate(robot.joints)}
        return tuple(sorted(uses, key=lambda use: order[use.joint]))

    def _torque_uses(self, robot: Robot, moved: np.ndarray) -> Iterator[LimitUse]:
        """Use of the torque limits, with the margin of the model."""
        c = self.constraints
        if not c.torques:
            return
        motion = (moved[0], moved[1], moved[2])
        found = [model.torque_and_margin(motion) for model in c.torques]
        torque, margin = (np.concatenate(part) for part in zip(*found, strict=True))
        rms_torque = np.max([np.sqrt(np.mean(own**2, axis=0)) for own, _ in found], axis=0)
        times = np.tile(self.times, len(found))
        for j, joint in enumerate(robot.joints):
            limit, rms = c.limits.torque[j], c.limits.rms_torque[j]
            if np.isfinite(limit):
                size = np.abs(torque[:, j]) + margin[:, j]
                yield LimitUse(
                    joint.name,
                    "torque",
                    joint.torque_unit,
                    -float(limit),
                    float(limit),
                    float((torque - margin)[:, j].min()),
                    float((torque + margin)[:, j].max()),
                    float(times[int(np.argmax(size))]),
                    c.limits.source.get("torque", ("description",) * robot.size)[j],
                )
            if np.isfinite(rms):
                reached = float(rms_torque[j])
                yield LimitUse(
                    joint.name,
                    "rms torque",
                    joint.torque_unit,
                    0.0,
                    float(rms),
                    0.0,
                    reached,
                    float("nan"),
                    c.limits.source.get("rms_torque", ("file",) * robot.size)[j],
                )

    def clearance_uses(self, coefficients: np.ndarray) -> tuple[ClearanceUse, ...]:
        """Least clearance of each pair of bodies, the nearest first."""
        c = self.constraints
        if c.clearances is None:
            return ()
        least, instants = self._least(coefficients)
        uses = [
            ClearanceUse(name, float(distance), float(needed), float(t))
            for name, distance, needed, t in zip(
                c.clearances.names, least, c.clearances.needed, instants, strict=True
            )
        ]
        return tuple(sorted(uses, key=lambda use: use.least - use.needed))


def with_more_room(constraints: Constraints, share: float, room: float) -> Constraints:
    """The same constraints, of which a search uses only a share, and keeps more room [m].

    Between its samples a motion may go a little further.
    """
    clearances = constraints.clearances
    wider = None if clearances is None else clearances.with_more(room)
    return replace(constraints, limits=constraints.limits.within(share), clearances=wider)
