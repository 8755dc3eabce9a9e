"""Causes of model error by name, parameters not estimated among them, the gravest first.

The residual of an estimate is compared with what each cause would make of it (`score_tests`). A
cause is named if it is significant among all that were tried and lets motion that was not fitted be
predicted better. It is a reservation if correcting it would move a parameter by more than
`MATTERS` standard errors, or if it makes a good part of the residual.

Parameters that are not estimated: left out by choice, or carried in one recording only.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import Parameter, standard_parameters
from pivident.estimation.identification import Identification
from pivident.estimation.problem import Problem
from pivident.foundation.errors import IdentificationError
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.numbers import plus_minus
from pivident.foundation.threads import linear_algebra_in_one_thread
from pivident.judgement.model_errors.cause import Cause, Reach, RecordMotion
from pivident.judgement.model_errors.cause_rows import CauseRows, instrument_motions, smoothed
from pivident.judgement.model_errors.cause_sums import JointRows
from pivident.judgement.model_errors.coupling_errors import COUPLED, coupling_causes
from pivident.judgement.model_errors.motion_errors import geometry_causes, motion_causes
from pivident.judgement.model_errors.score_tests import LEVEL, MOST_CAUSES, Score, ScoreTests
from pivident.judgement.model_errors.time_errors import (
    LOAD,
    Instants,
    temperature_causes,
    time_causes,
    torques_of,
)
from pivident.judgement.model_errors.torque_errors import (
    friction_causes,
    spring_causes,
    torque_causes,
)
from pivident.judgement.model_errors.unchecked_causes import (
    UncheckedCause,
    checked_gains,
    timely,
    unchecked_causes,
)
from pivident.judgement.model_errors.wrench_errors import wrench_causes
from pivident.judgement.validation.held_out.prediction import motion_band
from pivident.loop.motion.motion import Kinematics
from pivident.robot.description import Robot

#: Change of a parameter, in standard errors, from which on a cause is a reservation: it leaves the
#: interval.
MATTERS = 2.0
#: Share of the residual's power from which on it is one in any case: the estimate weighs the rows
#: otherwise, and may be moved further.
EXPLAINS = 0.1
#: Share of the best cause's effect from which on another one cannot be told from it.
ALIKE = 0.9
#: The same for a simpler one to be named instead: where the best has many columns, those of joints
#: that are tied otherwise, and where it has one of many instants.
SIMPLER, STEADY = 0.7, 0.99
#: Share of the most from which on causes help alike: the first in their order is then named.
SAME = 0.999
#: Level of a cause that takes `EXPLAINS` more than it has to from what is left of motion that was
#: not fitted, as chance hardly does.
FORETOLD = 1e-2
#: Share of the most that a cause explains from which on its significance is asked first.
NEAR = 0.5


@dataclass(frozen=True, eq=False)
class NamedCause(Displayed):
    """A cause that was found.

    Attributes:
        score: its test, beside the causes named before it.
        shift: largest change of a parameter by correcting it, in standard errors.
        parameter: the one that changes so much.
        torques: torque that goes with it as a share of the torque, shape (joints,).
        alternatives: other causes that explain nearly as much, and cannot be told from it.
        changes: of the estimate by correcting it, and by correcting each of these in its place,
            shape (1 + alternatives, parameters).
    """

    score: Score
    shift: float
    parameter: str
    torques: np.ndarray
    alternatives: tuple[Cause, ...]
    changes: np.ndarray

    @property
    def cause(self) -> Cause:
        """What it is."""
        return self.score.cause

    @property
    def matters(self) -> bool:
        """Whether correcting it would change the estimate, or much of what it leaves."""
        return self.shift > MATTERS or self.score.explained > EXPLAINS

    @property
    def size(self) -> tuple[float, float]:
        """Its size and the standard error, in the unit of the cause."""
        size, std = self.score.size, self.score.std
        if size.size == 1 or self.cause.by_first:
            return float(size[0]), float(std[0])
        length = float(np.linalg.norm(size))
        along = size / max(length, 1e-300)
        return length, float(np.sqrt(along @ self.score.covariance @ along))

    @property
    def size_text(self) -> str:
        """Its size ± 2σ with the unit."""
        size, std = self.size
        return f"{plus_minus(size, 2.0 * std)} {self.cause.unit}"

    @property
    def text(self) -> str:
        """``axis_3, length along x from axis_2 to axis_3: 0.98 ± 0.02 mm``."""
        cause = self.cause
        if cause.phrase:
            return cause.phrase.replace("{size}", self.size_text)
        return f"{f'{cause.subject}, ' * bool(cause.subject)}{cause.what}: {self.size_text}"

    def __str__(self) -> str:
        return f"{self.cause}, {self.size_text}"


@dataclass(frozen=True, eq=False)
class ModelErrors(Displayed):
    """What is wrong besides noise, as far as the residual shows it.

    Attributes:
        named: causes in the order in which they were found.
        tried: how many were tried.
        explained: share of the residual's sum of squares, below the motion's highest frequency,
            that they explain.
        unseen: the same on blocks that were not fitted.
        unchecked: errors that would not be seen, and would change the estimate.
        checked_gains: joints whose torque agrees in scale with those of the others.
        timely: delays that are ruled out by the joint whose torque would have them [ms].
    """

    named: tuple[NamedCause, ...]
    tried: int
    explained: float
    unseen: float
    unchecked: tuple[UncheckedCause, ...] = ()
    checked_gains: tuple[str, ...] = ()
    timely: Mapping[str, float] = field(default_factory=dict)

    @property
    def matter(self) -> tuple[NamedCause, ...]:
        """Those that change the estimate."""
        return tuple(named for named in self.named if named.matters)


def missing_causes(
    robot: Robot, parameters: Sequence[Parameter], recordings: Sequence[str]
) -> Iterator[Cause]:
    """Base parameters that were left out, and loads of single recordings.

    ``parameters``: those that are estimated; ``recordings``: names of the recordings.
    """
    known = {p.name for p in parameters}
    base = base_parameters(robot)
    for name, parameter in zip(base.names, base.parameters, strict=True):
        if parameter.name not in known:
            yield _left_out(robot, name, parameter)
    if robot.constraints is not None:
        return  # it has no flange
    last = robot.size - 1
    stems = {p.stem: p for p in standard_parameters(robot) if p.joint == last}
    own = [stems[stem] for stem in LOAD]  # the mass first, whose amplitude is the size
    for number, recording in enumerate(recordings[1:], start=1):
        yield _carried(robot, own, number, recording)


def _left_out(robot: Robot, name: str, parameter: Parameter) -> Cause:
    torques = torques_of([parameter])

    joint = robot.tree.joint_names[parameter.joint]
    what = f"{name}, which is not estimated"
    return Cause("missing parameter", joint, what, parameter.unit, torques)


def _carried(robot: Robot, own: Sequence[Parameter], number: int, recording: str) -> Cause:
    torques = torques_of(own)

    def columns(motion: RecordMotion) -> np.ndarray:
        found = torques(motion)
        return found if motion.number == number else np.zeros_like(found)

    what = f"mass at the flange in {recording} alone"
    name = robot.joint_names[-1]
    return Cause("payload", name, what, "kg", columns, len(own), by_first=True)


def all_causes(problem: Problem, found: Identification, reach: Reach) -> list[Cause]:
    """What is tried of one joint or of the whole, and does not change with time."""
    robot = problem.robot
    names = [r.name for r in problem.recordings]
    return [
        *torque_causes(robot, max(map(motion_band, problem.recordings)), reach.pace),
        *geometry_causes(robot),
        *motion_causes(robot),
        *missing_causes(robot, found.parameters, names),
        *friction_causes(robot, reach),
        *spring_causes(robot, reach),
        *wrench_causes(problem),
    ]


def _sets(
    problem: Problem, found: Identification, kinematics: Sequence[Kinematics]
) -> list[list[Cause]]:
    """Causes of one joint or of the whole, those that change with time, and those between joints.

    Each of the sets is held to the level by the number of the largest one.
    """
    reach = reach_of(kinematics)
    return [
        all_causes(problem, found, reach),
        list(time_causes(problem.robot, Instants.of(kinematics))),
        list(coupling_causes(problem.robot, reach)),
    ]


def _signals_of(problem: Problem, found: Identification) -> list[Kinematics]:
    """The smoothed motion of each record, where an estimate still has its signals."""
    if found.equations is None:
        raise IdentificationError(
            f"{found.method}: causes of model error are looked for in the signals of an estimate, "
            "and a file has none",
            advice="identify again",
        )
    return smoothed(problem, found)


def _tests(rows: CauseRows, sets: Sequence[Sequence[Cause]]) -> ScoreTests:
    """Tests of the causes of some rows."""
    theta = np.zeros(int(rows.first[-1]))
    theta[: rows.found.theta.size] = rows.found.theta

    def measured(chosen: Sequence[Cause]) -> list[list[JointRows]]:
        return CauseRows(
            rows.problem, rows.found, chosen, rows.kinematics, rows.motions, measured=True
        ).joints

    own = measured if any(motion is not None for motion in rows.motions) else None
    sums, tried = rows.sums(rows.variances(theta)), max(map(len, sets))
    return ScoreTests(sums, rows.causes, rows.first, tried, own)


def score_tests(
    problem: Problem, found: Identification, kinds: Sequence[str] | None = None
) -> ScoreTests:
    """Tests of an estimate, ready to be asked.

    Args:
        problem: what was given.
        found: the estimate.
        kinds: of these causes only; None: of all.

    Raises:
        IdentificationError: the estimate comes from a file and has no signals.
    """
    kinematics = _signals_of(problem, found)
    sets = _sets(problem, found, kinematics)
    causes = list(chain(*sets))
    if kinds is not None:
        causes = [c for c in (*causes, *temperature_causes(problem)) if c.kind in kinds]
    motions = instrument_motions(problem, found, kinematics)
    return _tests(CauseRows(problem, found, causes, kinematics, motions), sets)


def named_causes(problem: Problem, found: Identification) -> ModelErrors:
    """Name the causes of model error that an estimate's residual shows.

    Args:
        problem: what was given.
        found: the estimate, as ``identify`` returned it.

    Returns:
        The causes, the gravest first, with sizes and what correcting them would change.

    Raises:
        IdentificationError: the estimate comes from a file and has no signals.
    """
    with linear_algebra_in_one_thread():
        kinematics = _signals_of(problem, found)
        sets = _sets(problem, found, kinematics)
        motions = instrument_motions(problem, found, kinematics)
        rows = CauseRows(problem, found, list(chain(*sets)), kinematics, motions)
        tests = _tests(rows, sets)
        named = _one_by_one(tests, found)
        causes = [c for one in named.values() for c in (one.cause, *one.alternatives)]
        jumps = {cause.instant for cause in causes if cause.instant is not None}
        if jumps:  # the next instants to them are near enough to find a cause, not to measure it
            near = Instants.of(kinematics).near(sorted(jumps))
            sets[1] = list(time_causes(problem.robot, near))
            if _jumps_between(rows, list(named.values()), sets):
                tests = _tests(rows.with_causes(list(chain(*sets))), sets)
                named = _one_by_one(tests, found)
        return _model_errors(tests, named, found)


def _jumps_between(
    rows: CauseRows, named: Sequence[NamedCause], sets: Sequence[Sequence[Cause]]
) -> bool:
    """Whether a jump explains more at an instant near to that at which it was found.

    ``sets``: causes, those with the instants that are nearer second.
    """
    if any(other.instant is not None for one in named for other in one.alternatives):
        return True
    found = [one.cause for one in named]
    jumps = [k for k, cause in enumerate(found) if cause.instant is not None]
    kinds = [(found[k].kind, found[k].subject) for k in jumps]
    near = [c for c in sets[1] if c.instant is not None and (c.kind, c.subject) in kinds]
    tests = _tests(rows.with_causes([*found, *near]), sets)
    for k, what in zip(jumps, kinds, strict=True):
        _, scores = tests.all_scores(range(k))
        own = {
            n: score
            for n, score in scores.items()
            if n >= len(found) and (score.cause.kind, score.cause.subject) == what
        }
        if not own or own[_first_of_best(own)].cause.instant != found[k].instant:
            return True
    return False


def is_found(score: Score, tried: int) -> bool:
    """Whether a cause is significant among so many, and helps with motion that was not fitted."""
    least = score.cause.least
    level = FORETOLD if score.unseen > least + EXPLAINS else LEVEL
    return (
        score.unseen > least
        and score.explained >= least
        and score.significance * tried < level
        and score.cause.allows(score.size)
    )


def _is_large(
    tests: ScoreTests, corrected: Sequence[int], number: int, score: Score, std: np.ndarray
) -> bool:
    """Whether a cause is large enough to be named, where that is asked: in torque or in effect."""
    cause, least = score.cause, score.cause.least_torque
    if not least or float(tests.torques(corrected, number).max()) > least:
        return True
    return cause.by_effect and float(np.max(np.abs(score.shift) / std)) > MATTERS


def _one_by_one(tests: ScoreTests, found: Identification) -> dict[int, NamedCause]:
    """One cause after the other by its number, each beside those before it."""
    named: dict[int, NamedCause] = {}
    while len(named) < MOST_CAUSES:
        corrected = list(named)
        candidates = _candidates(tests, corrected, found)
        if not candidates:
            break
        best = _best(candidates)
        torques = tests.torques(corrected, best)
        named[best] = _named(found, candidates[best], candidates, torques)
    return named


def _model_errors(
    tests: ScoreTests, by_number: Mapping[int, NamedCause], found: Identification
) -> ModelErrors:
    """Causes that were found, by their numbers, with their sizes and what they leave."""
    start = tests.fit(tests.columns([]))
    corrected, named = list(by_number), list(by_number.values())
    with suppress(np.linalg.LinAlgError):  # all that is known of one lies within one window
        named = [
            replace(one, score=replace(one.score, size=size, covariance=covariance))
            for one, (size, covariance) in zip(named, tests.sizes(corrected), strict=True)
        ]
    base, scores = tests.all_scores(corrected)
    return ModelErrors(
        tuple(named),
        tests.tried,
        1.0 - base.residual / max(start.residual, 1e-300),
        1.0 - base.unseen / max(start.unseen, 1e-300),
        unchecked_causes(tests, scores, corrected, found, MATTERS),
        checked_gains(tests, scores.values()),
        timely(scores.values()),
    )


def _candidates(
    tests: ScoreTests, corrected: Sequence[int], found: Identification
) -> dict[int, Score]:
    """Causes of which one is to be named next: the best one, and all that come near it.

    The significance of the others is not asked, which takes longer than what they explain.
    """
    for share in (NEAR, 0.0):
        _, scores = tests.all_scores(corrected, share)
        candidates = {
            k: s
            for k, s in scores.items()
            if is_found(s, tests.tried) and _is_large(tests, corrected, k, s, found.free_std)
        }
        most = max((s.unseen for s in scores.values()), default=0.0)
        if any(s.unseen * SIMPLER * ALIKE >= NEAR * most for s in candidates.values()):
            break  # what is further off is neither simpler nor alike
    return candidates


def _best(candidates: Mapping[int, Score]) -> int:
    """The one that helps most, or a simpler one that helps nearly as much.

    Joints are tied otherwise, or something jumped, only where nothing simpler explains it.
    """
    best = _first_of_best(candidates)
    simple = {
        k: s for k, s in candidates.items() if s.cause.kind != COUPLED and s.cause.instant is None
    }
    simplest = _first_of_best(simple) if simple else best
    share = SIMPLER if candidates[best].cause.kind == COUPLED else STEADY
    return simplest if candidates[simplest].unseen > share * candidates[best].unseen else best


def _first_of_best(candidates: Mapping[int, Score]) -> int:
    """The first of those that help most, whatever the last digits."""
    most = max(score.unseen for score in candidates.values())
    return min(k for k, score in candidates.items() if score.unseen >= SAME * most)


def alternatives(best: Score, candidates: Iterable[Score]) -> tuple[Score, ...]:
    """Causes of which the record says nearly as much as of the best one; of jumps one instant."""
    chosen: list[Score] = []
    jumps = {(best.cause.kind, best.cause.subject)}
    for score in sorted(candidates, key=lambda one: -one.unseen):
        what = score.cause.kind, score.cause.subject
        is_known = score.cause.instant is not None and what in jumps
        if score is not best and score.unseen > ALIKE * best.unseen and not is_known:
            chosen.append(score)
            jumps.add(what)
    return tuple(chosen)


def _named(
    found: Identification, best: Score, candidates: dict[int, Score], torques: np.ndarray
) -> NamedCause:
    """A cause with those that cannot be told from it."""
    shifts = np.abs(best.shift) / found.free_std
    k = int(np.argmax(shifts))
    alike = alternatives(best, candidates.values())
    changes = np.array([score.shift for score in (best, *alike)])
    causes = tuple(score.cause for score in alike)
    return NamedCause(best, float(shifts[k]), found.names[k], torques, causes, changes)


def reach_of(kinematics: Sequence[Kinematics]) -> Reach:
    """Travel, speeds and torques of all records."""
    spans = [(k, slice(k.start, k.stop)) for k in kinematics]
    return Reach(
        np.min([k.q[:, span].min(axis=1) for k, span in spans], axis=0),
        np.max([k.q[:, span].max(axis=1) for k, span in spans], axis=0),
        np.max([np.abs(k.dq[:, span]).max(axis=1) for k, span in spans], axis=0),
        np.max([np.abs(k.tau[:, span]).max(axis=1) for k, span in spans], axis=0),
        np.sqrt(
            np.sum([(k.ddq[:, span] ** 2).sum(axis=1) for k, span in spans], axis=0)
            / np.maximum(np.sum([(k.dq[:, span] ** 2).sum(axis=1) for k, span in spans], 0), 1e-300)
        ),
    )
