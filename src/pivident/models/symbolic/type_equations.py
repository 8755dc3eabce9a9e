"""Dependent joints in closed form: parallelograms, triangles of two unknown joints, single ones.

Whole-number proportions. Where q_d is a sum of independent positions with whole factors, as in a
parallelogram, that is how it is written.

Type equations (Khalil and Dombre, *Modeling, Identification and Control of Robots*, chapter 1). In
a planar loop with two unknown joints u and v, the loop's cut is at the same place from both sides,
seen from the frame that u turns in,

    Rz(θ_u) a = r,    a = a_0 + a_c cos θ_v + a_s sin θ_v,    r = r_0 + r_c cos θ_v + r_s sin θ_v

Lengths are equal, |a|² = |r|², which is X cos θ_v + Y sin θ_v = Z with two solutions,

    cos θ_v = (X Z - ε Y w) / (X² + Y²),    sin θ_v = (Y Z + ε X w) / (X² + Y²),
    w = √(X² + Y² - Z²),    ε = ±1

and θ_u turns a into r. One equation that has one unknown joint is of this type, or linear, at once.
The posture of the description chooses ε; w = 0 is a singular posture, and
behind it the loop does not close (w is NaN). If v slides, |a|² = |r|² is quadratic in its position.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pivident.dynamics.grouping.expressions import (
    ONE,
    ZERO,
    Expression,
    call,
    constant,
    divide,
    evaluate,
)
from pivident.models.symbolic.closures import LoopEnds, seen_from
from pivident.models.symbolic.sums import JointFrame, Turn, dot, joint_frame, minus, plus
from pivident.robot.description import Joint

#: Largest difference of a whole proportion from Newton's method at postures at random [rad or m],
#: and of a type equation, which is right or far off but for rounding next to a singular posture.
AGREES, NEAR = 1e-9, 1e-6

Plane = tuple[Expression, Expression]

#: a and r, see above.
Sides = tuple[Plane, Plane]


def whole_proportion(
    independent: np.ndarray, dependent: np.ndarray
) -> tuple[np.ndarray, float] | None:
    """Whole factors K and offset of q_d = K q_a + offset; None where there are none.

    Args:
        independent: positions q_a at postures at random, the description's first, shape
            (postures, joints).
        dependent: q_d there, shape (postures,).
    """
    start = independent[0], dependent[0]
    moved = independent[1:] - start[0]
    factors = np.round(np.linalg.lstsq(moved, dependent[1:, None] - start[1])[0][:, 0])
    offset = float(start[1] - factors @ start[0])
    if np.abs(independent @ factors + offset - dependent).max() > AGREES:
        return None
    quarters = round(offset / (0.5 * math.pi))
    if abs(offset - quarters * 0.5 * math.pi) < AGREES:
        offset = quarters * 0.5 * math.pi
    return factors, offset


def triangle(
    ends: LoopEnds, joints: Sequence[Joint], unknown: Sequence[int], posture: np.ndarray
) -> list[dict[int, Expression]]:
    """Positions of two unknown joints of a planar loop, one set for each of two solutions.

    Args:
        ends: the loop's closure; positions of the unknown joints in it are not used.
        joints: all joints of the tree.
        unknown: indices of the two.
        posture: positions of all joints near which angles are counted [rad or m].

    Returns:
        Expressions by joint; none where no joint of the two turns on the way of the loop.
    """
    turning = [i for i in unknown if joints[i].kind == "revolute"]
    if not turning:
        return []
    u = turning[0]
    (v,) = (i for i in unknown if i != u)
    frames = [motion.frame for motion in ends.motions]
    slides = joints[v].kind == "prismatic"
    (a_0, r_0), *moved = [
        _sides(ends, [own if i == v else frame for i, frame in enumerate(frames)], u)
        for own in _places(joints[v], frames[v])
    ]
    slopes = [(_less(a, a_0), _less(r, r_0)) for a, r in moved]
    places = (_slides if slides else _turns)((a_0, r_0), slopes)
    found = []
    for place in places:
        a, r = a_0, r_0
        for weight, (slope_a, slope_r) in zip(place, slopes, strict=True):
            a, r = _added(a, weight, slope_a), _added(r, weight, slope_r)
        scale = divide(ONE, _dot(a, a))
        turned = _dot(a, r) * scale, (a[0] * r[1] - a[1] * r[0]) * scale
        position = place[0] if slides else _angle_near(place, posture[v], frames[v])
        found.append({v: position, u: _angle_near(turned, posture[u], frames[u])})
    return found


def alone(
    ends: LoopEnds, axis: int, joints: Sequence[Joint], unknown: int, posture: np.ndarray
) -> list[dict[int, Expression]]:
    """Positions of a joint that one equation along an axis determines, one for each solution.

    Args:
        ends: the closure of the equation; the joint's position in it is not used.
        axis: of the first frame, along which its ends meet.
        joints: all joints of the tree.
        unknown: index of the joint.
        posture: positions of all joints near which angles are counted [rad or m].
    """
    frames = [motion.frame for motion in ends.motions]
    gaps = []
    for own in _places(joints[unknown], frames[unknown]):
        placed = [own if i == unknown else frame for i, frame in enumerate(frames)]
        met = seen_from(placed, ends.points[1], *reversed(ends.beyond))
        gaps.append(dot(ends.axis(0, axis), plus(ends.points[0], minus(met))))
    start, *moved = gaps
    slopes = [gap - start for gap in moved]
    if joints[unknown].kind == "prismatic":
        return [{unknown: divide(-start, slopes[0])}]
    places = _type_two(slopes[0], slopes[1], -start)
    return [{unknown: _angle_near(place, posture[unknown], frames[unknown])} for place in places]


def chosen_solution(
    solutions: Sequence[dict[int, Expression]],
    names: Sequence[str],
    independent: np.ndarray,
    positions: np.ndarray,
) -> dict[int, Expression] | None:
    """The solution that is right at postures at random; None without one.

    Args:
        solutions: positions by joint, in independent ones.
        names: of the symbols of independent positions.
        independent: their values, shape (postures, joints).
        positions: of all joints, shape (postures, tree joints).
    """
    values = dict(zip(names, independent.T, strict=True))
    for solution in solutions:
        with np.errstate(invalid="ignore", divide="ignore"):
            found = evaluate(solution.values(), values)
        apart = [
            np.abs(own - positions[:, joint]) for joint, own in zip(solution, found, strict=True)
        ]
        if np.max(apart) < NEAR:  # not so where one is NaN
            return solution
    return None


def _places(joint: Joint, frame: JointFrame) -> list[JointFrame]:
    """A joint put where what is linear in its place can be read off: 0, then one each."""
    if joint.kind == "prismatic":
        return [joint_frame(joint, 0.0), joint_frame(joint, 1.0)]
    turns = Turn(ZERO, ZERO), Turn(ONE, ZERO), Turn(ZERO, ONE)
    return [replace(frame, last=turn) for turn in turns]


def _sides(ends: LoopEnds, frames: list[JointFrame], u: int) -> Sides:
    """The cut behind u in the frame that turns with it, and from the other side in that before."""
    end = 0 if u in ends.beyond[0] else 1
    own, other = ends.beyond[end], ends.beyond[1 - end]
    place = own.index(u)
    behind = seen_from(frames, ends.points[end], own[:place], ())
    before = seen_from(frames, ends.points[1 - end], other, own[place + 1 :])
    met = frames[u].staged(plus(before, minus(frames[u].origin)))
    return (behind[0], behind[1]), (met[0], met[1])


def _turns(start: Sides, slopes: Sequence[Sides]) -> list[tuple[Expression, ...]]:
    """Cosine and sine of the two angles with |a|² = |r|²."""
    (a_0, r_0), (a_c, r_c), (a_s, r_s) = start, *slopes
    # |a_c| = |a_s|, at right angles, because they are turned by v
    x = _dot(r_0, r_c) - _dot(a_0, a_c)
    y = _dot(r_0, r_s) - _dot(a_0, a_s)
    z = -0.5 * (_dot(r_0, r_0) + _dot(r_c, r_c) - _dot(a_0, a_0) - _dot(a_c, a_c))
    return _type_two(x, y, z)


def _type_two(x: Expression, y: Expression, z: Expression) -> list[tuple[Expression, ...]]:
    """Cosine and sine of the two angles with X cos θ + Y sin θ = Z."""
    square = x * x + y * y
    root = call("sqrt", square - z * z)
    scale = divide(ONE, square)
    return [
        ((x * z - sign * (y * root)) * scale, (y * z + sign * (x * root)) * scale)
        for sign in (1.0, -1.0)
    ]


def _slides(start: Sides, slopes: Sequence[Sides]) -> list[tuple[Expression, ...]]:
    """The two positions with |a_0 + a_c q|² = |r_0 + r_c q|²."""
    (a_0, r_0), (a_c, r_c) = start, *slopes
    square = _dot(r_c, r_c) - _dot(a_c, a_c)
    half = divide(_dot(r_0, r_c) - _dot(a_0, a_c), square)
    root = call("sqrt", half * half - divide(_dot(r_0, r_0) - _dot(a_0, a_0), square))
    return [(root - half,), (-half - root,)]


def _angle_near(place: Sequence[Expression], position: float, frame: JointFrame) -> Expression:
    """A joint's angle within half a turn of the quarter turn next to a position.

    By 2 atan(sin / (1 + cos)) of what is left when that quarter is taken off.
    """
    (cos, sin), own = place, frame.last_angle
    quarter = round((position + own) / (0.5 * math.pi))
    for _ in range(quarter % 4):
        cos, sin = sin, -cos
    turned = 2.0 * call("atan", divide(sin, ONE + cos))
    return turned + constant(quarter * 0.5 * math.pi - own)


def _dot(a: Plane, b: Plane) -> Expression:
    return a[0] * b[0] + a[1] * b[1]


def _less(a: Plane, b: Plane) -> Plane:
    return a[0] - b[0], a[1] - b[1]


def _added(a: Plane, weight: Expression, b: Plane) -> Plane:
    return a[0] + weight * b[0], a[1] + weight * b[1]
