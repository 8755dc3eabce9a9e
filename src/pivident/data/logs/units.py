"""Units of a log: how much one of them is in SI.

A unit is written as a name (``"deg"``), as a bare factor to SI (``1.014``), or, where the unit
alone does not say it, as a table:

    {unit = "counts", per_revolution = 4096}    positions counted by an encoder (or per_metre)
    {unit = "V", gain = 35.15}                  drive commands; gain in N m or N per unit
    {unit = "A", gain = 11.4, scale = "masses"} a gain that is assumed, see `torque_scale`

Commands without a gain (``"A"``, ``"V"``, ``"command"``) take the transmission's drive gain.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from pivident.data.logs.torque_scale import BASES, EARLIER
from pivident.foundation.errors import RecordingError, concerning
from pivident.robot.naming import nearest

#: What a user may write for the unit of one channel of one joint.
UnitSpec = str | float | Mapping[str, str | float]

DEGREE = math.pi / 180.0

ANGLE = {"rad": 1.0, "deg": DEGREE, "rev": 2.0 * math.pi}
LENGTH = {"m": 1.0, "mm": 1e-3, "um": 1e-6}
POSITION = ANGLE | LENGTH
SPEED = {f"{unit}/s": factor for unit, factor in POSITION.items()} | {"rpm": 2.0 * math.pi / 60.0}
ACCELERATION = {f"{unit}/s^2": factor for unit, factor in POSITION.items()}
TORQUE = {"N m": 1.0, "Nm": 1.0, "mN m": 1e-3, "kN m": 1e3, "N": 1.0, "kN": 1e3}
COMMAND = {"A": 1.0, "mA": 1e-3, "V": 1.0, "mV": 1e-3, "command": 1.0}
TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}

#: The units a channel may have; known inputs keep the controller's unit, up to a prefix.
UNITS_OF = {
    "q": POSITION,
    "q_ref": POSITION,
    "q_link": POSITION,  # flexible joints
    "dq": SPEED,
    "dq_ref": SPEED,
    "ddq_ref": ACCELERATION,
    "tau": TORQUE | COMMAND,
    "t": TIME,
    "inputs": TORQUE | COMMAND,
    "wrench": TORQUE,
    "base.position": LENGTH,
    "base.rpy": ANGLE,
    "base.quaternion": {"1": 1.0},
    "base.twist": SPEED,
}


def factor_to_si(channel: str, spec: UnitSpec) -> tuple[float, bool]:
    """What one unit of a channel is in SI."""
    if isinstance(spec, Mapping):
        return _scaled(channel, dict(spec))
    if isinstance(spec, (int, float)) and not isinstance(spec, bool):
        return _number(channel, "factor", spec), False
    return _named(channel, spec), channel == "tau" and spec in COMMAND


def _named(channel: str, unit: object) -> float:
    """Factor of a unit that is given by its name."""
    units = UNITS_OF.get(channel) or UNITS_OF[channel.partition(".")[0]]
    name = str(unit).replace("²", "^2").replace("·", " ").replace("µ", "u")
    if name not in units:
        scale = "; counts need per_revolution or per_metre" if name == "counts" else ""
        raise RecordingError(
            f"unit {unit!r} of {channel} is not known here", advice=f"{nearest(name, units)}{scale}"
        )
    return units[name]


def _scaled(channel: str, spec: dict[str, str | float]) -> tuple[float, bool]:
    """Factor of a unit that is given with its scale."""
    unit = spec.pop("unit", None)
    if channel in ("q", "q_ref", "q_link") and unit == "counts" and len(spec) == 1:
        scale, value = spec.popitem()
        if scale in ("per_revolution", "per_metre"):
            circle = 2.0 * math.pi if scale == "per_revolution" else 1.0
            with concerning("units", channel, scale):
                return circle / _number(channel, scale, value), False
    if channel == "tau" and unit is not None and "scale" in spec:
        _check_scale(spec.pop("scale"))
        if not spec and unit in TORQUE:
            return _named(channel, unit), False
    if channel == "tau" and unit is not None and set(spec) == {"gain"}:
        factor = _named(channel, unit)
        with concerning("units", channel, "gain"):
            return factor * _number(channel, "gain", spec["gain"]), False
    raise RecordingError(
        f"unit of {channel} is given as unit = {unit!r} with {', '.join(spec) or 'nothing else'}",
        advice="use {unit = 'counts', per_revolution or per_metre = …} for positions, {unit = "
        "'A' or 'V', gain = …} for torques",
    )


def _check_scale(basis: object) -> None:
    """Refuse what a scale cannot rest on."""
    if basis not in (*BASES, *EARLIER):
        raise RecordingError(
            f"scale of tau is {basis!r}",
            advice=f"it is {' or '.join(map(repr, BASES))} where a gain is assumed, and left out "
            "where somebody knows it",
        )


def _number(channel: str, name: str, value: object) -> float:
    """A finite number other than zero."""
    try:
        number = float(value) if isinstance(value, (int, float)) else math.nan
    except OverflowError:  # a whole number of hundreds of digits
        number = math.inf
    if not math.isfinite(number) or number == 0.0:
        raise RecordingError(
            f"{name} of {channel} is {value!r}", advice="a number other than 0 is needed"
        )
    return number


def check_kind(channel: str, spec: UnitSpec, joint: str, kind: str) -> None:
    """Refuse an angle for a sliding joint and a length for a turning one."""
    wrong = ("rad", "deg", "rev") if kind == "prismatic" else ("m", "mm", "um")
    if isinstance(spec, str) and spec in wrong:
        raise RecordingError(
            f"unit {spec!r} of {channel} does not suit the {kind} joint {joint!r}",
            advice="give a list with one unit per joint if they differ",
        )
