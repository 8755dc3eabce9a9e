"""From the table ``[robot]`` of an experiment file to a robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pivident.experiment.file_keys import ContactEntry, CouplingEntry, RobotEntry, WrenchEntry
from pivident.foundation.errors import ExperimentError, RobotDescriptionError, concerning
from pivident.foundation.files import named_file
from pivident.robot.description import Coupling, Robot, TorqueSide
from pivident.robot.drives import implied_coupling, with_drives
from pivident.robot.frames import Pose, rotation_from_rpy
from pivident.robot.friction import FrictionLaw
from pivident.robot.gallery import load_robot
from pivident.robot.joints import Contact
from pivident.robot.measured_base import with_floating_base, with_wrench_sensors
from pivident.robot.mjcf import read_mjcf
from pivident.robot.modified_dh import friction_law
from pivident.robot.mounted import with_body, with_frozen_joints
from pivident.robot.naming import MJCF_FILES, URDF_FILES
from pivident.robot.urdf import read_urdf
from pivident.robot.wrench_sensor import WrenchSensor

#: Keys of friction laws that somebody chose.
FRICTION_KEYS = ("friction", "joint_friction", "extra_friction")


def robot_of(
    entry: RobotEntry,
    folder: Path,
    torque_side: TorqueSide = "motor",
    wrenches: Sequence[WrenchEntry] = (),
    contacts: Sequence[ContactEntry] = (),
) -> Robot:
    """The described robot with everything that the experiment file adds to it.

    Where torques are measured behind the gears, its laws of friction are those of the file alone.
    """
    with concerning("model"):
        described = _described(entry, folder)
    robot = _with_additions(described.on_fixed_base, entry, torque_side)
    if entry.floating_base or described.base_joints:
        link = described.links[described.base_joints - 1] if described.base_joints else None
        with concerning("floating_base"):
            robot = with_floating_base(robot, link)
    for contact in contacts:
        with concerning("contact"):
            robot.link_index(contact.link)
    if contacts and not robot.base_joints:
        raise ExperimentError(
            "[[contact]] describes feet of a robot whose base floats",
            advice="write floating_base = true under [robot]",
        ).about("contact")
    standing = tuple(Contact(own.link, np.array(own.at)) for own in contacts)
    robot = replace(robot, contacts=standing) if standing else robot
    return with_wrench_sensors(robot, [_sensor(own) for own in wrenches]) if wrenches else robot


def _sensor(entry: WrenchEntry) -> WrenchSensor:
    """A force sensor."""
    frame = Pose(rotation_from_rpy(*entry.rpy), np.array(entry.at))
    return WrenchSensor(entry.name, entry.link, frame, entry.acts)


def _with_additions(robot: Robot, entry: RobotEntry, torque_side: TorqueSide) -> Robot:
    """A robot with the drives, friction and gravity of the experiment file."""
    if torque_side == "link":
        robot = robot.with_link_torques()
    for body in entry.bodies:
        with concerning("bodies"):
            robot = with_body(robot, body.link, body.mass, body.center_of_mass, body.inertia)
    if entry.gravity is not None:
        with concerning("gravity"):
            robot = robot.with_gravity(np.array(entry.gravity))
    if entry.friction is not None:
        with concerning("friction"):
            robot = robot.with_friction(friction_law(entry.friction))
    with concerning("joint_friction"):
        robot = _with_joint_friction(robot, entry)
    with concerning("extra_friction"):
        robot = _with_extra_friction(robot, entry)
    for key in ("rotor_inertia", "reduction", "reduction_matrix", "drive_gain", "position_offset"):
        given: dict[str, Any] = {key.removesuffix("_matrix"): getattr(entry, key)}
        with concerning(key):
            robot = with_drives(robot, **given)
    if torque_side == "link":
        return replace(robot, rotor_inertia=np.zeros(robot.size))  # no part of these torques
    if entry.couplings is None:
        return robot
    with concerning("couplings"):
        return with_drives(robot, couplings=[_coupling(robot, c) for c in entry.couplings])


def _described(entry: RobotEntry, folder: Path) -> Robot:
    """The robot of the gallery or of a file."""
    path = named_file(folder, entry.model)
    if not entry.model.endswith((*URDF_FILES, *MJCF_FILES)):
        table = load_robot(path if path.suffix == ".toml" else entry.model)
        return with_frozen_joints(table, entry.joints, entry.frozen)
    if entry.model.endswith(MJCF_FILES):
        return read_mjcf(path, joints=entry.joints, frozen=entry.frozen, passive=entry.passive)
    return read_urdf(path, joints=entry.joints, frozen=entry.frozen)


def _with_joint_friction(robot: Robot, entry: RobotEntry) -> Robot:
    """Laws that single joints have in place of the common one."""
    laws = {}
    for name, terms in entry.joint_friction.items():
        try:
            laws[name] = friction_law(terms)
        except RobotDescriptionError as error:
            whole = ExperimentError.of_part(f"joint_friction of joint {name!r}: ", error)
            raise whole.about("joint_friction", name) from error
    return robot.with_friction(laws)


def _with_extra_friction(robot: Robot, entry: RobotEntry) -> Robot:
    """Terms that single joints have beyond the common law."""
    joints = list(robot.joints)
    for name, terms in entry.extra_friction.items():
        with concerning("extra_friction", name):
            index = robot.joint_index(name)
        try:
            law = FrictionLaw(joints[index].friction.terms + friction_law(terms).terms)
        except ValueError as error:
            whole = ExperimentError.of_part(f"extra_friction of joint {name!r}: ", error)
            raise whole.about("extra_friction", name) from error
        joints[index] = joints[index].with_friction(law)
    return replace(robot, joints=tuple(joints))


def _coupling(robot: Robot, entry: CouplingEntry) -> Coupling:
    """A coupling; its ratio is the one that the reduction implies where it is not given."""
    implied = implied_coupling(
        robot.joint_names, robot.transmission.reduction, entry.motor, entry.joint
    )
    if implied.motor == implied.joint:
        raise RobotDescriptionError(
            f"coupling of motor {entry.motor!r} with its own joint", advice="name the second joint"
        )
    return replace(
        implied,
        ratio=implied.ratio if entry.ratio is None else entry.ratio,
        inertia="iam" in entry.parameters,
        viscous="fvm" in entry.parameters,
        coulomb="fcm" in entry.parameters,
    )
