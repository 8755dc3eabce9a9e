"""Closed loops of an MJCF: equality constraints between sites, joints and sums of joints.

    point       connect of two sites
    axis        two of them, at the origins and at a point of the axes
    full        weld of two sites
    r_1 q_1 + r_2 q_2 = r_0              joint, q_1 - q_1* = a_0 - r_2/r_1 (q_2 - q_2*)
    r_1 q_1 + r_2 q_2 + r_3 q_3 … = r_0  the length of a fixed tendon, which a tendon equality holds

A planar loop keeps the axes of its hinges parallel, so that one connect is enough there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.export.mjcf_bodies import quaternion
from pivident.export.xml_text import number, numbers, quoted, unlike
from pivident.robot.assembly import link_frames
from pivident.robot.constraints import Closure, LinearConstraint
from pivident.robot.description import Robot
from pivident.robot.frames import Pose

#: Time constant and damping ratio with which MuJoCo closes loops, and its impedance: constraints
#: are soft, and time constants below two steps are raised.
LOOP_REFERENCE, LOOP_IMPEDANCE = (4e-3, 1.0), (0.99, 0.9999, 1e-4)

#: Distance of the second point on the axis of a hinge [m].
ALONG = 0.1


@dataclass(frozen=True, eq=False)
class LoopElements:
    """Lines of an MJCF that close loops."""

    sites: dict[int, list[str]]  # by link, -1 for the base
    tendons: list[str]
    equalities: list[str]


def loop_elements(robot: Robot) -> LoopElements:
    """All loops and proportions of a robot."""
    sites: dict[int, list[str]] = {}
    tendons: list[str] = []
    equalities: list[str] = []
    constraints = robot.constraints
    if constraints is None:
        return LoopElements(sites, tendons, equalities)
    used: list[str] = []
    first = 0
    for closure in constraints.closures:
        own = [k - first for k in constraints.kept if first <= k < first + closure.equations]
        turns = any(k >= 3 for k in own)
        first += closure.equations
        for name, element, frames in _pairs(robot, closure, turns):
            both = []
            for k, (link, frame) in enumerate(zip(closure.links, frames, strict=True)):
                both.append(unlike(f"{name}_{k + 1}", used))
                used.append(both[-1])
                sites.setdefault(link, []).append(_site(both[-1], frame))
            one, two = (quoted(site) for site in both)
            equalities.append(f"<{element} name={quoted(name)} site1={one} site2={two}/>")
    for proportion in constraints.linear:
        own_tendons, line = _proportion(robot, proportion)
        tendons += own_tendons
        equalities.append(line)
    return LoopElements(sites, tendons, equalities)


def _pairs(robot: Robot, closure: Closure, turns: bool) -> list[tuple[str, str, tuple[Pose, Pose]]]:
    """Name, element and frames of the pairs of sites that close a loop."""
    assert robot.constraints is not None
    if closure.kind == "point" or not turns:
        return [(closure.name, "connect", closure.frames)]
    # the equations hold for frames that differ by half turns too, sites of a weld do not
    poses = link_frames(robot.tree, robot.constraints.posture)
    ends = [
        poses[link] @ frame if link >= 0 else frame
        for link, frame in zip(closure.links, closure.frames, strict=True)
    ]
    half_turn = np.round(ends[1].rotation.T @ ends[0].rotation)
    one, two = closure.frames
    if closure.kind == "full":
        turned = Pose(two.rotation @ half_turn, two.translation)
        return [(closure.name, "weld", (one, turned))]
    sides = 1.0, float(half_turn[2, 2])
    points = tuple(
        Pose(f.rotation, f.translation + side * ALONG * f.rotation[:, 2])
        for f, side in zip((one, two), sides, strict=True)
    )
    return [
        (closure.name, "connect", closure.frames),
        (f"{closure.name} axis", "connect", (points[0], points[1])),
    ]


def _site(name: str, frame: Pose) -> str:
    turn = "" if (frame.rotation == np.eye(3)).all() else numbers(quaternion(frame.rotation))
    turned = f' quat="{turn}"' if turn else ""
    return f'<site name={quoted(name)} pos="{numbers(frame.translation)}"{turned}/>'


def _proportion(robot: Robot, one: LinearConstraint) -> tuple[list[str], str]:
    """Joints in proportion: lines of a tendon, which few of them need, and the equality."""
    assert robot.constraints is not None
    tree, posture = robot.tree, robot.constraints.posture
    coupled = np.flatnonzero(one.ratios)
    names = [quoted(tree.joints[i].name) for i in coupled]
    follower = max(range(len(coupled)), key=lambda k: (coupled[k] not in robot.places, k))
    ratios = one.ratios[coupled] / one.ratios[coupled[follower]]
    rest = float((one.offset - one.ratios @ posture) / one.ratios[coupled[follower]])
    own = quoted(one.name)
    if len(coupled) > 2:
        tendon = [f"<fixed name={own}>"]
        tendon += [
            f'  <joint joint={name} coef="{number(ratio)}"/>'
            for name, ratio in zip(names, ratios.tolist(), strict=True)
        ]
        line = f'<tendon name={own} tendon1={own} polycoef="{number(rest)} 0 0 0 0"/>'
        return [*tendon, "</fixed>"], line
    leader, slope = "", 0.0
    if len(coupled) == 2:
        leader, slope = f" joint2={names[1 - follower]}", -float(ratios[1 - follower])
    coefficients = f'polycoef="{number(rest)} {number(slope)} 0 0 0"'
    return [], f"<joint name={own} joint1={names[follower]}{leader} {coefficients}/>"
