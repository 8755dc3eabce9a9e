"""The check of an experiment file: everything that would stop or bias an identification, in one go.

file ─▶ robot ─▶ each log: names of columns, audit, motion, reference, gains ─▶ recordings together
─▶ methods, parameters, output ─▶ plan. Nothing is estimated. What fails early does not stop what
can still be looked at.

Recordings are also asked about one another: the same run twice, held-out motion that is fitted.

Lines of keys in a TOML text.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from tomlkit.items import Array, InlineTable, Item, Key

from pivident.data.recording.recording import Recording
from pivident.experiment.check.audit_file import excited_together
from pivident.experiment.check.file_check import file_problems
from pivident.experiment.check.log_check import check_log
from pivident.experiment.check.plan import Plan
from pivident.experiment.check.problem_check import ProblemCheck
from pivident.experiment.check.remark import Remark, gravest_first, of_error, of_finding
from pivident.experiment.check.robot_check import check_robot
from pivident.experiment.experiment import Experiment
from pivident.experiment.file_keys import RecordingEntry
from pivident.experiment.file_lines import file_lines, numbered
from pivident.foundation.common_work import work_in_common
from pivident.foundation.errors import PividentError
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.finding import Finding, FindingKind, Severity, Topic, merged, worst
from pivident.foundation.text.plain_values import plain
from pivident.foundation.text.repair import Edit, Place, Repair
from pivident.foundation.text.sentences import listed, plural
from pivident.foundation.text.toml import behind_dots, keys_in, tables, toml_document
from pivident.foundation.threads import linear_algebra_in_one_thread
from pivident.judgement.audit.audit import Audit
from pivident.judgement.audit.standstill import STANDSTILL
from pivident.judgement.audit.timing import MISSING_SAMPLES
from pivident.robot.description import Robot


@dataclass(frozen=True, eq=False)
class ExperimentCheck(Displayed):
    """What was found wrong with an experiment, and what would be done with it.

    Attributes:
        path: the experiment file.
        remarks: everything that was found, the gravest first.
        looked_at: what was checked, in words.
        plan: what an identification would do, or None where it cannot begin. Where nothing but
            gaps in the clock stops it, what it would do with the stretches between them.
        audits: of the logs that are fitted, as far as they can be read, as `audit_file` has them.
    """

    path: Path
    remarks: tuple[Remark, ...]
    looked_at: tuple[str, ...]
    plan: Plan | None = None
    audits: tuple[Audit, ...] = ()

    @property
    def severity(self) -> Severity:
        """The gravest of the remarks."""
        return worst(self.remarks)

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
            "plan": plain(self.plan),
        }


def check_experiment(
    path: str | Path, robot: str | None = None, progress: Callable[[str], None] | None = None
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
    plan: Plan | None = None
    audits: tuple[Audit, ...] = ()
    if experiment is not None:
        worker = _Check(experiment, say)
        with linear_algebra_in_one_thread():
            worker.run()
        remarks += worker.remarks
        looked_at += worker.looked_at
        plan, audits = worker.plan, tuple(worker.audits)
    lines = TomlLines(text)
    unique = {(r.message, r.subject): r for r in reversed(remarks)}
    placed = [
        replace(remark, line=lines.line(remark.place))
        for remark in merged(reversed(unique.values()))
    ]
    stops = any(remark.refused and remark.kind != MISSING_SAMPLES.name for remark in placed)
    found = tuple(gravest_first(placed))
    return ExperimentCheck(path, found, tuple(looked_at), None if stops else plan, audits)


class _Check:
    """The stages of one check; each adds its remarks."""

    def __init__(self, experiment: Experiment, say: Callable[[str], None]) -> None:
        self.experiment, self.say = experiment, say
        self.content = experiment.content
        self.folder = experiment.path.parent
        self.remarks: list[Remark] = []
        self.looked_at: list[str] = []
        self.plan: Plan | None = None
        self.recordings: list[tuple[Place, Recording]] = []
        self.audits: list[Audit] = []

    def run(self) -> None:
        """All stages, one after the other."""
        robot = self._robot()
        entries = self._entries()
        for number, (place, entry) in enumerate(entries, start=1):
            self.say(f"looking at log {number} of {len(entries)}")
            self._log(place, entry, robot)
        self._together()
        self.remarks += map(of_finding, check_recordings(self.recordings))
        if len(self.recordings) > 1:
            self.looked_at.append("recordings against one another")
        self.say("looking at controller, methods and parameters")
        rest = ProblemCheck(self.experiment, robot, self.recordings)
        self.remarks = [*_refused_standstill(self.remarks, rest.motionless), *rest.remarks]
        self.plan = rest.plan
        if robot is not None:
            self.looked_at.append("methods, parameters, control law, folder of the results")

    def _robot(self) -> Robot | None:
        self.say("reading the robot")
        try:
            robot = self.experiment.robot
        except PividentError as error:
            self.remarks.append(of_error(error, "robot", ("robot",)))
            return None
        self.remarks += map(of_finding, check_robot(robot, self.content.robot.model))
        joints = robot.on_fixed_base.size
        self.looked_at.append(
            f"robot {robot.name}: {plural(joints, 'joint')}, limits, masses, inertias, gravity"
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
        """Everything about one log."""
        controller = self.content.controller
        with work_in_common():  # base parameters and regressors once for a robot
            found = check_log(entry, place, robot, self.folder, controller)
        self.remarks += found.remarks
        self.recordings += [(place, recording) for recording in found.recordings]
        if found.audit is not None and place[0] == "recording":
            self.audits.append(found.audit)
        if found.looked_at:
            self.looked_at.append(found.looked_at)

    def _together(self) -> None:
        """Excitation belongs to all fitted recordings, not to each."""
        self.audits = list(excited_together(self.audits))
        models = [audit for audit in self.audits if audit.model is not None]
        if len(models) < 2 or models[0].excitation is None:
            return
        self.remarks = [r for r in self.remarks if r.topic != "excitation"]
        said = models[0].excitation.findings
        self.remarks += [of_finding(f) for f in said if f.severity != "ok"]


TOO_SLOW = FindingKind(STANDSTILL.topic, "too slow", STANDSTILL.place, stops=True)


def _refused_standstill(remarks: Sequence[Remark], motionless: Sequence[str]) -> list[Remark]:
    """The remarks, with what an identification says of joints that it has no row of."""
    if not motionless:
        return list(remarks)
    if any(remark.declared is STANDSTILL for remark in remarks):
        return [replace(r, refused=r.refused or r.declared is STANDSTILL) for r in remarks]
    move = "moves" if len(motionless) == 1 else "move"
    text = (
        f"Too slow: {listed(motionless)} never {move} faster than the low-speed mask, which leaves "
        "no row to fit."
    )
    step = (
        "Log faster motion, or freeze the joint (URDF) and leave its columns out; a smaller mask "
        "under [identify] keeps slow rows, where friction obeys no law."
    )
    return [*remarks, of_finding(TOO_SLOW.finding("error", text, motionless[0], step))]


#: What this check looks at.
RECORDINGS = Topic("recordings")

SAME_RUN = FindingKind(RECORDINGS, "same run")
RATES = FindingKind(RECORDINGS, "rates")

#: What tables of recordings are for, by the table's first key.
PURPOSE = {"validation": "judged on", "payload": "with the load", "gains": "with the payload"}


def check_recordings(recordings: Sequence[tuple[Place, Recording]]) -> Iterator[Finding]:
    """Runs that appear twice, and runs of different rates."""
    for k, (place, second) in enumerate(recordings):
        for other, first in recordings[:k]:
            if not _same_motion(first, second):
                continue
            here, there = _table(place), _table(other)
            purpose = PURPOSE.get(str(place[0]))
            step = "It counts twice, and all intervals come out too narrow; remove one of them."
            if place[0] == "validation" != other[0]:
                step = (
                    "Fitted motion cannot validate the estimate; name another file, or "
                    "another part of this one."
                )
            elif purpose is not None and place[0] != other[0]:
                step = f"The record {purpose} must be another run; name its file."
            yield SAME_RUN.finding(
                "error",
                f"{here} is the same motion as {there} ({', '.join(_files(second))}).",
                second.name,
                step,
                place=(*place, "files"),
                repairs=[Repair((Edit(place),), "Remove this run.")],
            )
            break
    rates = {recording.rate for _, recording in recordings}
    if len(rates) > 1 and max(rates) > 1.5 * min(rates):
        listed = ", ".join(f"{r.name} {r.rate:.5g} Hz" for _, r in recordings)
        yield RATES.finding(
            "warning",
            f"The recordings have different rates: {listed}.",
            next_step="This is allowed; check that all come from the same loop.",
            place=(*recordings[-1][0], "rate"),
        )


def _same_motion(first: Recording, second: Recording) -> bool:
    """Whether two recordings share samples: parts of one file that overlap, or copies of it."""
    if first.joint_names != second.joint_names:
        return False
    if _files(first) == _files(second) and {s.sha256 for s in first.sources} == {
        s.sha256 for s in second.sources
    }:
        start = max(first.start_time, second.start_time)
        return start < min(r.start_time + r.duration for r in (first, second))
    shorter = min(first.samples, second.samples)
    return np.allclose(first.q[:shorter], second.q[:shorter], rtol=0.0, atol=1e-12)


def _files(recording: Recording) -> list[str]:
    return [source.name for source in recording.sources] or [recording.name]


def _table(place: Place) -> str:
    names = ".".join(str(p) for p in place if not isinstance(p, int))
    number = next((p for p in place if isinstance(p, int)), 0)
    return f"[[{names}]] {number + 1}"


#: A character that stands in no TOML text.
_MARK = "\0"


class TomlLines:
    """Where the keys of a TOML text stand; nowhere in one that `tomlkit` would reorder.

    The number of its place is written behind each key and header, and found in the text.
    """

    def __init__(self, text: str) -> None:
        self._rows: dict[Place, int] = {}
        try:
            document = toml_document(text, to_write=True)
        except ValueError:
            return
        places: list[Place] = []
        for line in file_lines(document):
            _, body, number = behind_dots(line.body, line.number)
            for place, key in _keys(line.place, *body[number]):
                key.sep += f"{_MARK}{len(places)}{_MARK}"
                places.append(place)
        for place, element in tables(document.body):
            element.trivia.comment_ws += f"{_MARK}{len(places)}{_MARK}"
            places.append(place)
        row = 1
        for k, part in enumerate(document.as_string().split(_MARK)):
            if k % 2:
                self._rows.setdefault(numbered(places[int(part)]), row)
            row += part.count("\n")

    def line(self, place: Sequence[int | str]) -> int | None:
        """Line of a place, or of the nearest table around it, counted from 1; None without one."""
        around = (numbered(place[:length]) for length in range(len(place), 0, -1))
        return next((self._rows[place] for place in around if place in self._rows), None)


def _keys(place: Place, key: Key | None, item: Item) -> Iterator[tuple[Place, Key]]:
    """A key and those inside of its value."""
    if key is not None:
        yield place, key
    if isinstance(item, InlineTable):
        for parts, inner, value in keys_in(item):
            yield from _keys((*place, *parts), inner, value)
    elif isinstance(item, Array):
        for number, entry in enumerate(item):
            yield from _keys((*place, number), None, entry)
