"""Differences of a robot file from the model, as sentences with sizes in N m (or N).

A robot description in the format of simulators.
"""

from __future__ import annotations

import gzip
import io
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from pivident.dynamics.friction import friction_column
from pivident.dynamics.parameters import Parameter
from pivident.foundation.errors import ExportError
from pivident.models.export.joint_side import JointProperty
from pivident.models.exported import ExportedText
from pivident.models.runnable_model import RunnableModel
from pivident.robot.description import Joint, Robot
from pivident.robot.friction_term import FrictionTerm
from pivident.robot.urdf_xml import GZIP_MAGIC, MAXIMUM_SIZE

#: Acceleration at which inertias are expressed as torque [rad/s² or m/s²].
ACCELERATION = 10.0
#: Speed and largest position where the robot's are not known [rad/s or m/s, rad or m].
SPEED, POSITION = 1.0, np.pi
#: Torque below which nothing is reported [N m or N].
NEGLIGIBLE = 1e-6
#: Each kind of parameter in the order of the sentences, and what to do about it.
_KINDS = {
    "rotor": "rotor inertia (armature); set it in the engine, or add ia · ddq to the torque",
    "offset": "constant torque of a joint; add it to the torque",
    "bias": "constant torque of a joint without a motor; apply it to the joint",
    "spring": "spring in a joint; add ks · q to the torque",
    "negative": "negative friction, which a free estimate may have; left out",
    "viscous": "damping that depends on the direction; the mean of both is written, and the rest "
    "times |dq| is missing",
    "friction": "friction of this form; add it to the torque",
    "coupling": "element for motors that turn with a second joint; add it to both torques",
}


def differences(
    model: RunnableModel,
    name: str,
    supported: frozenset[JointProperty],
    left_out: Mapping[str, float],
) -> tuple[str, ...]:
    """Sentences on everything that the file represents differently or leaves out."""
    robot = model.robot.tree
    found: dict[str, list[str]] = {}
    for p in model.parameters:
        part = left_out.get(p.name, 0.0)
        text, size = _sized(robot, p, part)
        if size > NEGLIGIBLE:
            kind = _kind(p, part, supported, driven=p.joint in model.robot.places)
            found.setdefault(kind, []).append(text)
    sentences = [
        f"{name} has no {what}: {', '.join(found[kind])}"
        for kind, what in _KINDS.items()
        if kind in found
    ]
    return (*sentences, *_dry_friction(model, name, left_out))


def _kind(p: Parameter, part: float, supported: frozenset[JointProperty], driven: bool) -> str:
    if p.stem == "ia":
        return "rotor"
    if p.coupling is not None:
        return "coupling"
    assert p.friction is not None
    element, one_way = p.friction.column.element, p.friction.column.opposite
    dry = element == "dry friction"
    if (element == "offset" or (dry and one_way)) and "offset" not in supported:
        return "offset"
    if element == "offset" and not driven:
        return "bias"
    if element == "spring":
        return "spring"
    if one_way and not dry:
        return "viscous"
    if p.is_dissipative and part < 0.0:
        return "negative"
    return "friction"


def _sized(robot: Robot, p: Parameter, part: float) -> tuple[str, float]:
    """A parameter with the torque that is missing without it, and that torque [N m or N]."""
    if part == 0.0:
        return "", 0.0
    joint = robot.joints[p.joint]
    torque, unit = joint.torque_unit, joint.position_unit
    speed = joint.rated_speed or SPEED
    own = f"{p.name} {part:.4g} {p.unit}"
    if p.stem in ("ia", "iam"):
        ratio = 1.0 if p.coupling is None else p.coupling.ratio
        size = abs(part * ratio) * ACCELERATION
        return f"{own} ({size:.3g} {torque} at {ACCELERATION:g} {unit}/s²)", size
    if p.coupling is not None:
        other = robot.joints[p.coupling.joint].rated_speed or SPEED
        size = abs(part) if p.stem == "fcm" else abs(part * p.coupling.ratio) * max(speed, other)
        return f"{own} (up to {size:.3g} {torque})", size
    assert p.friction is not None
    if p.friction.depends_on_load:
        return f"{own} ({abs(part):.3g} {torque} per {torque} that the joint carries)", abs(part)
    if p.friction.column.element == "offset" or _is_presliding(p.friction):
        return own, abs(part)
    size = abs(part) * _largest(p.friction, joint, speed)
    return f"{own}, {p.friction} (up to {size:.3g} {torque})", size


def _is_presliding(term: FrictionTerm) -> bool:
    return term.has_memory and term.column.element == "dry friction"


def _largest(term: FrictionTerm, joint: Joint, speed: float) -> float:
    """Largest value of a term's function between the limits and up to a speed."""
    if term.has_memory:  # d dz/dt is at most the speed
        return speed
    low, high = joint.position_limits or (-POSITION, POSITION)
    q = np.linspace(low, high, 2001)
    return float(np.abs(friction_column(term, np.linspace(-speed, speed, 2001), q)).max())


def _dry_friction(model: RunnableModel, name: str, left_out: Mapping[str, float]) -> Iterator[str]:
    """How the file's dry friction, with its sharp sign, differs from the model's."""
    smooth, elastic = [], []
    for p, value in zip(model.parameters, model.values, strict=True):
        part = float(value) - left_out.get(p.name, 0.0)
        if p.friction is None or part == 0.0 or not p.is_dissipative:
            continue
        torque, unit = p.unit, "rad" if p.unit == "N m" else "m"
        if _is_presliding(p.friction):
            distance = p.friction.shapes[0].value
            elastic.append(
                f"{p.name} {abs(part):.3g} {torque}, over some {distance:.3g} {unit} of travel"
            )
        elif p.friction.has_sign and p.friction.smoothing != "sign":
            gamma = p.friction.encoded()[2][0]
            # 90 % of the level: (2/π) atan(6.3), tanh(1.5)
            speed = (6.31 if p.friction.smoothing == "atan" else 1.47) / gamma
            smooth.append(f"{p.name} {abs(part):.3g} {torque} ({speed:.2g} {unit}/s)")
    if smooth:
        yield (
            f"dry friction has a sharp sign in {name}; in the model it is smoothed, with nine "
            f"tenths of its level at the speed given here: {', '.join(smooth)}"
        )
    if elastic:
        yield (
            f"{name} has no elastic displacement before friction slips; after a reversal its "
            f"friction reaches its level immediately: {', '.join(elastic)}"
        )


@dataclass(frozen=True)
class RobotFile(ExportedText):
    """A robot in the format of simulators: ``urdf``, ``mjcf`` or ``sdf``.

    ``left_out`` are the parts of parameters that are not in the file, by name, in the parameters'
    units, ``supported`` the properties of joints that the format has. With Φ the observation
    matrix, the model's torque is what the file's readers compute plus Φ · left_out; dry friction is
    in the file with a sharp sign.
    """

    format: str = "urdf"
    left_out: Mapping[str, float] = field(default_factory=dict)
    supported: frozenset[JointProperty] = frozenset()

    @property
    def text(self) -> str:
        """The file as text; bytes that are not UTF-8 become escapes."""
        return self.content.decode("utf-8", errors="backslashreplace")


def plain_content(content: bytes) -> bytes:
    """A file's bytes, decompressed if they are gzip."""
    if content[: len(GZIP_MAGIC)] == GZIP_MAGIC:
        try:
            with gzip.GzipFile(fileobj=io.BytesIO(content)) as file:
                content = file.read(MAXIMUM_SIZE + 1)
        except (EOFError, gzip.BadGzipFile, zlib.error) as error:
            raise ExportError(
                f"the original file is damaged gzip ({error})", advice="fetch or compress it again"
            ) from error
    if len(content) > MAXIMUM_SIZE:
        raise ExportError(
            f"the original file is larger than {MAXIMUM_SIZE // 2**20} MiB",
            advice="this is not a robot description",
        )
    return content
