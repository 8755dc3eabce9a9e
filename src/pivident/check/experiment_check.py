"""The check of an experiment file: everything that would spoil an identification, in one go.

file ─▶ robot ─▶ each log: names of columns, audit, motion, reference, gains ─▶ recordings together
─▶ methods, parameters, output ─▶ plan. Nothing is estimated. What fails early does not stop what
can still be looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pivident.audit.audit import Audit, audit_log
from pivident.audit.finding import SEVERITIES, Severity
from pivident.audit.log import Log
from pivident.audit.reading import entry_log, read_columns
from pivident.check.columns_check import check_columns
from pivident.check.file_check import file_problems
from pivident.check.filters_check import check_filters
from pivident.check.geometry_check import check_geometry
from pivident.check.gravity_check import check_gravity
from pivident.check.loop_check import (
    check_gains,
    check_limit,
    check_reference,
    check_stability,
)
from pivident.check.motion_check import check_motion
from pivident.check.plan import Plan, plan_of
from pivident.check.recordings_check import check_recordings
from pivident.check.remark import (
    Place,
    Remark,
    gravest_first,
    grouped,
    of_error,
    of_finding,
    with_line,
)
from pivident.check.robot_check import check_robot
from pivident.check.toml_lines import TomlLines
from pivident.dynamics.base_parameters import base_parameters
from pivident.errors import (
    BadCell,
    ConstantChannel,
    ExperimentError,
    IrregularSampling,
    NonFiniteSamples,
    PividentError,
    SaturatedSignal,
)
from pivident.experiment.experiment import Experiment
from pivident.experiment.recordings import loop_of, recording_of
from pivident.experiment.schema import RecordingEntry
from pivident.recording.recording import Recording
from pivident.recording.timestamps import LOWEST_RATE
from pivident.robot.description import Robot
from pivident.robot.naming import find_joint

#: Errors of the reader that an audit reports with more numbers.
TOLD_BY_AUDIT: dict[type[Exception], tuple[str, ...]] = {
    NonFiniteSamples: ("missing",),
    IrregularSampling: ("duplicate", "backward", "gap", "jitter", "no clock"),
    ConstantChannel: ("constant",),
    SaturatedSignal: ("clipped",),
}


#: Findings after which the gains that a log shows say nothing about those of the file.
CONSEQUENTIAL = ("reach", "speed", "angle unit", "side", "order", "late", "early", "joint late",
                 "constant", "stuck", "clipped")  # fmt: skip

#: Findings after which the geometry cannot be judged.
HIDES_GEOMETRY = (*CONSEQUENTIAL, "sign", "missing", "rate")

#: A declared delay beyond this is in milliseconds [s].
LONGEST_DELAY = 0.5

#: Lines up to which a line of another length means that the whole table is something else.
EARLY = 3


@dataclass(frozen=True, eq=False)
class ExperimentCheck:
    """What was found wrong with an experiment, and what would be done with it.

    Attributes:
        path: the experiment file.
        remarks: everything that was found, the gravest first.
        looked_at: what was checked, in words.
        plan: what an identification would do, or None where it cannot begin.
    """

    path: Path
    remarks: tuple[Remark, ...]
    looked_at: tuple[str, ...]
    plan: Plan | None = None

    @property
    def severity(self) -> Severity:
        """The gravest of the remarks."""
        return max((r.severity for r in self.remarks), key=SEVERITIES.index, default="fine")

    @property
    def refused(self) -> bool:
        """Whether an identification would stop before it has begun."""
        return any(remark.refused for remark in self.remarks)

    def as_json(self) -> dict[str, Any]:
        """Everything as plain values."""
        return {
            "experiment": self.path.name,
            "severity": self.severity,
            "refused": self.refused,
            "remarks": [remark.as_json() for remark in self.remarks],
            "checked": list(self.looked_at),
            "plan": None if self.plan is None else self.plan.as_json(),
        }


def check_experiment(
    path: str | Path,
    robot: str | None = None,
    progress: Callable[[str], None] | None = None,
) -> ExperimentCheck:
    """Say everything that is wrong with an experiment; nothing is estimated.

    Args:
        path: the experiment file.
        robot: gallery name or robot file to check it with, in place of the file's.
        progress: called with one line at each stage.

    Returns:
        The remarks, the gravest first, and what an identification would do.

    Raises:
        ExperimentError: the file cannot be read, or is no TOML.
    """
    say = progress or (lambda line: None)
    path = Path(path)
    say("reading the experiment file")
    text, experiment, remarks = file_problems(path, robot)
    looked_at = ["tables, keys and values of the file"]
    plan = None
    if experiment is not None:
        worker = _Check(experiment, say)
        worker.run()
        remarks += worker.remarks
        looked_at += worker.looked_at
        plan = worker.plan
    lines = TomlLines(text)
    unique = {(r.sentence, r.where): r for r in reversed(remarks)}
    placed = [
        with_line(remark, lines.line(remark.place)) for remark in grouped(reversed(unique.values()))
    ]
    stops = any(remark.refused for remark in placed)
    return ExperimentCheck(
        path, tuple(gravest_first(placed)), tuple(looked_at), None if stops else plan
    )


class _Check:
    """The stages of one check; each adds its remarks."""

    def __init__(self, experiment: Experiment, say: Callable[[str], None]) -> None:
        self.experiment, self.say = experiment, say
        self.content = experiment.content
        self.folder = experiment.path.parent
        self.plain = self.content.model_dump(exclude_unset=True, by_alias=True, warnings=False)
        self.remarks: list[Remark] = []
        self.looked_at: list[str] = []
        self.plan: Plan | None = None
        self.recordings: list[tuple[Place, Recording]] = []
        self.models: list[Audit] = []

    def run(self) -> None:
        """All stages, one after the other."""
        robot = self._robot()
        entries = self._entries()
        for number, (place, entry) in enumerate(entries, start=1):
            self.say(f"looking at log {number} of {len(entries)}")
            self._log(place, entry, robot)
        self._together()
        self.remarks += check_recordings(self.recordings)
        if len(self.recordings) > 1:
            self.looked_at.append("recordings against one another")
        self.say("looking at controller, methods and parameters")
        self._methods_and_plan(robot)

    def _robot(self) -> Robot | None:
        self.say("reading the robot")
        try:
            robot = self.experiment.robot
        except PividentError as error:
            self.remarks.append(of_error(error, "robot", ("robot",), self.plain))
            return None
        self.remarks += check_robot(robot, self.content.robot.model)
        self.looked_at.append(
            f"robot {robot.name}: {robot.size} joint(s), limits, masses, inertias, gravity"
        )
        return robot

    def _entries(self) -> list[tuple[Place, RecordingEntry]]:
        """Every table of a recording with its place."""
        content = self.content
        listed: list[tuple[Place, Iterable[RecordingEntry]]] = [
            (("recording",), content.recording),
            (("validation", "recording"), content.validation.recording),
            (("gains", "recording"), content.gains.recording),
        ]
        if content.payload is not None:
            listed.append((("payload", "recording"), content.payload.recording))
        return [((*place, k), entry) for place, own in listed for k, entry in enumerate(own)]

    def _log(self, place: Place, entry: RecordingEntry, robot: Robot | None) -> None:
        """Everything about one log, read strictly and read forgivingly."""
        before = len(self.remarks)
        if entry.columns is not None:
            columns = entry.columns.model_dump(exclude_unset=True)
            units = entry.units.model_dump(exclude_unset=True)
            self.remarks += check_columns(columns, units, robot, place)
        failure: PividentError | None = None
        if robot is not None:
            try:
                recording = recording_of(entry, robot, self.folder)
                self.recordings.append((place, recording))
            except PividentError as error:
                failure = error
        try:
            log = entry_log(entry, robot, self.folder)
        except PividentError as error:
            self.remarks.append(of_error(failure or error, "recording", place, self.plain))
            return
        if isinstance(failure, BadCell) and failure.column is None and failure.line <= EARLY:
            self.remarks.append(of_error(failure, "recording", place, self.plain))
            return  # the columns are not what they are called
        audit = audit_log(log)
        own = [of_finding(f, place) for f in audit.findings if f.severity != "fine"]
        if failure is not None and not _told(failure, audit):
            self.remarks.append(of_error(failure, "recording", place, self.plain))
        elif failure is not None:
            kinds = _kinds(failure)
            own = [replace(r, refused=True) if r.kind in kinds else r for r in own]
        self.remarks += own
        if audit.model is not None:
            if place[0] == "recording":
                self.models.append(audit)
            if not any(f.severity == "wrong" and f.kind in HIDES_GEOMETRY for f in audit.findings):
                self.remarks += check_geometry(log, audit.timing, audit.model, place)
        slow = entry.rate is not None and entry.rate < LOWEST_RATE
        if entry.delay is not None and abs(entry.delay) > LONGEST_DELAY:
            self.remarks.append(_long_delay(entry.delay, place))
        if slow:
            self.remarks.append(_no_rate(float(entry.rate or 0.0), place))
        if not slow and not any(f.kind in ("rate", "no clock") for f in audit.of("timing")):
            self.remarks += self._motion(log, audit, place, entry)
        name = log.name if entry.part is None else f"{log.name} ({entry.part[0]:g} s on)"
        if len(self.remarks) == before or robot is not None:
            rate = f" at {audit.timing.rate:.6g} Hz" if audit.timing.rate else ""
            judged = "" if audit.model is None else ", signs, gains, delay, excitation"
            self.looked_at.append(
                f"{name}: {log.samples} samples{rate}; clock, gaps, units, columns, limits{judged}"
            )

    def _motion(self, log: Log, audit: Audit, place: Place, entry: RecordingEntry) -> list[Remark]:
        """What the channels say about one another, and about the controller."""
        parameters = 0 if log.robot is None else len(base_parameters(log.robot))
        found = check_motion(self._with_other_columns(log, entry), audit.timing, parameters, place)
        found += check_reference(log, place)
        controller = self.content.controller
        wrong = any(r.severity == "wrong" for r in found)
        wrong |= any(f.severity == "wrong" and f.kind in CONSEQUENTIAL for f in audit.findings)
        if controller is not None:
            found += check_limit(log, controller)
        if controller is not None and controller.kp is not None and not wrong:
            reversed_joints = () if audit.power is None else audit.power.reversed
            found += check_gains(log, audit.timing, controller, reversed_joints, place)
            if entry.columns is None or not entry.columns.inputs:
                found += check_gravity(log, audit.timing, controller)
        return found

    def _with_other_columns(self, log: Log, entry: RecordingEntry) -> Log:
        """The log with the columns of its file that the experiment does not use."""
        if not isinstance(entry.files, str) or entry.columns is None:
            return log
        used = str(entry.columns.model_dump(exclude_unset=True))
        try:
            every = read_columns(self.folder / entry.files)
        except PividentError:
            return log
        rest = {name: x for name, x in every.items() if repr(name) not in used}
        return replace(log, columns=rest)

    def _together(self) -> None:
        """Excitation belongs to all fitted recordings, not to each."""
        fitted = [a.model for a in self.models if a.model is not None]
        if len(fitted) < 2:
            return
        from pivident.audit.excitation import check_excitation

        self.remarks = [r for r in self.remarks if r.check != "excitation"]
        together = check_excitation(fitted).findings
        self.remarks += [of_finding(f, ()) for f in together if f.severity != "fine"]

    def _methods_and_plan(self, robot: Robot | None) -> None:
        """Methods, parameters, loop and output, and what would be done."""
        experiment, content = self.experiment, self.content
        methods = {}
        try:
            methods = experiment.methods()
        except PividentError as error:
            self.remarks.append(self._refused(error, ("identify", "methods")))
        self._output()
        self.remarks += check_filters(methods, [r for _, r in self.recordings])
        if robot is None:
            return
        self._joints(robot)
        try:
            experiment.consistency()
        except PividentError as error:
            self.remarks.append(self._refused(error, ("consistency",)))
        fitted = [r for place, r in self.recordings if place[0] == "recording"]
        unseen = [r for place, r in self.recordings if place[0] == "validation"]
        problem = self._problem(robot, fitted)
        self.looked_at.append("methods, parameters, control law, folder of the results")
        if problem is None or not methods:
            return
        law = content.controller
        self.plan = plan_of(
            problem,
            methods,
            unseen,
            content.validation.folds,
            "" if law is None else law.type,
            "" if law is None else law.source,
        )

    def _joints(self, robot: Robot) -> None:
        """Joints that other tables name."""
        load, known = self.content.payload, self.content.gains.payload
        for table, joint in (
            (("payload", "link"), None if load is None else load.link),
            (("gains", "payload", "joint"), None if known is None else known.joint),
        ):
            names = (*robot.joint_names, *(link.name for link in robot.links))
            try:
                if joint is not None and joint not in names:
                    find_joint(robot.joint_names, joint)
            except PividentError as error:
                self.remarks.append(self._refused(error, table))

    def _problem(self, robot: Robot, fitted: list[Recording]) -> Any:
        """The problem that would be identified, without a law that has to be found first."""
        from pivident.estimation.problem import Problem

        given, law = self.content.identify, self.content.controller
        loop = None
        if law is not None and law.type != "identify" and law.source != "reconstruct":
            try:
                recordings = tuple(fitted)
                if recordings or law.type != "virtual_pd":
                    _, loop = loop_of(law, robot, recordings)
                    loop.controller.check(robot.size)
            except PividentError as error:
                self.remarks.append(self._refused(error, ("controller",)))
                loop = None
            else:
                self._stability(robot, fitted)
        if not fitted:
            self._parameters(robot)
            return None
        try:
            return Problem(
                robot,
                tuple(fitted),
                loop,
                parameters=None if given.parameters is None else tuple(given.parameters),
                mask=given.mask,
                initial=given.initial,
            )
        except PividentError as error:
            key = "initial" if given.parameters is None else "parameters"
            self.remarks.append(self._refused(error, ("identify", key)))
            return None

    def _parameters(self, robot: Robot) -> None:
        """Names of parameters, where no recording can be read."""
        from pivident.estimation.problem import parameter_index

        given = self.content.identify
        base = base_parameters(robot)
        for key, names in (("parameters", given.parameters or ()), ("initial", given.initial)):
            for name in names:
                try:
                    parameter_index(base, name)
                except PividentError as error:
                    self.remarks.append(self._refused(error, ("identify", key)))

    def _stability(self, robot: Robot, fitted: list[Recording]) -> None:
        law = self.content.controller
        if law is None or law.kp is None or not fitted:
            return
        first = fitted[0]
        rate = first.control_rate or first.rate
        if rate < LOWEST_RATE:
            return
        self.remarks += check_stability(robot, law, rate, np.mean(first.q, axis=0))

    def _refused(self, error: Exception, table: Place) -> Remark:
        """An error about the file's own tables; its path in front is left out."""
        text = " ".join(str(error).split())
        head, separator, tail = text.partition(": ")
        own = tail if separator and head.endswith(".toml") else text
        return of_error(ExperimentError(own), "file", table, self.plain)

    def _output(self) -> None:
        from pivident.files import check_output

        folder = self.experiment.output or Path(f"{self.experiment.path.stem}-results")
        try:
            check_output(folder)
        except PividentError as error:
            self.remarks.append(self._refused(error, ("output", "folder")))


def _long_delay(delay: float, place: Place) -> Remark:
    """A declared delay that no logger has."""
    return Remark(
        "wrong",
        "timing",
        "delay",
        f"The torque is declared to be {delay:g} s late.",
        f"delay is in seconds; {delay:g} ms are {1e-3 * delay:g}.",
        "tau",
        (*place, "delay"),
    )


def _no_rate(rate: float, place: Place) -> Remark:
    """A declared rate that no log has."""
    return Remark(
        "wrong",
        "timing",
        "rate",
        f"The rate is {rate:g} Hz, which no robot's log has.",
        "It may be a period in seconds, or a rate in kHz; rate is in Hz.",
        "",
        (*place, "rate"),
    )


def _kinds(failure: PividentError) -> tuple[str, ...]:
    """Kinds of findings that say the same as an error of the reader."""
    own = next((k for c, k in TOLD_BY_AUDIT.items() if isinstance(failure, c)), ())
    return (*own, "reach") if "far beyond its limits" in str(failure) else own


def _told(failure: PividentError, audit: Audit) -> bool:
    """Whether the audit says what the reader refused."""
    kinds = _kinds(failure)
    return any(f.kind in kinds and f.severity == "wrong" for f in audit.findings)
