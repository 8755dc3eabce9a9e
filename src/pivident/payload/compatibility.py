"""Checks that arms, mountings, links and recordings match."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from pivident.errors import ExperimentError, RobotDescriptionError
from pivident.estimation.identification import Identification
from pivident.estimation.problem import Problem
from pivident.recording.recording import Recording
from pivident.robot.description import Robot
from pivident.robot.frames import Pose
from pivident.robot.naming import nearest


def link_index(robot: Robot, name: str | None) -> int:
    """Index of a link by its name, its joint's name or number (from 1); None: the last link."""
    if name is None:
        return robot.size - 1
    try:
        return robot.link_index(name)
    except RobotDescriptionError:
        known = [*(link.name for link in robot.links), *robot.joint_names]
        raise ExperimentError(
            f"there is no moving link {name!r} to carry a load", advice=nearest(name, known)
        ) from None


def check_recordings(empty: Problem, loaded: Problem | Sequence[Recording]) -> None:
    """Refuse a recording that is given for both states, and an empty list."""
    runs = loaded.recordings if isinstance(loaded, Problem) else tuple(loaded)
    if not runs:
        raise ExperimentError(
            "no recording with the load is given", advice="at least one is needed"
        )
    for run in runs:
        if any(run is other for other in empty.recordings):
            raise ExperimentError(
                f"recording {run.name!r} is given both without and with the load",
                advice="give two runs",
            )


def check_same_arm(arm: Identification, loaded: Problem) -> None:
    """Refuse an arm with other joints, geometry, friction law or mounting."""
    base = loaded.base
    groups = dict(zip((p.name for p in base.parameters), base.expressions, strict=True))
    laws = {p.name: p.friction for p in base.parameters}
    there = arm.robot.size, arm.robot.joint_names
    if there != (loaded.robot.size, loaded.robot.joint_names):
        raise ExperimentError(
            f"the empty arm has the joints {', '.join(arm.robot.joint_names)}, the loaded one "
            f"{', '.join(loaded.robot.joint_names)}",
            advice="give records of the same robot",
        )
    if not np.allclose(arm.robot.gravity, loaded.robot.gravity, atol=0.05):
        raise ExperimentError(
            f"the empty arm was identified with gravity {_vector(arm.robot.gravity)} m/s² in its "
            f"base frame, the loaded one has {_vector(loaded.robot.gravity)} m/s²: another "
            "mounting has other identifiable parameters. Use a record without load in the mounting "
            "of the loaded one, or correct gravity under [robot]"
        )
    for parameter, expression in zip(arm.parameters, arm.expressions, strict=True):
        if not _is_same_group(groups.get(parameter.name, ""), expression):
            raise ExperimentError(
                f"the arm was identified with {expression!r}, but the robot of the loaded record "
                f"has {groups.get(parameter.name, 'no such parameter')!r}: geometry or friction "
                "law differ. Identify the arm again with the robot of the loaded record"
            )
        if laws[parameter.name] != parameter.friction:
            raise ExperimentError(
                f"the friction term {parameter.name!r} of the arm is {parameter.friction}, that "
                f"of the loaded record's robot {laws[parameter.name]}. Identify the arm again with "
                "the same friction law"
            )


def tool_frame(robot: Robot, link: int, frame: Pose) -> str:
    """A tool's pose in the frame of its link, as text."""
    rotation = np.array2string(frame.rotation, precision=4, suppress_small=True, separator=", ")
    return (
        f"tool with origin {_vector(frame.translation)} m and axes {' '.join(rotation.split())} "
        f"(columns) in the frame of link {robot.links[link].name!r}"
    )


def _is_same_group(one: str, other: str) -> bool:
    """Whether two groups of parameters are the same but for the last digit of their factors."""
    words, others = one.split(), other.split()
    if len(words) != len(others):
        return False
    return all(a == b or _is_same_factor(a, b) for a, b in zip(words, others, strict=True))


def _is_same_factor(one: str, other: str) -> bool:
    numbers = all(re.fullmatch(r"[-+]?[0-9.]+(e[-+]?[0-9]+)?", word) for word in (one, other))
    return numbers and math.isclose(float(one), float(other), rel_tol=1e-4)


def _vector(values: np.ndarray) -> str:
    return "(" + ", ".join(f"{v:.4g}" for v in values) + ")"
