"""Limits of a written motion, computed again by other means than those of the design.

The samples come from ``motion.csv``. Forward kinematics are homogeneous matrices of the robot's
joints, distances those of the library coal (capsules against capsules and solids, and the shapes of
a URDF against each other), torques those of Pinocchio where there is a URDF with masses, with the
friction of the present model.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import coal
import numpy as np
import pinocchio

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.regressor import Regressor
from pivident.robot.description import Robot
from pivident.studies import Body, Clearances, JointLimits, Obstacle, exact_distances

#: What rounding in the file, and the tolerance of coal, may take: share of a limit, and [m].
SHARE, TOLERANCE = 1e-6, 1e-5

#: Distance below which every sample is looked at, above it each tenth [m].
NEAR = 0.08


@dataclass(frozen=True)
class FineResult:
    """What the other computation found.

    Attributes:
        violations: one sentence each.
        samples: of the fine grid.
        torque: largest difference of the torques, by Pinocchio and by the design [N m], or NaN.
        room: of the shapes of links over that of their capsules where these are nearest, least
            and median over the pairs of links [m]; NaN without a URDF with shapes.
        exact: least distance of two shapes [m].
    """

    violations: tuple[str, ...]
    samples: int
    torque: float
    room: tuple[float, float]
    exact: float


def check(
    robot: Robot, path: Path, limits: JointLimits, clearances: Clearances, *, shapes: bool
) -> FineResult:
    """All limits on the samples of a file."""
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    n = robot.size
    t, (q, dq, ddq) = table[:, 0], (table[:, 1 + k * n : 1 + (k + 1) * n] for k in range(3))
    found = _derivatives(t, q, dq, ddq) + _kinematic(robot, q, dq, ddq, limits)
    torque, difference = torques(robot, q, dq, ddq)
    if torque is not None:
        used = np.abs(torque).max(axis=0) / limits.torque
        found += _over("torque", robot, used)
    poses = kinematics(robot, q)
    least = {}
    for pair in clearances.pairs:
        distance, sample = least_distance(pair, poses, clearances)
        least[pair.name] = (distance, sample)
        if distance < pair.needed - TOLERANCE:
            found.append(f"{pair.name}: {1e3 * distance:.2f} mm at {t[sample]:.3f} s")
    room, exact = (np.nan, np.nan), np.nan
    if shapes and robot.urdf is not None:
        room, exact, touching = _shapes(robot, q, clearances, least)
        found += touching
    return FineResult(tuple(found), len(t), difference, room, exact)


def _derivatives(t, q, dq, ddq) -> list[str]:
    """Speeds and accelerations of the file against differences of its positions."""
    step = t[1] - t[0]
    speed = (q[2:] - q[:-2]) / (2 * step)
    acceleration = (dq[2:] - dq[:-2]) / (2 * step)
    found = []
    for name, made, written in (("speed", speed, dq), ("acceleration", acceleration, ddq)):
        error = np.abs(made - written[1:-1]).max() / np.abs(written).max()
        if error > 0.01:
            found.append(f"{name} is not the derivative: {100 * error:.2f} %")
    return found


def _kinematic(robot, q, dq, ddq, limits) -> list[str]:
    found = _over("position", robot, np.abs(q - limits.middle).max(axis=0) / limits.half)
    found += _over("speed", robot, np.abs(dq).max(axis=0) / limits.speed)
    return found + _over("acceleration", robot, np.abs(ddq).max(axis=0) / limits.acceleration)


def _over(quantity: str, robot: Robot, used: np.ndarray) -> list[str]:
    return [
        f"{quantity} of {joint.name}: {100 * share:.3f} %"
        for joint, share in zip(robot.joints, used, strict=True)
        if share > 1.0 + SHARE
    ]


def torques(robot: Robot, q, dq, ddq) -> tuple[np.ndarray | None, float]:
    """Torques of the description, and the largest difference of Pinocchio's from pivident's."""
    base = base_parameters(robot)
    values = base.values(nominal_values(robot, base.standard))
    rigid = np.array([p.is_inertial for p in base.parameters])
    if not values[rigid].any():
        return None, np.nan
    regressor = Regressor.build(robot, base.parameters)
    matrix = regressor.matrix(q, dq, ddq, inner=regressor.levels(dq.T))
    matrix = np.asarray(matrix).reshape(len(q), robot.size, len(base))
    own = matrix @ values
    if robot.urdf is None:
        return own, np.nan
    model = reduced_model(robot)
    data = model.createData()
    order = [model.joints[model.getJointId(name)].idx_v for name in robot.joint_names]
    place = np.argsort(order)
    other = np.array(
        [pinocchio.rnea(model, data, *(x[k][place] for x in (q, dq, ddq))) for k in range(len(q))]
    )[:, order]
    friction = matrix[:, :, ~rigid] @ values[~rigid]
    return other + friction, float(np.abs(other + friction - own).max())


def reduced_model(robot: Robot):
    """Pinocchio's model of the URDF with the joints of the robot alone."""
    model = pinocchio.buildModelFromUrdf(robot.urdf.path)
    rest = [i for i in range(1, model.njoints) if model.names[i] not in robot.joint_names]
    posture = pinocchio.neutral(model)
    for i in rest:
        frozen = dict(getattr(robot.urdf, "frozen", {}) or {})
        posture[model.joints[i].idx_q] = frozen.get(model.names[i], 0.0)
    return pinocchio.buildReducedModel(model, rest, posture)


def kinematics(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Frames of the links and, last, of the base: shape (links + 1, samples, 4, 4)."""
    frames = np.tile(np.eye(4), (robot.size + 1, len(q), 1, 1))
    for i, joint in enumerate(robot.joints):
        mounted, moved = np.eye(4), np.tile(np.eye(4), (len(q), 1, 1))
        mounted[:3, :3], mounted[:3, 3] = joint.rotation, joint.translation
        if joint.kind == "prismatic":
            moved[:, 2, 3] = q[:, i]
        else:
            moved[:, 0, 0] = moved[:, 1, 1] = np.cos(q[:, i])
            moved[:, 1, 0] = np.sin(q[:, i])
            moved[:, 0, 1] = -moved[:, 1, 0]
        frames[i] = frames[joint.parent] @ mounted @ moved
    return frames


def least_distance(pair, poses: np.ndarray, clearances: Clearances) -> tuple[float, int]:
    """Least distance of a pair along the motion and its sample: every tenth, then those near."""
    if pair.body is not None and pair.other is None:
        up = -clearances.robot.gravity / np.linalg.norm(clearances.robot.gravity)
        ends = [_points(poses[pair.body.link], x) @ up for x in (pair.body.start, pair.body.end)]
        height = np.minimum(*ends) - pair.body.radius - clearances.floor
        return float(height.min()), int(height.argmin())
    solid, place = _placed(pair.body, poses)
    other, there = _placed(pair.other, poses)
    request = coal.DistanceRequest()

    def distance(k: int) -> float:
        return coal.distance(solid, place(k), other, there(k), request, coal.DistanceResult())

    samples = poses.shape[1]
    found = {k: distance(k) for k in [*range(0, samples, 10), samples - 1]}
    near = [k for k, d in found.items() if d < NEAR or d == min(found.values())]
    for k in near:
        for beside in range(max(k - 9, 0), min(k + 10, samples)):
            found.setdefault(beside, distance(beside))
    sample = min(found, key=lambda k: found[k])
    return found[sample], sample


def _points(frames: np.ndarray, point) -> np.ndarray:
    return frames[:, :3, :3] @ np.asarray(point, dtype=float) + frames[:, :3, 3]


def _placed(body: Body | Obstacle, poses: np.ndarray):
    """A solid of coal, and its pose at a sample."""
    if isinstance(body, Obstacle):
        pose = coal.Transform3s(np.array(body.rotation), np.array(body.translation))
        made = {
            "box": lambda: coal.Box(*np.array(body.size, dtype=float)),
            "sphere": lambda: coal.Sphere(body.radius),
            "cylinder": lambda: coal.Cylinder(body.radius, body.length),
            "capsule": lambda: coal.Capsule(body.radius, body.length),
        }[body.shape]()
        return made, lambda k: pose
    way = np.asarray(body.end) - np.asarray(body.start)
    length = float(np.linalg.norm(way))
    own = np.eye(4)
    own[:3, 3] = 0.5 * (np.asarray(body.start) + np.asarray(body.end))
    if length > 0.0:
        third = way / length
        first = np.cross(third, np.eye(3)[int(np.argmin(np.abs(third)))])
        first /= np.linalg.norm(first)
        own[:3, :3] = np.column_stack([first, np.cross(third, first), third])
    frames = poses[body.link] @ own

    def place(k: int):
        return coal.Transform3s(frames[k, :3, :3].copy(), frames[k, :3, 3].copy())

    return coal.Capsule(body.radius, length), place


def _shapes(robot, q, clearances, least):
    """Room of the shapes over the capsules, and shapes that touch."""
    pairs = [p for p in clearances.pairs if isinstance(p.other, Body)]
    counts = Counter((p.body.link, p.other.link) for p in pairs)
    own = Counter(body.link for body in clearances.bodies)
    # a remark of the design names the pairs of which some capsules are not checked
    of_links = sorted(pair for pair, n in counts.items() if n == own[pair[0]] * own[pair[1]])
    nearest = {
        links: min(least[p.name] for p in pairs if (p.body.link, p.other.link) == links)
        for links in of_links
    }
    samples = sorted({k for _, k in nearest.values()} | set(range(0, len(q), len(q) // 100)))
    distance = exact_distances(robot, of_links, q[samples])
    room = [
        distance[row, samples.index(sample)] - capsule
        for row, (capsule, sample) in enumerate(nearest[links] for links in of_links)
    ]
    touching = [
        f"shapes of links {links}: {1e3 * d.min():.2f} mm"
        for links, d in zip(of_links, distance, strict=True)
        if d.min() < clearances.needed.min() - TOLERANCE
    ]
    return (float(np.min(room)), float(np.median(room))), float(np.nanmin(distance)), touching
