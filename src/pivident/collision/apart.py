"""Bodies that are built close to each other: their capsules overlap, their own shapes never touch.

Links with two joints between them, as a base and an upper arm, are often near each other in every
posture. Where their capsules overlap, a motion would be kept out of postures that are free. Only
two positions count for such a pair, so a grid of them shows all that it can do.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from pivident.collision.bodies import BASE, Outline
from pivident.collision.clearances import Clearances
from pivident.collision.exact import exact_distances
from pivident.collision.pairs import candidate_pairs, position_ranges
from pivident.extras import is_installed
from pivident.robot.description import Robot

#: Share of postures with capsules too near from which on the shapes themselves are measured.
OFTEN = 0.02

#: Positions of each of the two joints.
POSITIONS = 31

#: Least distance of two shapes that are taken to stay apart [m].
LEAST_GAP = 1e-3


def built_apart(
    robot: Robot, outline: Outline, clearance: float = 0.02
) -> tuple[frozenset[frozenset[str]], tuple[str, ...]]:
    """Pairs of bodies that need not be checked, because their shapes never touch.

    Args:
        robot: the robot, with the ranges that its joints move in.
        outline: its bodies; pairs of links with bodies by hand are always checked.
        clearance: distance that bodies keep [m].

    Returns:
        Names of the bodies of each pair, for `Clearances.of`, and remarks that say so. None where
        the robot has no URDF with shapes, or coal is not installed.

    Raises:
        RobotDescriptionError: a mesh of the URDF cannot be found.
    """
    if outline.source != "urdf" or not is_installed("coal"):
        return frozenset(), ()
    apart: set[frozenset[str]] = set()
    remarks = []
    for first, second in _two_joints_apart(robot):
        sides = [[body for body in outline.bodies if body.link == link] for link in (first, second)]
        if not all(sides) or {first, second} & set(outline.given):
            continue
        pairs = candidate_pairs(
            robot, [*sides[0], *sides[1]], (), clearance, floor=False, tool=False
        )
        q = _grid(robot, first, second)
        near = (Clearances(robot, tuple(pairs)).distances(q) < clearance).any(axis=0)
        if not near.mean() > OFTEN:
            continue
        (distance,) = exact_distances(robot, [(first, second)], q[near], without=outline.given)
        if distance.min() >= LEAST_GAP:
            apart |= {frozenset((a.name, b.name)) for a, b in product(*sides)}
            names = [robot.links[k].name if k >= 0 else BASE for k in (second, first)]
            remarks.append(
                f"Not checked: {' and '.join(names)}. Their capsules overlap "
                f"in some postures, their own shapes stay {1e3 * distance.min():.0f} mm apart or "
                f"more on a grid of {len(q)}."
            )
    return frozenset(apart), tuple(remarks)


def _grid(robot: Robot, first: int, second: int) -> np.ndarray:
    """Postures on a grid of the joints between two links, the others in their middles."""
    ancestors = [set(robot.ancestors(link)) if link >= 0 else set() for link in (first, second)]
    between = sorted(ancestors[0] ^ ancestors[1])
    low, high = position_ranges(robot)
    axes = [np.linspace(low[i], high[i], POSITIONS) for i in between]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(between))
    q = np.tile(0.5 * (low + high), (len(places), 1))
    q[:, between] = places
    return q


def _two_joints_apart(robot: Robot) -> list[tuple[int, int]]:
    """Links with two joints between them: a link and what carries its carrier, or two on one."""
    parents = [joint.parent for joint in robot.joints]
    return [
        (a, b)
        for b in range(robot.size)
        for a in range(-1, b)
        if a != parents[b]
        and (
            (parents[b] >= 0 and parents[parents[b]] == a) or (a >= 0 and parents[a] == parents[b])
        )
    ]
