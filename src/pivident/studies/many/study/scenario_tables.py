"""Tables of a scenario: robot, motions, methods, conditions, and the hash of all of them.

Motions of a scenario.

An optimised motion is found once, kept beside the results and sent to all workers.
"""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from pivident.dynamics.base_parameters import base_parameters
from pivident.foundation.codec import decode
from pivident.foundation.errors import ExperimentError
from pivident.foundation.files import regular_file
from pivident.foundation.options import per_joint
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.plain_values import plain
from pivident.loop.simulation import excitation
from pivident.loop.simulation.excitation import FourierSeries, motion_limits, random_series
from pivident.loop.simulation.reference import point_to_point, trapezoidal_moves
from pivident.robot.naming import ROBOT_FILES, nearest
from pivident.studies.many.batch.batch_errors import StudyFolderError

if TYPE_CHECKING:
    from pivident.estimation.method import Method
    from pivident.robot.description import Robot
    from pivident.studies.many.study.scenario_keys import ScenarioFile, TrajectoryEntry

#: Keys for the amount of work, not its content: they may change from one call to the next.
AMOUNTS = ("runs", "description")
#: File of the motion in a results folder.
FILE = "trajectory.json"
#: Default for the largest distance of postures from zero [rad or m].
DEFAULT_REACH = 1.0
#: Number of postures of a point-to-point motion: a constant, and one per this time [s].
POSTURES, MIN_MOVE = 12, 0.6
#: Motions optimised by this process: conditions of one scenario often share theirs.
_found: dict[str, FourierSeries] = {}


@dataclass(frozen=True, eq=False)
class ScenarioTables(Displayed):
    """The tables of a scenario, or of one condition of it, with the objects that they describe."""

    name: str  # name of the scenario
    plain: dict[str, Any]  # its tables as plain values, short forms written out, without ``vary``
    source: str  # file it was read from; paths in it are relative to its folder
    # tables of ``vary`` by group and alternative
    alternatives: Mapping[str, Mapping[str, Mapping[str, Any]]]
    condition: str = ""  # name of the condition, empty without ``vary``

    @property
    def title(self) -> str:
        """Name with the condition."""
        return f"{self.name}/{self.condition}" if self.condition else self.name

    @cached_property
    def content(self) -> ScenarioFile:
        """The tables as checked objects."""
        from pivident.experiment.explained import checked
        from pivident.studies.many.study.scenario_keys import ScenarioFile

        with file_named(self.source):
            return checked(self.plain, ScenarioFile)

    @cached_property
    def robot(self) -> Robot:
        """The robot."""
        from pivident.experiment.explained import errors_name
        from pivident.experiment.robot_table import robot_of

        with errors_name(Path(self.source), "[robot]"):
            return robot_of(self.content.robot, Path(self.source).parent)

    @cached_property
    def methods(self) -> dict[str, Method]:
        """Methods with the scenario's options, by name."""
        from pivident.experiment.identify_table import method_of

        names = self.content.identify.methods or ["ls", "iv", "iv-full-rate", "piv"]
        with file_named(self.source):
            return {name: method_of(name, self.content.identify) for name in names}

    @property
    def conditions(self) -> tuple[Self, ...]:
        """All conditions of the scenario; itself without ``vary``."""
        if not self.alternatives:
            return (self,)
        made = []
        for chosen in itertools.product(*(group.items() for group in self.alternatives.values())):
            plain = self.plain
            for _, changes in chosen:
                plain = merged(plain, changes)
            name = "-".join(name for name, _ in chosen)
            made.append(type(self)(self.name, short_forms(plain), self.source, {}, name))
        return tuple(made)

    def chosen_conditions(self, patterns: Sequence[str]) -> tuple[Self, ...]:
        """The conditions whose name matches one of the patterns (``tx40-*``); all without any."""
        known = [c.condition for c in self.conditions]
        for pattern in patterns:
            if not any(fnmatchcase(name, pattern) for name in known):
                if known == [""]:
                    raise ExperimentError(f"{self.source}: the scenario has no conditions")
                raise ExperimentError(
                    f"{self.source}: no condition {pattern!r}", advice=nearest(pattern, known)
                )
        return tuple(
            c
            for c in self.conditions
            if not patterns or any(fnmatchcase(c.condition, p) for p in patterns)
        )

    @cached_property
    def identity(self) -> dict[str, Any]:
        """All that the numbers of a run depend on, as plain values."""
        content = self.content.model_dump(
            mode="json",
            exclude_unset=True,
            exclude={*AMOUNTS, "vary"},
            by_alias=True,
            warnings=False,  # a whole number for a real one is no reason to warn
        )
        robot = self.content.robot.model
        file = Path(self.source).parent / robot
        if robot.endswith(ROBOT_FILES):
            self.robot  # noqa: B018 - says what is wrong with the file
            content["robot_sha256"] = hashlib.sha256(file.read_bytes()).hexdigest()
        return content

    @property
    def hash(self) -> str:
        """SHA-256 of the identity."""
        text = json.dumps(_real(self.identity), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()


def merged(tables: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Tables with changes: keys are replaced, tables merged, tables of another type replaced."""
    out = dict(tables)
    for key, value in changes.items():
        before = out.get(key)
        out[key] = value
        if isinstance(before, Mapping) and isinstance(value, Mapping):
            if value.get("type", before.get("type")) == before.get("type"):
                out[key] = merged(before, value)
    return out


def _real(value: Any) -> Any:
    """Integers as floating-point numbers: 5 and 5.0 are the same scenario."""
    if isinstance(value, Mapping):
        return {key: _real(v) for key, v in value.items()}
    if isinstance(value, list):
        return [_real(v) for v in value]
    if type(value) is not int:
        return value
    try:
        return float(value)
    except OverflowError:  # a seed of hundreds of digits
        return value


def short_forms(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Tables with their short forms written out."""
    from pivident.experiment.explained import plain_form

    return plain_form(dict(tables))


@contextmanager
def file_named(source: str) -> Iterator[None]:
    """Prefix every scenario error with the file, once."""
    try:
        yield
    except ExperimentError as error:
        if f"{source}:" in error.headings[:1]:
            raise
        raise error.headed(f"{source}:") from error


def reference_of(
    scenario: ScenarioTables,
    entry: TrajectoryEntry,
    series: FourierSeries | None = None,
    number: int = 0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Reference q, dq, ddq at the control rate, each (samples, joints).

    ``series``: an optimised Fourier motion; None: a random one; ``number``: which of the seeds, in
    turns.
    """
    rate, robot = scenario.content.record.law_rate, scenario.robot
    samples = round(entry.duration * rate)
    seed = entry.seeds[number % len(entry.seeds)]
    if entry.type != "fourier":
        reach = reach_of(entry, robot.size)
        count = POSTURES + int(entry.duration / MIN_MOVE)
        postures = np.random.default_rng(seed).uniform(-reach, reach, (count, robot.size))
        speeds = entry.speed * robot.rated_speeds
        if entry.type == "point_to_point":
            return point_to_point(postures, speeds, rate, samples, entry.dwell)
        largest = np.full(robot.size, entry.acceleration)
        return trapezoidal_moves(postures, speeds, largest, rate, samples, entry.dwell)
    if series is None:
        limits = motion_limits(robot, entry.speed, entry.acceleration)
        series = random_series(limits, entry.harmonics, entry.frequency, seed)
    return series.sampled(rate, samples)


def reach_of(entry: TrajectoryEntry, joints: int) -> np.ndarray:
    """Largest distance of postures from zero [rad or m], shape (joints,)."""
    return per_joint("trajectory.reach", entry.reach or DEFAULT_REACH, joints)


def optimised_series(
    scenario: ScenarioTables, folder: Path | None, progress: Callable[[str], None] | None = None
) -> FourierSeries | None:
    """The scenario's optimised motion, or None where it has none.

    One that is in the folder for the same robot, limits and seed is taken from it.
    """
    entry = scenario.content.trajectory
    if entry.type != "fourier" or not entry.optimise:
        return None
    key = _key(scenario)
    file = None if folder is None else folder / FILE
    if file is not None and file.is_file():
        kept = _kept_series(file, key)
        if kept is not None:
            return kept
    if key in _found:
        return _found[key]
    _found[key] = excitation.optimised_series(
        scenario.robot,
        base_parameters(scenario.robot).parameters,
        motion_limits(scenario.robot, entry.speed, entry.acceleration),
        entry.harmonics,
        entry.frequency,
        entry.seeds[0],
        progress=progress,
    )
    return _found[key]


def _kept_series(file: Path, key: str) -> FourierSeries | None:
    """The motion of a file, None where it belongs to another robot, limits or seed."""
    try:
        kept = json.loads(regular_file(file).read_text("utf-8"))
        return decode(FourierSeries, kept) if kept.pop("belongs_to") == key else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise StudyFolderError(
            file, f"it cannot be read ({type(error).__name__})", "delete it to recompute it"
        ) from error


def as_json(scenario: ScenarioTables, series: FourierSeries) -> str:
    """The motion as the text of its file."""
    first = {"belongs_to": _key(scenario), "frequency": None, "cost": None}
    return json.dumps(first | plain(series), indent=1)


def _key(scenario: ScenarioTables) -> str:
    """Hash of robot and table ``[trajectory]``, on which the motion depends."""
    tables = {k: scenario.identity.get(k) for k in ("robot", "robot_sha256", "trajectory")}
    return hashlib.sha256(json.dumps(tables, sort_keys=True).encode()).hexdigest()
