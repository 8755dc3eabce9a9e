"""What the causes of model error that pivident names have to do with the planted fault."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

import pivident as pv
from pivident.foundation.text.finding import Finding
from pivident.judgement import ModelErrors, corrections, named_causes, with_corrections
from pivident.judgement.audit.recording_audit import recording_faults

from .cases import Case, make_case
from .faults import Cause, is_possible

#: Faults of the log, and the kind of finding that names each.
LOG_KINDS = {"lost samples": "lost", "jitter": "hidden jitter"}

#: An estimate whose largest error is above this is wrong, in standard errors.
WRONG = 5.0


@dataclass(frozen=True)
class Named:
    """One case: what was named, and the errors with and without the named causes corrected."""

    case: Case
    found: ModelErrors
    log: tuple[Finding, ...]  # what an audit has against the recordings
    before: np.ndarray  # errors over the standard errors
    after: np.ndarray  # with the named causes corrected, where that can be; else as ``before``
    seconds: float  # processor time of the causes over that of the estimate

    @property
    def place(self) -> int:
        """Which of the named causes is the planted one, from 1; 0: none. The log comes first."""
        kinds = {finding.kind for finding in self.log}
        if any(LOG_KINDS.get(wanted) in kinds for wanted, _ in self.case.expected):
            return 1
        for number, one in enumerate(self.found.named, start=1):
            for cause in (one.cause, *one.alternatives):
                if any(
                    is_cause(cause.kind, cause.subject, wanted) for wanted in self.case.expected
                ):
                    return number
        return 0

    @property
    def is_silent(self) -> bool:
        """Whether nothing is said that would be a reservation.

        Warnings of an audit, such as rest at the ends, are notes where their repair does nothing.
        """
        grave = (f.severity == "error" or f.kind in LOG_KINDS.values() for f in self.log)
        return not self.found.matter and not any(grave)

    @property
    def is_presumed(self) -> bool:
        """Whether the planted cause is among those that the record is said not to show."""
        return any(
            is_cause(one.cause.kind, one.cause.subject, wanted)
            for one in self.found.unchecked
            for wanted in self.case.expected
        )


def is_cause(kind: str, subject: str, wanted: Cause) -> bool:
    """Whether a cause is of the kind, and of the joint where there is one."""
    return kind == wanted[0] and (wanted[1] is None or not subject or subject == wanted[1])


def name_causes(case: Case) -> Named:
    """Estimate a case and name its causes."""
    begin = time.process_time()
    piv = pv.identify(case.problem, "piv")
    middle = time.process_time()
    found = named_causes(case.problem, piv)
    seconds = (time.process_time() - middle) / (middle - begin)
    log = recording_faults(case.problem.robot, case.problem.recordings)
    after = corrected(case, found) or piv
    return Named(case, found, log, errors(case, piv), errors(case, after), seconds)


def errors(case: Case, found: pv.Identification) -> np.ndarray:
    """Errors of an estimate over its standard errors, one for each parameter that has a truth."""
    # what a wrong geometry only groups otherwise is no error of the estimate
    truth = {**case.truth, **case.corrected_truth}
    pairs = zip(found.names, found.theta, found.std, strict=True)
    return np.array([(x - truth[name]) / std for name, x, std in pairs if name in truth])


def corrected(case: Case, found: ModelErrors) -> pv.Identification | None:
    """The estimate with the named causes corrected; None where they have no single size."""
    kinds = dict.fromkeys(one.cause.kind for one in found.matter if one.cause.correct is not None)
    if not kinds:
        return None
    try:
        made = corrections(case.problem, "piv", list(kinds))
        return with_corrections(pv.identify(made.problem, "piv"), made)
    except pv.PividentError:
        return None


def naming(faults: list[str], arms: list[str], records: int, first: int) -> None:
    """A line for each case, and a summary of each fault over all arms."""
    for fault in faults:
        rows, refused = [], 0
        for arm in arms:
            for seed in range(first, first + records) if is_possible(fault, arm) else ():
                try:
                    rows.append(name_causes(make_case(arm, fault, seed)))
                except pv.PividentError as error:
                    refused += 1
                    print(f"{arm:7s} {fault:18s} {seed:3d} refused: {error}")
                    continue
                print(line(rows[-1]), flush=True)
        print(f"{summary(fault, rows)}; refused {refused}", flush=True)


def line(row: Named) -> str:
    """One case."""
    case = row.case
    said = "; ".join(f"{one} ({one.shift:.1f} σ)" for one in row.found.named[:3]) or "nothing"
    return (
        f"{case.arm:7s} {case.fault:18s} {case.seed:3d} {case.size:8.3g} {case.unit:8s} "
        f"largest {np.abs(row.before).max():6.1f} σ, corrected {np.abs(row.after).max():5.1f}; "
        f"place {row.place}; {said}{'; said not to be shown' * (row.is_silent and row.is_presumed)}"
    )


def summary(fault: str, rows: list[Named]) -> str:
    """How often the cause is among the first two, and what was called free of reservations."""
    wrong = [row for row in rows if np.abs(row.before).max() > WRONG]
    silent = [row for row in wrong if row.is_silent]
    early = sum(0 < row.place <= 2 for row in rows)
    told = sum(0 < row.place <= 2 for row in wrong)
    plain, after = (
        100.0 * np.mean(np.abs(np.concatenate(own)) <= 2.0)
        for own in ([r.before for r in rows], [r.after for r in rows])
    )
    return (
        f"{fault}: among the first two {early} of {len(rows)} ({told} of {len(wrong)} with an "
        f"error above {WRONG:g} σ); wrong and silent {len(silent)}, of which "
        f"{sum(row.is_presumed for row in silent)} said not to be shown; coverage {plain:.1f} %, "
        f"corrected {after:.1f} %; a reservation "
        f"{sum(not r.is_silent for r in rows)}; "
        f"causes take {np.median([r.seconds for r in rows]):.2f} times the estimate"
    )
