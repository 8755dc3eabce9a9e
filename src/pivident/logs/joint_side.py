"""From units of the log to SI, and from the motors to the joints.

joint-side SI = N⁻¹ (factor · logged) + offset        positions; speeds without the offset
Nᵀ (gain · factor · logged)           torques
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pivident.logs.log import Description
from pivident.logs.units import factor_to_si
from pivident.robot.transmission import Transmission
from pivident.scratch import working_array

#: Channels of positions, to which the zero of the model is added.
POSITIONS = ("q", "q_ref", "q_link")


def factors_of(channel: str, units: Sequence[Any]) -> tuple[np.ndarray, np.ndarray]:
    """Factor to SI of each joint, and whether it is a drive command; None stands for SI."""
    pairs = [(1.0, False) if unit is None else factor_to_si(channel, unit) for unit in units]
    return np.array([factor for factor, _ in pairs]), np.array([c for _, c in pairs], dtype=bool)


def gains_of(
    commands: np.ndarray, transmission: Transmission | None
) -> tuple[np.ndarray, tuple[int, ...]]:
    """Drive gain of each joint with a command, 1 of the others, and commands without a gain."""
    joints = len(commands)
    if transmission is None:
        return np.ones(joints), tuple(int(j) for j in np.flatnonzero(commands))
    gains = np.where(commands, transmission.drive_gain[:joints], 1.0)
    without = np.flatnonzero(commands & ~np.asarray(transmission.gain_given, bool)[:joints])
    return gains, tuple(int(j) for j in without)


def sides_of(side: Any) -> dict[str, Any]:
    """Side of each channel that has one; references are on that of the positions."""
    given = dict(side) if isinstance(side, Mapping) else dict.fromkeys(("q", "tau"), side)
    positions = given.get("q", "joint")
    sides = {channel: given.get(channel, positions) for channel in ("q", "dq", "q_ref")}
    sides |= {channel: given.get(channel, sides["q_ref"]) for channel in ("dq_ref", "ddq_ref")}
    return sides | {"tau": given.get("tau", "joint"), "q_link": "joint"}  # flexible joints


def on_joint_side(
    channel: str, values: np.ndarray, sides: Mapping[str, str], said: Description
) -> np.ndarray:
    """A channel in SI behind the gear, positions with the zero of the model."""
    joints = values.shape[1]
    given, transmission = said.position_offset, said.transmission
    offset = np.zeros(joints) if given is None else np.asarray(given, float)[:joints]
    on_motor = {key: own == "motor" and transmission is not None for key, own in sides.items()}
    if on_motor[channel] and transmission is not None:
        gear = transmission.first(joints)
        if channel == "tau":
            return gear.joint_torques(values)
        values = gear.joint_positions(values)
        values -= gear.position_offset
    if transmission is not None and given is None:
        # Both encoders of a flexible joint are in the model's coordinates.
        if on_motor[channel] or (channel == "q_link" and on_motor["q"]):
            offset = transmission.position_offset[:joints]
    if channel in POSITIONS and offset.any():
        return np.add(values, offset, out=working_array(values.shape))
    return values
