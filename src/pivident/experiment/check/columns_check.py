"""What the names of the columns say against the experiment file: quantity, joint, unit, order."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from pivident.data.logs.recognition.channel_words import (
    PLAIN_QUANTITIES,
    REFERENCE,
    UNIT_WORDS,
    plain_channel,
    words_of,
)
from pivident.foundation.text.finding import Finding, FindingKind, Severity, Topic
from pivident.foundation.text.repair import Repair, in_unit, setting
from pivident.foundation.text.sentences import listed
from pivident.robot.description import Robot

#: What these checks look at, and the table of the columns.
COLUMNS, TABLE = Topic("columns"), ("recording", "columns")

JOINT_ORDER = FindingKind(COLUMNS, "joint order")
TORQUE_NOT_NAMED = FindingKind(COLUMNS, "torque not named", TABLE)
UNIT = FindingKind(COLUMNS, "unit")

#: What a channel is called in a sentence.
CALLED = {
    "q": "position",
    "dq": "speed",
    "ddq": "acceleration",
    "tau": "torque",
    "q_ref": "reference position",
    "dq_ref": "reference speed",
    "ddq_ref": "reference acceleration",
}

_QUANTITY = {
    "q": "angle",
    "q_ref": "angle",
    "q_link": "angle",
    "dq_ref": "speed",
    "tau": "torque",
    "t": "time",
}
_SI = {"angle": "rad", "speed": "rad/s", "torque": "N m", "time": "s"}

#: Units that stand for the same.
_ALIKE = {"Nm": "N m", "m": "rad", "m/s": "rad/s", "N": "N m"}

_ACCELERATION = set(PLAIN_QUANTITIES["ddq"].split())

#: Words that may be units: the letter before a number is that of an axis, ``A1``.
_UNIT_WORD = re.compile(r"[a-zA-Zµ]{2,}|[a-zA-Z](?![a-zA-Z\d])")


def check_columns(
    columns: Mapping[str, Any], units: Mapping[str, Any], robot: Robot | None
) -> list[Finding]:
    """Compare what a file says its columns are with what they are called."""
    others = ("inputs", "temperature")  # of any quantity, and of several joints at once
    named = {key: _names(spec) for key, spec in columns.items() if key not in others}
    findings = [*_used_twice(named)]
    joints = robot.on_fixed_base.joint_names if robot else ()  # no log has a base's joints
    for channel, names in named.items():
        findings += [*_another_quantity(channel, names)]
        findings += [*_another_order(channel, names, joints)]
        findings += [*_another_unit(channel, names, units.get(channel))]
    return findings


def check_unnamed_torque(columns: Mapping[str, Any], others: Iterable[str]) -> list[Finding]:
    """Columns that read like torques where none is named, so that the control law stands for it.

    ``others``: names of the columns that the experiment does not use.
    """
    if columns.get("tau") is not None:
        return []
    found = [name for name in others if plain_channel(name) == "tau"]
    if not found:
        return []
    text = f"No column is named for tau, but {listed([repr(n) for n in found])} read like torques."
    step = (
        "Name them for tau if they are: a measured torque tells the scale of all parameters, one "
        "computed from the control law does not."
    )
    repairs = [_named("tau", found)] if len(found) == len(_names(columns.get("q"))) else []
    return [TORQUE_NOT_NAMED.finding("warning", text, "tau", step, repairs=repairs)]


def _named(channel: str, names: Sequence[str]) -> Repair:
    """Names of the columns of a channel."""
    words = f"Name the columns of {channel} as {', '.join(names)}."
    return setting("columns", channel, value=list(names), words=words)


def _names(spec: Any) -> list[str]:
    """Names of the columns of one channel."""
    if isinstance(spec, Mapping):
        spec = spec.get("columns")
    listed = [spec] if isinstance(spec, str) else spec
    return [n for n in listed if isinstance(n, str)] if isinstance(listed, list | tuple) else []


def _used_twice(named: Mapping[str, Sequence[str]]) -> Iterator[Finding]:
    first: dict[str, str] = {}
    reported: set[tuple[str, str]] = set()
    for channel, names in named.items():
        for column in names:
            other = first.setdefault(column, channel)
            again = other != channel or list(names).count(column) > 1
            if not again or (column, channel) in reported or column.endswith("]"):
                continue
            reported.add((column, channel))
            of = f"for {other} and for {channel}" if other != channel else f"twice for {channel}"
            yield FindingKind(COLUMNS, f"used {of}", (*TABLE, channel)).finding(
                "error",
                f"The column {column!r} is used {of}.",
                column,
                f"Name the column of {CALLED.get(channel, channel)} that was meant.",
            )


def _another_quantity(channel: str, names: Sequence[str]) -> Iterator[Finding]:
    for column in names:
        kind = "ddq" if _ACCELERATION & set(words_of(column.lower())) else plain_channel(column)
        if kind is None or kind == channel or channel not in CALLED:
            continue
        if f"{kind}_ref" == channel and (kind != "q" or REFERENCE & set(words_of(column))):
            continue  # a reference, which the names of speeds need not say: q_d, q_set, dq_des
        yield FindingKind(COLUMNS, f"reads like {kind}", (*TABLE, channel)).finding(
            "warning",
            f"The column {column!r} is taken for {channel} ({CALLED[channel]}), but its name "
            f"reads like {kind} ({CALLED.get(kind, kind)}).",
            column,
            "The columns may be swapped; check which is which.",
        )


def _another_order(channel: str, names: Sequence[str], joints: Sequence[str]) -> Iterator[Finding]:
    """Columns that carry numbers or joints' names in another order than the joints."""
    if len(names) < 2:
        return
    place = (*TABLE, channel)
    for j, (column, joint) in enumerate(zip(names, joints, strict=False)):
        others = [o for o in joints if o != joint and _contains(column, o)]
        if others and not _contains(column, joint):
            text = (
                f"Number {j + 1} of the columns of {channel} belongs to {joint}, but is "
                f"{column!r}, which reads like {others[-1]}."
            )
            step = "List the columns in the order of the robot's joints: " + ", ".join(joints) + "."
            owners = [[n for n in names if _contains(n, own)] for own in joints[: len(names)]]
            right = [columns[0] for columns in owners if len(columns) == 1]
            repairs = [_named(channel, right)] if sorted(right) == sorted(names) else []
            yield JOINT_ORDER.finding("error", text, joint, step, place=place, repairs=repairs)
            return
    numbers = [re.findall(r"\d+", column) for column in names]
    if all(len(found) == 1 for found in numbers):
        values = [int(found[0]) for found in numbers]
        if values != sorted(values) and len(set(values)) == len(values):
            text = (
                f"The columns of {channel} are numbered {', '.join(map(str, values))}, not in "
                "order."
            )
            step = "One column for each joint, from the base to the tip; two may be swapped."
            right = [names[k] for k in sorted(range(len(names)), key=values.__getitem__)]
            repairs = [_named(channel, right)]
            yield JOINT_ORDER.finding("warning", text, channel, step, place=place, repairs=repairs)


def _contains(column: str, joint: str) -> bool:
    """Whether a column's name has the joint's name as words of its own."""
    text = re.escape(joint.lower())
    return re.search(rf"(?<![a-z0-9]){text}(?![a-z0-9])", column.lower()) is not None


def _another_unit(channel: str, names: Sequence[str], given: Any) -> Iterator[Finding]:
    quantity = _QUANTITY.get(channel)
    if quantity is None or isinstance(given, list | tuple) or isinstance(given, int | float):
        return
    declared = given.get("unit") if isinstance(given, Mapping) else given
    taken = str(declared or _SI[quantity])
    taken = _ALIKE.get(taken, taken)
    for column in names:
        words = {w.lower() for w in _UNIT_WORD.findall(column)}
        found = [unit for unit, own in UNIT_WORDS[quantity].items() if own & words]
        commands = {"A", "mA", "V"} & set(found)  # may be called by one another's names
        if not found or taken in found or (commands and taken in ("command", "A", "mA", "V", "mV")):
            continue
        how = "is given as" if declared else "is not given and taken for"
        advice = f'Set units = {{{channel} = "{found[0]}"}} if the name is right.'
        repairs = [] if found[0] in {*commands, "counts"} else [in_unit(channel, found[0])]
        if found[0] in commands:
            advice = (
                f"A current or voltage needs N m per unit: units = "
                f'{{tau = {{unit = "{found[0]}", gain = ...}}}}.'
            )
        if found[0] == "counts":
            advice = 'Counts need their scale: {unit = "counts", per_revolution = ...}.'
        severity: Severity = "warning" if declared or quantity == "torque" else "error"
        text = (
            f"The name of the column {column!r} reads like {found[0]}, but the unit of {channel} "
            f"{how} {taken}."
        )
        place = ("recording", "units", channel)
        yield UNIT.finding(severity, text, column, advice, place=place, repairs=repairs)
        return
