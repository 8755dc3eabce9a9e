"""Vectors and symmetric tensors of expressions, and their rotation about coordinate axes."""

from __future__ import annotations

from typing import NamedTuple

from pivident.dynamics.grouping.expressions import ZERO, Expression

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
    twice = a.xy + a.xy
    t = s * (a.xx - a.yy) + c * twice
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
