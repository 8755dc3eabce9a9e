"""A robot as text: geometry, drives and base parameters with their expressions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from textwrap import indent

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, base_parameters
from pivident.foundation.text.identifiers import escaped
from pivident.foundation.text.numbers import plain_table
from pivident.foundation.text.sentences import plural
from pivident.robot.description import Joint, Robot
from pivident.robot.gallery import gallery_names, load_robot


def gallery_text() -> str:
    """The robots of the gallery, one line each."""
    robots = [(name, load_robot(name)) for name in gallery_names()]
    width = max(len(name) for name, _ in robots)
    lines = [
        f"{name:<{width}}  {plural(robot.on_fixed_base.size, 'joint')}: {robot.description}"
        for name, robot in robots
    ]
    return "\n".join([*lines, "", "pivident robots NAME shows geometry and base parameters"])


def robot_text(name: str) -> str:
    """Geometry and base parameters of one robot."""
    robot = load_robot(name)
    base = base_parameters(robot)
    return "\n\n".join([_heading(robot), _geometry(robot), _drives(robot), _parameters(base)])


def _heading(robot: Robot) -> str:
    gravity = ", ".join(f"{g:g}" for g in robot.gravity)
    lines = [robot.name, robot.description, f"gravity in the base frame: {gravity} m/s²"]
    return escaped("\n".join(line for line in lines if line))


def _geometry(robot: Robot) -> str:
    """Each joint's frame in its parent's frame at zero position; the joint's axis is z."""
    rows = [("joint", "kind", "on", "x y z [m]", "roll pitch yaw [deg]", "range", "rated speed")]
    for i, joint in enumerate(robot.tree.joints):
        parent = "base" if joint.parent < 0 else robot.tree.joints[joint.parent].name
        place = " ".join(map(_number, joint.translation))
        turn = " ".join(_number(math.degrees(a)) for a in _roll_pitch_yaw(joint.rotation))
        kind = joint.kind if i in robot.places else f"{joint.kind}, passive"
        if joint.motion != "driven":
            kind = f"{joint.kind}, {joint.motion}"
        rows.append((joint.name, kind, parent, place, turn, *_limits(joint)))
    return "Geometry at q = 0 (z is the joint's axis)\n" + _table(rows)


def _limits(joint: Joint) -> tuple[str, str]:
    """Position range and rated speed, in degrees or metres."""
    revolute = joint.kind == "revolute"
    scale, unit = (180.0 / math.pi, "°") if revolute else (1.0, " m")
    limits = joint.position_limits
    reach = "–" if limits is None else f"{scale * limits[0]:.4g} … {scale * limits[1]:.4g}{unit}"
    return reach, "–" if joint.rated_speed is None else f"{scale * joint.rated_speed:.4g}{unit}/s"


def _drives(robot: Robot) -> str:
    """Reduction, drive gain, friction law and couplings."""
    robot = robot.on_fixed_base
    transmission = robot.transmission
    rows = [("joint", "reduction", "drive gain", "γ of the friction", "friction law")]
    for j, joint in enumerate(robot.joints):
        ratio = " ".join(
            f"{n:.6g}" + ("" if k == j else f"·{robot.joints[k].name}")
            for k, n in enumerate(transmission.reduction[j])
            if n != 0.0
        )
        gain = f"{transmission.drive_gain[j]:.6g}" if transmission.gain_given[j] else "not given"
        rows.append((joint.name, ratio, gain, joint.slopes_text or "–", str(joint.friction)))
    lines = ["Drives", _table(rows)]
    for c in robot.couplings:
        motor, second = robot.joint_names[c.motor], robot.joint_names[c.joint]
        lines.append(f"  the motor of {motor} also turns with {second} (ratio {c.ratio:g})")
    lines += [
        f"  {joint.name} is passive; its friction: {joint.friction}"
        for joint in robot.passive_joints
        if joint.friction.terms
    ]
    unknown = [k.name for k in robot.tree.links if k.is_body and not k.inertia.any()]
    if unknown:
        lines.append(f"  nominal inertia is zero (IV and PIV start from it): {', '.join(unknown)}")
    return "\n".join(lines)


def _parameters(base: BaseParameters) -> str:
    """Base parameters with unit and group."""
    rows = [("name", "unit", "group")]
    rows += [
        (name, parameter.unit, expression)
        for name, parameter, expression in zip(
            base.names, base.parameters, base.expressions, strict=True
        )
    ]
    silent = [base.standard[k].name for k in base.without_effect]
    lines = [f"{len(base)} base parameters of {len(base.standard)} standard ones", _table(rows)]
    if silent:
        lines.append(f"without effect on any torque: {' '.join(silent)}")
    return "\n".join(lines)


def _number(x: float) -> str:
    """Six digits, rounding noise taken for zero."""
    return f"{round(float(x), 9) + 0.0:.6g}"


def _table(rows: Sequence[tuple[str, ...]]) -> str:
    """Columns side by side, a little indented."""
    return indent(plain_table([(t, "<", cells) for t, *cells in zip(*rows, strict=True)]), "  ")


def _roll_pitch_yaw(rotation: np.ndarray) -> tuple[float, float, float]:
    """Angles of R = Rz(yaw) Ry(pitch) Rx(roll) [rad]; roll is zero where it is not determined."""
    pitch = math.atan2(-rotation[2, 0], math.hypot(rotation[0, 0], rotation[1, 0]))
    if abs(math.cos(pitch)) < 1e-9:
        return 0.0, pitch, math.atan2(-rotation[0, 1], rotation[1, 1])
    roll = math.atan2(rotation[2, 1], rotation[2, 2])
    return roll, pitch, math.atan2(rotation[1, 0], rotation[0, 0])
