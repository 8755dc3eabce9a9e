"""The table ``[excite]`` of a file as limits, clearances and a request."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pivident.experiment.excite_keys import ExciteEntry
from pivident.experiment.explained import checked, errors_name, toml_content
from pivident.foundation.errors import ExperimentError
from pivident.robot.description import Robot
from pivident.robot.inertia import from_center_of_mass, tensor
from pivident.robot.mdh_schema import Entry
from pivident.robot.naming import find_joint
from pivident.studies.excitation.knowledge import Knowledge
from pivident.studies.excitation.limits import JointLimits, joint_limits
from pivident.studies.excitation.questions import Question, gain_question, load_question


class CellFile(Entry):
    """A file that holds the table alone."""

    excite: ExciteEntry = ExciteEntry.model_validate({})


def read_cell(path: str | Path) -> ExciteEntry:
    """The table ``[excite]`` of a file that holds nothing else: limits and room of a robot's cell.

    Args:
        path: the TOML file.

    Returns:
        The checked table.

    Raises:
        ExperimentError: it cannot be read, or has an unknown key or a bad value.
    """
    path = Path(path)
    with errors_name(path, ""):
        return checked(toml_content(path), CellFile).excite


def limits_of(robot: Robot, entry: ExciteEntry) -> JointLimits:
    """Limits of a robot's joints, those of the table in place of its description's.

    Args:
        robot: the robot.
        entry: the table.

    Raises:
        ExperimentError: an unknown joint, or limits that are unknown or contradict each other.
    """
    given: dict[str, dict[str, Any]] = {name: {} for name in robot.joint_names}
    for quantity in ("acceleration", "jerk"):
        value = getattr(entry, quantity)
        if value is not None:
            for name, number in zip(
                robot.joint_names, _for_each(robot, quantity, value), strict=True
            ):
                given[name][quantity] = number
    for reference, own in entry.joint.items():
        name = robot.joint_names[find_joint(robot.joint_names, reference)]
        for quantity in own.model_fields_set:
            value = getattr(own, quantity)
            given[name][quantity] = tuple(value) if isinstance(value, list) else value
    return joint_limits(robot, given, speed_share=entry.speed, torque_share=entry.torque)


def _for_each(robot: Robot, key: str, value: float | Sequence[float]) -> Sequence[float]:
    """One number for each joint."""
    if isinstance(value, (int, float)):
        return [float(value)] * robot.size
    if len(value) != robot.size:
        raise ExperimentError(
            f"{key} has {len(value)} numbers for {robot.size} joints",
            advice="give one for all or one for each",
        ).about(key)
    return value


def torque_noise_of(robot: Robot, entry: ExciteEntry) -> np.ndarray | None:
    """Standard deviation of the torque that the table expects, shape (joints,); None: not said.

    Args:
        robot: the robot.
        entry: the table.
    """
    if entry.torque_noise is None:
        return None
    return np.array(_for_each(robot, "torque_noise", entry.torque_noise), dtype=float)


def question_of(entry: ExciteEntry) -> Callable[[Knowledge], Question] | None:
    """What is asked besides parameters of the robot: a load, or drive gains.

    Args:
        entry: the table.
    """
    if entry.about == "robot":
        return None
    assert entry.load is not None
    about_centre = np.zeros(6) if entry.load.inertia is None else np.array(entry.load.inertia)
    centre = np.array(entry.load.center_of_mass)
    load = from_center_of_mass(entry.load.mass, centre, tensor(about_centre))
    made = load_question if entry.about == "load" else gain_question

    def asked(known: Knowledge) -> Question:
        if entry.about == "gains" and not known.has_masses:
            raise ExperimentError(
                "drive gains can be asked for only where the masses of the robot are known: name a "
                "result, or a description with masses"
            ).about("about")
        return made(known.base, known.model_values, load)

    return asked
