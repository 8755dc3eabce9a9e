"""What closes loops in an MJCF file, and the robot of independent joints that is left.

    connect         origins of two frames that meet
    weld            two frames that are the same
    joint           q_1 - q_1(0) = a_0 + a_1 (q_2 - q_2(0))
    tendon          the same of lengths Σ c_i q_i

with q(0) the positions in the drawn pose. Constraints that the file switches off are left out.

From the tree of an MJCF file and its constraints to a robot of independent joints.

A file says which joints have motors by its actuators. Where their number is not that of the
freedoms, a joint that an equality makes a function of another one follows it; else the user says
which joints have none.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.closed_chains import assembled, closed_robot, equations, proportions
from pivident.robot.constraints import Closure, ClosureKind, Constraints, LinearConstraint
from pivident.robot.description import Robot
from pivident.robot.frames import Pose
from pivident.robot.friction import FrictionLaw
from pivident.robot.mjcf_model import (
    actuated_joints,
    mujoco_library,
    rotation_of_quaternion,
    tendon_joints,
)
from pivident.robot.naming import find_joint, frozen_example

#: Largest gap of two frames of the same link that counts as closed [m, or element of a rotation].
MEETING = 1e-6
#: Gap of a posture in which loops count as drawn closed [m, rad].
DRAWN_CLOSED = 1e-3
#: Relative size of a singular value that counts as zero.
RANK = 1e-7


@dataclass(frozen=True, eq=False)
class Meeting:
    """Two frames in bodies that meet."""

    name: str
    kind: ClosureKind
    bodies: tuple[int, int]
    frames: tuple[Pose, Pose]
    joints: frozenset[int]  # that lie on the loop


@dataclass(frozen=True, eq=False)
class Proportion:
    """Joints in proportion, Σ ratio q = offset, and the one that follows the others."""

    name: str
    ratios: Mapping[int, float]  # by joint
    offset: float
    follower: int | None  # None: none more than another

    @property
    def joints(self) -> frozenset[int]:
        """Joints that it couples."""
        return frozenset(self.ratios)


@dataclass(frozen=True, eq=False)
class Equalities:
    """All active constraints of a file."""

    meetings: tuple[Meeting, ...]
    proportions: tuple[Proportion, ...]

    def moved_along(self, kept: Sequence[int], frozen: Sequence[int]) -> tuple[int, ...]:
        """Joints that constraints move with those that are kept, and that are not frozen."""
        found = set(kept)
        whole = [one.joints for one in self.meetings] + [one.joints for one in self.proportions]
        groups = [joints - set(frozen) for joints in whole]
        while any(group & found and not group <= found for group in groups):
            found |= {k for group in groups if group & found for k in group}
        return tuple(sorted(found - set(kept)))


def read_equalities(model: Any) -> Equalities:
    """The active equality constraints of a compiled model.

    Raises:
        RobotDescriptionError: names a constraint that is no loop or proportion, and the next step.
    """
    mujoco = mujoco_library()
    meetings: list[Meeting] = []
    proportions: list[Proportion] = []
    for k in range(model.neq):
        if not model.eq_active0[k]:
            continue
        kind = mujoco.mjtEq(int(model.eq_type[k])).name.removeprefix("mjEQ_").lower()
        name = model.equality(k).name or f"{kind} {k + 1}"
        if kind in ("connect", "weld"):
            meetings.append(_meeting(model, k, name, kind))
        elif kind in ("joint", "tendon"):
            proportions.append(_proportion(model, k, name, kind))
        else:
            raise RobotDescriptionError(
                f"equality {name!r}: a constraint of the kind {kind} does not close a loop of "
                "rigid links",
                advice='remove it, or switch it off, active="false"',
            )
    return Equalities(tuple(meetings), tuple(proportions))


def _meeting(model: Any, k: int, name: str, kind: str) -> Meeting:
    """A connect or weld, between bodies or sites."""
    mujoco = mujoco_library()
    one, two = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
    if int(model.eq_objtype[k]) == int(mujoco.mjtObj.mjOBJ_SITE):
        bodies = int(model.site_bodyid[one]), int(model.site_bodyid[two])
        first, second = (
            Pose(rotation_of_quaternion(model.site_quat[s]), np.array(model.site_pos[s]))
            for s in (one, two)
        )
    else:
        data, bodies = np.array(model.eq_data[k], dtype=float), (one, two)
        if kind == "connect":
            first, second = (Pose(np.eye(3), data[s : s + 3]) for s in (0, 3))
        else:
            first = Pose(rotation_of_quaternion(data[6:10]), data[3:6])
            second = Pose(np.eye(3), data[:3])
    joints = [_joints_below(model, body) for body in bodies]
    return Meeting(
        name,
        "point" if kind == "connect" else "full",
        bodies,
        (first, second),
        joints[0] ^ joints[1],
    )


def _joints_below(model: Any, body: int) -> frozenset[int]:
    """Joints between the world and a body."""
    found: set[int] = set()
    while body > 0:
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        found |= set(range(first, first + count))
        body = int(model.body_parentid[body])
    return frozenset(found)


def _proportion(model: Any, k: int, name: str, kind: str) -> Proportion:
    """A joint or tendon constraint with a straight line."""
    constant, slope, *higher = (float(x) for x in model.eq_data[k][:5])
    one, two = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
    if two >= 0 and any(higher):
        raise RobotDescriptionError(
            f"equality {name!r}: a polynomial of a degree above one (polycoef = {constant:g} "
            f"{slope:g} {' '.join(f'{x:g}' for x in higher)}) couples positions",
            advice="only proportions, polycoef = a0 a1 0 0 0, are in the model. Close the loop "
            "that it stands for by connect, or freeze its joints",
        )
    member = _joint_terms if kind == "joint" else _tendon_terms
    ratios, drawn = member(model, one)
    offset = constant + drawn
    if two >= 0:
        others, at = member(model, two)
        offset -= slope * at
        for joint, ratio in others.items():
            ratios[joint] = ratios.get(joint, 0.0) - slope * ratio
    return Proportion(name, ratios, offset, one if kind == "joint" else None)


def _joint_terms(model: Any, joint: int) -> tuple[dict[int, float], float]:
    """A joint's ratio, one, and its position in the drawn pose."""
    return {joint: 1.0}, float(model.qpos0[model.jnt_qposadr[joint]])


def _tendon_terms(model: Any, tendon: int) -> tuple[dict[int, float], float]:
    """Coefficients of a fixed tendon's joints, and its length in the drawn pose."""
    if tendon_joints(model, tendon) is None:
        name = model.tendon(tendon).name or f"number {tendon + 1}"
        raise RobotDescriptionError(
            f"tendon {name!r} is no sum of joint positions, and its length is not in the model",
            advice="remove its equality",
        )
    first, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
    ratios: dict[int, float] = {}
    for w in range(first, first + count):
        joint = int(model.wrap_objid[w])
        ratios[joint] = ratios.get(joint, 0.0) + float(model.wrap_prm[w])
    return ratios, float(model.tendon_length0[tendon])


def closures(
    meetings: Sequence[Meeting], ends: Mapping[int, tuple[int, Pose]], held: Mapping[int, float]
) -> Iterator[Closure]:
    """Meetings of two moving links.

    Args:
        meetings: of the file.
        ends: by body the moving link that carries it, -1 for the base, and its frame in that link.
        held: positions of the joints that stand still.

    Raises:
        RobotDescriptionError: frames of one link that do not meet.
    """
    for one in meetings:
        (first, before), (second, after) = (ends[body] for body in one.bodies)
        frames = before @ one.frames[0], after @ one.frames[1]
        if first != second:
            yield Closure(one.name, (first, second), frames, one.kind)
            continue
        apart = float(np.linalg.norm(frames[0].translation - frames[1].translation))
        turned = float(np.abs(frames[0].rotation - frames[1].rotation).max())
        if apart > MEETING or (one.kind == "full" and turned > MEETING):
            raise RobotDescriptionError(
                f"equality {one.name!r}: its joints stand still, and its ends are {apart:.3g} m "
                "apart"
                if held
                else f"equality {one.name!r}: its ends are {apart:.3g} m apart, and no joint of it "
                "moves",
                advice="freeze them at positions where it is closed" if held else "",
            )


def linear_constraints(
    proportions: Sequence[Proportion],
    names: Sequence[str],
    order: Mapping[int, int],
    held: Mapping[int, float],
) -> Iterator[LinearConstraint]:
    """Proportions of moving joints; a follower that stands still takes its constraint along.

    Args:
        proportions: of the file.
        names: of all joints of the file.
        order: index in the tree of each joint of the file that moves.
        held: positions of the others.

    Raises:
        RobotDescriptionError: a joint that follows others which stand still.
    """
    for one in proportions:
        moving = [k for k in one.joints if k in order]
        if not moving or one.follower in held:
            continue
        if len(moving) == 1 and len(one.ratios) > 1:
            name, others = names[moving[0]], [names[k] for k in one.ratios if k in held]
            raise RobotDescriptionError(
                f"equality {one.name!r}: joint {name!r} follows {', '.join(map(repr, others))}, "
                "which does not move",
                advice=f"freeze it, {frozen_example(name)}",
            )
        ratios = np.zeros(len(order))
        for k in moving:
            ratios[order[k]] = one.ratios[k]
        rest = sum(one.ratios[k] * held[k] for k in one.joints if k in held)
        yield LinearConstraint(one.name, ratios, one.offset - rest)


def closed_mjcf(
    tree: Robot,
    model: Any,
    names: Sequence[str],
    constraints: tuple[Sequence[Closure], Sequence[LinearConstraint], Equalities],
    joints: Sequence[str] | None,
    passive: Sequence[str] | None,
) -> Robot:
    """The robot of a tree in the order of the file, its loops closed.

    Args:
        tree: all joints that move, with nominal friction.
        model: the compiled model.
        names: of all joints of the file.
        constraints: closures and proportions of the tree, and the equalities that they come from.
        joints: order of the independent joints; None: that of the file.
        passive: joints without motors; None: as the actuators say.

    Raises:
        RobotDescriptionError: loops that do not close; joints without motors that neither
            actuators nor the user name.
    """
    loops, linear, equalities = constraints
    postures = _postures(tree, model, names, Constraints((), tuple(loops), tuple(linear)))
    if passive is None:
        dependent = _dependent(tree, loops, linear, postures)
        passive = _undriven(tree, model, names, equalities, dependent)
    passive = [tree.joint_names[find_joint(tree.joint_names, name)] for name in passive]
    order = [*(name for name in joints or () if name in tree.joint_names)]
    order += [name for name in tree.joint_names if name not in order]
    independent = [name for name in order if name not in passive]
    failure: RobotDescriptionError | None = None
    for posture in postures:
        try:
            robot = closed_robot(tree, independent, loops, linear, posture)
        except RobotDescriptionError as error:
            failure = failure or error
            continue
        return _with_rotors(_with_own_friction(robot), tree.rotor_inertia)
    assert failure is not None
    raise RobotDescriptionError(
        f"{failure}. Joints without motors are {', '.join(passive) or 'missing'}",
        advice="passive = […] under [robot] names others, a <key> of the file another posture to "
        "start from",
    ) from failure


def _postures(
    tree: Robot, model: Any, names: Sequence[str], constraints: Constraints
) -> list[np.ndarray]:
    """The drawn pose and the keyframes, those first in which the loops are closed."""
    at = [int(model.jnt_qposadr[names.index(name)]) for name in tree.joint_names]
    found = [np.array(q[at], dtype=float) for q in (model.qpos0, *model.key_qpos)]
    return sorted(
        found, key=lambda q: bool(np.abs(equations(tree, constraints, q)[0]).max() > DRAWN_CLOSED)
    )


def _dependent(
    tree: Robot,
    loops: Sequence[Closure],
    linear: Sequence[LinearConstraint],
    postures: Sequence[np.ndarray],
) -> int:
    """How many joints the others determine: the rank of A where the loops are closed."""
    free = Constraints((), tuple(loops), tuple(linear))
    largest, failure = 0, None
    for posture in postures:
        try:
            slope = equations(tree, free, assembled(tree, free, posture))[1]
        except RobotDescriptionError as error:
            failure = failure or error
            continue
        sizes = np.linalg.svd(slope, compute_uv=False)
        largest = max(largest, int((sizes > RANK * sizes.max(initial=1.0)).sum()))
    if not largest and failure is not None:
        raise RobotDescriptionError(f"{failure}: add a <key> in which it is closed") from failure
    return largest


def _undriven(
    tree: Robot, model: Any, names: Sequence[str], equalities: Equalities, dependent: int
) -> list[str]:
    """Joints of loops and proportions that have no motor.

    Raises:
        RobotDescriptionError: their number is not that of the dependent joints.
    """
    driven = actuated_joints(model)
    on_loops = {k for one in equalities.meetings for k in one.joints}
    geared = {k for one in equalities.proportions for k in one.joints}
    follow = {one.follower for one in equalities.proportions if one.follower is not None}
    moving = {k for k, name in enumerate(names) if name in tree.joint_names}
    for choice in ((on_loops | geared) - driven, (on_loops - driven) | follow):
        if len(choice & moving) == dependent:
            return [names[k] for k in sorted(choice & moving)]
    touched = (on_loops | geared) & moving

    def listed(joints: Iterable[int]) -> str:
        return ", ".join(names[k] for k in sorted(joints)) or "none"

    raise RobotDescriptionError(
        f"its equality constraints couple the joints {listed(touched)}, of which {dependent} "
        "follow the others",
        advice=f"actuators, on {listed(touched & driven)}, do not tell which: name those without "
        "a motor, passive = […] under [robot]",
    )


def _with_own_friction(robot: Robot) -> Robot:
    """Passive joints have only the terms of friction that the file has values for."""
    label = {joint.name: robot.label(i) for i, joint in enumerate(robot.tree.joints)}
    laws = {
        joint.name: FrictionLaw(
            tuple(
                term
                for term in joint.friction.terms
                if f"{term.stem}{label[joint.name]}" in robot.friction_nominal
            )
        )
        for joint in robot.passive_joints
    }
    return robot.with_friction(laws)


def _with_rotors(robot: Robot, rotor: np.ndarray) -> Robot:
    """Rotors of followers, J_a + Σ n² J where one joint moves them in proportion."""
    others = [i for i in range(rotor.size) if i not in robot.places]
    own = rotor[list(robot.places)].copy()
    loaded = [i for i in others if rotor[i]]
    if not loaded:
        return robot
    found = proportions(robot)
    for i in loaded:
        moved_by = [] if found is None else np.flatnonzero(found[0][i]).tolist()
        if found is None or len(moved_by) > 1:
            raise RobotDescriptionError(
                f"joint {robot.tree.joints[i].name!r} has armature = {rotor[i]:g} but no motor, "
                "and a loop moves it",
                advice="rotor inertias are in the model of joints with motors only: remove its "
                "armature, or add it to the inertia of its body",
            )
        for a in moved_by:
            own[a] += found[0][i, a] ** 2 * rotor[i]
    return replace(robot, rotor_inertia=own)
