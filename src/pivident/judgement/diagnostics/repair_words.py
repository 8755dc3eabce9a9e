"""What was wrong where a repair helps, in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pivident.foundation.text.numbers import format_significant
from pivident.foundation.text.repair import (
    CALLED,
    Change,
    Edit,
    Multiplied,
    NotRead,
    Reordered,
    Repair,
    Retimed,
    Reversed,
    Shifted,
)
from pivident.foundation.text.sentences import listed


def cause_of(repair: Repair, joints: Sequence[str]) -> str:
    """What was wrong, one sentence for each edit; empty where its edits do not say.

    Args:
        repair: which helps.
        joints: names of the robot's joints, in order.
    """
    return " ".join(filter(None, (_of(edit, joints) for edit in repair.edits)))


def _of(edit: Change, names: Sequence[str]) -> str:
    """One edit."""
    match edit:
        case Reversed(channel="", joints=joints):
            return f"{listed(joints)} turn{'s' * (len(joints) == 1)} the other way than described."
        case Reversed(channel=channel, joints=joints):
            return f"The {CALLED.get(channel, channel)} of {listed(joints)} has the other sign."
        case Multiplied(channel="q", factors=factors):
            return " ".join(_unit(*pair) for pair in factors)
        case Multiplied(channel=channel, factors=factors):
            said = [f"of {j} is {format_significant(1.0 / f)} times as large" for j, f in factors]
            return f"The logged {CALLED.get(channel, channel)} {listed(said)} as it should be."
        case Reordered(channel=channel, order=order):
            whose = CALLED.get(channel, "column") if channel else "column"
            moved = [names[k] for k, own in enumerate(order) if own != k]
            return f"The {whose}s of {' and '.join(moved)} are exchanged."
        case Shifted(offsets=offsets):
            said = [f"of {j} is off by {_angle(x)}" for j, x in offsets]
            return f"The zero position {listed(said)}."
        case Retimed(factor=factor):
            times = factor if factor > 1.0 else 1.0 / factor
            faster = "fast" if factor > 1.0 else "slowly"
            return f"The clock runs {format_significant(times)} times as {faster} as it should."
        case NotRead(channel=channel):
            return f"{channel} is not what its name says."
        case Edit(place=("robot", "gravity"), value=value) if not any(value):
            return "The torques hold no gravity: the drives have taken it out."
        case Edit(place=("robot", "gravity"), value=value):
            return f"Gravity points along {_axis(value)} of the base."
        case Edit(place=(*_, "delay"), value=value):
            late = 1e3 * (value or 0.0)
            side = "before" if late < 0.0 else "after"
            return f"The torques were logged {abs(late):.3g} ms {side} the positions."
        case Edit(place=(*_, "torque_timing"), value=value):
            return f"The torques are {value}, see torque_timing."
    return ""


def _unit(joint: str, factor: float) -> str:
    """Degrees among radians, or a factor."""
    if math.isclose(factor, math.pi / 180.0, rel_tol=1e-3):
        return f"The position of {joint} is in degrees."
    if math.isclose(factor, 180.0 / math.pi, rel_tol=1e-3):
        return f"The position of {joint} is in radians."
    return f"The position of {joint} is {format_significant(1.0 / factor)} times as large."


def _angle(radians: float) -> str:
    return f"{math.degrees(-radians):.4g}°"


def _axis(gravity: Sequence[float]) -> str:
    """``-z``, or the components."""
    size = math.hypot(*gravity)
    for axis, x in zip("xyz", gravity, strict=True):
        if abs(x) > 0.99 * size:
            return f"{'+' if x > 0 else '-'}{axis}"
    return str(list(gravity))
