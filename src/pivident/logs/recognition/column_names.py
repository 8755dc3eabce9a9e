"""Which column is what, by its name: ``q1``, ``tau[0]``, ``arm_3_joint_effort``."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence, Sized

from pivident.logs.recognition.channel_words import (
    PLAIN_FILLING,
    PLAIN_MEASURED,
    PLAIN_QUANTITIES,
    PLAIN_REFERENCE,
)
from pivident.logs.recognition.column_series import column_series

#: Words that name a channel; a current stands for a torque.
WORDS = {
    "q": set(PLAIN_QUANTITIES["q"].split()),
    "dq": set(PLAIN_QUANTITIES["dq"].split()),
    "tau": {*PLAIN_QUANTITIES["tau"].split(), *PLAIN_QUANTITIES["current"].split()},
}

#: Words without information about the joint.
FILLING = PLAIN_FILLING | PLAIN_MEASURED | {"rad", "deg", "nm"}

_WORD = re.compile(r"[a-z]+|\d+")


def channel_of(name: str) -> tuple[str, str] | None:
    """Channel and joint that a column's name belongs to."""
    words = _WORD.findall(name.lower().replace("_ref", " ref"))
    kinds = [kind for kind, own in WORDS.items() if own & set(words)]
    is_reference = bool(PLAIN_REFERENCE & set(words))
    if not kinds and "r" in words:
        kinds = ["q"]
    if len(kinds) != 1 or (is_reference and kinds[0] == "tau"):
        return None
    known = set().union(*WORDS.values()) | PLAIN_REFERENCE | FILLING
    joint = " ".join(word for word in words if word not in known)
    return (f"{kinds[0]}_ref" if is_reference else kinds[0]), joint


def recognise_columns(
    names: Sequence[str], joint_names: Sequence[str] = ()
) -> tuple[dict[str, list[str]], list[str]]:
    """Columns of each channel, one per joint, as far as their names show."""
    channels, joints = _by_words(names, joint_names)
    series = _by_series(names, joint_names)
    if not {"q", "tau"} <= set(channels):
        return series or (channels, joints)
    if series is not None and all(series[0].get(kind) == channels[kind] for kind in ("q", "tau")):
        channels = series[0] | channels
    return channels, joints


def _by_series(
    names: Sequence[str], joint_names: Sequence[str]
) -> tuple[dict[str, list[str]], list[str]] | None:
    """Channels from columns that differ only in the joint, where these are as many as joints."""
    channels: dict[str, list[str]] = {}
    merits: dict[str, tuple[int, int]] = {}
    labels: list[str] = []
    for own in column_series(names, joint_names):
        kind = {"current": "tau"}.get(own.channel or "", own.channel or "")
        if kind not in (*WORDS, "q_ref", "dq_ref"):
            continue
        numbers = sorted(own.columns, key=lambda k: int(k or 0)) if not own.named else []
        keys = [k for k in joint_names if k in own.columns] if own.named else numbers
        if joint_names and len(keys) != len(joint_names):
            continue
        merit = (own.reading.measured, len(keys))
        if kind in merits and merit <= merits[kind]:
            if merit == merits[kind]:
                channels.pop(kind, None)  # two sets, and nothing says which
            continue
        merits[kind], channels[kind] = merit, [own.columns[k] for k in keys]
        labels = keys if kind == "q" else labels
    if not {"q", "tau"} <= set(channels):
        return None
    alike = {k: v for k, v in channels.items() if len(v) == len(channels["q"])}
    return alike, list(joint_names) or [f"joint_{label or k + 1}" for k, label in enumerate(labels)]


def _by_words(
    names: Sequence[str], joint_names: Sequence[str]
) -> tuple[dict[str, list[str]], list[str]]:
    """Channels from the words of single names."""
    families: dict[str, dict[str, dict[str, str]]] = {}
    for name in names:
        assumption = channel_of(name)
        if assumption is not None:
            kind, joint = assumption
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
