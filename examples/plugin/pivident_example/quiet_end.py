"""A finding with its repair: a record that goes on long after its motion."""

from __future__ import annotations

import numpy as np

from pivident.foundation.text.finding import FindingKind, Quantity, Topic
from pivident.foundation.text.repair import setting
from pivident.judgement.audit.examination import Examination, LogCheck

#: Longest rest at the end [s], and speed below which an arm rests, as share of its fastest.
LONGEST, REST = 2.0, 1e-3

QUIET_END = FindingKind(Topic("rest", "Rest at the end"), "quiet end", place=("recording", "part"))


class QuietEnd(LogCheck):
    """The rest behind the last motion."""

    name = "quiet end"

    def examine(self, seen: Examination) -> Examination:
        """Say how long the arm rests, and where the recording would end without that."""
        step = np.abs(np.diff(seen.log.channels["q"], axis=0))
        last = int(np.flatnonzero((step > REST * step.max(axis=0)).any(axis=1))[-1])
        rest = (len(step) - last) / seen.timing.rate
        if rest < LONGEST or seen.log.clock is None:
            return seen
        first, stop = (round(float(seen.log.clock[k]), 3) for k in (0, last))
        finding = QUIET_END.finding(
            "warning",
            f"The arm rests for the last {rest:.3g} s of the record.",
            next_step=f"Set part = [{first}, {stop}] under [recording].",
            evidence={"rest": Quantity(rest, "s", bound=LONGEST)},
            repairs=[setting("part", value=[first, stop])],
        )
        return seen.after(self.name, [finding])
