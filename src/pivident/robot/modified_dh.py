"""Khalil–Kleinfinger tables (modified Denavit–Hartenberg) in TOML.

A file describes any tree of revolute, prismatic and fixed joints. Row ``j`` places its frame in
the frame of its parent by

    T = Rz(gamma) Tz(b) Rx(alpha) Tx(d) Rz(theta + q) Tz(r)        revolute
    T = Rz(gamma) Tz(b) Rx(alpha) Tx(d) Rz(theta) Tz(r + q)        prismatic

so ``theta`` and ``r`` are the values at q = 0, and gamma = b = 0 in a serial chain. The smallest
useful file is

    name = "pendulum"
    units = "degrees"                   # of all angles; default "radians"
    gravity = "-y"                      # where it points; default "-z"; or three numbers in m/s²

    [[joints]]
    name = "shoulder"                   # kind = "revolute" by default
    rated_speed = 180                   # degrees per second, as the units say
    rotor_inertia = 0.01                # kg m² on the joint side
    nominal_friction = {fv = 0.5, fc = 1.2}
    link = {mass = 2, center_of_mass = [0.2, 0, 0], inertia_at_center_of_mass = [0, 0, 0, 0, 0, 0]}

Further keys of a joint: ``parent`` (a name or "base"; default the row before), ``position_limits``,
``torque_limit``, ``friction`` (a law of its own). A link may also give ``first_moments`` and
``inertia_at_origin``; inertias are xx xy xz yy yz zz. At the top: ``friction`` (the law of all
joints), ``[transmission]`` with ``reduction`` or ``reduction_matrix``, ``drive_gain`` and
``position_offset``, and ``[[couplings]]`` with ``motor``, ``joint``, ``reduction``, ``ratio``,
``parameters`` and ``nominal``. Friction is SI whatever the units.

A mechanism with closed loops is described as a tree with its loops cut. Joints without a motor are
``passive = true``; a joint between the axes of a universal joint carries no body (``body =
false``); ``posture`` is where a joint is when the loops are assembled, roughly. What was cut is
closed again by

    [[loops]]
    name = "tip"
    closes = "axis"                     # "point": origins meet; "axis": z axes too; "full": frames
    first = {link = "forearm", at = [0.5, 0, 0]}        # a link or joint or "base"; rpy turns it
    second = {link = "rod", at = [0.5, 0, 0]}

and joints in proportion (gears, belts, ball screws) by ``[[gears]]`` with ``name``, ``ratios`` (as
``{nut = 1, spindle = -1}``) and ``offset``: the sum of ratio times position is the offset, angles
in the units of the file. Drives, couplings and logs are those of the joints that are not passive.

A base that floats is a body, ``[floating_base]`` with the keys of a link; logs hold its pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.foundation.errors import RobotDescriptionError, require_known
from pivident.foundation.files import small_text
from pivident.foundation.text.toml import parse_toml
from pivident.robot.closed_chains import Member, merge_fixed
from pivident.robot.closed_tables import BASE, closed_from_tables
from pivident.robot.description import Coupling, Joint, Link, Robot
from pivident.robot.drives import implied_coupling, with_drives
from pivident.robot.frames import Pose, exact_angle, rotation_x, rotation_z
from pivident.robot.friction import DEFAULT_FRICTION, FrictionLaw
from pivident.robot.friction_term import FrictionTerm
from pivident.robot.friction_terms import TERM_KINDS
from pivident.robot.inertia import from_center_of_mass, tensor
from pivident.robot.measured_base import with_floating_base
from pivident.robot.naming import errors_name, find_joint, nearest, repeated
from pivident.robot.transmission import Transmission

if TYPE_CHECKING:
    from pivident.robot.mdh_keys import (
        CouplingEntry,
        JointEntry,
        LinkEntry,
        TableFile,
    )

#: Law of passive joints that are given none.
NO_FRICTION = FrictionLaw(())


def read_modified_dh(path: str | Path) -> Robot:
    """Read a robot from a TOML file.

    Args:
        path: the file.

    Returns:
        The robot.

    Raises:
        RobotDescriptionError: the file cannot be read, or names a joint, key and value that
            cannot be used.
    """
    path = Path(path)
    with errors_name(str(path)):
        text = small_text(path, RobotDescriptionError, "a robot file")
    return parse_modified_dh(text, source=str(path))


def parse_modified_dh(text: str, source: str = "modified DH table") -> Robot:
    """Build a robot from the text of a TOML file.

    Args:
        text: content of the file.
        source: what errors call it.

    Returns:
        The robot.

    Raises:
        RobotDescriptionError: names a joint, key and value that cannot be used.
    """
    from pivident.robot.mdh_keys import validated

    with errors_name(source):
        try:
            content = parse_toml(text)
        except ValueError as error:
            raise RobotDescriptionError(
                f"is not TOML: {error}", advice="correct this line"
            ) from error
        return _robot(validated(content))


def _robot(table: TableFile) -> Robot:
    angle = _AngleUnit(np.pi / 180.0 if table.units == "degrees" else 1.0)
    parents = _parents(table.joints)
    default_law = friction_law(table.friction)
    members = [
        Member(
            _joint(row, parent, angle, NO_FRICTION if row.passive else default_law),
            Link(_link_name(row), _inertia(row.link), row.body),
            fixed=row.kind == "fixed",
        )
        for row, parent in zip(table.joints, parents, strict=True)
    ]
    joints, links = merge_fixed(members)
    undriven = Robot(
        name=table.name,
        joints=joints,
        links=links,
        gravity=np.array(table.gravity),
        rotor_inertia=np.zeros(len(joints)),
        transmission=Transmission.direct(len(joints)),
        description=table.description,
    )
    moving = [row for row in table.joints if row.kind != "fixed"]
    driven = [row for row in moving if not row.passive]
    if len(driven) < len(moving) or table.loops or table.gears:
        undriven = closed_from_tables(undriven, moving, table.loops, table.gears, angle.radians)
    robot = _with_drives(undriven, table, driven, angle)
    nominal = _nominal_friction(robot, moving) | _nominal_couplings(robot, table.couplings)
    robot = replace(robot, friction_nominal=nominal)
    base = table.floating_base
    if base is None:
        return robot
    return with_floating_base(robot, Link(base.name or BASE, _inertia(base)))


def _with_drives(
    robot: Robot, table: TableFile, rows: Sequence[JointEntry], angle: _AngleUnit
) -> Robot:
    """The robot with rotor inertias, transmission and couplings of the file."""
    given = table.transmission
    offsets = given.position_offset
    if offsets is not None and len(offsets) == len(rows):
        offsets = [angle.of(row.kind) * x for row, x in zip(rows, offsets, strict=True)]
    diagonal = given.reduction if given.reduction_matrix is None else given.reduction_matrix
    geared = with_drives(
        robot,
        rotor_inertia=[row.rotor_inertia for row in rows],
        reduction=diagonal,
        drive_gain=given.drive_gain,
        position_offset=offsets,
    )
    matrix = _coupled_reduction(geared, table.couplings)
    couplings = [_coupling(entry, robot.joint_names, matrix) for entry in table.couplings]
    return with_drives(geared, reduction=matrix, couplings=couplings)


@dataclass(frozen=True)
class _AngleUnit:
    """Radians per unit of angle in the file."""

    radians: float

    def of(self, kind: str) -> float:
        """SI units per unit of a joint's position: angles of revolute joints, metres else."""
        return self.radians if kind == "revolute" else 1.0


def _parents(rows: Sequence[JointEntry]) -> list[int]:
    """Index of the row that each row hangs on, -1 for the base."""
    names = [row.name for row in rows]
    if repeated(names):
        raise RobotDescriptionError(
            f"joint names used twice: {', '.join(repeated(names))}",
            advice="give each joint its own name",
        )
    parents = []
    for i, row in enumerate(rows):
        if row.parent is None:
            parents.append(i - 1)
        elif row.parent in names[:i]:
            parents.append(names.index(row.parent))
        elif row.parent == BASE:
            parents.append(-1)
        elif row.parent in names:
            raise RobotDescriptionError(
                f"joint {row.name!r}: its parent {row.parent!r} does not precede it",
                advice="move the parent's row up",
            )
        else:
            raise RobotDescriptionError(
                f"joint {row.name!r}: key 'parent' = {row.parent!r}: there is no such joint",
                advice=nearest(row.parent, [BASE, *names[:i]]),
            )
    return parents


def _pose(row: JointEntry, angle: _AngleUnit) -> Pose:
    """Rz(gamma) Tz(b) Rx(alpha) Tx(d) Rz(theta) Tz(r): the frame at q = 0."""
    gamma, alpha, theta = (
        exact_angle(x) if angle.radians == 1.0 else angle.radians * x
        for x in (row.gamma, row.alpha, row.theta)
    )
    turn = Pose(rotation_z(gamma), np.array([0.0, 0.0, row.b]))
    tilt = Pose(rotation_x(alpha), np.zeros(3))
    # Rz(theta) and the translation along z commute, so r needs no rotation of its own.
    screw = Pose(rotation_z(theta), np.array([row.d, 0.0, row.r]))
    return turn @ tilt @ screw


def _joint(row: JointEntry, parent: int, angle: _AngleUnit, default_law: FrictionLaw) -> Joint:
    unit = angle.of(row.kind)
    pose = _pose(row, angle)
    limits = row.position_limits
    joint = Joint(
        name=row.name,
        kind="prismatic" if row.kind == "prismatic" else "revolute",
        parent=parent,
        rotation=pose.rotation,
        translation=pose.translation,
        position_limits=None if limits is None else (unit * limits[0], unit * limits[1]),
        rated_speed=None if row.rated_speed is None else unit * row.rated_speed,
        torque_limit=row.torque_limit,
    )
    try:
        law = default_law if row.friction is None else friction_law(row.friction)
    except RobotDescriptionError as error:
        raise RobotDescriptionError.of_part(f"joint {row.name!r}: ", error) from error
    return joint.with_friction(law)


def _link_name(row: JointEntry) -> str:
    return row.link.name if row.link is not None and row.link.name else row.name


def _inertia(link: LinkEntry | None) -> np.ndarray:
    """Ten parameters at the frame's origin; zeros for what the file leaves out."""
    if link is None:
        return np.zeros(10)
    if link.center_of_mass is not None or link.inertia_at_center_of_mass is not None:
        center = np.array(link.center_of_mass or np.zeros(3))
        at_center = np.array(link.inertia_at_center_of_mass or np.zeros(6))
        return from_center_of_mass(link.mass, center, tensor(at_center))
    at_origin = link.inertia_at_origin or [0.0] * 6
    first_moments = link.first_moments or [0.0] * 3
    return np.array([*at_origin, *first_moments, link.mass])


def friction_law(entries: Sequence[Any] | None) -> FrictionLaw:
    """The friction law of a list of terms; viscous, Coulomb and offset where there is none."""
    if entries is None:
        return DEFAULT_FRICTION
    terms: list[FrictionTerm] = []
    for entry in entries:
        try:
            terms += _terms(entry)
        except ValueError as error:
            heading = f"key 'friction': term {entry.term!r}: "
            raise RobotDescriptionError.of_part(heading, error) from error
    try:
        return FrictionLaw(tuple(terms))
    except ValueError as error:
        raise RobotDescriptionError.of_part("key 'friction': ", error) from error


def _terms(entry: Any) -> tuple[FrictionTerm, ...]:
    """The terms of an entry; its keys have the names of the constructor's arguments."""
    kind = TERM_KINDS[entry.term]
    keys = entry.model_fields_set & frozenset().union(*kind.arguments)
    made = kind.make(**{key: getattr(entry, key) for key in keys})
    return (made,) if isinstance(made, FrictionTerm) else made


def _nominal_friction(robot: Robot, rows: Sequence[JointEntry]) -> dict[str, float]:
    """Nominal values by parameter name: ``fv`` of the second joint of a chain is ``fv2``."""
    values = {}
    for i, (row, joint) in enumerate(zip(rows, robot.tree.joints, strict=True)):
        stems = [term.stem for term in joint.friction.terms]
        for stem, value in row.nominal_friction.items():
            require_known(
                stem,
                stems,
                f"joint {row.name!r}: key 'nominal_friction': its friction law has no "
                f"parameter {stem!r}",
                RobotDescriptionError,
            )
            values[f"{stem}{robot.label(i)}"] = value
    return values


def _nominal_couplings(robot: Robot, entries: Sequence[CouplingEntry]) -> dict[str, float]:
    """Nominal values of couplings by parameter name: ``fvm6`` for the sixth motor of a chain."""
    return {
        f"{stem}{robot.label(robot.places[find_joint(robot.joint_names, entry.motor)])}": value
        for entry in entries
        for stem, value in entry.nominal.items()
    }


def _coupled_reduction(robot: Robot, entries: Sequence[CouplingEntry]) -> np.ndarray:
    """The reduction matrix with the couplings off its diagonal."""
    matrix = robot.transmission.reduction.copy()
    for entry in entries:
        motor = find_joint(robot.joint_names, entry.motor)
        joint = find_joint(robot.joint_names, entry.joint)
        if entry.reduction is None:
            continue
        if matrix[motor, joint] != 0.0:
            raise RobotDescriptionError(
                f"coupling of motor {entry.motor} with joint {entry.joint}: this element of the "
                "reduction matrix is already given",
                advice="state it once",
            )
        matrix[motor, joint] = entry.reduction
    return matrix


def _coupling(entry: CouplingEntry, names: Sequence[str], reduction: np.ndarray) -> Coupling:
    implied = implied_coupling(names, reduction, entry.motor, entry.joint)
    return replace(
        implied,
        ratio=implied.ratio if entry.ratio is None else entry.ratio,
        inertia="iam" in entry.parameters,
        viscous="fvm" in entry.parameters,
        coulomb="fcm" in entry.parameters,
    )
