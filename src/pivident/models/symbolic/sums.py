"""Sums whose terms cancel, and products of rotations about the axes of frames in turn.

Angles of closed mechanisms depend on each other: on the way from the base over a parallelogram to
the wrist, the same angle is added and subtracted again. What is left is found by collecting terms,
so that a link which only moves in parallel has a constant rotation.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pivident.dynamics.grouping.expressions import (
    EXACT,
    ZERO,
    Add,
    Constant,
    Expression,
    Multiply,
    Negate,
    constant,
)
from pivident.models.symbolic.vectors import (
    JointFrame,
    Vector,
    about_x,
    about_z,
    back_about_x,
    back_about_z,
    turn,
)

#: Terms above which a sum is left as it is.
MAX_TERMS = 500


def collected(total: Expression) -> Expression:
    """The same sum without the terms that cancel; itself where nothing does."""
    weights: dict[Expression, float] = {}
    offset, count = 0.0, 0
    waiting = [(total, 1.0)]
    while waiting:
        node, factor = waiting.pop()
        if isinstance(node, Add):
            waiting.extend((operand, factor) for operand in reversed(node.operands))
        elif isinstance(node, Negate):
            waiting.append((node.operands[0], -factor))
        elif isinstance(node, Constant):
            offset += factor * node.value
        elif isinstance(node, Multiply) and isinstance(node.operands[0], Constant):
            waiting.append((node.operands[1], factor * node.operands[0].value))
        else:
            weights[node] = weights.get(node, 0.0) + factor
            count += 1
        if count > MAX_TERMS:
            return total
    if count == len(weights):
        return total
    result = ZERO
    for node, weight in weights.items():
        if abs(weight) > EXACT:
            result = result + constant(_whole(weight)) * node
    return result + constant(offset)


def _whole(weight: float) -> float:
    """A factor within rounding of a whole number is that number."""
    return float(round(weight)) if abs(weight - round(weight)) < EXACT else weight


class Rotation(NamedTuple):
    """A rotation by an angle about z, or a constant one about x."""

    about: str
    angle: Expression


class Rotations:
    """A product of rotations about z and x; neighbours about one axis are one rotation.

    Rx(π) moves to the right of Rz(x), which becomes Rz(-x), so that opposite axes count as
    parallel.
    """

    def __init__(self) -> None:
        self.factors: list[Rotation] = []

    def append(self, about: str, angle: Expression) -> None:
        """Multiply by a rotation from the right."""
        last = self.factors[-1] if self.factors else None
        if last is not None and last.about == about:
            self.factors.pop()
            angle = collected(last.angle + angle)
        elif last is not None and about == "z" and _is_half_turn(last.angle):
            self.factors.pop()
            self.append("z", -angle)
            self.append("x", last.angle)
            return
        if isinstance(angle, Constant):
            rest = math.remainder(angle.value, 2.0 * math.pi)
            if abs(rest) < EXACT:
                return
            angle = constant(rest)
        self.factors.append(Rotation(about, angle))

    def into(self, frame: JointFrame) -> None:
        """Go on from a parent's frame into that of its link."""
        tilt = math.atan2(frame.tilt.sin.evaluate({}), frame.tilt.cos.evaluate({}))
        self.append("z", constant(frame.first_angle))
        self.append("x", constant(tilt))
        self.append("z", frame.angle)

    def out_of(self, frame: JointFrame) -> None:
        """Go on from a link's frame into that of its parent."""
        tilt = math.atan2(frame.tilt.sin.evaluate({}), frame.tilt.cos.evaluate({}))
        self.append("z", -frame.angle)
        self.append("x", constant(-tilt))
        self.append("z", constant(-frame.first_angle))

    def back(self, a: Vector) -> Vector:
        """A vector in the last frame, seen from the first."""
        for about, angle in reversed(self.factors):
            a = (about_z if about == "z" else about_x)(turn(angle), a)
        return a

    def out(self, a: Vector) -> Vector:
        """A vector in the first frame, seen from the last."""
        for about, angle in self.factors:
            a = (back_about_z if about == "z" else back_about_x)(turn(angle), a)
        return a


def _is_half_turn(angle: Expression) -> bool:
    return isinstance(angle, Constant) and abs(abs(angle.value) - math.pi) < EXACT
