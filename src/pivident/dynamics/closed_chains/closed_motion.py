"""The motion of all joints of a closed mechanism from that of its independent ones."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from pivident.dynamics.closed_chains.closure_kernels import CLOSED, approach, follow
from pivident.dynamics.closed_chains.closure_table import (
    ClosureTable,
    ClosureWork,
    closure_table,
    closure_work,
)
from pivident.foundation.errors import LoopNotClosed
from pivident.robot.description import Robot

#: Change of an independent joint from one sample to the next that is no motion any more [rad or m].
JUMP = 0.2

#: Postures at which an element of N has to be zero to count as one that always is, and its size.
PROBES, ZERO = 64, 1e-11


class ClosedMotion(NamedTuple):
    """Motion of all joints of the tree, time last; shapes (tree joints, samples)."""

    q: np.ndarray  # [rad or m]
    dq: np.ndarray  # [rad/s or m/s]
    ddq: np.ndarray  # [rad/s² or m/s²]
    gain: np.ndarray  # N, dq = N dq_a, shape (tree joints, joints, samples)


def closed_place(
    table: ClosureTable,
    q: np.ndarray,
    joint_names: Sequence[str] = (),
    sample: int | None = None,
) -> ClosureWork:
    """A mechanism at independent positions, followed from the posture of its description.

    Args:
        table: its constraints.
        q: independent positions [rad or m], shape (joints,).
        joint_names: of the independent joints, for the error.
        sample: of the record, likewise.

    Raises:
        LoopNotClosed: on the way the loops do not close, or the mechanism is singular.
    """
    work, goal = closure_work(table), np.array(q, dtype=float)
    status = approach(table, work, goal, np.zeros((2, goal.size)))
    if status != CLOSED:
        raise LoopNotClosed(status, goal, joint_names, sample)
    return work


class ClosedChains:
    """The constraints of a robot, ready for motions.

    Args:
        robot: with `Robot.constraints`.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.table: ClosureTable = closure_table(robot)

    def start(self, q: np.ndarray) -> ClosureWork:
        """The mechanism at independent positions, followed from the posture of its description.

        Args:
            q: independent positions [rad or m], shape (joints,).

        Raises:
            LoopNotClosed: on the way the loops do not close, or the mechanism is singular.
        """
        return closed_place(self.table, q, self.robot.joint_names)

    def motion(
        self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, begin: int = 0
    ) -> ClosedMotion:
        """Motion of all joints, ddq = N ddq_a + γ.

        Args:
            q: independent positions [rad or m], time last, shape (joints, samples). A sample far
                from the one before is approached from the posture of the description.
            dq: their speeds [rad/s or m/s], likewise.
            ddq: their accelerations [rad/s² or m/s²], likewise.
            begin: number of the first sample in its record.

        Raises:
            LoopNotClosed: names the sample.
        """
        q, dq, ddq = (np.array(x, dtype=float, order="C") for x in (q, dq, ddq))
        joints, samples = len(self.table.posture), q.shape[1]
        whole = np.empty((3, joints, samples))
        gain = np.empty((joints, self.robot.size, samples))
        far = np.flatnonzero(np.abs(np.diff(q)).max(axis=0, initial=0.0) > JUMP) + 1
        ends = [0, *far.tolist(), samples] if samples else []
        for first, stop in pairwise(ends):
            part = np.s_[..., first:stop]
            number = begin + first or None  # a record that begins out of reach has no sample
            work = closed_place(self.table, q[:, first], self.robot.joint_names, number)
            given = (np.ascontiguousarray(x[part]) for x in (q, dq, ddq))
            made = [x if len(ends) == 2 else np.ascontiguousarray(x[part]) for x in (*whole, gain)]
            status, sample = follow(self.table, work, *given, *made)
            if status != CLOSED:
                sample += first
                raise LoopNotClosed(status, q[:, sample], self.robot.joint_names, begin + sample)
            if len(ends) > 2:
                for all_of_it, own in zip((*whole, gain), made, strict=True):
                    all_of_it[part] = own
        positions, speeds, accelerations = whole
        return ClosedMotion(positions, speeds, accelerations, gain)

    def closing(self, q: np.ndarray) -> np.ndarray:
        """Whether the loops close at each of some postures, shape (samples,).

        ``q``: independent positions [rad or m], shape (samples, joints).
        """
        found = np.zeros(len(q), bool)
        for k, own in enumerate(q):
            with contextlib.suppress(LoopNotClosed):
                self.start(own)
                found[k] = True
        return found

    def moved(self) -> np.ndarray:
        """Which independent joints move which joint of the tree, shape (tree joints, joints)."""
        postures = self.random_postures(np.random.default_rng(20260501), PROBES)
        return np.max([np.abs(self.start(q).gain) for q in postures], axis=0) > ZERO

    def random_postures(self, rng: np.random.Generator, samples: int) -> np.ndarray:
        """Independent positions at which the loops close, shape (samples, joints) [rad or m].

        Uniform between the limits of the joints, or half a radian or decimetre around the posture
        of the description where a joint has none.

        Raises:
            LoopNotClosed: most of them do not close.
        """
        joints, posture = self.robot.joints, self.table.posture[self.table.places]
        spread = [0.5 if joint.kind == "revolute" else 0.1 for joint in joints]
        low, high = np.transpose(
            [
                joint.position_limits or (at - own, at + own)
                for joint, at, own in zip(joints, posture, spread, strict=True)
            ]
        )
        found: list[np.ndarray] = []
        failure: LoopNotClosed | None = None
        for _ in range(20 * samples):
            if len(found) == samples:
                break
            q = rng.uniform(low, high)
            try:
                self.start(q)
            except LoopNotClosed as error:
                failure = error
                continue
            found.append(q)
        if len(found) < samples:
            assert failure is not None
            raise failure
        return np.array(found)


@lru_cache(maxsize=8)
def moved_joints(robot: Robot) -> np.ndarray:
    """As `ClosedChains.moved`, found once for each robot; not to be written to."""
    moved = ClosedChains(robot).moved()
    moved.flags.writeable = False
    return moved
