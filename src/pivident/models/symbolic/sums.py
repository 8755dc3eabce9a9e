"""Sums whose terms cancel, and products of rotations about the axes of frames in turn.

Angles of closed mechanisms depend on each other: on the way from the base over a parallelogram to
the wrist, the same angle is added and subtracted again. What is left is found by collecting terms,
so that a link which only moves in parallel has a constant rotation.

Vectors and symmetric tensors of expressions, their rotation, and the frame of a link.

The frame of a link in its parent's, factored so that a symbolic recursion can simplify it.

Every fixed rotation is Rz(ψ) Rx(α) Rz(φ), and φ adds to the joint's angle:

    ^pR_i = Rz(ψ) Rx(α) Rz(q + φ)   revolute,      Rz(ψ) Rx(α) Rz(φ)   prismatic

In a modified DH table ψ = 0. Rotating a vector costs four products for each factor that is not a
multiple of 90°, at most twelve instead of the thirteen of a full matrix and one angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pivident.dynamics.grouping.expressions import (
    EXACT,
    ZERO,
    Add,
    Constant,
    Expression,
    Multiply,
    Negate,
    Operand,
    as_expression,
    constant,
    cosine,
    sine,
)
from pivident.robot.description import Joint

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
        elif (
            about == "z"
            and last is not None
            and isinstance(last.angle, Constant)
            and abs(abs(last.angle.value) - math.pi) < EXACT
        ):
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


Vector = tuple[Expression, Expression, Expression]
NULL: Vector = (ZERO, ZERO, ZERO)


def plus(*vectors: Vector) -> Vector:
    """Sum of vectors."""
    x, y, z = NULL
    for a, b, c in vectors:
        x, y, z = x + a, y + b, z + c
    return x, y, z


def minus(a: Vector) -> Vector:
    """The opposite vector."""
    return -a[0], -a[1], -a[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product a × b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def dot(a: Vector, b: Vector) -> Expression:
    """Scalar product aᵀb."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def scaled(factor: Expression, a: Vector) -> Vector:
    """A vector times a number."""
    return factor * a[0], factor * a[1], factor * a[2]


def is_null(a: Vector) -> bool:
    """Whether all elements are the constant 0."""
    return all(x.is_zero for x in a)


class Turn(NamedTuple):
    """Cosine and sine of an angle."""

    cos: Expression
    sin: Expression


def about_z(turn: Turn, a: Vector) -> Vector:
    """Rz(θ) a, from the turned frame into the one before."""
    c, s = turn
    return c * a[0] - s * a[1], s * a[0] + c * a[1], a[2]


def back_about_z(turn: Turn, a: Vector) -> Vector:
    """Rz(θ)ᵀ a, into the turned frame."""
    c, s = turn
    return c * a[0] + s * a[1], c * a[1] - s * a[0], a[2]


def about_x(turn: Turn, a: Vector) -> Vector:
    """Rx(α) a."""
    c, s = turn
    return a[0], c * a[1] - s * a[2], s * a[1] + c * a[2]


def back_about_x(turn: Turn, a: Vector) -> Vector:
    """Rx(α)ᵀ a."""
    c, s = turn
    return a[0], c * a[1] + s * a[2], c * a[2] - s * a[1]


class Tensor(NamedTuple):
    """A symmetric tensor by its elements."""

    xx: Expression
    xy: Expression
    xz: Expression
    yy: Expression
    yz: Expression
    zz: Expression

    def plus(self, other: Tensor) -> Tensor:
        """Sum with another one."""
        return Tensor(*(a + b for a, b in zip(self, other, strict=True)))


def tensor_about_z(turn: Turn, a: Tensor) -> Tensor:
    """Rz(θ) A Rz(θ)ᵀ in 9 products: t = s (xx - yy) + 2 c xy turns the upper block."""
    c, s = turn
    t = s * (a.xx - a.yy) + c * (a.xy + a.xy)
    return Tensor(
        a.xx - s * t,
        c * t - a.xy,
        c * a.xz - s * a.yz,
        a.yy + s * t,
        s * a.xz + c * a.yz,
        a.zz,
    )


def tensor_about_x(turn: Turn, a: Tensor) -> Tensor:
    """Rx(α) A Rx(α)ᵀ, the same with the axes permuted cyclically."""
    b = tensor_about_z(turn, Tensor(a.yy, a.yz, a.xy, a.zz, a.xz, a.xx))
    return Tensor(b.zz, b.xz, b.yz, b.xx, b.xy, b.yy)


@dataclass(frozen=True)
class JointFrame:
    """Pose of a link's frame in its parent's."""

    first: Turn  # Rz(ψ)
    tilt: Turn  # Rx(α)
    angle: Expression  # θ, of the last rotation Rz(θ)
    last: Turn  # Rz(θ)
    first_angle: float  # ψ
    last_angle: float  # φ, which θ is more than the position of a revolute joint
    parallel: int  # 1: its axis has the parent's direction, -1: the opposite one, 0: another
    origin: Vector  # in the parent's frame, with the slide of a prismatic joint

    def out(self, a: Vector) -> Vector:
        """A vector in the parent's frame, seen from the link's."""
        return back_about_z(self.last, self.staged(a))

    def staged(self, a: Vector) -> Vector:
        """A vector in the parent's frame, seen from the link's before the last rotation."""
        return back_about_x(self.tilt, back_about_z(self.first, a))

    def back(self, a: Vector) -> Vector:
        """A vector in the link's frame, seen from the parent's."""
        return about_z(self.first, about_x(self.tilt, about_z(self.last, a)))

    def tensor_back(self, a: Tensor) -> Tensor:
        """A tensor in the link's frame, seen from the parent's."""
        return tensor_about_z(self.first, tensor_about_x(self.tilt, tensor_about_z(self.last, a)))


def joint_frame(joint: Joint, q: Operand) -> JointFrame:
    """The frame behind a joint at the position q."""
    psi, alpha, phi = _angles(joint.rotation)
    revolute = joint.kind == "revolute"
    angle = as_expression(q) + phi if revolute else constant(phi)
    slide = constant(0.0) if revolute else as_expression(q)
    origin = tuple(
        exact(t) + exact(z) * slide
        for t, z in zip(joint.translation.tolist(), joint.rotation[:, 2].tolist(), strict=True)
    )
    tilt = turn(alpha)
    parallel = 0
    if tilt.sin.is_zero:
        parallel = 1 if tilt.cos.is_one else -1
    return JointFrame(
        turn(psi),
        tilt,
        angle,
        turn(angle),
        psi,
        phi,
        parallel,
        (origin[0], origin[1], origin[2]),
    )


def turn(angle: Operand) -> Turn:
    """Cosine and sine of an angle."""
    return Turn(cosine(angle), sine(angle))


def _angles(rotation: np.ndarray) -> tuple[float, float, float]:
    """ψ, α, φ of R = Rz(ψ) Rx(α) Rz(φ), with ψ = 0 where possible."""
    tilt = math.hypot(rotation[0, 2], rotation[1, 2])
    if tilt < EXACT:
        alpha = 0.0 if rotation[2, 2] > 0.0 else math.pi
        return 0.0, alpha, math.atan2(rotation[1, 0] * math.cos(alpha), rotation[0, 0])
    psi = math.atan2(rotation[0, 2], -rotation[1, 2])
    phi = math.atan2(rotation[2, 0], rotation[2, 1])
    alpha = math.atan2(tilt, rotation[2, 2])
    if abs(psi) > 0.5 * math.pi + EXACT:  # the same rotation with the angles on the other side
        psi, alpha, phi = psi - math.copysign(math.pi, psi), -alpha, phi + math.pi
    return psi, alpha, math.remainder(phi, 2.0 * math.pi)


def exact(value: float) -> Expression:
    """A constant; 0 and ±1 within rounding are exact."""
    whole = round(value)
    return constant(whole if abs(value - whole) < EXACT and abs(whole) <= 1 else value)
