"""What one unit of a logged torque is worth, where nobody has said it.

A log in amperes, or one whose unit nobody knows, becomes newton metres by a gain. A gain that was
taken from the masses of the robot's description is as wrong as they are, and one that was assumed
leaves all parameters in units of the log. Who writes such a number says so beside it:

    tau = {unit = "A", gain = 11.4, scale = "masses"}    # or "assumed"

The mark is a part of the unit, so that a gain of one's own takes its place. A torque that was not
logged, but computed from the control law, has the unit of the law's output where nobody knows the
drive gain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

#: What a scale may rest on, other than on somebody's word.
MASSES, ASSUMED = "masses", "assumed"
BASES = (MASSES, ASSUMED)

#: On nothing: the torque is the output of a control law whose drive gain is not known.
OUTPUT = "output"

#: Its unit.
OUTPUT_UNIT = "output"

#: What earlier versions wrote for an assumed scale; such files are read all the same.
EARLIER = {"guessed": ASSUMED}

#: What to write, for both.
_ENTER = (
    "Enter the drives' own gains (torque constant times gear ratio) as gain of tau under "
    "[recording.units], without scale; `pivident gains` finds them from a known payload, and with "
    "--in-log-units it identifies every motor in the unit of its log"
)


@dataclass(frozen=True)
class TorqueScale:
    """The scale of one joint's torque that nobody has verified."""

    joint: str
    unit: str  # unit of the log, such as ``A`` or ``command``
    basis: str  # ``masses`` (of the robot's description), ``assumed`` or ``output``


def torque_scales(spec: Any, joint_names: Sequence[str]) -> tuple[TorqueScale, ...]:
    """The scales that a unit of ``tau`` marks as somebody's assumption."""
    listed = spec if isinstance(spec, (list, tuple)) else [spec] * len(joint_names)
    return tuple(
        TorqueScale(joint, str(unit["unit"]), EARLIER.get(str(unit["scale"]), str(unit["scale"])))
        for joint, unit in zip(joint_names, listed, strict=False)
        if isinstance(unit, Mapping) and "scale" in unit
    )


def is_ratio(scales: Sequence[TorqueScale]) -> bool:
    """Whether parameters are ratios to a drive gain that nobody knows.

    Args:
        scales: of the torques that they were identified from.
    """
    return any(s.basis == OUTPUT for s in scales)


def marked_scales(scales: Sequence[TorqueScale]) -> list[TorqueScale]:
    """Scales that a unit of the log marks, without those of a control law's output.

    Args:
        scales: of the torques; what the others mean is said with the law.
    """
    return [s for s in scales if s.basis != OUTPUT]


def scale_sentences(scales: Sequence[TorqueScale]) -> tuple[str, ...]:
    """What assumed scales mean for parameters, for each basis, and at the end what to enter."""
    assumed, masses = (
        [s for s in dict.fromkeys(scales) if s.basis == basis] for basis in (ASSUMED, MASSES)
    )
    found = []
    if assumed:
        found.append(
            f"The torque of {_joints(assumed)} is in units of the log ({_units(assumed)}), and the "
            "scale to N m is an assumption: so are the sizes of all parameters, whatever their "
            "intervals say; relative errors of the torque do not depend on it. Write "
            '"N m" where the log has that.'
        )
    if masses:
        found.append(
            f"The scale of the torque of {_joints(masses)} ({_units(masses)}) was taken from the "
            "masses of the robot's description: parameters are as wrong as these, whatever their "
            "intervals say; relative errors of the torque do not depend on it."
        )
    found = [*found[:-1], f"{found[-1]} {_ENTER}."] if found else []
    if output := [s for s in dict.fromkeys(scales) if s.basis == OUTPUT]:
        found.append(
            f"The torque of {_joints(output)} is in units of the controller's output, since the "
            "drive gain is not known: every parameter is a ratio to the drive gain, the same for "
            "all joints. Ratios between parameters hold, their sizes in SI units are not known. "
            "Write drive_gain, the joint torque per unit of the output, under [controller]; one "
            "known mass or inertia gives it as that value over its estimate."
        )
    return tuple(found)


def scale_headline(scales: Sequence[TorqueScale]) -> str:
    """The same in a few words; empty where all scales are verified."""
    if is_ratio(scales):
        return "Parameters are ratios to the drive gain, which is not known."
    if any(s.basis == ASSUMED for s in scales):
        return "Parameters are in units of the logged torque; its scale to N m is an assumption."
    if scales:
        return (
            "The torque scale was taken from the description's masses; parameters are as good as "
            "these."
        )
    return ""


def _joints(scales: Sequence[TorqueScale]) -> str:
    return ", ".join(s.joint for s in scales)


def _units(scales: Sequence[TorqueScale]) -> str:
    return ", ".join(dict.fromkeys(s.unit for s in scales))
