"""The room that a robot takes: a capsule for each body that moves, and for the base.

Where the capsules come from, the first that there is: what the caller gives for a link, the
``<collision>`` elements of the robot's URDF, a published outline of a gallery robot, and otherwise
a skeleton from joint to joint, whose radius is an assumption.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from pivident.errors import RobotDescriptionError, concerning
from pivident.robot.description import Robot
from pivident.robot.naming import nearest, repeated

if TYPE_CHECKING:
    from pivident.experiment.room_keys import BodyEntry

#: Name of the fixed link where the description gives it none.
BASE = "base"

#: How a body is given by hand, in messages.
BY_HAND = 'body = [{name = "forearm", link = "…", from = [x, y, z], to = [x, y, z], radius = r}]'


@dataclass(frozen=True, eq=False)
class Body:
    """A capsule: all points within a radius of a segment.

    Attributes:
        name: of the body, unique.
        link: index of the moving link that carries it, -1 for the fixed base.
        start: one end of the segment in the link's frame (base: the base frame) [m], shape (3,).
        end: its other end [m], shape (3,).
        radius: radius [m].
    """

    name: str
    link: int
    start: np.ndarray
    end: np.ndarray
    radius: float

    def __post_init__(self) -> None:
        for key, value in (("start", self.start), ("end", self.end)):
            if np.shape(value) != (3,) or not np.isfinite(value).all():
                raise RobotDescriptionError(
                    f"body {self.name!r}: {key} = {value} must be three finite numbers in metres"
                )
        if not 0.0 < self.radius < np.inf:
            raise RobotDescriptionError(
                f"body {self.name!r}: radius = {self.radius} must be positive, in metres"
            )


@dataclass(frozen=True)
class Outline:
    """The bodies of a robot, and where they come from.

    Attributes:
        bodies: capsules, those of the base first, links in order.
        source: ``urdf``, ``gallery`` or ``skeleton``; ``given`` where the caller gave all of them.
        remarks: what a user should know of them, complete sentences.
    """

    bodies: tuple[Body, ...]
    source: Literal["urdf", "gallery", "skeleton", "given"]
    remarks: tuple[str, ...] = ()


def outline_of(robot: Robot, given: Iterable[Body] = ()) -> Outline:
    """The bodies of a robot: given ones, and those found for all other links.

    Args:
        robot: the robot.
        given: bodies that replace what would be found for their links.

    Returns:
        The bodies with their source and remarks.

    Raises:
        RobotDescriptionError: a shape of the URDF cannot be used or its mesh is missing, or a name
            is used twice; names link, file and next step.
        MissingExtra: the URDF has meshes, and coal is not installed.
    """
    from pivident.excitation.geometry_outlines import gallery_outline, skeleton
    from pivident.excitation.geometry_urdf import urdf_outline

    given = tuple(given)
    for body in given:
        if not -1 <= body.link < robot.size:
            raise RobotDescriptionError(
                f"body {body.name!r}: link {body.link} does not exist; the links of "
                f"{robot.name!r} count from -1 (base) to {robot.size - 1}"
            )
    known = {body.link for body in given}
    if known >= set(range(robot.size)):
        found = Outline((), "given")
    else:
        found = (
            urdf_outline(robot, known) or gallery_outline(robot, known) or skeleton(robot, known)
        )
    kept = [body for body in found.bodies if body.link not in known]
    bodies = tuple(sorted([*given, *kept], key=lambda body: body.link))
    twice = repeated([body.name for body in bodies])
    if twice:
        raise RobotDescriptionError(
            f"body names used twice: {', '.join(twice)}; name each body once"
        )
    return Outline(bodies, found.source, found.remarks)


def bodies_of_entries(robot: Robot, entries: Sequence[BodyEntry]) -> tuple[Body, ...]:
    """Bodies that a file gives by hand.

    Args:
        robot: the robot, whose links they name; ``base`` is the fixed one.
        entries: the checked entries of the table ``body``.

    Returns:
        The bodies, in order.

    Raises:
        RobotDescriptionError: there is no such link; names the nearest ones.
    """
    bodies = []
    for number, entry in enumerate(entries):
        with concerning("body", str(number)):
            link = -1 if entry.link == BASE else _link_index(robot, entry)
            bodies.append(
                Body(
                    entry.name,
                    link,
                    np.array(entry.start, dtype=float),
                    np.array(entry.end, dtype=float),
                    float(entry.radius),
                )
            )
    return tuple(bodies)


def _link_index(robot: Robot, entry: BodyEntry) -> int:
    try:
        return robot.link_index(entry.link)
    except RobotDescriptionError:
        names = dict.fromkeys([BASE, *(link.name for link in robot.links), *robot.joint_names])
        raise RobotDescriptionError(
            f"body {entry.name!r}: robot {robot.name!r} has no link {entry.link!r}; "
            f"{nearest(entry.link, names)}"
        ) from None


def numbered(name: str, count: int) -> list[str]:
    """Names of so many bodies of one link: its own, numbered where there are several."""
    return [name] if count == 1 else [f"{name} ({k + 1})" for k in range(count)]
