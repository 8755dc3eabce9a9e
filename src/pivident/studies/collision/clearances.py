"""Distances between the bodies of a robot and all that they must not touch, with their gradients.

With n the unit vector from the nearest point of one body to that of the other, and J the Jacobians
of these two points as carried by their links,

    ∂d/∂q = nᵀ (J_a - J_b)

wherever the nearest points are unique. The gradient is that of d itself, no matter that the points
slide along the surfaces as the robot moves.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.display import Displayed
from pivident.robot.description import Robot
from pivident.robot.refusals import without_loops
from pivident.studies.collision.bodies import (
    Body,
    LinkPoses,
    Obstacle,
    ToolBox,
    floor_plate,
    upward,
)
from pivident.studies.collision.distances import SEGMENT, axis_distances, gradient_by_joints
from pivident.studies.collision.outlines import reach
from pivident.studies.collision.pairs import (
    Pair,
    candidate_pairs,
    levers,
    random_postures,
    swept_ball,
)

#: Share of random postures from which on two bodies are near because they are built so.
STRUCTURAL_SHARE = 0.95

#: Change over all postures below which a distance is a constant [m].
CONSTANT = 1e-9


@dataclass(frozen=True, eq=False)
class Clearances(Displayed):
    """What must stay apart, and how far apart it is; made by `Clearances.of`.

    Attributes:
        robot: the robot.
        pairs: what is checked, one for each row.
        floor: height of the floor above the base's origin [m], None without one.
        tool_box: where the tool has to stay, None where it may go anywhere.
        remarks: what is not checked and why, complete sentences.
        bodies: bodies of the robot.
        obstacles: what stands around it.
    """

    robot: Robot
    pairs: tuple[Pair, ...]
    floor: float | None = None
    tool_box: ToolBox | None = None
    remarks: tuple[str, ...] = ()
    bodies: tuple[Body, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()

    @classmethod
    def of(
        cls,
        robot: Robot,
        bodies: Sequence[Body],
        obstacles: Sequence[Obstacle] = (),
        *,
        floor: float | None = None,
        tool_box: ToolBox | None = None,
        clearance: float = 0.02,
        apart: Collection[frozenset[str]] = (),
    ) -> Clearances:
        """Everything that must stay apart.

        Checked are bodies of links that are not neighbours, and moving bodies against obstacles and
        floor. Left out, with a remark, are bodies of the robot that overlap in nearly all of some
        hundred random postures, and bodies of a first link that are as near to what the robot
        stands on, because they are built so; and silently, what no posture brings together. Bodies
        that are built closer than the clearance, but do not overlap, keep half of what nearly every
        posture leaves them. Neighbouring links are kept apart by the limits of their joint.

        Args:
            robot: the robot.
            bodies: its bodies, see `pivident.studies.outline_of`.
            obstacles: what stands around it.
            floor: height of the floor above the base's origin, against gravity [m]; None: none.
            tool_box: where a point of the tool has to stay; None: anywhere.
            clearance: distance that bodies keep [m].
            apart: pairs of bodies, by their names, that are known not to touch; see
                `pivident.studies.built_apart`.

        Returns:
            The pairs to check.

        Raises:
            ExperimentError: a name is used twice, a value is not finite, a tool's link does not
                exist, or the robot has no gravity that says where the floor is.
            RobotDescriptionError: a robot with closed loops.
        """
        without_loops(robot, "the search for collisions")
        if floor is not None and not np.isfinite(floor):
            raise ExperimentError(f"floor = {floor} must be a height in metres").about("floor")
        if floor is not None:
            upward(robot)
        if not 0.0 <= clearance < np.inf:
            raise ExperimentError(f"clearance = {clearance} must not be negative, in metres").about(
                "clearance"
            )
        if tool_box is not None and tool_box.link is None:
            tool_box = replace(tool_box, link=robot.size - 1)
        if tool_box is not None and not 0 <= (tool_box.link or 0) < robot.size:
            raise ExperimentError(
                f"tool: link {tool_box.link} does not exist",
                advice=f"the links of {robot.name!r} count from 0 to {robot.size - 1}",
            )
        pairs = candidate_pairs(
            robot,
            bodies,
            obstacles,
            clearance,
            floor=floor is not None,
            tool=tool_box is not None,
        )
        pairs = [
            pair
            for pair in pairs
            if not isinstance(pair.other, Body)
            or pair.body is None
            or frozenset((pair.body.name, pair.other.name)) not in apart
        ]
        return cls(
            robot, tuple(pairs), floor, tool_box, bodies=tuple(bodies), obstacles=tuple(obstacles)
        )._without_constant_pairs()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the rows."""
        return tuple(pair.name for pair in self.pairs)

    @property
    def surroundings(self) -> tuple[Obstacle, ...]:
        """The obstacles, and a plate for the floor."""
        if self.floor is None:
            return self.obstacles
        width = 2.4 * max(reach(self.robot), 0.2)
        return (*self.obstacles, floor_plate(self.robot, self.floor, width))

    @property
    def needed(self) -> np.ndarray:
        """Distance that is asked for in each row [m], shape (rows,)."""
        return np.array([pair.needed for pair in self.pairs])

    def with_more(self, room: float) -> Clearances:
        """The same with more room between all.

        Args:
            room: beyond the distances asked for [m].
        """
        return replace(self, pairs=tuple(pair.with_more(room) for pair in self.pairs))

    def distances(self, q: np.ndarray) -> np.ndarray:
        """All distances, negative where bodies penetrate each other.

        Args:
            q: joint positions [rad or m], shape (samples, joints).

        Returns:
            Distances [m], shape (rows, samples).

        Raises:
            ExperimentError: q has another shape, or is not finite.
        """
        return self._evaluated(q, gradients=False)[0]

    def with_gradients(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances and their gradients by the joint positions.

        Args:
            q: joint positions [rad or m], shape (samples, joints).

        Returns:
            Distances [m], shape (rows, samples), and gradients [m/rad or 1], shape (rows, samples,
            joints).

        Raises:
            ExperimentError: q has another shape, or is not finite.
        """
        return self._evaluated(q, gradients=True)

    @cached_property
    def steepest(self) -> np.ndarray:
        """Bounds of |∂d/∂q| in every posture, shape (rows, joints) [m/rad or 1]."""
        found = []
        for pair in self.pairs:
            first, second = self._links(pair)
            one = levers(self.robot, first, self._points(pair.body))
            if isinstance(pair.other, Body):
                other = levers(self.robot, second, self._points(pair.other))
                # what moves both sides moves neither against the other
                one = np.where((one > 0.0) & (other > 0.0), 0.0, one + other)
            found.append(one)
        return np.reshape(found, (len(self.pairs), self.robot.size))

    def _points(self, body: Body | None) -> tuple[np.ndarray, ...]:
        """Ends of a body's axis, or the point of the tool, in the frame of the link."""
        if body is not None:
            return body.start, body.end
        assert self.tool_box is not None
        return (np.asarray(self.tool_box.point, dtype=float),)

    def _evaluated(self, q: np.ndarray, gradients: bool) -> tuple[np.ndarray, np.ndarray]:
        q = self._checked(q)
        poses = LinkPoses.of(self.robot, q)
        rows, samples = len(self.pairs), len(q)
        distance = np.empty((rows, samples))
        gradient = np.empty((rows if gradients else 0, samples, self.robot.size))
        axes = np.ascontiguousarray(poses.rotation[:-1, :, :, 2])
        prismatic = np.array([joint.kind == "prismatic" for joint in self.robot.joints])
        moved_by = _moved_by(self.robot)
        ends: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        for row, pair in enumerate(self.pairs):
            for body in (pair.body, pair.other):
                if isinstance(body, Body) and body.name not in ends:
                    ends[body.name] = (
                        poses.points(body.link, body.start),
                        poses.points(body.link, body.end),
                    )
            if pair.body is None:
                distance[row], normal, point = self._tool(poses)
            elif pair.other is None:
                distance[row], normal, point = self._above_floor(pair.body, *ends[pair.body.name])
            else:
                distance[row], normal, point = _apart(pair.body, pair.other, ends)
            if gradients:
                first, second = self._links(pair)
                gradient_by_joints(
                    moved_by[first] - moved_by[second], prismatic, axes, poses.origin, normal,
                    point, gradient[row],
                )  # fmt: skip
        return distance, gradient

    def _links(self, pair: Pair) -> tuple[int, int]:
        """Links that carry the two sides of a pair, -1 for what stands still."""
        if pair.body is None:
            assert self.tool_box is not None and self.tool_box.link is not None
            return self.tool_box.link, -1
        return pair.body.link, pair.other.link if isinstance(pair.other, Body) else -1

    def _above_floor(
        self, body: Body, start: np.ndarray, end: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        assert self.floor is not None
        up = upward(self.robot)
        heights = np.stack([start @ up, end @ up])
        lower = (heights[1] < heights[0])[:, None]
        normal = np.broadcast_to(up, start.shape).copy()
        return (
            heights.min(axis=0) - self.floor - body.radius,
            normal,
            np.where(lower, end, start),
        )

    def _tool(self, poses: LinkPoses) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Distance of the tool from the nearest side of its box, negative outside."""
        box = self.tool_box
        assert box is not None and box.link is not None
        point = poses.points(box.link, np.asarray(box.point, dtype=float))
        room = np.hstack([point - box.low, box.high - point])
        nearest = room.argmin(axis=1)
        normal = np.vstack([np.eye(3), -np.eye(3)])[nearest]
        return room.min(axis=1), normal, point

    def _checked(self, q: np.ndarray) -> np.ndarray:
        q = np.ascontiguousarray(q, dtype=float)
        if q.ndim != 2 or q.shape[1] != self.robot.size:
            raise ExperimentError(
                f"positions have shape {q.shape}",
                advice=f"(samples, {self.robot.size}) is needed for robot {self.robot.name!r}",
            )
        if not np.isfinite(q).all():
            sample, joint = np.argwhere(~np.isfinite(q))[0]
            raise ExperimentError(
                f"position of joint {self.robot.joints[joint].name!r} is {q[sample, joint]} at "
                f"sample {sample}",
                advice="a finite number is needed",
            )
        return q

    def _without_constant_pairs(self) -> Clearances:
        """The pairs that a motion can bring together and take apart, and remarks on the others."""
        found = self.distances(random_postures(self.robot))
        kept: list[Pair] = []
        built, close, standing = [], [], []
        for pair, distance in zip(self.pairs, found, strict=True):
            if pair.body is None:
                kept.append(pair)
                continue
            own = isinstance(pair.other, Body)
            constant = np.ptp(distance) <= CONSTANT
            near, overlap = (float(np.mean(distance < d)) for d in (pair.needed, 0.0))
            if own and (overlap > STRUCTURAL_SHARE or (constant and near)):
                built.append(pair.name)
            elif (
                not own
                and near > STRUCTURAL_SHARE
                and (constant or self.robot.joints[pair.body.link].parent < 0)
            ):  # a link that the base carries may be built near to what it stands on
                standing.append(pair.name)
            elif own and near > STRUCTURAL_SHARE:
                # nearly every posture keeps twice as much, which leaves as much again to plan with
                less = 0.5 * max(float(np.quantile(distance, 1.0 - STRUCTURAL_SHARE)), 0.0)
                kept.append(replace(pair, needed=less, spare=less))
                close.append(f"{pair.name} ({1e3 * less:.3g} mm)")
            elif not constant and not self._is_out_of_reach(pair):
                # room to plan with: at most half of what the pair has at its widest
                spare = 0.5 * float(np.quantile(distance - pair.needed, STRUCTURAL_SHARE))
                kept.append(replace(pair, spare=max(spare, 0.0)))
        remarks = []
        if built:
            remarks.append(
                f"Not checked, because they overlap in nearly every posture as they are built: "
                f"{'; '.join(built)}."
            )
        if close:
            remarks.append(
                f"These are built closer than the clearance and keep less: {'; '.join(close)}."
            )
        remarks += (
            f"Not checked: {name}, which is nearer than the clearance in nearly every posture; "
            "move or shrink one of the two if that is not how the robot stands."
            for name in standing
        )
        return replace(self, pairs=tuple(kept), remarks=(*self.remarks, *remarks))

    def _is_out_of_reach(self, pair: Pair) -> bool:
        """Whether no posture brings a body as near as the clearance to what stands still."""
        if pair.body is None or isinstance(pair.other, Body):
            return False
        centre, radius = swept_ball(self.robot, pair.body)
        if not np.isfinite(radius):
            return False
        ball = Body(pair.body.name, -1, centre, centre, radius)
        if pair.other is None:
            (distance,), _, _ = self._above_floor(ball, centre[None, :], centre[None, :])
        else:
            ends = {ball.name: (centre[None, :], centre[None, :])}
            (distance,), _, _ = _apart(ball, pair.other, ends)
        return bool(distance >= pair.needed)


def _apart(
    body: Body,
    other: Body | Obstacle,
    ends: dict[str, tuple[np.ndarray, np.ndarray]],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance of a body from another or an obstacle, with normal and point in the base frame."""
    start, end = ends[body.name]
    if isinstance(other, Body):
        kind, skin, solid = SEGMENT, other.radius, np.hstack(ends[other.name])
    else:
        kind, skin, solid = other.kind, other.skin, other.solid
    if not isinstance(other, Body) and kind != SEGMENT:
        start, end = (
            (points - other.translation) @ np.asarray(other.rotation, dtype=float)
            for points in (start, end)
        )
    distance = np.empty(len(start))
    normal, point = np.empty_like(start), np.empty_like(start)
    radii = body.radius + skin
    axis_distances(kind, start, end, solid, distance, normal, point)
    if not isinstance(other, Body) and kind != SEGMENT:
        normal = normal @ np.asarray(other.rotation).T
        point = point @ np.asarray(other.rotation).T + other.translation
    return distance - radii, normal, point


def _moved_by(robot: Robot) -> np.ndarray:
    """1 where a joint moves a link, shape (links + 1, joints); the base, last, is moved by none."""
    moved = np.zeros((robot.size + 1, robot.size))
    for link in range(robot.size):
        moved[link, list(robot.ancestors(link))] = 1.0
    return moved
