"""Motions of a scenario.

An optimised motion is found once, kept beside the results and sent to all workers.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.dynamics.base_parameters import base_parameters
from pivident.errors import ExperimentError
from pivident.files import regular_file
from pivident.many.study.study_errors import StudyFolderError
from pivident.simulation import excitation
from pivident.simulation.excitation import FourierSeries, motion_limits, random_series
from pivident.simulation.reference import point_to_point, trapezoidal_moves

if TYPE_CHECKING:
    from pivident.many.study.scenario_tables import ScenarioTables
    from pivident.many.study.study_schema import TrajectoryEntry

#: File of the motion in a results folder.
FILE = "trajectory.json"

#: Default for the largest distance of postures from zero [rad or m].
DEFAULT_REACH = 1.0

#: Number of postures of a point-to-point motion: a constant, and one per this time [s].
POSTURES, MIN_MOVE = 12, 0.6

#: Motions optimised by this process: conditions of one scenario often share theirs.
_found: dict[str, FourierSeries] = {}


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
        rng = np.random.default_rng(seed)
        postures = rng.uniform(-reach, reach, (count, robot.size))
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


def per_joint(key: str, value: Any, joints: int) -> np.ndarray:
    """One number for each joint."""
    values = np.asarray(value, dtype=float)
    if values.ndim and values.shape != (joints,):
        raise ExperimentError(
            f"key {key!r} has {values.size} number(s) for {joints} joint(s)",
            advice="give one for all or one for each",
        )
    return np.broadcast_to(values, (joints,)).copy()


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
        return FourierSeries.of(kept) if kept["belongs_to"] == key else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise StudyFolderError(
            file, f"it cannot be read ({type(error).__name__})", "delete it to recompute it"
        ) from error


def as_json(scenario: ScenarioTables, series: FourierSeries) -> str:
    """The motion as the text of its file."""
    return json.dumps({"belongs_to": _key(scenario)} | series.plain(), indent=1)


def _key(scenario: ScenarioTables) -> str:
    """Hash of robot and table ``[trajectory]``, on which the motion depends."""
    tables = {k: scenario.identity.get(k) for k in ("robot", "robot_sha256", "trajectory")}
    return hashlib.sha256(json.dumps(tables, sort_keys=True).encode()).hexdigest()
