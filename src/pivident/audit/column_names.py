"""Which column is what, told from its name: ``q1``, ``tau[0]``, ``arm_3_joint_effort``."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence, Sized

import numpy as np

#: Words that name a channel.
WORDS = {
    "q": {"q", "qm", "pos", "position", "positions", "theta", "angle", "pfbk"},
    "dq": {"dq", "qdot", "vel", "velocity", "velocities", "speed", "omega", "vfbk"},
    "tau": {"tau", "torque", "torques", "effort", "efforts", "trq", "current", "curr", "force"},
}

#: Words that make a reference of a position or a speed; ``r1`` is the reference of joint 1.
REFERENCE = {"ref", "reference", "des", "desired", "cmd", "command", "target", "setpoint", "r"}

#: Words that tell nothing about the joint.
FILLING = {
    "joint",
    "j",
    "axis",
    "measured",
    "meas",
    "actual",
    "act",
    "motor",
    "link",
    "rad",
    "deg",
    "nm",
}

#: Words of a column that holds time stamps.
TIME = {"t", "time", "timestamp", "stamp", "clock", "secs", "seconds", "sec", "ms", "us", "ns"}

_WORD = re.compile(r"[a-z]+|\d+")


def channel_of(name: str) -> tuple[str, str] | None:
    """Channel and joint that a column's name speaks of.

    Args:
        name: name of a column, or of a column of an array, such as ``tau[:, 0]``.

    Returns:
        ``("tau", "0")``, or None where the name tells nothing.
    """
    words = _WORD.findall(name.lower().replace("_ref", " ref"))
    kinds = [kind for kind, own in WORDS.items() if own & set(words)]
    is_reference = bool(REFERENCE & set(words))
    if not kinds and "r" in words:
        kinds = ["q"]
    if len(kinds) != 1 or (is_reference and kinds[0] == "tau"):
        return None
    known = set().union(*WORDS.values()) | REFERENCE | FILLING
    joint = " ".join(word for word in words if word not in known)
    return (f"{kinds[0]}_ref" if is_reference else kinds[0]), joint


def is_clock(name: str, values: np.ndarray) -> bool:
    """Whether a column holds time stamps: by its name, and nearly always increasing.

    Args:
        name: name of the column.
        values: shape (samples,).
    """
    words = set(_WORD.findall(name.lower()))
    if not words & TIME or len(values) < 3:
        return False
    steps = np.diff(values[np.isfinite(values)])
    return bool(steps.size and np.mean(steps >= 0) > 0.9 and np.ptp(values[np.isfinite(values)]))


def guess_channels(
    names: Sequence[str], joint_names: Sequence[str] = ()
) -> tuple[dict[str, list[str]], list[str]]:
    """Columns of each channel, one per joint, as far as their names tell.

    Args:
        names: names of the columns.
        joint_names: joints of the robot, where it is known; gives order and number.

    Returns:
        Columns by channel and the names of the joints. A channel that has no column for some
        joint of ``q`` is left out.
    """
    families: dict[str, dict[str, dict[str, str]]] = {}
    for name in names:
        guess = channel_of(name)
        if guess is not None:
            kind, joint = guess
            family = "" if joint_names else " ".join(re.findall(r"[a-z]+", joint))
            families.setdefault(family, {}).setdefault(kind, {}).setdefault(joint, name)
    # Several sets of positions: the one that has torques too is the arm.
    with_torque = [own for own in families.values() if {"q", "tau"} <= set(own)]
    with_position = [own for own in families.values() if "q" in own]
    if len(families) > 1 and not joint_names and not with_torque:
        merged: dict[str, dict[str, str]] = {}
        for own in families.values():
            for kind, columns in own.items():
                merged.setdefault(kind, {}).update(columns)
        with_position = [merged] if len(merged.get("q", ())) == _largest(merged) else with_position
    chosen = with_torque or with_position
    if len(chosen) != 1:
        return {}, []
    found = chosen[0]
    joints = _ordered(list(found["q"]), joint_names)
    if joint_names and len(joints) != len(joint_names):
        return {}, []
    channels = {
        kind: [own[joint] for joint in joints]
        for kind, own in found.items()
        if set(joints) <= set(own)
    }
    labels = [f"joint_{j or k + 1}".replace(" ", "_") for k, j in enumerate(joints)]
    return channels, list(joint_names) or labels


def _largest(channels: Mapping[str, Sized]) -> int:
    """Number of columns of the channel that has most."""
    return max((len(own) for own in channels.values()), default=0)


def _ordered(labels: list[str], joint_names: Sequence[str]) -> list[str]:
    """The labels in the order of the robot's joints where they are their names."""
    own = [
        " ".join(word for word in _WORD.findall(name.lower()) if word not in FILLING)
        for name in joint_names
    ]
    return own if own and set(own) <= set(labels) else labels
