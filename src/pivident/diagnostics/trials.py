"""Repairs that were tried: applied, solved again, compared on motion that was not fitted.

Every repair that an audit suggests, that a search finds or that the logged speeds ask for is carried
out on the samples. Least squares is solved again, and its torque error on held-out blocks compared,
block by block, with that of the log as it is read. A repair is shown

- if the error falls by more than chance, corrected for the number that was tried, or
- if it does not move, and something else says so: the logged speeds, or friction that would give
  energy.

One that makes the error larger, or leaves nothing to be solved, is never shown.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from pivident.diagnostics.logged_speeds import speed_evidence
from pivident.diagnostics.repair_search import joined, search
from pivident.diagnostics.repair_words import cause_of
from pivident.errors import PividentError
from pivident.estimation.method import Method
from pivident.estimation.problem import Problem
from pivident.experiment.repaired_problem import repaired
from pivident.text.finding import Finding
from pivident.text.numbers import percent
from pivident.text.repair import Change, Repair
from pivident.validation.held_out.cross_validation import CrossValidation, judged_on
from pivident.validation.held_out.folds import JudgedMotion
from pivident.validation.held_out.out_of_sample import error_ratio

#: Ratio of two held-out errors within which they are the same.
SAME = 0.02

#: Level of the interval of a ratio, for all repairs together.
LEVEL = 0.05

#: Repairs that are carried out at most.
MAX_TRIALS = 8

Outcome = Literal["better", "same", "worse", "unsolvable"]


@dataclass(frozen=True, eq=False)
class Trial:
    """One repair with what it did.

    Attributes:
        repair: what was changed.
        cause: what was wrong then, a sentence.
        outcome: of the held-out torque error.
        before: held-out torque error of least squares [%].
        after: the same with the repair [%]; NaN where it left nothing to be solved.
        evidence: what else says so, a sentence; empty for nothing.
        alike: other repairs that do as well, in words.
    """

    repair: Repair
    cause: str
    outcome: Outcome
    before: float
    after: float
    evidence: str = ""
    alike: tuple[str, ...] = ()

    @property
    def wins(self) -> bool:
        """Whether the log is better read with it."""
        return self.outcome == "better" or (self.outcome == "same" and bool(self.evidence))

    @property
    def effect(self) -> str:
        """What it did, in half a line."""
        if self.outcome == "unsolvable":
            return "nothing can be solved with it"
        before, after = percent(self.before), percent(self.after)
        if before == after:
            return f"the error stays {after}"
        return f"error {before} → {after}"


@dataclass(frozen=True, eq=False)
class _Suspicion:
    """A repair that is to be tried, and why."""

    repair: Repair
    cause: str
    evidence: str = ""
    alike: tuple[str, ...] = ()
    is_found: bool = False  # whether a search has found that it lowers the error


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
    waiting = _suspicions(problem, log)
    if not waiting:
        return ()
    number, done, winners = len(waiting), list[Trial](), list[Trial]()
    given = _judged(problem, method, folds, gap)
    while waiting:
        results = [
            (one, _trial(one, problem, given, method, folds, gap, number)) for one in waiting
        ]
        won = [pair for pair in results if pair[1].wins]
        if not won:
            return (*winners, *done, *(trial for _, trial in results))
        first = min(won, key=lambda pair: (not pair[0].is_found, pair[1].after))
        winners.append(first[1])
        done += [trial for one, trial in results if one is not first[0] and not trial.wins]
        waiting = [one for one, _ in won if one is not first[0] and _apart(one, first[0])]
        try:
            problem = repaired(problem, first[0].repair)
            given = _judged(problem, method, folds, gap)
        except PividentError:
            break
    return (*winners, *done)


def _suspicions(problem: Problem, log: Iterable[Finding]) -> list[_Suspicion]:
    """What is tried: a search's repairs, those of the logged speeds, those of an audit."""
    found: list[_Suspicion] = []
    candidates = search(problem)
    if candidates:
        whole = joined(candidates)
        alike = tuple(cause_of(r) for one in candidates for r in one.alike)
        found.append(_Suspicion(whole, cause_of(whole), "", alike, True))
    for said in speed_evidence(problem):
        found.append(_Suspicion(said.repair, said.sentence, said.sentence))
    for finding in log:
        direct = finding.message if finding.severity == "error" else ""
        for repair in finding.repairs:
            if not any(repair.edits == other.repair.edits for other in found):
                found.append(_Suspicion(repair, cause_of(repair) or finding.message, direct))
    return found[:MAX_TRIALS]


def _trial(
    one: _Suspicion, problem: Problem, given: CrossValidation, method: Method, folds: int,
    gap: float | None, number: int,
) -> Trial:  # fmt: skip
    """One repair carried out."""
    before = given.prediction.total_in_band
    try:
        other = _judged(repaired(problem, one.repair), method, folds, gap)
    except PividentError:
        nothing = float("nan")
        return Trial(one.repair, one.cause, "unsolvable", before, nothing, one.evidence, one.alike)
    ratio = error_ratio(other, given, LEVEL / number)
    outcome: Outcome = "same"
    if ratio.value < 1.0 - SAME and (one.is_found or ratio.high < 1.0):
        outcome = "better"
    elif ratio.value > 1.0 + SAME:
        outcome = "worse"
    after = other.prediction.total_in_band
    return Trial(one.repair, one.cause, outcome, before, after, one.evidence, one.alike)


def _judged(
    problem: Problem, method: Method, folds: int, gap: float | None
) -> CrossValidation:
    """Held-out errors of least squares."""
    return judged_on(JudgedMotion.of(problem), method, folds, gap, None, lambda line: None)


def _apart(one: _Suspicion, other: _Suspicion) -> bool:
    """Whether two repairs change different things."""
    return not {_thing(edit) for edit in one.repair.edits} & {
        _thing(edit) for edit in other.repair.edits
    }


def _thing(edit: Change) -> tuple[str, ...]:
    """What an edit is about: joints, or a key."""
    for name in ("joints", "factors", "offsets"):
        if entries := getattr(edit, name, ()):
            return tuple(e if isinstance(e, str) else e[0] for e in entries)
    return tuple(map(str, getattr(edit, "place", (type(edit).__name__,))))


def consequences(log: Sequence[Finding], trials: Iterable[Trial]) -> tuple[Finding, ...]:
    """What an audit has against a log, as far as it has consequences.

    A finding whose repairs were all tried in vain is left out where they make the result worse, and
    a note where they change nothing; one that nobody can try is a reservation at most.
    """
    outcome = {id(trial.repair): trial for trial in trials}
    left = []
    for finding in log:
        own = [outcome[id(repair)] for repair in finding.repairs if id(repair) in outcome]
        if any(trial.wins for trial in own) or (
            own and all(trial.outcome in ("worse", "unsolvable") for trial in own)
        ):
            continue
        if own:
            effect = next(trial.effect for trial in own if trial.outcome == "same")
            text = f"{finding.message} Of no consequence: repaired, {effect}."
            left.append(replace(finding, severity="note", message=text, next_step="", repairs=()))
        elif finding.severity == "error":
            left.append(replace(finding, severity="warning"))
        else:
            left.append(finding)
    return tuple(left)
