"""The records: families that are right, and the same machines with one fault each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from benchmarks.model_faults.cases import make_case
from benchmarks.model_faults.faults import FAULTS, Cause, is_possible

import pivident as pv

#: Scenarios of the TX40 by family.
TX40 = {"tx40-fine": "fine", "tx40-loop": "loop", "tx40-coloured": "coloured"}

#: Arms that MuJoCo moves: four and seven axes, a telescope under a cascade that nobody declares, a
#: cobot.
ARMS = ("scara", "link7", "telescope", "cobot6")

FAMILIES = (*TX40, *ARMS)

#: The fault of a right record.
NONE = "none"


@dataclass(frozen=True)
class Wanted:
    """A record: its family, its fault and its seed."""

    family: str
    fault: str
    seed: int

    @property
    def name(self) -> str:
        """Name of its file, without the ending."""
        return f"{self.family}-{self.fault}-{self.seed}"


@dataclass(frozen=True)
class Made:
    """A record as a user has it, and what is true.

    Attributes:
        problem: what was given.
        truths: true parameters by name; a second time where a wrong description groups them
            otherwise, which is no error of the estimate.
        expected: causes of which each is right to name.
        size: how large the fault is, in ``unit``.
        unit: its unit.
    """

    problem: pv.Problem
    truths: tuple[dict[str, float], ...]
    expected: tuple[Cause, ...] = ()
    size: float = 0.0
    unit: str = ""


def wanted(
    families: list[str], faults: list[str], right: int, wrong: int, first: int
) -> Iterator[Wanted]:
    """Records in the order in which they are made: seed by seed, so that any part is a sample."""
    for seed in range(first, first + max(right, wrong)):
        if seed < first + right:
            yield from (Wanted(family, NONE, seed) for family in families)
        if seed < first + wrong:
            for fault in faults:
                for family in families:
                    if family in ARMS and is_possible(fault, family):
                        yield Wanted(family, fault, seed)


def make(record: Wanted) -> Made:
    """A record."""
    if record.family in TX40:
        from .tx40 import tx40_record  # needs Pinocchio

        problem, truth = tx40_record(TX40[record.family], record.seed)
        # the regrouping is marked by an r that either of the names may have
        by_stem = {name.removesuffix("r"): value for name, value in truth.items()}
        truth = {name: by_stem[name.removesuffix("r")] for name in problem.names}
        return Made(problem, (truth,))
    case = make_case(record.family, record.fault, record.seed)
    truths = (case.truth,) if case.corrected_truth == case.truth else (
        case.truth, case.corrected_truth
    )  # fmt: skip
    return Made(case.problem, truths, case.expected, case.size, case.unit)


#: All faults that are planted.
PLANTED = [fault for fault in FAULTS if fault != NONE]
