"""What has to stay apart: pairs of bodies, obstacles, the floor and the sides of the tool's box."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from pivident.foundation.errors import ExperimentError
from pivident.robot.description import Joint, Robot
from pivident.robot.naming import repeated
from pivident.studies.collision.bodies import Body, Obstacle

#: Postures that show which bodies touch all the time, and their seed.
POSTURES, SEED = 400, 1

#: Range of a joint without limits: half a turn, half a metre either way.
WITHOUT_LIMITS = {"revolute": np.pi, "prismatic": 0.5}


@dataclass(frozen=True, eq=False)
class Pair:
    """One distance: of a body from another, from an obstacle or the floor, or of the tool.

    Attributes:
        name: such as ``forearm and table``.
        needed: distance that is asked for [m].
        body: the body; None for the tool.
        other: what it must not touch; None for the floor, or for the sides of the tool's box.
        spare: most room beyond ``needed`` that can be asked for [m].
    """

    name: str
    needed: float
    body: Body | None
    other: Body | Obstacle | None
    spare: float = np.inf

    def with_more(self, room: float) -> Pair:
        """The same pair, with more room [m] as far as there is some."""
        return replace(self, needed=self.needed + min(room, self.spare))


def candidate_pairs(
    robot: Robot,
    bodies: Sequence[Body],
    obstacles: Sequence[Obstacle],
    clearance: float,
    *,
    floor: bool,
    tool: bool,
) -> list[Pair]:
    """All pairs that could touch, by which links carry them.

    Args:
        robot: the robot.
        bodies: its bodies; those of the base are kept from moving bodies only.
        obstacles: what stands around it.
        clearance: distance that is asked for [m].
        floor: whether there is a floor.
        tool: whether the tool has a box to stay in.

    Returns:
        Pairs of bodies, then those with obstacles and floor, then the tool.

    Raises:
        ExperimentError: a name is used twice, or a body's link does not exist.
    """
    _check_names(robot, bodies, obstacles)
    moving = [body for body in bodies if body.link >= 0]
    pairs = [
        Pair(f"{b.name} and {a.name}", clearance, b, a)
        for a, b in combinations(sorted(bodies, key=lambda body: body.link), 2)
        if not _are_neighbours(robot, a.link, b.link)
    ]
    pairs += [
        Pair(f"{body.name} and {obstacle.name}", clearance, body, obstacle)
        for obstacle in obstacles
        for body in moving
    ]
    if floor:
        pairs += [Pair(f"{body.name} above the floor", clearance, body, None) for body in moving]
    if tool:
        pairs.append(Pair("tool inside its box", 0.0, None, None))
    return pairs


def _are_neighbours(robot: Robot, a: int, b: int) -> bool:
    """Whether two links are the same, or one carries the other."""
    return a == b or (b >= 0 and robot.joints[b].parent == a)


def random_postures(robot: Robot) -> np.ndarray:
    """Postures within the limits of the joints, the same in each call.

    Args:
        robot: the robot.

    Returns:
        Joint positions [rad or m], shape (POSTURES, joints).
    """
    low, high = position_ranges(robot)
    return np.random.default_rng(SEED).uniform(low, high, (POSTURES, robot.size))


def position_ranges(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest position of each joint, assumed where it has no limits.

    Args:
        robot: the robot.

    Returns:
        Two arrays of shape (joints,) [rad or m].
    """
    limits = [
        joint.position_limits or (-WITHOUT_LIMITS[joint.kind], WITHOUT_LIMITS[joint.kind])
        for joint in robot.joints
    ]
    low, high = np.array(limits, dtype=float).T
    return low, high


def levers(robot: Robot, link: int, points: Sequence[np.ndarray]) -> np.ndarray:
    """Bounds of how far points of a link move as one joint does, |∂p/∂q_i| ≤ r_i.

    r_i is the length of the chain from the axis of joint i to the points, stretched; 1 for a slide.

    Args:
        robot: the robot, with the ranges of its joints.
        link: index of the link, -1 for the base.
        points: in the link's frame [m], each (3,).

    Returns:
        Shape (joints,) [m/rad or 1]; zero for joints that do not move the link, infinite behind a
        slide without limits.
    """
    found = np.zeros(robot.size)
    length = max(float(np.linalg.norm(point)) for point in points)
    for i in robot.ancestors(link) if link >= 0 else ():
        joint = robot.joints[i]
        found[i] = 1.0 if joint.kind == "prismatic" else length
        length += float(np.linalg.norm(joint.translation)) + _travel(joint)
    return found


def _travel(joint: Joint) -> float:
    """How far a slide moves at most [m]; zero for a joint that turns."""
    if joint.kind != "prismatic":
        return 0.0
    limits = joint.position_limits
    return np.inf if limits is None else max(abs(limits[0]), abs(limits[1]))


def swept_ball(robot: Robot, body: Body) -> tuple[np.ndarray, float]:
    """A ball around the first joint of its chain that a body never leaves.

    Args:
        robot: the robot.
        body: a body of a moving link.

    Returns:
        Centre in the base frame [m], shape (3,), and radius [m], infinite for a slide without
        limits.
    """
    *later, first = robot.ancestors(body.link)
    radius = body.radius + float(max((np.linalg.norm(body.start), np.linalg.norm(body.end))))
    radius += sum(float(np.linalg.norm(robot.joints[i].translation)) for i in later)
    radius += sum(_travel(robot.joints[i]) for i in (*later, first))
    return robot.joints[first].translation, radius


def _check_names(robot: Robot, bodies: Sequence[Body], obstacles: Sequence[Obstacle]) -> None:
    names = [*(body.name for body in bodies), *(obstacle.name for obstacle in obstacles)]
    twice = repeated(names)
    if twice:
        raise ExperimentError(
            f"the names {', '.join(map(repr, twice))} are used by several bodies or obstacles",
            advice="name each once",
        )
    for body in bodies:
        if not -1 <= body.link < robot.size:
            raise ExperimentError(
                f"body {body.name!r}: link {body.link} does not exist",
                advice=f"the links of {robot.name!r} count from -1 (base) to {robot.size - 1}",
            )
