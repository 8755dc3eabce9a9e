"""Another reading of the log's joints that fits the robot's description better.

A log with two joints in each other's columns, or with a joint that counts backwards, is the log of
an arm, but of another one: the description misses its torque, or no machine has what is estimated.
Where that is so, least squares is asked about other readings:

    q_j, τ_j exchanged with q_k, τ_k;      q_j, τ_j with the other sign

in the units of their new places, one after the other, as long as each lowers the torque error
clearly. Gains that nobody knows but the masses of the description are taken from these again for
each reading: those of joints in each other's columns are wrong. A joint that only turns the arm
about the vertical has the same torques both ways round; then the reading counts whose estimate a
machine can have. An arm of few joints and its mirror image may have the same torques, so that
several readings fit: all of them are given.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from pivident.audit.description_factors import description_factors
from pivident.audit.inverse_model import build_inverse_model
from pivident.audit.recording_audit import log_of
from pivident.audit.timing import check_timing
from pivident.consistency.consistent_model import make_consistent
from pivident.errors import PividentError
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.experiment.repaired_problem import worth_of_units
from pivident.logs.torque_scale import BASES
from pivident.recording.recording import Recording

#: Samples of the record that is read again, at most.
MOST_SAMPLES = 40_000

#: Factor by which a change of the reading lowers the torque error, or it is not followed; …
FOLLOWED = 1.2

#: … and by which all of them lower it, for each: where the direction of gravity is wrong, readings
#: with three or four changes lower it to a third.
EACH = 2.0

#: Growth of the torque error that a reading of a possible machine may cost.
AS_GOOD = 1.02


@dataclass(frozen=True)
class Reading:
    """How a log's joints are read.

    Attributes:
        column: number of the joint whose columns are taken for each joint.
        sign: of each joint's position and torque, 1 or -1.
        error: torque error of least squares [%].
        is_possible: whether a machine can have its estimate; None: nobody asked.
    """

    column: tuple[int, ...]
    sign: tuple[int, ...]
    error: float
    is_possible: bool | None = None

    @property
    def changes(self) -> int:
        """Pairs that are exchanged, one after the other, and joints that are reversed."""
        order, pairs = list(self.column), 0
        for j in range(len(order)):
            while order[j] != j:
                k = order[j]
                order[j], order[k] = order[k], order[j]
                pairs += 1
        return pairs + len(self.reversed)

    @property
    def exchanged(self) -> tuple[int, ...]:
        """Joints that take the columns of others."""
        return tuple(j for j, k in enumerate(self.column) if j != k)

    @property
    def reversed(self) -> tuple[int, ...]:
        """Joints with the other sign."""
        return tuple(j for j, sign in enumerate(self.sign) if sign < 0)


def better_readings(problem: Problem) -> tuple[Reading, ...]:
    """The log as it is read, then the readings that fit better, all equally well.

    Args:
        problem: of an estimate that misses the torque, or that no machine has.

    Returns:
        The readings; empty where no other one fits better.
    """
    robot = problem.robot
    measured = all(r.torque_source == "measured" for r in problem.recordings)
    if robot.constraints is not None or robot.base_joints or not measured:
        return ()
    search = _Search(problem)
    places = range(robot.size)
    given = search.read(tuple(places), (1,) * robot.size)
    best = given
    for _ in places:  # one change after the other
        nearest = min(search.others(best), key=lambda own: own.error, default=best)
        if nearest.error * FOLLOWED > best.error:
            break
        best = nearest
    given = search.asked(given)
    if best.changes == 0 and given.is_possible:
        return ()

    def explains(own: Reading) -> bool:
        """Whether it is clearly better, or, with one sign changed, possible and as good."""
        if own.changes == len(own.reversed) == 1 and not given.is_possible:
            return own.error <= AS_GOOD * given.error
        return own.error * EACH**own.changes <= given.error

    tried = [own for own in search.known.values() if own.changes and explains(own)]
    fitting = [own for own in map(search.asked, tried) if own.is_possible]
    lowest = min((own.error for own in fitting), default=np.inf)
    alike = [own for own in fitting if own.error <= AS_GOOD * lowest]
    fewest = min((own.changes for own in alike), default=0)
    return (given, *(own for own in alike if own.changes == fewest)) if alike else ()


class _Search:
    """Readings of one recording."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.kinds = [joint.kind for joint in problem.robot.joints]
        self.record = max(problem.recordings, key=lambda r: r.samples)
        self.worth = worth_of_units(problem.robot, self.record)
        scales = {s.joint for s in self.record.torque_scale if s.basis in BASES}
        #: Joints whose gain nobody knows but the masses of the description.
        self.weighed = np.array([name in scales for name in self.record.joint_names])
        self.known: dict[tuple[tuple[int, ...], tuple[int, ...]], Reading] = {}

    def others(self, own: Reading) -> Iterator[Reading]:
        """Readings that differ in one joint's sign or in the places of two joints."""
        for j in range(len(own.sign)):
            sign = tuple(-s if k == j else s for k, s in enumerate(own.sign))
            yield self.read(own.column, sign)
        for j, k in combinations(range(len(own.column)), 2):
            if self.kinds[j] == self.kinds[k]:
                column = list(own.column)
                column[j], column[k] = column[k], column[j]
                yield self.read(tuple(column), own.sign)

    def read(self, column: tuple[int, ...], sign: tuple[int, ...]) -> Reading:
        """The reading with its error; infinite where it cannot be estimated."""
        if (column, sign) not in self.known:
            self.known[column, sign] = self._estimated(column, sign)
        return self.known[column, sign]

    def _estimated(self, column: tuple[int, ...], sign: tuple[int, ...]) -> Reading:
        found = self._identified(column, sign)
        error = np.inf if found is None else 100.0 * float(found.relative_error)
        return Reading(column, sign, error)

    def asked(self, own: Reading) -> Reading:
        """The same, asked whether a machine can have it.

        It is estimated once more: estimates of all readings would hold as many copies of the log.
        """
        found, possible = self._identified(own.column, own.sign), False
        if found is not None:
            try:
                possible = not make_consistent(found, accept_far=True).is_far
            except PividentError:
                pass
        return replace(own, is_possible=possible)

    def _identified(self, column: tuple[int, ...], sign: tuple[int, ...]) -> Identification | None:
        """Least squares on the log read so; None where there is no estimate."""
        try:
            record = self._record(column, sign)
            problem = replace(self.problem, recordings=(record,), loop=None)
            return identify(problem, METHODS["ls"], test_gains=False)
        except PividentError:
            return None

    def _record(self, column: tuple[int, ...], sign: tuple[int, ...]) -> Recording:
        """The recording read so: what least squares needs of it."""
        whole, columns, worth = self.record, list(column), self.worth
        read = {
            channel: np.array(sign) * worth[channel] / worth[channel][columns] * values[:, columns]
            for channel, values in (
                ("q", whole.q[:MOST_SAMPLES]),
                ("tau", whole.tau[:MOST_SAMPLES]),
            )
        }
        made = Recording(
            whole.name, whole.joint_names, read["q"], read["tau"], whole.rate,
            control_rate=whole.control_rate, torque_timing=whole.torque_timing, delay=whole.delay,
            drive_delay=whole.drive_delay, allow_constant=True, saturation="allow",
            torque_side=whole.torque_side,
        )  # fmt: skip
        return replace(made, tau=made.tau / self._gains(made)) if self.weighed.any() else made

    def _gains(self, read: Recording) -> np.ndarray:
        """Torques over those of the description's masses, for joints with gains from them."""
        log = log_of(self.problem.robot, read)
        try:
            model = build_inverse_model(log, check_timing(log))
            factors = description_factors(log, model)[0]
        except (PividentError, np.linalg.LinAlgError):
            return np.ones(len(self.weighed))
        return np.where(self.weighed & (factors > 0.0), factors, 1.0)
