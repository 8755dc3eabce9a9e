"""Motion of the links by the forward recursion of Newton and Euler, in symbols.

From the base outwards, with R and p the pose of link i in its parent j,

    ω_i  = Rᵀ ω_j + dq z                          (revolute)
    dω_i = Rᵀ dω_j + ω_i × dq z + ddq z
    a_i  = Rᵀ (a_j + U_j p) + 2 ω_i × dq z + ddq z    (last two terms: prismatic)
    U_i  = [dω_i]× + [ω_i]× [ω_i]×

Gravity is an upward acceleration of the base. Consecutive joints with parallel axes turn together
by one angle: a vector from before the first of them is rotated once, by q₂ + q₃, instead of twice
(Khalil and Kleinfinger 1987).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from pivident.dynamics.grouping.expressions import ONE, ZERO, Expression, constant
from pivident.models.symbolic.model_symbols import ModelSymbols
from pivident.models.symbolic.sums import (
    NULL,
    JointFrame,
    Turn,
    Vector,
    back_about_x,
    back_about_z,
    collected,
    cross,
    dot,
    is_null,
    joint_frame,
    plus,
    turn,
)

Matrix = tuple[Vector, Vector, Vector]


@dataclass(frozen=True)
class Run:
    """Consecutive joints with parallel axes, the last of them the link's own."""

    before: int  # link that carries the first of them, -1 for the base
    first: int  # index of the first of them
    angle: Expression  # by which they turn together
    turn: Turn  # its cosine and sine
    flip: Turn  # Rx(0) or Rx(π) after that rotation
    rate: Expression  # speed of the turn, about the link's axis
    acceleration: Expression

    def out(self, frame: JointFrame, a: Vector) -> Vector:
        """A vector in the frame before the run's first joint, seen from the link at its end."""
        return back_about_x(self.flip, back_about_z(self.turn, frame.staged(a)))


@dataclass(frozen=True)
class LinkMotion:
    """Motion of one link in its own frame: ω, dω, and a of the origin, less gravity.

    ``run`` are the joints with parallel axes that end here, one joint alone included; ``origin`` is
    the part of a across the axis as it was before the run, None if that is not all.
    """

    frame: JointFrame
    run: Run
    w: Vector
    dw: Vector
    a: Vector
    origin: Vector | None
    u: Matrix  # U row by row
    squares: Vector  # wx², wy², wz²
    products: Vector  # wx wy, wx wz, wy wz

    def hints(self, number: int) -> Iterator[tuple[str, Expression]]:
        """Descriptive names of its quantities for generated code."""
        yield f"s{number}", self.frame.last.sin
        yield f"c{number}", self.frame.last.cos
        for name, vector in (("w", self.w), ("dw", self.dw), ("a", self.a)):
            yield from ((f"{name}{x}{number}", v) for x, v in zip("xyz", vector, strict=True))
        for x, row in zip("xyz", self.u, strict=True):
            yield from ((f"u{x}{y}{number}", v) for y, v in zip("xyz", row, strict=True))


def link_motion(
    model: ModelSymbols,
    *,
    speeds: bool = True,
    accelerations: bool = True,
    gravity: bool = True,
    combine: bool = True,
) -> list[LinkMotion]:
    """Motion of every link; ``combine`` rotates joints with parallel axes together."""
    moving: list[LinkMotion] = []
    for i, joint in enumerate(model.robot.joints):
        frame = joint_frame(joint, model.q[i])
        dq = model.dq[i] if speeds else ZERO
        ddq = model.ddq[i] if accelerations else ZERO
        before = moving[joint.parent] if joint.parent >= 0 else None
        revolute = joint.kind == "revolute"
        turning = (dq, ddq) if revolute else (ZERO, ZERO)
        sliding = (ZERO, ZERO) if revolute else (dq, ddq)
        run = _run(i, joint.parent, frame, before, turning, combine)
        base = _base_motion(model, gravity)
        start = moving[run.before] if run.before >= 0 else base
        first = frame if run.first == i else moving[run.first].frame
        w = _angular_velocity(frame, run, first, start.w, (before or base).w, turning[0])
        dw = _angular_acceleration(frame, run, first, start.dw, (before or base).dw, w, turning[1])
        a, origin = _acceleration(frame, run, first, before or base, w, sliding)
        moving.append(LinkMotion(frame, run, w, dw, a, origin, *_rotation_matrix(w, dw)))
    return moving


def link_velocities(
    model: ModelSymbols, motions: list[LinkMotion], link: int
) -> Iterator[tuple[int, tuple[Vector, Vector]]]:
    """Velocities (v, w) of a link's origin and frame per joint speed, in its frame."""
    robot = model.robot
    chain = robot.ancestors(link)
    for start, j in enumerate(chain):
        axis: Vector = (ZERO, ZERO, ONE)
        v, w = (NULL, axis) if robot.joints[j].kind == "revolute" else (axis, NULL)
        for i in reversed(chain[:start]):
            frame = motions[i].frame
            v, w = frame.out(plus(v, cross(w, frame.origin))), frame.out(w)
        yield j, (v, w)


def given_velocities(
    model: ModelSymbols, motions: list[LinkMotion], link: int
) -> Iterator[tuple[int, tuple[Vector, Vector]]]:
    """The same per speed of the joints whose motion is given, numbered among themselves."""
    if model.gain is None:
        yield from link_velocities(model, motions, link)
        return
    for a in range(model.gain.shape[1]):
        v, w = NULL, NULL
        for i in reversed(model.robot.ancestors(link)):
            frame, share = motions[i].frame, model.gain[i, a]
            v, w = frame.out(plus(v, cross(w, frame.origin))), frame.out(w)
            if model.robot.joints[i].kind == "revolute":
                w = w[0], w[1], collected(w[2] + share)
            else:
                v = v[0], v[1], collected(v[2] + share)
        if not (is_null(v) and is_null(w)):
            yield a, (v, w)


@dataclass(frozen=True)
class _Base:
    """The base: at rest, or accelerated upwards."""

    w: Vector
    dw: Vector
    a: Vector
    u: Matrix
    origin: Vector | None = None


def _base_motion(model: ModelSymbols, gravity: bool) -> _Base:
    upwards = tuple(-g for g in model.gravity)
    a = (upwards[0], upwards[1], upwards[2]) if gravity else NULL
    return _Base(NULL, NULL, a, (NULL, NULL, NULL))


def _run(
    i: int,
    parent: int,
    frame: JointFrame,
    before: LinkMotion | None,
    turning: tuple[Expression, Expression],
    combine: bool,
) -> Run:
    rate, acceleration = turning
    if before is None or not combine or not frame.parallel:
        none = turn(constant(0.0))
        return Run(parent, i, frame.angle, frame.last, none, rate, acceleration)
    # Rx(flip) Rz(x) = Rz(±x) Rx(flip), so that angles after a flip count negative
    sign = before.run.flip.cos
    angle = collected(
        before.run.angle + sign * frame.first_angle + sign * frame.parallel * frame.angle
    )
    flip = turn(0.0) if (sign * frame.parallel).is_one else Turn(constant(-1.0), ZERO)
    return Run(
        before.run.before,
        before.run.first,
        angle,
        turn(angle),
        flip,
        collected(frame.parallel * before.run.rate + rate),
        collected(frame.parallel * before.run.acceleration + acceleration),
    )


def _angular_velocity(
    frame: JointFrame, run: Run, first: JointFrame, start: Vector, parent: Vector, dq: Expression
) -> Vector:
    """ω: across the axis from before the run, along it from the parent."""
    turned = run.out(first, start)
    return turned[0], turned[1], collected(frame.staged(parent)[2] + dq)


def _angular_acceleration(
    frame: JointFrame,
    run: Run,
    first: JointFrame,
    start: Vector,
    parent: Vector,
    w: Vector,
    ddq: Expression,
) -> Vector:
    """dω: ω × (rate of the run) across the axis; ω is seen from the link, so it is free of q."""
    turned = run.out(first, start)
    return (
        turned[0] + w[1] * run.rate,
        turned[1] - w[0] * run.rate,
        collected(frame.staged(parent)[2] + ddq),
    )


def _acceleration(
    frame: JointFrame,
    run: Run,
    first: JointFrame,
    before: LinkMotion | _Base,
    w: Vector,
    sliding: tuple[Expression, Expression],
) -> tuple[Vector, Vector | None]:
    """Acceleration of the origin, less gravity, and the same before the run's rotation."""
    lever = tuple(dot(row, frame.origin) for row in before.u)
    total = plus(before.a, (lever[0], lever[1], lever[2]))
    origin: Vector | None = total
    if first is not frame:
        # without lever arm since the run began, the vector from before it is rotated only once
        origin = before.origin if is_null((lever[0], lever[1], lever[2])) else None
    x, y, z = frame.out(total)
    if origin is not None:
        x, y, _ = run.out(first, origin)
    dq, ddq = sliding
    across = (2.0 * (dq * w[1]), -2.0 * (dq * w[0]))
    if not (across[0].is_zero and across[1].is_zero):
        origin = None
    return (x + across[0], y + across[1], z + ddq), origin


def _rotation_matrix(w: Vector, dw: Vector) -> tuple[Matrix, Vector, Vector]:
    """U row by row, and the products of speeds in it."""
    xx, yy, zz = w[0] * w[0], w[1] * w[1], w[2] * w[2]
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    u = (
        (-(yy + zz), xy - dw[2], xz + dw[1]),
        (xy + dw[2], -(xx + zz), yz - dw[0]),
        (xz - dw[1], yz + dw[0], -(xx + yy)),
    )
    return u, (xx, yy, zz), (xy, xz, yz)
