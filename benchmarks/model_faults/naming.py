"""What the causes of model error that pivident names have to do with the planted fault."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

import pivident as pv
from pivident.model_errors import ModelErrors, named_causes
from pivident.model_errors.wider_intervals import with_model_errors

from .cases import Case, make_case
from .faults import Cause, is_possible

#: An estimate whose largest error is above this is wrong, in standard errors.
WRONG = 5.0


@dataclass(frozen=True)
class Named:
    """One case: what was named, and the errors with and without intervals for it."""

    case: Case
    found: ModelErrors
    before: np.ndarray  # errors over the standard errors of the noise
    after: np.ndarray  # over those with model error
    seconds: float  # processor time of the causes over that of the estimate

    @property
    def place(self) -> int:
        """Which of the named causes is the planted one, from 1; 0: none."""
        for number, one in enumerate(self.found.named, start=1):
            for cause in (one.cause, *one.alternatives):
                if any(
                    is_cause(cause.kind, cause.subject, wanted) for wanted in self.case.expected
                ):
                    return number
        return 0

    @property
    def is_silent(self) -> bool:
        """Whether nothing is said that would be a reservation."""
        return not self.found.matter


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
    # what a wrong geometry only groups otherwise is no error of the estimate
    truth = np.array([case.corrected_truth.get(name, case.truth[name]) for name in piv.names])
    wider = with_model_errors(piv, found)
    return Named(
        case, found, (piv.theta - truth) / piv.std, (wider.theta - truth) / wider.std, seconds
    )


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
        f"largest {np.abs(row.before).max():6.1f} σ, wider {np.abs(row.after).max():5.1f}; "
        f"place {row.place}; {said}"
    )


def summary(fault: str, rows: list[Named]) -> str:
    """How often the cause is among the first two, and what was called free of reservations."""
    wrong = [row for row in rows if np.abs(row.before).max() > WRONG]
    silent = sum(row.is_silent for row in wrong)
    early = sum(0 < row.place <= 2 for row in rows)
    told = sum(0 < row.place <= 2 for row in wrong)
    inside = np.mean(np.abs(np.concatenate([row.after for row in rows])) <= 2.0)
    plain = np.mean(np.abs(np.concatenate([row.before for row in rows])) <= 2.0)
    return (
        f"{fault}: among the first two {early} of {len(rows)} ({told} of {len(wrong)} with an "
        f"error above {WRONG:g} σ); wrong and silent {silent}; coverage {100 * plain:.1f} %, with "
        f"model error {100 * inside:.1f} %; a reservation {sum(not r.is_silent for r in rows)}; "
        f"causes take {np.median([r.seconds for r in rows]):.2f} times the estimate"
    )
