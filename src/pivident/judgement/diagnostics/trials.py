"""Repairs that were tried: applied, solved again, compared on motion that was not fitted.

Every repair that an audit suggests, that a search finds or that the logged speeds ask for is
carried out on the samples. Least squares is solved again, and its torque error on held-out blocks
compared, block by block, with that of the log as it is read. A repair is shown

- if the error falls by more than chance, corrected for the number that was tried, or
- if it does not move, and something else says so: the logged speeds, or friction that would give
  energy.

Where it falls on one or two blocks, which have no interval, what an audit said stays as it is.

One that makes the error larger, or leaves nothing to be solved, is never shown.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.signs import negative_parameters
from pivident.estimation.identify import identify
from pivident.estimation.method import Method
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Bandpass
from pivident.foundation.errors import PividentError
from pivident.foundation.text.finding import Finding
from pivident.foundation.text.numbers import percent
from pivident.foundation.text.repair import Change, Multiplied, Repair, Retimed
from pivident.judgement.audit.scale import GAIN
from pivident.judgement.audit.steps import LOST, REPEATED_SAMPLE, unsteady_steps
from pivident.judgement.diagnostics.logged_speeds import speed_evidence
from pivident.judgement.diagnostics.reading_rows import ReadingRows
from pivident.judgement.diagnostics.repair_search import Candidate, joined, raises_the_error, search
from pivident.judgement.diagnostics.repaired_problem import cause_of, repaired
from pivident.judgement.validation.held_out.cross_validation import CrossValidation, judged_on
from pivident.judgement.validation.held_out.folds import JudgedMotion
from pivident.judgement.validation.held_out.out_of_sample import error_ratio
from pivident.judgement.validation.held_out.prediction import Judge

#: Ratio of two held-out errors within which they are the same.
SAME = 0.02

#: Ratio from which on the error contradicts what the logged speeds say, which need no model.
CONTRADICTED = 1.25

#: Level of the interval of a ratio, for all repairs together.
LEVEL = 0.05

#: Samples on either side of a gap that are left out.
BESIDE = 3

#: Repairs that are carried out at most.
MAX_TRIALS = 8

Outcome = Literal["better", "unclear", "same", "worse", "unsolvable"]


@dataclass(frozen=True, eq=False)
class Trial:
    """One repair with what it did.

    Attributes:
        repair: what was changed; None where it is nothing that a file can say.
        cause: what was wrong then, a sentence.
        outcome: of the held-out torque error.
        before: held-out torque error of least squares in motion, without standstill [%].
        after: the same with the repair [%]; NaN where it left nothing to be solved.
        evidence: what else says so, a sentence; empty for nothing.
        alike: other repairs that do as well, in words.
        finding: what an audit said, where that was why it was tried.
    """

    repair: Repair | None
    cause: str
    outcome: Outcome
    before: float
    after: float
    evidence: str = ""
    alike: tuple[str, ...] = ()
    finding: Finding | None = None

    @property
    def wins(self) -> bool:
        """Whether the log is better read with it."""
        by_evidence = self.outcome in ("same", "unclear") and bool(self.evidence)
        return self.repair is not None and (self.outcome == "better" or by_evidence)

    @property
    def effect(self) -> str:
        """What it did, in half a line."""
        if self.outcome == "unsolvable":
            return "nothing can be solved with it"
        before, after = percent(self.before), percent(self.after)
        if before == after:
            return f"the error in motion stays {after}"
        return f"error in motion {before} → {after}"


@dataclass(frozen=True, eq=False)
class _Suspicion:
    """A repair that is to be tried, and why."""

    repair: Repair | None
    cause: str
    evidence: str = ""
    alike: tuple[str, ...] = ()
    is_found: bool = False  # whether a search has found that it lowers the error
    finding: Finding | None = None

    @property
    def rank(self) -> int:
        """The logged speeds come first, which need no model; then a search; then an audit."""
        return 1 if self.is_found else 2 if self.finding is not None else 0

    def carried_out(self, problem: Problem) -> Problem:
        """The problem with the repair; without one, that of samples that are lost or repeated."""
        if self.repair is None:
            return without_unsteady_steps(problem)
        return repaired(problem, self.repair)


def tried(
    problem: Problem, log: Iterable[Finding], method: Method, folds: int, gap: float | None = None
) -> tuple[Trial, ...]:
    """Carry out what is suspected of a log.

    Args:
        problem: what was given.
        log: what an audit has against its recordings, with repairs.
        method: least squares, by which all are compared.
        folds: blocks of the motion that are held out in turn.
        gap: left out on either side of a block [s].

    Returns:
        All trials, the winners first in the order in which they are applied, each upon those
        before it.

    Raises:
        PividentError: least squares finds nothing in the log as it is.
    """
    rows = ReadingRows.of(problem)
    waiting, done = _suspicions(problem, log, method, rows), list[Trial]()
    number, winners = len(waiting), list[Trial]()
    if rows is not None:
        lost = [(one, _lost(one, rows)) for one in waiting]
        done = [trial for _, trial in lost if trial is not None]
        waiting = [one for one, trial in lost if trial is None]
    if not waiting:
        return tuple(done)
    given = _judged(problem, method, folds, gap)
    while waiting:
        results = [
            (one, _trial(one, problem, given, method, folds, gap, number)) for one in waiting
        ]
        won = [pair for pair in results if pair[1].wins]
        if not won:
            return (*winners, *done, *(trial for _, trial in results))
        first = min(won, key=lambda pair: (pair[0].rank, pair[1].after))
        winners.append(first[1])
        done += [trial for one, trial in results if one is not first[0] and not trial.wins]
        waiting = [one for one, _ in won if one is not first[0] and _apart(one, first[0])]
        try:
            problem = first[0].carried_out(problem)
            given = _judged(problem, method, folds, gap)
        except PividentError:
            break
    return (*winners, *done)


def _possible(problem: Problem, one: Candidate, method: Method) -> Candidate:
    """Of repairs that do as well, the one that leaves fewest frictions and rotors negative."""

    def impossible(repair: Repair) -> int:
        try:
            found = identify(repaired(problem, repair), method, test_gains=False)
        except PividentError:
            return len(problem.base.names) + 1
        return len(negative_parameters(found.parameters, found.names, found.theta, found.std))

    if not one.alike:
        return one
    best, *others = sorted((one.repair, *one.alike), key=impossible)
    return replace(one, repair=best, alike=tuple(others))


def _suspicions(
    problem: Problem, log: Iterable[Finding], method: Method, rows: ReadingRows | None
) -> list[_Suspicion]:
    """What is tried: a search's repairs, those of the logged speeds, those of an audit."""
    found: list[_Suspicion] = []
    names = problem.robot.joint_names
    unverified = {scale.joint for r in problem.recordings for scale in r.torque_scale}
    found_by_search = () if rows is None else search(rows, unverified)
    candidates = [_possible(problem, one, method) for one in found_by_search]
    if candidates:
        whole = joined(candidates)
        alike = tuple(cause_of(r, names) for one in candidates for r in one.alike)
        found.append(_Suspicion(whole, cause_of(whole, names), "", alike, True))
    found += [
        _Suspicion(said.repair, said.sentence, said.sentence) for said in speed_evidence(problem)
    ]
    for finding in log:
        if finding.declared in (LOST, REPEATED_SAMPLE):
            found.append(_Suspicion(None, finding.message, finding=finding))
        direct = finding.message if finding.severity == "error" and finding.repairs else ""
        for repair in finding.repairs or _as_gain(finding):
            if not any(own.repair and repair.edits == own.repair.edits for own in found):
                cause = cause_of(repair, names) or finding.message
                found.append(_Suspicion(repair, cause, direct, finding=finding))
    return found[:MAX_TRIALS]


def _as_gain(finding: Finding) -> tuple[Repair, ...]:
    """What would make up for a torque of another size than the description's, were it a gain."""
    factor = finding.evidence["factor"].value if finding.declared is GAIN else 0.0
    if factor <= 0.0:
        return ()
    scaled = ((finding.subject, float(f"{1.0 / factor:.4g}")),)
    return (Repair((Multiplied(channel="tau", factors=scaled),)),)


def without_unsteady_steps(problem: Problem) -> Problem:
    """The problem with new samples for those that repeat others, and without those beside a gap."""

    def without(recording: Recording) -> Recording:
        places = unsteady_steps(recording.q).astype(int)
        repeated = places[places[:, 1] < 0, 0] + 1
        repeated = repeated[repeated < recording.samples - 1]
        filled: dict[str, Any] = {}
        for channel in ("q", "tau"):
            values = getattr(recording, channel).copy()
            values[repeated] = 0.5 * (values[repeated - 1] + values[repeated + 1])
            filled[channel] = values
        valid = np.ones(recording.q.shape, bool) if recording.valid is None else recording.valid
        valid = valid.copy()
        for sample in places[places[:, 1] > 0, 0]:
            valid[max(sample - BESIDE, 0) : sample + BESIDE + 1] = False
        return replace(recording, valid=None if valid.all() else valid, **filled)

    return replace(problem, recordings=tuple(map(without, problem.recordings)), loop=None)


def _lost(one: _Suspicion, rows: ReadingRows) -> Trial | None:
    """The trial of what an audit suggests, where the rows of the search say that it is in vain."""
    if one.finding is None or one.repair is None:
        return None
    errors = raises_the_error(rows, one.repair)
    if errors is None:
        return None
    return Trial(one.repair, one.cause, "worse", *errors, one.evidence, one.alike, one.finding)


def _trial(
    one: _Suspicion, problem: Problem, given: CrossValidation, method: Method, folds: int,
    gap: float | None, number: int,
) -> Trial:  # fmt: skip
    """One repair carried out."""
    before = given.prediction.total_moving_in_band
    trial = Trial(
        one.repair, one.cause, "unsolvable", before, float("nan"), one.evidence, one.alike,
        one.finding,
    )  # fmt: skip
    try:
        slower = math.prod(e.factor for e in _edits(one.repair) if isinstance(e, Retimed))
        band = given.prediction.band / slower
        method = _at_pace(method, 1.0 / slower, problem.robot.size)
        other = _judged(one.carried_out(problem), method, folds, gap, band)
    except PividentError:
        return trial
    ratio = error_ratio(other, given, LEVEL / number, _compared(one.repair))
    outcome: Outcome = "same"
    if ratio.value < 1.0 - SAME and (one.is_found or ratio.high < 1.0):
        outcome = "better"
    elif ratio.value < 1.0 - SAME and math.isnan(ratio.high):
        outcome = "unclear"
    elif ratio.value > (CONTRADICTED if one.rank == 0 else 1.0 + SAME):
        outcome = "worse"
    return replace(trial, outcome=outcome, after=other.prediction.total_moving_in_band)


def _at_pace(method: Method, factor: float, joints: int) -> Method:
    """The same filters for a motion that is so many times as fast as the log's clock says."""
    signals = method.signals
    if factor == 1.0 or not isinstance(signals, Bandpass):
        return method
    cutoff = signals.cutoff and tuple(factor * signals.cutoffs(joints))
    bandwidth = signals.bandwidth and factor * signals.bandwidth
    return replace(method, signals=replace(signals, cutoff=cutoff, bandwidth=bandwidth))


def _judged(
    problem: Problem, method: Method, folds: int, gap: float | None, band: float | None = None
) -> CrossValidation:
    """Held-out errors of least squares; ``band``: highest frequency that is judged [Hz].

    Only torques are compared: no loop is simulated.
    """
    problem = replace(problem, loop=None)
    motion = JudgedMotion(problem, tuple(Judge(r, band) for r in problem.recordings))
    return judged_on(motion, method, folds, gap, None, lambda line: None)


def _compared(repair: Repair | None) -> str:
    """Which error of a `PredictionError` is compared: one that a gain of a joint cannot change."""
    scales = any(isinstance(e, Multiplied) and e.channel == "tau" for e in _edits(repair))
    return "typical_moving_in_band" if scales else "total_moving_in_band"


def _edits(repair: Repair | None) -> tuple[Change, ...]:
    return () if repair is None else repair.edits


def _apart(one: _Suspicion, other: _Suspicion) -> bool:
    """Whether two repairs change different things."""
    mine, others = ({_thing(edit) for edit in _edits(own.repair)} for own in (one, other))
    return not mine & others


def _thing(edit: Change) -> tuple[str, ...]:
    """What an edit is about: joints, or a key."""
    for name in ("joints", "factors", "offsets"):
        if entries := getattr(edit, name, ()):
            return tuple(e if isinstance(e, str) else e[0] for e in entries)
    return tuple(map(str, getattr(edit, "place", (type(edit).__name__,))))


def consequences(log: Sequence[Finding], trials: Iterable[Trial]) -> tuple[Finding, ...]:
    """What an audit has against a log, as far as it has consequences.

    A finding whose repairs were all tried in vain is left out where they make the result worse, and
    a note where they change nothing; where the error falls on too few blocks for an interval, it
    says so. A torque of another size than the description's is a note if it is no gain; where a
    gain would change nothing, which it is remains open. What nobody can try is a reservation at
    most.
    """
    done, left = list(trials), []
    for finding in log:
        own = [trial for trial in done if trial.finding is finding]
        lost = [trial.outcome in ("worse", "unsolvable") for trial in own if trial.repair]
        if any(trial.wins for trial in own):
            continue
        if lost and all(lost):
            if not finding.repairs:
                left.append(_of_description(finding, own[0]))
            continue
        effects = {trial.outcome: f"repaired, {trial.effect}" for trial in own}
        same = effects.get("same") or (effects.get("worse") if own and not own[0].repair else None)
        if "unclear" in effects:
            finding = replace(
                finding,
                message=f"{finding.message} On trial {effects['unclear']}, on one or two blocks "
                "only.",
            )
        elif same and (finding.repairs or own[0].repair is None):
            finding = replace(
                finding,
                severity="note",
                message=f"{finding.message} Of no consequence: {same}.",
                next_step="",
                repairs=(),
            )
        left.append(
            replace(finding, severity="warning") if finding.severity == "error" else finding
        )
    return tuple(left)


def _of_description(finding: Finding, lost: Trial) -> Finding:
    """A torque of another size than the description's that is no gain."""
    return replace(
        finding,
        severity="note",
        message=f"{finding.message} It is no gain (tried: {lost.effect}): its masses in the "
        "description are wrong, or something is mounted that it lacks. The estimate does not use "
        "them.",
        next_step="",
        repairs=(),
    )
