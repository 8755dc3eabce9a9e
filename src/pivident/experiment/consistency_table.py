"""From the table ``[consistency]``, of an experiment file or of a file of its own, to options."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pivident.experiment.consistency_keys import ConsistencyEntry, ConsistencyFile
from pivident.experiment.explained import checked, errors_name, plain_form, toml_content
from pivident.experiment.file_keys import ExperimentFile
from pivident.foundation.errors import ExperimentError, RobotDescriptionError, concerning
from pivident.models.consistency.constraints import Bounds, Interval
from pivident.models.consistency.options import ConsistencyOptions
from pivident.robot.description import Robot
from pivident.robot.gallery import load_robot
from pivident.robot.mjcf import read_mjcf
from pivident.robot.naming import MJCF_FILES, URDF_FILES
from pivident.robot.urdf import read_urdf

#: Frames of a reference may differ by rounding of their files [m, and elements of rotations].
FRAME_TOLERANCE = 1e-4


def consistency_of(entry: ConsistencyEntry, robot: Robot, folder: Path) -> ConsistencyOptions:
    """Options with everything checked against the robot."""
    name = entry.reference
    with concerning("reference"):
        reference = None if name is None else reference_of(name, robot, folder)
    with concerning("bounds"):
        bounds = bounds_of(entry, robot)
    return ConsistencyOptions(
        prior=entry.prior,
        bounds=bounds,
        margin=entry.margin,
        reference=reference,
        accept_far=entry.accept_far,
    )


def bounds_of(entry: ConsistencyEntry, robot: Robot) -> Bounds | None:
    """What the table knows of masses and centres of mass; None if nothing."""
    if entry.total_mass is None and not entry.bounds:
        return None
    tree = robot.tree
    links = [link.name for link in tree.links]
    named: dict[str, str] = {}
    for name in entry.bounds:
        try:
            link = links[tree.link_index(name)]
        except RobotDescriptionError as error:
            raise ExperimentError.of_part("bounds: ", error).about("bounds", name) from error
        if link in named:
            raise ExperimentError(
                f"bounds: {named[link]!r} and {name!r} are the same link", advice="keep one of them"
            ).about("bounds", name)
        named[link] = name
    own = {link: entry.bounds[name] for link, name in named.items()}
    bounds = Bounds(
        mass={link: _pair(b.mass) for link, b in own.items() if b.mass is not None},
        total_mass=None if entry.total_mass is None else _pair(entry.total_mass),
        center_of_mass={
            link: _box(b.center_of_mass) for link, b in own.items() if b.center_of_mass is not None
        },
        ellipsoid={
            link: (tuple(b.ellipsoid[0]), tuple(b.ellipsoid[1]))
            for link, b in own.items()
            if b.ellipsoid is not None
        },
    )
    with concerning("total_mass"):
        _check_total(bounds, links)
    return bounds


def reference_of(name: str, robot: Robot, folder: Path) -> Robot:
    """The robot whose bodies are the nominal ones."""
    if name.endswith((*URDF_FILES, *MJCF_FILES)):
        names = robot.tree.joint_names
        if name.endswith(MJCF_FILES):
            passive = [joint.name for joint in robot.passive_joints]
            reference = read_mjcf(folder / name, joints=names, passive=passive or None)
        else:
            reference = read_urdf(folder / name, joints=names)
    else:
        reference = load_robot(folder / name if name.endswith(".toml") else name)
    ours, theirs = robot.tree.joint_names, reference.tree.joint_names
    if ours != theirs:
        raise ExperimentError(
            f"reference {name!r} has the joints {', '.join(theirs)}, the robot {', '.join(ours)}",
            advice="give a description of the same arm",
        )
    for own, other in zip(robot.tree.joints, reference.tree.joints, strict=True):
        same = own.kind == other.kind and own.parent == other.parent
        apart = max(
            float(np.abs(own.rotation - other.rotation).max()),
            float(np.abs(own.translation - other.translation).max()),
        )
        if not same or apart > FRAME_TOLERANCE:
            raise ExperimentError(
                f"reference {name!r}: the frame of joint {own.name!r} is another one than that of "
                f"the robot (by {apart:.3g} in its pose), so its inertias do not belong to the "
                "same axes",
                advice="give inertias in the robot's own frames",
            )
    return reference


def read_consistency(path: Path, robot: Robot) -> ConsistencyOptions:
    """Options of a TOML file with a table ``[consistency]``."""
    with errors_name(path, ""):
        content = toml_content(path)
        if "consistency" not in content:
            raise ExperimentError(
                "has no table [consistency]", advice="put the bounds below that heading"
            )
        entry = _table(content)
    with errors_name(path, "[consistency]"):
        return consistency_of(entry, robot, path.parent)


def _table(content: dict[str, Any]) -> ConsistencyEntry:
    """The table of a file of its own, or of an experiment file."""
    if "robot" in content or "recording" in content:
        found = checked(plain_form(content), ExperimentFile).consistency
        assert found is not None
        return found
    return checked(content, ConsistencyFile).consistency


def _check_total(bounds: Bounds, links: list[str]) -> None:
    """Refuse a total mass that the links' masses cannot have."""
    if bounds.total_mass is None:
        return
    lowest, highest = bounds.total_mass
    low = sum(bounds.mass[link][0] or 0.0 for link in bounds.mass)
    high = sum(bounds.mass[link][1] or 0.0 for link in bounds.mass)
    if highest is not None and low > highest:
        raise ExperimentError(
            f"the lowest masses of {', '.join(bounds.mass)} add up to {low:g} kg, more than the "
            f"highest total mass of {highest:g} kg",
            advice="one of these bounds is wrong",
        )
    if lowest is not None and set(bounds.mass) == set(links) and high < lowest:
        raise ExperimentError(
            f"the highest masses of all links add up to {high:g} kg, less than the lowest total "
            f"mass of {lowest:g} kg",
            advice="one of these bounds is wrong",
        )


def _pair(ends: list[float]) -> tuple[float, float]:
    return ends[0], ends[1]


def _box(intervals: list[list[float]]) -> tuple[Interval, Interval, Interval]:
    x, y, z = map(_pair, intervals)
    return x, y, z
