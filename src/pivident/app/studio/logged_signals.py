"""From an experiment file to the signals of its logs, whatever is wrong with either.

A log is shown as the file describes it: SI, on the joint side, with its NaN and gaps. Where the
description does not hold, its columns are shown as they stand in the file, with the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pivident.app.studio.arm_picture import Swept, motion_of, sweep
from pivident.app.studio.signals import SIGNALS, write_channel, write_times
from pivident.data.logs.file_columns import read_columns
from pivident.data.logs.log import CHANNELS, Log
from pivident.data.logs.recognition.log_clock import clocks_in, is_clock
from pivident.data.logs.timestamps import mean_rate
from pivident.experiment.check.file_check import file_problems
from pivident.experiment.experiment import Experiment
from pivident.experiment.explained import plain_form, toml_content
from pivident.experiment.file_keys import RecordingEntry
from pivident.experiment.recording_tables import log_of
from pivident.foundation.errors import PividentError
from pivident.foundation.text.plain_values import plain, write_json
from pivident.foundation.text.repair import Place
from pivident.robot.description import Robot
from pivident.robot.gallery import load_robot
from pivident.robot.naming import ROBOT_FILES

#: What channels are called.
TITLES = {
    "q": "position",
    "dq": "speed",
    "tau": "torque",
    "q_ref": "reference position",
    "dq_ref": "reference speed",
    "ddq_ref": "reference acceleration",
}

#: Content of the moving picture.
MOTION = "motion.json"

#: Gaps in the clock that are listed: more than so many intervals and so long [s], the longest ones.
GAP, SHORTEST_GAP, MAX_GAPS = 3.0, 0.01, 200


class _Folder:
    """A folder of signals as it is filled."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.recordings: list[dict[str, Any]] = []
        self.channels: dict[str, dict[str, Any]] = {}
        self.joints: list[dict[str, str]] = []
        self.moved: list[Swept] = []

    def add(self, about: dict[str, Any], t: np.ndarray) -> int:
        """A recording; returns its number."""
        number = len(self.recordings)
        self.recordings.append(about | {"missing": {}})
        write_times(self.folder, number, t)
        return number

    def add_channel(
        self, number: int, name: str, title: str, labels: dict[str, str], values: np.ndarray
    ) -> None:
        """A channel of a recording; ``labels``: unit of each line by its name."""
        known = {"name": name, "title": title, "lines": list(labels), "units": [*labels.values()]}
        self.channels.setdefault(name, known | {"recordings": []})["recordings"].append(number)
        missing = (~np.isfinite(values)).sum(axis=0)
        self.recordings[number]["missing"][name] = missing.tolist()
        write_channel(self.folder, number, name, values)

    def write(self, robot: Robot | None, notes: Iterable[str]) -> None:
        """What the arrays are, and the moving picture."""
        content = {
            "recordings": self.recordings,
            "joints": self.joints,
            "channels": list(self.channels.values()),
            "notes": list(notes),
            "error": "",
        }
        write_json(self.folder / SIGNALS, plain(content))
        picture: dict[str, Any] = {"error": "There is no robot that can be drawn."}
        if robot is not None:
            fixed = robot.on_fixed_base
            picture = (
                motion_of(robot, self.moved) if self.moved else motion_of(fixed, [sweep(fixed)])
            )
            picture["logged"] = bool(self.moved)
        write_json(self.folder / MOTION, plain(picture))


def write_signals(experiment: Path, folder: Path, say: Callable[[str], None]) -> None:
    """Write ``signals.json``, the arrays and ``motion.json``; what is wrong stands in the first.

    Args:
        experiment: the experiment file.
        folder: an empty one.
        say: called with one line at each stage.
    """
    say("reading the experiment file")
    try:
        _, checked, _ = file_problems(experiment)
        content = plain_form(toml_content(experiment))
    except PividentError as error:
        write_json(folder / SIGNALS, {"error": _line(error)})
        write_json(folder / MOTION, {"error": _line(error)})
        return
    filled, notes = _Folder(folder), list[str]()
    robot: Robot | None = None
    try:
        say("reading the robot")
        robot = checked.robot if checked is not None else _robot_alone(content, experiment.parent)
    except PividentError as error:
        notes.append(_line(error))
    fixed = None if robot is None else robot.on_fixed_base
    if fixed is not None:
        filled.joints = [
            {"name": j.name, "unit": j.position_unit, "torque_unit": j.torque_unit}
            for j in fixed.joints
        ]
    entries = list(_tables(checked)) if checked is not None else []
    for place, entry in entries:
        say(f"reading log {len(filled.recordings) + 1} of {len(entries)}")
        _add_log(filled, place, entry, robot, experiment.parent)
    if checked is None:
        for place, files in _named_files(content):
            _add_columns(filled, place, experiment.parent, files, "its table cannot be read yet")
    filled.write(fixed, notes)


def _robot_alone(content: dict[str, Any], folder: Path) -> Robot | None:
    """The robot of a content that the schema refuses, as long as there is no log for instance."""
    table = content.get("robot")
    model = table.get("model") if isinstance(table, dict) else None
    if not isinstance(model, str):
        return None
    return load_robot(folder / model if model.endswith(ROBOT_FILES) else model)


def _tables(experiment: Experiment) -> Iterator[tuple[Place, RecordingEntry]]:
    """Every table of a recording with its place."""
    content = experiment.content
    payload = [] if content.payload is None else content.payload.recording
    for table, entries in (
        (("recording",), content.recording),
        (("validation", "recording"), content.validation.recording),
        (("gains", "recording"), content.gains.recording),
        (("payload", "recording"), payload),
    ):
        for number, entry in enumerate(entries):
            yield (*table, number), entry


def _named_files(content: dict[str, Any]) -> Iterator[tuple[Place, Any]]:
    """Files of the recordings in a content that the schema refuses."""
    listed = content.get("recording")
    for number, entry in enumerate(listed if isinstance(listed, list) else []):
        if isinstance(entry, dict) and "files" in entry:
            yield ("recording", number), entry["files"]


def _add_log(
    filled: _Folder,
    place: Place,
    entry: RecordingEntry,
    robot: Robot | None,
    folder: Path,
) -> None:
    """One log as its table describes it, or its bare columns."""
    try:
        log = log_of(entry.model_copy(update={"part": None}), robot, folder)
    except PividentError as error:
        _add_columns(filled, place, folder, entry.files, _line(error))
        return
    if not log.channels:
        _add_columns(filled, place, folder, entry.files, "it has no channel of the joints")
        return
    t, clock = display_times(log.clock, log.rate, max(map(len, log.channels.values())))
    part = None if entry.part is None else (entry.part[0], entry.part[1])
    note = " ".join(map(_line, log.faults))
    number = filled.add(_about(log.name, place, t, clock, log.clock, note, part), t)
    fixed = None if robot is None else robot.on_fixed_base
    for name in CHANNELS:
        if name in log.channels:
            labels = _labels(name, log, fixed)
            filled.add_channel(number, name, TITLES[name], labels, log.channels[name])
    q = log.channels.get("q")
    if fixed is not None and q is not None and q.shape[1] == fixed.size and len(q) == len(t):
        filled.moved.append(Swept(log.name, t, q))
        filled.recordings[number]["motion"] = len(filled.moved) - 1


def _labels(channel: str, log: Log, robot: Robot | None) -> dict[str, str]:
    """Unit of each line of a channel by the name of its joint."""
    joints = log.channels[channel].shape[1]
    names = [*log.joint_names, *(f"joint_{j + 1}" for j in range(joints))][:joints]
    after = {"q": "", "q_ref": "", "ddq_ref": "/s²"}.get(channel, "/s")
    units = []
    for j, _ in enumerate(names):
        known = robot is not None and j < robot.size
        position = robot.joints[j].position_unit if robot is not None and known else "rad"
        torque = robot.joints[j].torque_unit if robot is not None and known else "N m"
        torque = "command" if j in log.commands else torque
        units.append(torque if channel == "tau" else f"{position}{after}")
    return dict(zip(names, units, strict=True))


def _add_columns(filled: _Folder, place: Place, folder: Path, files: Any, reason: str) -> None:
    """The columns of the files of a log as they are."""
    listed = files.values() if isinstance(files, dict) else [files]
    for name in listed:
        try:
            columns = read_columns(folder / str(name))
        except (PividentError, OSError) as error:
            about = {"name": str(name), "samples": 0, "table": place, "note": _line(error)}
            filled.add(about | {"described": False}, np.zeros(0))
            continue
        stamps = {n: v for n, v in columns.items() if is_clock(n, v)}
        clock = next(iter(clocks_in(stamps, None)[0].values()), None)
        t, kind = display_times(clock, None, len(next(iter(columns.values()))))
        about = _about(str(name), place, t, kind, clock, reason, None)
        number = filled.add(about | {"described": False}, t)
        numbers = {c["title"]: c["name"] for c in filled.channels.values()}
        for column, values in columns.items():
            own = numbers.setdefault(column, f"column.{len(numbers)}")
            filled.add_channel(number, own, column, {column: ""}, values[:, None])


def _about(
    name: str,
    place: Place,
    t: np.ndarray,
    kind: str,
    clock: np.ndarray | None,
    note: str,
    part: tuple[float, float] | None,
) -> dict[str, Any]:
    """What is said of a recording."""
    start, stop = (float(t[0]), float(t[-1])) if t.size else (0.0, 0.0)
    excluded = (
        [] if part is None else [[a, b] for a, b in ((start, part[0]), (part[1], stop)) if b > a]
    )
    rate = None
    if kind != "samples" and t.size > 1 and stop > start:
        rate = mean_rate(t) if kind == "stamps" else (t.size - 1) / (stop - start)
    return {
        "name": name,
        "table": place,
        "samples": int(t.size),
        "start": start,
        "duration": stop - start,
        "rate": rate,
        "clock": kind,
        "gaps": [] if clock is None or kind != "stamps" else _gaps(t),
        "excluded": excluded,
        "described": True,
        "note": note,
    }


def display_times(
    clock: np.ndarray | None, rate: float | None, samples: int
) -> tuple[np.ndarray, str]:
    """Times that never go backward [s], and what they are.

    ``stamps``: those of the log, single missing ones interpolated; ``even``: at equal intervals,
    from the rate or since stamps go back; ``samples``: numbers of samples.
    """
    k = np.arange(samples, dtype=float)
    if clock is None or len(clock) != samples or np.isfinite(clock).sum() < 2:
        return (k / rate, "even") if rate else (k, "samples")
    seen = np.isfinite(clock)
    t = clock if seen.all() else np.interp(k, k[seen], clock[seen])
    steps = np.diff(t)
    forward = steps[steps > 0]
    interval = float(np.median(forward)) if forward.size else 0.0
    if (steps < -GAP * interval).any() or not interval:
        return t[0] + k * (interval or 1.0), "even" if interval else "samples"
    return np.maximum.accumulate(t), "stamps"


def _gaps(t: np.ndarray) -> list[list[float]]:
    """First and last time of the longest gaps, in order of time [s]."""
    steps = np.diff(t)
    usual = float(np.median(steps)) if steps.size else 0.0
    wide = np.flatnonzero(steps > max(GAP * usual, SHORTEST_GAP))
    longest = np.sort(wide[np.argsort(-steps[wide])][:MAX_GAPS])
    return [[float(t[k]), float(t[k + 1])] for k in longest]


def _line(error: BaseException) -> str:
    """An error in one line."""
    return " ".join(str(error).split())
