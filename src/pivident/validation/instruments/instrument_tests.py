"""Tests on the instruments of one identification: relevant, needed, and not contradicted?"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from pivident.validation.instruments.moment_sums import (
    ExtraInstruments,
    kept_equations,
    moment_sums,
)
from pivident.validation.instruments.overidentification import (
    DurbinWuHausmanTest,
    OveridentificationTest,
    exogeneity_test,
    overidentification_test,
)
from pivident.validation.instruments.weak_instruments import RelevanceTest, relevance_test

if TYPE_CHECKING:
    from pivident.estimation.identification import Identification


@dataclass(frozen=True, eq=False)
class InstrumentTests:
    """What is known about the instruments of a result."""

    relevance: RelevanceTest  # whether they explain the regressors
    #: Whether least squares on the same equations differs significantly.
    exogeneity: DurbinWuHausmanTest
    overidentification: OveridentificationTest  # whether further instruments contradict them

    def __str__(self) -> str:
        return "\n".join(
            str(test) for test in (self.relevance, self.exogeneity, self.overidentification)
        )


def instrument_tests(
    identification: Identification, extra: ExtraInstruments | Literal["auto"] = "auto"
) -> InstrumentTests:
    """All tests, from one pass over the equations that were solved last."""
    chosen = further_kind(identification) if extra == "auto" else extra
    sums = moment_sums(identification, chosen)
    names = identification.names
    return InstrumentTests(
        relevance_test(sums, names),
        exogeneity_test(sums, names),
        overidentification_test(sums, names),
    )


def further_kind(identification: Identification) -> ExtraInstruments:
    """Which further instruments a result can have."""
    records = kept_equations(identification).records
    used = identification.instruments
    if used is not None and used.further and records[0].full_rate:
        return "other"
    if used is not None and used.kind != "loop":
        return "delayed"
    recorded = all(r.full_rate and r.kinematics.recording.q_ref is not None for r in records)
    virtual = identification.loop is not None and identification.loop.reference == "smoothed"
    return "reference" if recorded and not virtual else "delayed"
