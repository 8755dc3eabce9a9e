"""What a report is made from, and how much of the signals it can show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.identification import FittedRecording, Identification
from pivident.estimation.parameter_rows import method_labels
from pivident.foundation.document.document import Document
from pivident.judgement.diagnostics.consistent_estimate import NoConsistentEstimate
from pivident.judgement.diagnostics.diagnostics import Diagnostics
from pivident.judgement.diagnostics.summary import Summary
from pivident.judgement.diagnostics.verdict import Verdict, verdict
from pivident.judgement.report.downloads import Download, downloads
from pivident.judgement.report.intervals import ConsistentValue
from pivident.loop.simulation.control_loop import Loop

#: Points of all signals together; a point takes 11 bytes, plotly itself 2 MB.
TOTAL_POINTS = 150_000

#: A trace has at most so many points, which is more than a screen has columns …
MAX_POINTS = 3000

#: … and at least so many; rather than fewer, recordings are left out.
MIN_POINTS = 300

#: Traces of one joint in one recording: two torques, their difference, q twice, dq and ddq.
_TRACES = 7

#: Traces of one joint's fitted simulation: two positions and two errors.
_SIMULATION_TRACES = 4

#: Traces of one joint's control law, and of its reconstructed reference in one recording.
_LOOP_TRACES = 3


@dataclass(frozen=True, eq=False)
class ReportData:
    """Everything that the sections of a report draw on."""

    identifications: tuple[Identification, ...]  # the results, in the order in which they are shown
    truth: Mapping[str, float]  # known values by parameter name, may be empty
    title: str
    diagnostics: Diagnostics
    screen: Summary | None = None  # the verdict on one screen, with the commands of its folder
    designs: tuple[Document, ...] = ()  # accounts of the designed motions that were recorded

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Name of each identification, unique."""
        return method_labels(self.identifications)

    @property
    def fitted(self) -> tuple[str, ...]:
        """Labels of the methods that fit a simulation."""
        pairs = zip(self.labels, self.identifications, strict=True)
        return tuple(label for label, i in pairs if i.simulation is not None)

    @property
    def several(self) -> bool:
        """Whether there is something to compare."""
        return len(self.identifications) > 1

    @cached_property
    def verdict(self) -> Verdict:
        """Which estimate to take, what supports it, and the reservations."""
        return verdict(self.diagnostics)

    @property
    def summary(self) -> Summary | None:
        """The verdict on one screen, with commands where there is a folder of results."""
        return self.screen or self.verdict.summary

    @property
    def recommended(self) -> int:
        """Index of the estimate to take."""
        return list(self.diagnostics.identifications).index(self.verdict.name)

    @cached_property
    def downloads(self) -> tuple[Download, ...]:
        """Files that the page carries; signals are those of the estimate to take."""
        best = self.recommended
        recordings = self.drawn(self.identifications[best].recordings)
        return downloads(self.identifications, self.labels, recordings, best)

    @cached_property
    def loops(self) -> tuple[tuple[Loop, tuple[int, ...]], ...]:
        """Control loops found from the record, each with the methods that simulated it."""
        loops = {id(i.loop): i.loop for i in self.identifications if i.loop and i.loop.found}
        return tuple(
            (loop, tuple(k for k, i in enumerate(self.identifications) if i.loop is loop))
            for loop in loops.values()
        )

    @cached_property
    def nominal(self) -> dict[str, float]:
        """Nominal (CAD) values of base parameters by name, where they are known and not zero."""
        found: dict[str, float] = {}
        for robot in {id(i.robot): i.robot for i in self.identifications}.values():
            base = base_parameters(robot)
            values = base.values(nominal_values(robot, base.standard))
            pairs = zip(base.names, values.tolist(), strict=True)
            found |= {name: value for name, value in pairs if value != 0.0}
        return found

    @cached_property
    def consistent(self) -> dict[str, tuple[ConsistentValue, ...]]:
        """Consistent estimates by parameter."""
        names = list(self.diagnostics.identifications)
        found: dict[str, tuple[ConsistentValue, ...]] = {}
        for name, made in self.diagnostics.consistent.items():
            if isinstance(made, NoConsistentEstimate):
                continue
            columns = zip(
                made.model.names, made.model.theta, made.base.low, made.base.high, strict=True
            )
            for parameter, value, low, high in columns:
                own = ConsistentValue(
                    names.index(name), made.label, float(value), float(low), float(high)
                )
                found[parameter] = (*found.get(parameter, ()), own)
        return found

    @cached_property
    def shown_recordings(self) -> int:
        """How many recordings of each identification have their signals drawn."""
        joints = sum(i.robot.size for i in self.identifications)
        most = max(len(i.recordings) for i in self.identifications)
        return min(most, max(1, TOTAL_POINTS // (MIN_POINTS * _TRACES * joints)))

    @cached_property
    def points(self) -> int:
        """Points per trace."""
        traces = _TRACES * sum(
            i.robot.size * len(self.drawn(i.recordings)) for i in self.identifications
        )
        traces += _SIMULATION_TRACES * sum(
            i.robot.size * len(self.drawn(i.recordings))
            for i in self.identifications
            if i.simulation is not None and i.simulation.fit is not None
        )
        for loop, methods in self.loops:
            user = self.identifications[methods[-1]]
            drawn = len(self.drawn(user.recordings)) if loop.reconstructed else 0
            traces += _LOOP_TRACES * user.robot.size * (drawn + (loop.identified is not None))
        return max(MIN_POINTS, min(MAX_POINTS, TOTAL_POINTS // max(traces, 1)))

    def drawn(self, recordings: tuple[FittedRecording, ...]) -> tuple[FittedRecording, ...]:
        """The recordings whose signals are drawn."""
        return recordings[: self.shown_recordings]

    @property
    def left_out(self) -> tuple[str, ...]:
        """Names of the recordings whose signals are not drawn."""
        names = (
            r.name for i in self.identifications for r in i.recordings[self.shown_recordings :]
        )
        return tuple(dict.fromkeys(names))
