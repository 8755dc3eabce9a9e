"""The equations that close the loops of a mechanism, in symbols: c(q), A = ∂c/∂q and dA/dt dq.

For two frames (p_1, R_1) and (p_2, R_2) that meet, in links i and j,

    c = R_1ᵀ (p_1 - p_2),    c = a_1 · b_2

as in `pivident.robot.closed_chains`. Everything is seen from link i: its own point is constant
there, and the rotation from link j on is one product (`sums.Rotations`). A column of A is what the
speed of one joint makes of both ends,

    R_1ᵀ ((v_i + w_i × r) - (v_j + w_j × r_j)),    (a_1 × b_2) · (w_i - w_j)

where r is the second point as link i sees it, for that is where the frame of c turns about. Where
the loops are closed, it is the first, and the columns of a rod's own joints have a constant zero in
the row along the rod. dA/dt dq are the accelerations of the ends that the speeds alone make, by U
of each link.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pivident.dynamics.grouping.expressions import ZERO, Expression
from pivident.models.symbolic.link_motion import LinkMotion, link_motion, link_velocities
from pivident.models.symbolic.model_symbols import ModelSymbols
from pivident.models.symbolic.sums import (
    NULL,
    JointFrame,
    Rotations,
    Vector,
    collected,
    cross,
    dot,
    exact,
    minus,
    plus,
)
from pivident.robot.constraints import DIRECTIONS, Closure, Constraints, LinearConstraint


@dataclass(frozen=True, eq=False)
class LoopEnds:
    """The two frames of a closure."""

    closure: Closure
    motions: list[LinkMotion]
    beyond: tuple[tuple[int, ...], tuple[int, ...]]  # joints of each end that the other has not

    @classmethod
    def of(cls, model: ModelSymbols, closure: Closure) -> LoopEnds:
        """Those of a closure of a tree's links; what moves both counts as at rest."""
        tree = model.robot
        first, second = (tree.ancestors(link) if link >= 0 else () for link in closure.links)
        beyond = (
            tuple(i for i in first if i not in second),
            tuple(i for i in second if i not in first),
        )
        speeds = tuple(
            dq if i in (*beyond[0], *beyond[1]) else ZERO for i, dq in enumerate(model.dq)
        )
        relative = replace(model, dq=speeds)
        return cls(closure, link_motion(relative, accelerations=False, gravity=False), beyond)

    @cached_property
    def rotation(self) -> Rotations:
        """From the first link to the second."""
        turned = Rotations()
        for i in self.beyond[0]:
            turned.out_of(self.motions[i].frame)
        for i in reversed(self.beyond[1]):
            turned.into(self.motions[i].frame)
        return turned

    @cached_property
    def points(self) -> tuple[Vector, Vector]:
        """The origin of each frame, in its link."""
        first, second = (fixed(frame.translation) for frame in self.closure.frames)
        return first, second

    @cached_property
    def meeting(self) -> Vector:
        """The second point, seen from the first link."""
        frames = [motion.frame for motion in self.motions]
        return seen_from(frames, self.points[1], self.beyond[1], self.beyond[0])

    def axis(self, end: int, number: int) -> Vector:
        """A unit vector of a frame, in its link."""
        return fixed(self.closure.frames[end].rotation[:, number])

    def velocities(self, model: ModelSymbols, end: int) -> Iterator[tuple[int, Vector, Vector]]:
        """Joint, v and w of one link, in its frame, per speed of the joint."""
        link = self.closure.links[end]
        for joint, (v, w) in link_velocities(model, self.motions, link) if link >= 0 else ():
            if joint in self.beyond[end]:
                yield joint, v, w

    def motion(self, end: int) -> tuple[Vector, Vector, tuple[Vector, Vector, Vector]]:
        """ω, a of the origin and U of one link; the base is at rest."""
        link = self.closure.links[end]
        if link < 0:
            return NULL, NULL, (NULL, NULL, NULL)
        own = self.motions[link]
        return own.w, own.a, own.u


@dataclass(frozen=True, eq=False)
class ClosureEquation:
    """One equation of a closure: along an axis of the first frame, or two axes at right angles."""

    ends: LoopEnds
    axes: tuple[int, int] | int

    def gap(self) -> Expression:
        """The element of c."""
        ends = self.ends
        if isinstance(self.axes, int):
            return dot(ends.axis(0, self.axes), plus(ends.points[0], minus(ends.meeting)))
        first, second = self._directions()
        return dot(ends.rotation.out(first), second)

    def slope(self, model: ModelSymbols, closed: bool) -> dict[int, Expression]:
        """Elements of A by joint; ``closed``: where the ends meet."""
        ends, row = self.ends, {}
        if isinstance(self.axes, int):
            axis = ends.axis(0, self.axes)
            arms = (ends.points[0] if closed else ends.meeting, ends.points[1])
            for end, (along, sign) in enumerate(((axis, 1.0), (ends.rotation.out(axis), -1.0))):
                for joint, v, w in ends.velocities(model, end):
                    row[joint] = sign * dot(along, plus(v, cross(w, arms[end])))
            return row
        first, second = self._directions()
        normals = (
            cross(first, ends.rotation.back(second)),
            cross(ends.rotation.out(first), second),
        )
        for end, sign in ((0, 1.0), (1, -1.0)):
            for joint, _, w in ends.velocities(model, end):
                row[joint] = sign * dot(normals[end], w)
        return row

    def drift(self) -> Expression:
        """The element of dA/dt dq."""
        ends = self.ends
        (w_1, a_1, u_1), (w_2, a_2, u_2) = ends.motion(0), ends.motion(1)
        if isinstance(self.axes, int):
            axis = ends.axis(0, self.axes)
            here = plus(a_1, _times(u_1, ends.points[0]))
            there = plus(a_2, _times(u_2, ends.points[1]))
            return dot(axis, here) - dot(ends.rotation.out(axis), there)
        first, second = self._directions()
        turned = ends.rotation
        return (
            dot(_times(u_1, first), turned.back(second))
            + 2.0 * dot(turned.out(cross(w_1, first)), cross(w_2, second))
            + dot(turned.out(first), _times(u_2, second))
        )

    def _directions(self) -> tuple[Vector, Vector]:
        assert not isinstance(self.axes, int)
        return self.ends.axis(0, self.axes[0]), self.ends.axis(1, self.axes[1])


@dataclass(frozen=True, eq=False)
class LinearEquation:
    """One equation of joints that move in proportion."""

    constraint: LinearConstraint
    q: tuple[Expression, ...]

    def gap(self) -> Expression:
        """The element of c."""
        total = exact(-self.constraint.offset)
        for ratio, q in zip(self.constraint.ratios.tolist(), self.q, strict=True):
            total = total + ratio * q
        return collected(total)

    def slope(self, model: ModelSymbols, closed: bool) -> dict[int, Expression]:
        """Elements of A by joint."""
        ratios = self.constraint.ratios.tolist()
        return {i: exact(ratio) for i, ratio in enumerate(ratios) if ratio}

    def drift(self) -> Expression:
        """The element of dA/dt dq."""
        return ZERO


def closing_equations(
    model: ModelSymbols, constraints: Constraints
) -> list[ClosureEquation | LinearEquation]:
    """The kept equations of a mechanism whose tree moves by the symbols of ``model``."""
    every: list[ClosureEquation | LinearEquation] = []
    for closure in constraints.closures:
        ends = LoopEnds.of(model, closure)
        every += [
            *(ClosureEquation(ends, axis) for axis in range(3)),
            *(ClosureEquation(ends, axes) for axes in DIRECTIONS[closure.kind]),
        ]
    every += [LinearEquation(one, model.q) for one in constraints.linear]
    return [every[k] for k in constraints.kept]


def jacobian(
    equations: list[ClosureEquation | LinearEquation], model: ModelSymbols, closed: bool
) -> np.ndarray:
    """A, shape (equations, joints of the tree); ``closed``: where the loops are closed."""
    matrix = np.full((len(equations), model.robot.size), ZERO, dtype=object)
    for row, equation in enumerate(equations):
        for joint, value in equation.slope(model, closed).items():
            matrix[row, joint] = value
    return matrix


def seen_from(
    frames: list[JointFrame], point: Vector, outwards: tuple[int, ...], inwards: tuple[int, ...]
) -> Vector:
    """A point of one link seen from another one.

    Args:
        frames: of all links.
        point: in the frame of the first link of ``outwards``.
        outwards: links from that of the point to the one before where the ways meet.
        inwards: links from the one that sees it to the one before where the ways meet.
    """
    for i in outwards:
        point = plus(frames[i].back(point), frames[i].origin)
    for i in reversed(inwards):
        point = frames[i].out(plus(point, minus(frames[i].origin)))
    return point


def fixed(vector: np.ndarray) -> Vector:
    """A constant vector."""
    x, y, z = (exact(value) for value in vector.tolist())
    return x, y, z


def _times(u: tuple[Vector, Vector, Vector], a: Vector) -> Vector:
    return dot(u[0], a), dot(u[1], a), dot(u[2], a)
