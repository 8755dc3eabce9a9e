"""Fitted values as files of simulators: MJCF, URDF and a table of actuators for Isaac Lab."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from pivident.foundation.errors import ExportError
from pivident.models.export.differences import RobotFile, plain_content
from pivident.models.export.urdf_new import dynamics_line
from pivident.models.export.xml_edit import XmlText, comment, number
from pivident.robot.mjcf_model import compilable, mujoco_library, read_spec
from pivident.robot.naming import MJCF_FILES, URDF_FILES
from pivident.robot.urdf_xml import parse_model
from pivident.studies.simulators.mujoco_replay import set_hard_friction
from pivident.studies.simulators.simulator_fit import SimulatorFit

#: Formats by the name of ``--to``, and the ending of their files.
ENDINGS = {"mjcf": ".xml", "urdf": ".urdf", "isaac": ".py"}

#: Fitted quantities that are attributes of a joint of MJCF.
_OF_MJCF = ("armature", "damping", "frictionloss")


def fitted_mjcf(fit: SimulatorFit, original: Path, folder: Path) -> RobotFile:
    """The robot as MJCF, its joints with the fitted values; read from an MJCF or a URDF.

    Bodies and shapes stay; MuJoCo writes the file anew, so that classes and includes are resolved
    and comments of the original are gone. Dry friction stops a joint within a time step, where by
    default MuJoCo's creeps and lags by 10 ms. Position actuators get fitted gains.

    Args:
        fit: what was fitted.
        original: the file that the robot was read from.
        folder: where the file is going to be, for the paths of meshes.

    Raises:
        RobotDescriptionError: MuJoCo refuses the original.
        ExportError: it has no joint of a fitted name.
    """
    spec, _, left_out = compilable(read_spec(original))
    for joint in _joints_of(spec, fit):
        name = _name(joint)
        for quantity in _OF_MJCF:
            value = fit.of(quantity).get(name)
            if value is None:
                continue
            if quantity == "damping":
                joint.damping[0] = value.value
            else:
                setattr(joint, quantity, value.value)
        set_hard_friction(joint, float(spec.option.timestep))
    _set_actuators(spec, fit)
    if original.name.endswith(URDF_FILES):
        spec.option.gravity = np.array(fit.robot.gravity, dtype=float)
    head = [comment(line) for line in _heading(fit, "MJCF")]
    text = _to_xml(spec, original, folder)
    sentences = (
        *((left_out,) if left_out else ()),
        "dry friction stops a joint within a time step (solreffriction, solimpfriction)",
        *_not_in_file(fit, (*_OF_MJCF, "kp", "kd"), "MJCF"),
    )
    return RobotFile(("\n".join(head) + "\n" + text).encode(), sentences, format="mjcf")


def fitted_urdf(fit: SimulatorFit, original: Path) -> RobotFile:
    """The URDF with ``<dynamics damping friction>`` of the fitted joints, else byte for byte.

    Raises:
        ExportError: the original is no URDF.
        RobotDescriptionError: it cannot be read.
    """
    check_format("urdf", original.name)
    content = plain_content(original.read_bytes())
    known = {joint.name for joint in parse_model(content).joints}
    text = XmlText(content)
    for element in text.root.children:
        name = element.attributes.get("name", "")
        if element.tag != "joint" or name not in fit.robot.joint_names or name not in known:
            continue
        values = {
            key: number(fit.value(quantity, name))
            for key, quantity in (("damping", "damping"), ("friction", "frictionloss"))
            if name in fit.of(quantity)
        }
        before = element.first("dynamics")
        if before is not None:
            text.set_attributes(before, values)
        elif values:
            damping, friction = (float(values.get(k, "0")) for k in ("damping", "friction"))
            text.append(element, [dynamics_line(damping, friction)])
    return RobotFile(text.content(), tuple(_not_in_file(fit, ("damping", "frictionloss"), "URDF")))


def isaac_actuators(fit: SimulatorFit, physics_step: float | None = None) -> RobotFile:
    """A ``DelayedPDActuatorCfg`` of Isaac Lab as a Python file.

    Args:
        fit: what was fitted.
        physics_step: step of the physics [s]; None: the period of the control loop.
    """
    step = physics_step or 1.0 / fit.control_rate
    late = 0.0 if fit.delay is None else fit.delay.value
    steps = round(late / step)
    names = fit.robot.joint_names
    nothing = dict.fromkeys(names, float("nan"))
    fields: dict[str, dict[str, float]] = {
        "stiffness": dict(zip(names, fit.kp.tolist(), strict=True)),
        "damping": dict(zip(names, fit.kd.tolist(), strict=True)),
        "armature": nothing | {n: v.value for n, v in fit.of("armature").items()},
        "friction": nothing | {n: v.value for n, v in fit.of("frictionloss").items()},
        "dynamic_friction": nothing | {n: v.value for n, v in fit.of("frictionloss").items()},
        "viscous_friction": nothing | {n: v.value for n, v in fit.of("damping").items()},
    }
    rest = 1e3 * (late - steps * step)
    delay = (
        f"The torque is {1e3 * late:.4g} ms late: {steps} physics steps of {1e3 * step:.4g} ms and "
        f"{rest:+.3g} ms that whole steps cannot give."
    )
    lines = [f"# {line}" for line in (*_heading(fit, "Isaac Lab"), delay)]
    lines += [
        "# DelayedPDActuator delays the target, the fit the torque, as PACE's actuator does.",
        "# friction and dynamic_friction are the same level: the fit has one.",
        "# Names of joints are regular expressions, in which points stand for themselves here.",
        "",
        "from isaaclab.actuators import DelayedPDActuatorCfg",
        "",
        f"PHYSICS_STEP = {step!r}  # s",
        "",
        "#: Add to the measured position's target what the encoder shows too much [rad or m].",
        f"ENCODER_BIAS = {dict(zip(names, fit.bias.tolist(), strict=True))!r}",
        "",
        "FITTED = DelayedPDActuatorCfg(",
        f"    joint_names_expr={[re.escape(name) for name in names]!r},",
    ]
    for key, values in fields.items():
        known = {re.escape(n): v for n, v in values.items() if np.isfinite(v)}
        if known:
            lines += [
                f"    {key}={{",
                *(f"        {name!r}: {value!r}," for name, value in known.items()),
                "    },",
            ]
    lines += [f"    min_delay={steps},", f"    max_delay={steps},", ")", ""]
    sentences = (delay, "DelayedPDActuator of Isaac Lab delays the target, not the torque")
    return RobotFile("\n".join(lines).encode(), sentences, format="isaac")


def fitted_file(fit: SimulatorFit, to: str, original: Path, folder: Path) -> RobotFile:
    """Write a fit into a simulator's file.

    Args:
        fit: the fit.
        to: ``mjcf``, ``urdf`` or ``isaac``.
        original: the description that the fit started from.
        folder: where the file will lie.

    Returns:
        The content of the file and what it leaves out.

    Raises:
        ExportError: no such format, or a description that cannot be written back.
    """
    check_format(to, original.name)
    if to == "isaac":
        return isaac_actuators(fit)
    return fitted_urdf(fit, original) if to == "urdf" else fitted_mjcf(fit, original, folder)


def check_format(to: str, name: str) -> None:
    """Refuse a format that there is not, or that a robot of this name cannot be written in.

    Raises:
        ExportError: says what can be written.
    """
    if to not in ENDINGS:
        raise ExportError(
            f"there is no format {to!r}", advice=f"choose one of {', '.join(ENDINGS)}"
        )
    if to != "isaac" and not name.endswith((*URDF_FILES, *MJCF_FILES)):
        raise ExportError(
            f"the robot is {name}, and only a URDF or MJCF can be written back",
            advice="name one under [robot], or write --to isaac",
        )
    if to == "urdf" and not name.endswith(URDF_FILES):
        raise ExportError(
            f"{name} is no URDF, and only a URDF can be edited into one",
            advice="write --to mjcf, or name a URDF as robot",
        )


def _joints_of(spec: Any, fit: SimulatorFit) -> list[Any]:
    """The joints that were fitted, in the order of the file."""
    found = [joint for joint in spec.joints if _name(joint) in fit.robot.joint_names]
    missing = set(fit.robot.joint_names) - {_name(joint) for joint in found}
    if missing:
        raise ExportError(
            f"the file has no joint {', '.join(map(repr, sorted(missing)))}",
            advice="give the file that the robot was read from",
        )
    return found


def _name(joint: Any) -> str:
    """Name of a joint; one without has that of its body, as `read_mjcf` has it."""
    return joint.name or (joint.parent.name if len(joint.parent.joints) == 1 else "")


def _set_actuators(spec: Any, fit: SimulatorFit) -> None:
    """Fitted gains into position actuators, which keep the positions that they hold."""
    mujoco = mujoco_library()
    for actuator in spec.actuators:
        name, bias, square = actuator.target, actuator.biasprm, actuator.gear[0] ** 2
        of_joint = actuator.trntype == mujoco.mjtTrn.mjTRN_JOINT
        affine = actuator.biastype == mujoco.mjtBias.mjBIAS_AFFINE
        if not of_joint or not affine or not bias[1] * square:
            continue
        if name in fit.of("kp"):
            factor = -fit.value("kp", name) / (square * bias[1])
            actuator.gainprm[0] *= factor
            bias[:2] *= factor
        if name in fit.of("kd"):
            bias[2] = -fit.value("kd", name) / square


def check_writable(to: str, original: Path, folder: Path) -> str:
    """What a file that can be written will leave out of the original, or nothing.

    Args:
        to: ``mjcf``, ``urdf`` or ``isaac``.
        original: the description.
        folder: where the file will lie.

    Raises:
        RobotDescriptionError: MuJoCo refuses the original.
        ExportError: it cannot be written.
    """
    if to != "mjcf":
        return ""
    spec, _, left_out = compilable(read_spec(original))
    _to_xml(spec, original, folder)
    return left_out


def _to_xml(spec: Any, original: Path, folder: Path) -> str:
    """MuJoCo's text of a spec, whose meshes and textures are found from another folder.

    MuJoCo looks for them where the original lies while it writes, so that paths are changed after.
    """
    try:
        spec.compile()
        text = XmlText(spec.to_xml().encode())
    except ValueError as error:
        said = " ".join(str(error).split())
        raise ExportError(f"MuJoCo cannot write the file: {said}") from error
    places = {}
    for kind in ("meshdir", "texturedir"):
        given = getattr(spec, kind)
        place = original.parent.absolute() / given
        with suppress(ValueError):  # on another drive
            place = Path(os.path.relpath(place, folder.absolute()))
        if given or any(list(files) for files in (spec.meshes, spec.textures, spec.hfields)):
            places[kind] = place.as_posix()
    compiler = text.root.first("compiler")
    if places and compiler is not None:
        text.set_attributes(compiler, places)
    return text.content().decode()


def _heading(fit: SimulatorFit, form: str) -> Iterable[str]:
    """What stands at the head of a file: origin, then all values with their intervals."""
    yield f"{form}: joints fitted by pivident {fit.version} to {', '.join(fit.recordings)}"
    yield "Values with their intervals of 95 %:"
    for value in fit.values:
        yield f"{value.joint} {value.quantity}: {value}".lstrip()


def _not_in_file(fit: SimulatorFit, known: tuple[str, ...], form: str) -> tuple[str, ...]:
    """What was fitted and the format has no place for."""
    left = dict.fromkeys(v.quantity for v in fit.values if v.quantity not in known)
    if not left:
        return ()
    return (
        f"{form} has no place for {', '.join(left)}: take {'it' if len(left) == 1 else 'them'} "
        "from simulator.csv",
    )
