"""The bodies of a robot, from the best source that there is.

Where the capsules come from, the first that there is: what the caller gives for a link, the
``<collision>`` elements of the robot's URDF, a published outline of a gallery robot, and otherwise
a skeleton from joint to joint, whose radius is an assumption.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

import numpy as np

from pivident.foundation.errors import RobotDescriptionError
from pivident.foundation.text.sentences import listed
from pivident.robot.description import INERTIAL, Robot
from pivident.robot.naming import repeated
from pivident.robot.refusals import without_loops
from pivident.studies.collision.bodies import BASE, Body, Outline, numbered
from pivident.studies.collision.urdf import urdf_outline

#: Radius of a skeleton's capsules as a share of the robot's reach. Industrial arms and cobots have
#: 5 to 10 % in their arms, and more in the shoulder.
RADIUS_SHARE = 0.08

#: Shortest way between two joints that a skeleton gives a capsule, as a share of its radius.
SHORTEST = 0.05

_Row = tuple[str, int, tuple[float, float, float], tuple[float, float, float], float]

#: Name of a robot → name, link, ends of the segment and radius of its bodies [m].
#:
#: TX40: from its published outline, shoulder 320 mm above the floor, upper arm and forearm 225 mm,
#: wrist to flange 65 mm; the diameters are those of the covers, rounded up.
GALLERY: dict[str, tuple[_Row, ...]] = {
    "Stäubli TX40": (
        ("base", -1, (0.0, 0.0, -0.24), (0.0, 0.0, -0.16), 0.09),
        ("shoulder", 0, (0.0, 0.0, -0.06), (0.0, 0.0, 0.01), 0.095),
        ("upper arm", 1, (0.0, 0.0, 0.05), (0.225, 0.0, 0.05), 0.09),
        ("elbow", 2, (0.0, 0.0, 0.0), (0.0, 0.0, 0.05), 0.085),
        ("forearm", 3, (0.0, 0.0, -0.16), (0.0, 0.0, -0.01), 0.065),
        ("wrist", 4, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.055),
        ("flange", 5, (0.0, 0.0, 0.03), (0.0, 0.0, 0.04), 0.03),
    ),
}


def outline_of(robot: Robot, given: Iterable[Body] = ()) -> Outline:
    """The bodies of a robot: given ones, and those found for all other links.

    Args:
        robot: the robot.
        given: bodies that replace what would be found for their links.

    Returns:
        The bodies with their source and remarks.

    Raises:
        RobotDescriptionError: a shape of the URDF or its mesh cannot be used, or a name is used
            twice; names link, file and next step.
        MissingExtra: the URDF has meshes, and coal is not installed.
    """
    without_loops(robot, "the search for collisions")
    given = tuple(given)
    for body in given:
        if not -1 <= body.link < robot.size:
            raise RobotDescriptionError(
                f"body {body.name!r}: link {body.link} does not exist",
                advice=f"the links of {robot.name!r} count from -1 (base) to {robot.size - 1}",
            )
    known = {body.link for body in given}
    found = (
        Outline((), "given")
        if known >= set(range(robot.size))
        else urdf_outline(robot, known) or gallery_outline(robot, known) or skeleton(robot, known)
    )
    kept = [body for body in found.bodies if body.link not in known]
    remarks = found.remarks
    if found.source == "urdf":
        more, words = _without_shapes(robot, known | {body.link for body in kept}, found.missing)
        kept, remarks = [*kept, *more], (*remarks, *words)
    bodies = tuple(sorted([*given, *kept], key=lambda body: body.link))
    twice = repeated([body.name for body in bodies])
    if twice:
        raise RobotDescriptionError(
            f"body names used twice: {', '.join(twice)}", advice="name each body once"
        )
    return Outline(bodies, found.source, remarks, tuple(sorted(known | {*found.missing})))


def gallery_outline(robot: Robot, without: Collection[int] = ()) -> Outline | None:
    """Approximate outline of a robot of the gallery.

    Args:
        robot: the robot, known by its name and number of joints.
        without: links that are given by hand.

    Returns:
        Its bodies, or None where its outline is not known.
    """
    rows = GALLERY.get(robot.name)
    if rows is None or max(row[1] for row in rows) >= robot.size:
        return None
    bodies = tuple(
        Body(name, link, np.array(start), np.array(end), radius)
        for name, link, start, end, radius in rows
        if link not in without
    )
    return Outline(
        bodies,
        "gallery",
        (
            f"The bodies of {robot.name} are an approximate outline without cables and tools; give "
            "bodies by hand where it matters.",
        ),
    )


def skeleton(robot: Robot, without: Collection[int] = ()) -> Outline:
    """Capsules from joint to joint, of one assumed radius.

    Args:
        robot: the robot.
        without: links that are given by hand.

    Returns:
        A capsule from the origin of each link to the next joint on it; that of a last link, or of
        one whose next joint is at its origin, goes as far behind its centre of mass as that is from
        its joint, the end of an even rod, and is a ball at its joint where it has no mass. None for
        a robot without reach.
    """
    radius = RADIUS_SHARE * reach(robot)
    bodies: list[Body] = []
    last: list[str] = []
    for link in range(-1, robot.size if radius > 0.0 else -1):
        if link in without:
            continue
        ends = [j.translation for j in robot.joints if j.parent == link]
        ends = [end for end in ends if np.linalg.norm(end) > SHORTEST * radius]
        is_last = link >= 0 and not any(j.parent == link for j in robot.joints)
        rod = _rods_end(robot, link) if link >= 0 and not ends else np.zeros(3)
        if is_last or np.linalg.norm(rod) > SHORTEST * radius:
            ends = [rod]
            last.append(robot.links[link].name)
        name = BASE if link < 0 else robot.links[link].name
        bodies += (
            Body(each, link, np.zeros(3), np.array(end, dtype=float), radius)
            for each, end in zip(numbered(name, len(ends)), ends, strict=True)
        )
    if not bodies:
        remark = (
            f"No bodies of {robot.name} are known; nothing keeps its links apart. Give bodies by "
            "hand."
        )
    else:
        remark = (
            f"No shapes of {robot.name} are known: its bodies are capsules from joint to joint of "
            f"radius {radius:.3f} m, an assumption ({100 * RADIUS_SHARE:.0f} % of the reach). Give "
            "bodies by hand, or a URDF with <collision> elements."
        )
        if last:
            remark += (
                f" How far {listed(last)} and a tool reach is assumed from the centre of mass: "
                "give at least that body by hand before anything stands near the robot."
            )
    return Outline(tuple(bodies), "skeleton", (remark,))


def _without_shapes(
    robot: Robot, covered: Collection[int], missing: Mapping[int, str]
) -> tuple[list[Body], tuple[str, ...]]:
    """Capsules of links that the URDF gives a mass or a length, but no shape, and remarks."""
    bare = [link for link in range(-1, robot.size) if link not in covered]
    bare = [link for link in bare if link >= 0 or link in missing]
    if not bare:
        return [], ()
    stand_in = skeleton(robot, {-1, *range(robot.size)}.difference(bare))
    bodies = [
        body
        for body in stand_in.bodies
        if body.link in missing
        or robot.links[body.link].inertia[INERTIAL.index("m")] > 0.0
        or np.linalg.norm(body.end - body.start) > 0.0
    ]
    names = {link: BASE if link < 0 else robot.links[link].name for link in bare}
    taken = {body.link for body in bodies}
    words = []
    first = next(iter(missing.values()), "")
    words += [
        f"{lack} {listed([names[link] for link in sorted(without)])}: capsules from joint "
        f"to joint of radius {bodies[0].radius:.3f} m stand for them, an assumption. Give "
        f"bodies by hand{step}."
        for without, lack, step in (
            (taken - {*missing}, "The URDF has no <collision> element of", ""),
            (taken & {*missing}, f"Meshes are missing ({first}) of", ", or put the meshes there"),
        )
        if without
    ]
    if left := [names[link] for link in bare if link not in taken]:
        words.append(
            f"Not checked: {listed(left)}, of which the URDF gives neither shape nor mass."
        )
    return bodies, tuple(words)


def _rods_end(robot: Robot, link: int) -> np.ndarray:
    """Twice the centre of mass of a link in its frame [m]; its origin where it has no mass."""
    inertia = robot.links[link].inertia
    mass = inertia[INERTIAL.index("m")]
    if not mass > 0.0:
        return np.zeros(3)
    first = INERTIAL.index("mx")
    return 2.0 * np.asarray(inertia[first : first + 3], dtype=float) / mass


def reach(robot: Robot) -> float:
    """Length of the longest chain from the first joint to the last, stretched [m]."""
    lengths: list[float] = []
    for joint in robot.joints:
        own = float(np.linalg.norm(joint.translation))
        lengths.append(lengths[joint.parent] + own if joint.parent >= 0 else 0.0)
    return max(lengths)
