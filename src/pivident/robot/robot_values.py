"""A robot as plain values for a JSON file, and back.

Everything that a `Robot` holds is stored, floats with all their digits, so the round trip is
exact. What values must look like is in `pivident.robot.robot_schema`; matrices of the wrong shape
and friction terms with too few constants for their kernel are refused here.

This module needs pydantic and is imported only when a file is read or written.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pivident.foundation.errors import RobotDescriptionError, UnusableValue
from pivident.robot.closed_chains import check_closed
from pivident.robot.constraints import Closure, Constraints, LinearConstraint
from pivident.robot.description import Coupling, Joint, Link, Robot, UrdfFile
from pivident.robot.frames import Pose
from pivident.robot.friction import FrictionLaw
from pivident.robot.friction_column import Shape
from pivident.robot.friction_term import FrictionTerm
from pivident.robot.friction_terms import column_named
from pivident.robot.joints import Contact
from pivident.robot.naming import errors_name
from pivident.robot.robot_schema import (
    ConstraintValues,
    JointValues,
    LinkValues,
    PoseValues,
    RobotValues,
    TermValues,
    checked,
)
from pivident.robot.transmission import Transmission
from pivident.robot.wrench_sensor import WrenchSensor


def robot_values(robot: Robot) -> dict[str, Any]:
    """The robot as dictionaries, lists, texts and finite numbers, ready for JSON."""
    content = {
        "name": robot.name,
        "description": robot.description,
        "gravity": _plain(robot.gravity),
        "joints": [_joint_values(joint) for joint in robot.joints],
        "links": [_link_values(link) for link in robot.links],
        "rotor_inertia": _plain(robot.rotor_inertia),
        "friction_nominal": {k: float(v) for k, v in robot.friction_nominal.items()},
        "couplings": [
            {
                "motor": int(coupling.motor),
                "joint": int(coupling.joint),
                "ratio": float(coupling.ratio),
                "inertia": bool(coupling.inertia),
                "viscous": bool(coupling.viscous),
                "coulomb": bool(coupling.coulomb),
            }
            for coupling in robot.couplings
        ],
        "transmission": {
            "reduction": _plain(robot.transmission.reduction),
            "drive_gain": _plain(robot.transmission.drive_gain),
            "position_offset": _plain(robot.transmission.position_offset),
            "gain_given": np.asarray(robot.transmission.gain_given, dtype=bool).tolist(),
        },
        "urdf": None
        if robot.urdf is None
        else vars(robot.urdf) | {"frozen": {**robot.urdf.frozen}},
        "torque_side": robot.torque_side,
        "constraints": _constraint_values(robot),
        "sensors": [
            {"name": s.name, "link": s.link, "frame": _frame_values(s.frame), "acts": s.acts}
            for s in robot.sensors
        ],
        "contacts": [{"link": c.link, "point": _plain(c.point)} for c in robot.contacts],
    }
    with errors_name(f"robot {robot.name!r}"):
        return checked(RobotValues, content).model_dump()


def robot_of_values(content: Any) -> Robot:
    """The robot that `robot_values` has written."""
    return made_robot(checked(RobotValues, content))


def made_robot(values: RobotValues) -> Robot:
    """The robot of values that have been checked; refuses shapes that do not belong together."""
    drives, n, closed = values.transmission, len(values.joints), values.constraints
    if {len(drives.reduction), *map(len, drives.reduction), len(drives.gain_given)} != {n}:
        raise RobotDescriptionError(
            f"transmission: the reduction matrix must have shape {(n, n)} and gain_given {n} "
            "entries, one for each joint",
            advice="write the file again",
        )
    robot = Robot(
        name=values.name,
        joints=tuple(_joint(joint) for joint in values.joints),
        links=tuple(_link(link) for link in values.links),
        gravity=np.array(values.gravity),
        rotor_inertia=np.array(values.rotor_inertia),
        transmission=Transmission(
            np.array(drives.reduction),
            np.array(drives.drive_gain),
            np.array(drives.position_offset),
            np.array(drives.gain_given, dtype=bool),
        ),
        friction_nominal=dict(values.friction_nominal),
        couplings=tuple(Coupling(**vars(coupling)) for coupling in values.couplings),
        description=values.description,
        urdf=None if values.urdf is None else UrdfFile(**vars(values.urdf)),
        torque_side=values.torque_side,
        passive_joints=tuple(_joint(joint) for joint in closed.joints) if closed else (),
        passive_links=tuple(_link(link) for link in closed.links) if closed else (),
        constraints=_constraints(closed, n) if closed else None,
        sensors=tuple(
            WrenchSensor(own.name, own.link, _frame(own.frame), own.acts) for own in values.sensors
        ),
        contacts=tuple(Contact(own.link, np.array(own.point)) for own in values.contacts),
    )
    if robot.constraints is not None:
        check_closed(robot.tree, robot.constraints)
    return robot


def _constraint_values(robot: Robot) -> dict[str, Any] | None:
    """What closes the loops, None for a tree."""
    constraints = robot.constraints
    if constraints is None:
        return None
    return {
        "joints": [_joint_values(joint) for joint in robot.passive_joints],
        "links": [_link_values(link) for link in robot.passive_links],
        "places": [int(place) for place in constraints.places],
        "closures": [
            {
                "name": closure.name,
                "links": [int(link) for link in closure.links],
                "frames": [_frame_values(frame) for frame in closure.frames],
                "kind": closure.kind,
            }
            for closure in constraints.closures
        ],
        "linear": [
            {"name": one.name, "ratios": _plain(one.ratios), "offset": float(one.offset)}
            for one in constraints.linear
        ],
        "posture": _plain(constraints.posture),
        "kept": [int(k) for k in constraints.kept],
        "driven": [int(i) for i in constraints.driven],
    }


def _constraints(values: ConstraintValues, joints: int) -> Constraints:
    """Constraints of values that have been checked; refuses counts that do not belong together."""
    count = joints + len(values.joints)
    made = Constraints(
        tuple(values.places),
        tuple(
            Closure(
                closure.name,
                (closure.links[0], closure.links[1]),
                (_frame(closure.frames[0]), _frame(closure.frames[1])),
                closure.kind,
            )
            for closure in values.closures
        ),
        tuple(
            LinearConstraint(one.name, np.array(one.ratios), one.offset) for one in values.linear
        ),
        np.array(values.posture),
        tuple(values.kept),
        tuple(values.driven),
    )
    links = [link for closure in made.closures for link in closure.links]
    fit = {
        "links": len(values.links) == len(values.joints),
        "places": len(set(made.places)) == joints and set(made.places) <= set(range(count)),
        "closures": all(-1 <= link < count for link in links),
        "linear": all(one.ratios.size == count for one in made.linear),
        "posture": made.posture.size == count,
        "driven": set(made.driven) <= set(range(count)) - set(made.places),
        "kept": len(made.kept) == count - joints
        and sorted(set(made.kept) & set(range(len(made.names)))) == list(made.kept),
    }
    for key, fits in fit.items():
        if not fits:
            raise RobotDescriptionError(
                f"constraints.{key} does not fit {joints} joints and {count - joints} passive ones",
                advice="write the file again",
            )
    return made


def _frame(values: PoseValues) -> Pose:
    rotation = np.array(values.rotation)
    if not np.abs(rotation @ rotation.T - np.eye(3)).max() <= 1e-9:
        raise RobotDescriptionError(
            "the rotation of a frame is not orthonormal", advice="write the file again"
        )
    return Pose(rotation, np.array(values.translation))


def _frame_values(frame: Pose) -> dict[str, Any]:
    return {"rotation": _plain(frame.rotation), "translation": _plain(frame.translation)}


def _link(values: LinkValues) -> Link:
    return Link(values.name, np.array(values.inertia), values.is_body)


def _link_values(link: Link) -> dict[str, Any]:
    return {"name": link.name, "inertia": _plain(link.inertia), "is_body": bool(link.is_body)}


def _plain(array: np.ndarray) -> list[Any]:
    return np.asarray(array, dtype=float).tolist()


def _joint_values(joint: Joint) -> dict[str, Any]:
    limits = joint.position_limits
    return {
        "name": joint.name,
        "kind": joint.kind,
        "parent": int(joint.parent),
        "rotation": _plain(joint.rotation),
        "translation": _plain(joint.translation),
        "position_limits": None if limits is None else [float(limit) for limit in limits],
        "rated_speed": None if joint.rated_speed is None else float(joint.rated_speed),
        "torque_limit": None if joint.torque_limit is None else float(joint.torque_limit),
        "motion": joint.motion,
        "friction": [
            {
                "stem": term.stem,
                "function": term.column.name,
                "smoothing": term.smoothing,
                "gamma": None if term.gamma is None else float(term.gamma),
                "shapes": [
                    vars(shape)
                    | {key: float(getattr(shape, key)) for key in ("value", "low", "high")}
                    for shape in term.shapes
                ],
            }
            for term in joint.friction.terms
        ],
    }


def _joint(values: JointValues) -> Joint:
    try:
        law = FrictionLaw(tuple(_term(term) for term in values.friction))
    except ValueError as error:
        raise RobotDescriptionError.of_part(
            f"friction of joint {values.name!r}: ", error
        ) from error
    limits = values.position_limits
    return Joint(
        name=values.name,
        kind=values.kind,
        parent=values.parent,
        rotation=np.array(values.rotation),
        translation=np.array(values.translation),
        position_limits=None if limits is None else (limits[0], limits[1]),
        rated_speed=values.rated_speed,
        torque_limit=values.torque_limit,
        friction=law,
        motion=values.motion,
    )


def _term(values: TermValues) -> FrictionTerm:
    column = column_named(values.function)
    allowed = column.shape_counts
    if len(values.shapes) not in allowed:
        needed = " or ".join(map(str, allowed))
        raise UnusableValue(
            f"the term {values.stem!r} ({values.function}) has {len(values.shapes)} constants of "
            "shape",
            advice=f"it needs {needed}",
        )
    shapes = tuple(Shape(**vars(shape)) for shape in values.shapes)
    return FrictionTerm(values.stem, column, values.smoothing, values.gamma, shapes)
