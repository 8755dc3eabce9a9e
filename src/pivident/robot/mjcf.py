"""MJCF, the format of MuJoCo → robot: hinge and slide joints on a fixed base, loops closed.

MuJoCo's poses are those of the bodies, and the joints of a body act one after the other, each
about its own anchor a and axis. With ^pT_b the pose of a body at qpos = 0 of its joints, A the
smallest rotation that takes z to the axis (as for a URDF) and F = (A, a) the frame of a joint in
its body, the frame of the first joint of a body in that of the last joint of its parent is

    F_p⁻¹ ^pT_b F Z(-ref),      and that of the next one      F⁻¹ F' Z(-ref')

where Z turns about or slides along z and ref is the joint's position in the drawn pose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pivident.foundation.errors import RobotDescriptionError, concerning
from pivident.robot.closed_chains import Member, carriers, chosen_order, merge_fixed
from pivident.robot.constraints import Closure, LinearConstraint
from pivident.robot.description import Joint, Link, Robot
from pivident.robot.frames import Pose, rotation_from_z_to, rotation_z
from pivident.robot.friction import DEFAULT_FRICTION, FrictionLaw, offset, spring
from pivident.robot.inertia import from_center_of_mass, moved
from pivident.robot.measured_base import with_floating_base
from pivident.robot.mjcf_loops import (
    Equalities,
    closed_mjcf,
    closures,
    linear_constraints,
    read_equalities,
)
from pivident.robot.mjcf_model import (
    compiled,
    joint_names,
    mujoco_library,
    read_spec,
    refuse_unknown_physics,
    rotation_of_quaternion,
    with_exact_angles,
)
from pivident.robot.naming import errors_name, frozen_example, nearest, repeated
from pivident.robot.transmission import Transmission

#: Mass below which a body is only a frame that MuJoCo needs a body for [kg].
MASSLESS = 1e-9


def read_mjcf(
    path: str | Path,
    *,
    joints: Sequence[str] | None = None,
    frozen: Mapping[str, float] | None = None,
    gravity: Sequence[float] | None = None,
    friction: FrictionLaw = DEFAULT_FRICTION,
    passive: Sequence[str] | None = None,
) -> Robot:
    """Read a robot with a fixed base from an MJCF file; needs the extra ``mujoco``.

    Bodies, ranges, gravity, armature (nominal rotor inertia), damping and frictionloss (nominal
    ``fv`` and ``fc``) are taken over. A joint with stiffness gets a spring. Contacts are left out.
    Equality constraints between bodies, sites, joints and fixed tendons close loops, see
    `pivident.robot.mjcf_loops`; passive joints have the friction that the file has values for.

    Args:
        path: the file.
        joints: names of the joints to keep, in the order of the log's columns; default all, in the
            order of the file. The others are frozen, but those that an equality moves along with
            one that is kept.
        frozen: position at which a joint is frozen [rad or m], by name; joints that are not kept
            and not named here are frozen at zero. A free joint is frozen at 0 where the file
            places it, which holds the base; the base floats where it is not frozen.
        gravity: acceleration of gravity in the world frame [m/s²], shape (3,); default: the file's.
        friction: friction law of all joints.
        passive: names of joints in loops that have no motor; default: those without an actuator.

    Returns:
        The robot; where equality constraints are active, of the joints with motors.

    Raises:
        MissingExtra: MuJoCo is not installed.
        RobotDescriptionError: the file cannot be read or used; names element, value, next step.
    """
    with errors_name(str(path)):
        model = compiled(with_exact_angles(read_spec(path)))
        names = joint_names(model)
        equalities = read_equalities(model)
        held = _frozen_positions(model, names, joints, frozen or {}, equalities)
        base = _floating(model, names, held)
        moving = [k for k, name in enumerate(names) if name not in held and k != base]
        refuse_unknown_physics(model, moving)
        members, ends = _members(model, names, held, friction, base)
        loops, linear = _constraints(equalities, members, ends, names, held)
        tree, links = merge_fixed(members)
        if not loops and not linear:
            _refuse_passive(passive)
            # what is stored has parameters of frames between the joints of a body
            links = tuple(replace(link, is_body=True) for link in links)
            wanted = [name for name in joints or () if base is None or name != names[base]]
            wanted += [names[k] for k in moving if names[k] not in wanted]
            _check_parents_first(tree, wanted)
            tree, links = chosen_order(tree, links, wanted)
        robot = Robot(
            name=str(model.names[: model.names.index(b"\0")].decode()) or "mjcf",
            joints=tree,
            links=links,
            gravity=np.array(model.opt.gravity if gravity is None else gravity, dtype=float),
            rotor_inertia=np.array(
                [float(model.dof_armature[model.jnt_dofadr[names.index(j.name)]]) for j in tree]
            ),
            transmission=Transmission.direct(len(tree)),
            description=str(path),
        )
        robot = replace(robot, friction_nominal=_nominal_friction(robot, model, names))
        if base is not None:
            return with_floating_base(robot, _base_link(model, int(model.jnt_bodyid[base])))
        if not loops and not linear:
            return robot
        return closed_mjcf(robot, model, names, (loops, linear, equalities), joints, passive)


def _constraints(
    equalities: Equalities,
    members: Sequence[Member],
    ends: Mapping[int, tuple[int, Pose]],
    names: Sequence[str],
    held: Mapping[str, float],
) -> tuple[list[Closure], list[LinearConstraint]]:
    """What closes the loops of the joints that move, see `_members` for ``ends``."""
    carried = carriers(members)
    places = {
        body: (carried[m][0], carried[m][1] @ pose) if m >= 0 else (-1, pose)
        for body, (m, pose) in ends.items()
    }
    still = {names.index(name): at for name, at in held.items()}
    moving = [k for k in range(len(names)) if k not in still]
    order = {k: i for i, k in enumerate(moving)}
    linear = list(linear_constraints(equalities.proportions, names, order, still))
    return list(closures(equalities.meetings, places, still)), linear


def _refuse_passive(passive: Sequence[str] | None) -> None:
    if passive:
        raise RobotDescriptionError(
            f"passive: {', '.join(passive)} move by themselves, since no equality of the file "
            "couples moving joints",
            advice="remove the key",
        ).about("passive")


def movable_joints(path: str | Path) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the joints of an MJCF file that have or may have motors, and of the others.

    Of loops the joints with motors, see `read_mjcf`.

    Args:
        path: the file.

    Raises:
        MissingExtra: MuJoCo is not installed.
        RobotDescriptionError: the file cannot be read, or no joint of it can be kept.
    """
    with errors_name(str(path)):
        model = compiled(with_exact_angles(read_spec(path)))
        names = joint_names(model)
        usable = [_kind(model, k) in ("hinge", "slide") for k in range(len(names))]
        if not any(usable):
            raise RobotDescriptionError(
                "no hinge or slide joint of it can move", advice="is it the right file?"
            )
        equalities = read_equalities(model)
    kept = tuple(name for name, yes in zip(names, usable, strict=True) if yes)
    if equalities.meetings or equalities.proportions:
        kept = read_mjcf(path, joints=kept).joint_names
    return kept, tuple(name for name in names if name not in kept)


def _kind(model: Any, k: int) -> str:
    """Hinge, slide, ball or free."""
    return mujoco_library().mjtJoint(int(model.jnt_type[k])).name.removeprefix("mjJNT_").lower()


def _frozen_positions(
    model: Any,
    names: Sequence[str],
    kept: Sequence[str] | None,
    frozen: Mapping[str, float],
    equalities: Equalities,
) -> dict[str, float]:
    """Position of every joint that could move and does not."""
    for key, given in (("joints", kept or ()), ("frozen", frozen)):
        for name in given:
            if name not in names:
                raise RobotDescriptionError(
                    f"{key}: there is no joint {name!r}", advice=nearest(name, names)
                ).about(key, *((name,) if key == "frozen" else ()))
    both = sorted(set(kept or ()) & set(frozen))
    if both or repeated(list(kept or ())):
        raise RobotDescriptionError(
            f"joints: {', '.join(both or repeated(list(kept or ())))} cannot be kept "
            f"{'and frozen' if both else 'twice'}",
            advice="name each joint once",
        ).about("joints")
    along: set[str] = set()
    if kept is not None:
        still = [names.index(name) for name in frozen]
        moved = equalities.moved_along([names.index(name) for name in kept], still)
        along = {names[k] for k in moved if _kind(model, k) in ("hinge", "slide")}
    positions = {
        name: float(frozen.get(name, 0.0))
        for name in names
        if name in frozen or (kept is not None and name not in kept and name not in along)
    }
    for k, name in enumerate(names):
        kind, freeze = _kind(model, k), f"freeze it, {frozen_example(name)}"
        if name not in positions and kind == "ball":
            raise RobotDescriptionError(
                f"joint {name!r}: a ball joint has three degrees of freedom, one is supported",
                advice=freeze,
            )
        if name in positions and not np.isfinite(positions[name]):
            raise RobotDescriptionError(
                f"frozen: position of {name!r} is {positions[name]}", advice="not finite"
            ).about("frozen", name)
        if positions.get(name) and kind not in ("hinge", "slide"):
            with concerning("frozen", name):
                raise RobotDescriptionError(
                    f"frozen: joint {name!r} of type {kind!r} can only be frozen at 0, where the "
                    f"file places it, not at {positions[name]:g}"
                )
    return positions


def _floating(model: Any, names: Sequence[str], held: Mapping[str, float]) -> int | None:
    """The free joint of the base, where one is not frozen."""
    free = [k for k, name in enumerate(names) if _kind(model, k) == "free" and name not in held]
    if len(free) > 1:
        listed = ", ".join(repr(names[k]) for k in free)
        raise RobotDescriptionError(
            f"{len(free)} bodies float ({listed}), and one can be the base of the robot",
            advice=f"freeze the others, {frozen_example(names[free[-1]])}",
        )
    for k, name in enumerate(names) if free else ():
        root = int(model.body_rootid[int(model.jnt_bodyid[k])])
        if name not in held and root != int(model.jnt_bodyid[free[0]]):
            raise RobotDescriptionError(
                f"joint {name!r} does not hang on the floating base {names[free[0]]!r}",
                advice=f"freeze one of them, {frozen_example(names[free[0]])}",
            )
    return free[0] if free else None


def _base_link(model: Any, base: int) -> Link:
    """The body of a floating base with what is fixed to it, in its frame."""
    total, places = _inertia(model, base), {base: Pose.identity()}
    for b in range(base + 1, model.nbody):
        parent = int(model.body_parentid[b])
        if parent in places and not model.body_jntnum[b]:
            turn = rotation_of_quaternion(model.body_quat[b])
            places[b] = places[parent] @ Pose(turn, np.array(model.body_pos[b]))
            total = total + moved(_inertia(model, b), places[b].rotation, places[b].translation)
    return Link(model.body(base).name or "base", total)


def _members(
    model: Any,
    names: Sequence[str],
    held: Mapping[str, float],
    friction: FrictionLaw,
    base: int | None = None,
) -> tuple[list[Member], dict[int, tuple[int, Pose]]]:
    """All joints, and bodies without any as fixed ones, with z along the axes.

    Then by body the member that carries it, -1 for the base, and the body's frame in that member's.
    """
    members: list[Member] = []
    last = {0: (-1, Pose.identity())}  # member that carries a body, and the body's frame in its own
    for b in range(1, model.nbody):
        parent, pose = last[int(model.body_parentid[b])]
        pose = pose @ Pose(rotation_of_quaternion(model.body_quat[b]), np.array(model.body_pos[b]))
        first, count = int(model.body_jntadr[b]), int(model.body_jntnum[b])
        body, name = _inertia(model, b), model.body(b).name or f"body_{b}"
        has_mass = bool(model.body_mass[b] > MASSLESS)
        if not count:
            members.append(_fixed(f"{name} (fixed)", parent, pose, Link(name, body)))
            last[b] = len(members) - 1, Pose.identity()
            continue
        for k in range(first, first + count):
            frame = _frame(model, k)
            end = k == first + count - 1
            back = Pose(frame.rotation.T, -frame.rotation.T @ frame.translation)
            inertia = moved(body, back.rotation, back.translation) if end else np.zeros(10)
            link = Link(name if end else f"{name} before {names[k + 1]}", inertia, end and has_mass)
            placed = pose @ frame @ _moved_by(model, k, held.get(names[k]))
            if k == base:
                placed = Pose.identity()
            if names[k] in held or k == base:
                members.append(_fixed(names[k], parent, placed, link))
            else:
                members.append(Member(_joint(model, k, names[k], parent, placed, friction), link))
            parent, pose = len(members) - 1, back
        last[b] = parent, pose
    return members, last


def _frame(model: Any, k: int) -> Pose:
    """F of a joint, in its body; that of a free or ball joint is the body's."""
    if _kind(model, k) not in ("hinge", "slide"):
        return Pose.identity()
    return Pose(rotation_from_z_to(np.array(model.jnt_axis[k])), np.array(model.jnt_pos[k]))


def _moved_by(model: Any, k: int, position: float | None) -> Pose:
    """Z(position - ref); of a joint that moves Z(-ref)."""
    kind = _kind(model, k)
    if kind not in ("hinge", "slide"):
        return Pose.identity()
    z = (position or 0.0) - float(model.qpos0[model.jnt_qposadr[k]])
    if kind == "slide":
        return Pose(np.eye(3), np.array([0.0, 0.0, z]))
    return Pose(rotation_z(z), np.zeros(3))


def _fixed(name: str, parent: int, pose: Pose, link: Link) -> Member:
    joint = Joint(name, "revolute", parent, pose.rotation, pose.translation)
    return Member(joint, link, fixed=True)


def _joint(model: Any, k: int, name: str, parent: int, pose: Pose, friction: FrictionLaw) -> Joint:
    kind: Literal["revolute", "prismatic"] = (
        "revolute" if _kind(model, k) == "hinge" else "prismatic"
    )
    limits = model.jnt_range[k] if model.jnt_limited[k] else None
    if limits is not None and not limits[0] < limits[1]:
        raise RobotDescriptionError(
            f"joint {name!r}: range = {limits[0]:g} {limits[1]:g} leaves no room to move",
            advice=f"correct it, or freeze the joint, {frozen_example(name)}",
        )
    most = float(np.abs(model.jnt_actfrcrange[k]).max()) if model.jnt_actfrclimited[k] else None
    joint = Joint(
        name=name,
        kind=kind,
        parent=parent,
        rotation=pose.rotation,
        translation=pose.translation,
        position_limits=None if limits is None else (float(limits[0]), float(limits[1])),
        torque_limit=most or None,
    )
    return joint.with_friction(_with_spring(friction) if model.jnt_stiffness[k] else friction)


def _with_spring(friction: FrictionLaw) -> FrictionLaw:
    """With a spring, and the offset that places its rest."""
    stems = {term.stem for term in friction.terms}
    added = [term for term in (spring(), offset()) if term.stem not in stems]
    return FrictionLaw((*friction.terms, *added))


def _inertia(model: Any, b: int) -> np.ndarray:
    """Ten inertial parameters of a body in its own frame."""
    axes = rotation_of_quaternion(model.body_iquat[b])
    at_center = axes @ np.diag(model.body_inertia[b]) @ axes.T
    return from_center_of_mass(float(model.body_mass[b]), np.array(model.body_ipos[b]), at_center)


def _check_parents_first(tree: Sequence[Joint], order: Sequence[str]) -> None:
    for joint in tree:
        carrier = tree[joint.parent].name if joint.parent >= 0 else None
        if carrier is not None and order.index(carrier) > order.index(joint.name):
            raise RobotDescriptionError(
                f"joints: {joint.name!r} is listed before {carrier!r}, which carries it",
                advice="list joints from the base outwards",
            )


def _nominal_friction(robot: Robot, model: Any, names: Sequence[str]) -> dict[str, float]:
    """Damping, frictionloss and springs by parameter name, where the law has the term."""
    nominal: dict[str, float] = {}
    for i, joint in enumerate(robot.joints):
        k = names.index(joint.name)
        dof, stiffness = int(model.jnt_dofadr[k]), float(model.jnt_stiffness[k])
        rest = float(model.qpos_spring[model.jnt_qposadr[k]])
        values = {
            "fv": float(model.dof_damping[dof]),
            "fc": float(model.dof_frictionloss[dof]),
            spring().stem: stiffness,
            "off": -stiffness * rest,
        }
        nominal |= {
            f"{term.stem}{robot.label(i)}": values[term.stem]
            for term in joint.friction.terms
            if values.get(term.stem)
        }
    return nominal
