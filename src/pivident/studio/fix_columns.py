"""Fixes that name other columns, or the same in another order, unit or sense."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

from pivident.logs.clocks.timestamps import likely_time_units
from pivident.logs.units import COMMAND, UNITS_OF
from pivident.robot.naming import URDF_FILES
from pivident.studio.remark_case import Edits, RemarkCase, unit_edit
from pivident.text.toml_places import Place
from pivident.text.toml_values import value_text

_QUOTED = re.compile(r"'([^']+)'")


def order_of_torques(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """``A takes the torque of B``: the column of B is that of A."""
    yield from _reordered(case, "tau", r"{one} takes the torque of {other}")


def order_of_reference(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """``A follows the reference of B``."""
    yield from _reordered(case, "q_ref", r"{one} follows the reference of {other}")


def order_of_columns(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """Columns in the order of their numbers, or of the joints whose names they carry."""
    channel = str(case.place[-1])
    names = case.columns(channel)
    if not names:
        return
    owners = [[n for n in names if _contains(n, joint)] for joint in case.joints[: len(names)]]
    numbers = [re.findall(r"\d+", name) for name in names]
    if all(len(found) == 1 for found in owners) and len(owners) == len(names):
        made = [found[0] for found in owners]
    elif all(len(found) == 1 for found in numbers):
        made = sorted(names, key=lambda name: int(re.findall(r"\d+", name)[0]))
    else:
        return
    if sorted(made) == sorted(names):
        yield _named(case.table, channel, made)


def unnamed_torque(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """Columns that read like torques, where there is one for each joint."""
    names, positions = _QUOTED.findall(case.message), case.columns("q")
    if positions and len(names) == len(positions):
        yield _named(case.table, "tau", names)


def without_joint(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """Leave joints out that stand still: they are frozen, and their columns are not read."""
    model = str(case.value("robot", "model") or "")
    still, size = case.concerned(), len(case.joints)
    if not still or len(still) == size or not model.endswith(URDF_FILES):
        return
    kept = [j for j in range(size) if j not in still]
    edits: list[tuple[Place, str | None]] = [
        (("robot", "joints"), value_text([case.joints[j] for j in kept]))
    ]
    for j in still:
        at = case.evidence.get("value", 0.0) if case.kind == "constant" else 0.0
        edits.append((("robot", "frozen", case.joints[j]), value_text(float(f"{at:.6g}"))))
    for table in ("columns", "units"):
        for channel, spec in (case.value(*case.table, table) or {}).items():
            if isinstance(spec, list) and len(spec) == size:
                place = (*case.table, table, channel)
                edits.append((place, value_text([spec[j] for j in kept])))
    names = ", ".join(case.joints[j] for j in still)
    yield f"Leave {names} out: frozen, and its columns are not read.", tuple(edits)


def fixed_columns(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """A logged speed that is none is not read; it follows from the position."""
    channel = case.subject.partition(" ")[0]
    if channel not in ("dq", "dq_ref") or case.value(*case.table, "columns", channel) is None:
        return
    edits: list[tuple[Place, str | None]] = [((*case.table, "columns", channel), None)]
    if case.value(*case.table, "units", channel) is not None:
        edits.append(((*case.table, "units", channel), None))
    yield f"Do not read {channel}: the derivative of the position takes its place.", tuple(edits)


def _reordered(case: RemarkCase, channel: str, pattern: str) -> Iterator[tuple[str, Edits]]:
    names = case.columns(channel)
    if names is None or len(names) != len(case.joints):
        return
    made = list(names)
    for j, one in enumerate(case.joints):
        for k, other in enumerate(case.joints):
            said = re.escape(pattern.format(one=one, other=other))
            if j != k and re.search(rf"(?<!\S){said}(?=[,;.]|$)", case.message):
                made[j] = names[k]
    if made != names and sorted(made) == sorted(names):
        yield _named(case.table, channel, made)


def _named(table: Place, channel: str, names: Sequence[str]) -> tuple[str, Edits]:
    place = (*table, "columns", channel)
    return f"Name the columns of {channel} as {', '.join(names)}.", ((place, value_text(names)),)


def _contains(column: str, joint: str) -> bool:
    """Whether a column's name has the joint's name as words of its own."""
    text = re.escape(joint.lower())
    return re.search(rf"(?<![a-z0-9]){text}(?![a-z0-9])", column.lower()) is not None


def reversed_torque(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """Torques of joints whose friction would supply energy, with the other sign."""
    yield from _reversed(case, "tau", "torque")


def reversed_reference(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """A reference that is minus the position."""
    if case.evidence.get("factor", 0.0) < 0.0:
        yield from _reversed(case, "q_ref", "reference")


def opposite_sense(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """Every channel of a joint that turns the other way, with the other sign."""
    joints = case.concerned()
    channels = [c for c in ("q", "tau", "q_ref", "dq_ref", "ddq_ref", "dq") if _is_read(case, c)]
    edits = [_turned(case, channel, joints) for channel in channels]
    if joints and all(edit is not None for edit in edits):
        names = _names(case, joints)
        words = f"Reverse the signs of all channels of {names}."
        yield words, tuple(edit for edit in edits if edit is not None)


def command_gain(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """The gain that the description suggests for a drive command."""
    said, joints = re.search(r"write gain = (\S+?) ", case.step), case.concerned()[:1]
    if said is None or not joints:
        return
    units = case.unit("tau", len(case.joints))
    known = units[joints[0]]
    name = known.get("unit") if isinstance(known, dict) else known
    if name not in COMMAND:
        return
    units[joints[0]] = {"unit": name, "gain": float(said[1])}
    words = f"Take {said[1]} per {name} for {_names(case, joints)}, as the masses suggest."
    yield words, (unit_edit(case.table, "tau", units),)


def loop_gain(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """The gain of the controller that the log shows."""
    key = str(case.place[-1])
    joints, said, seen = case.concerned()[:1], case.evidence.get("file"), case.evidence.get("log")
    if not joints or not said or seen is None or case.value("controller", "type") == "cascade":
        return
    given = case.value("controller", key)
    listed = list(given) if isinstance(given, list) else [given] * len(case.joints)
    if not all(isinstance(x, (int, float)) for x in listed) or joints[0] >= len(listed):
        return
    listed[joints[0]] = float(f"{listed[joints[0]] * seen / said:.4g}")
    words = f"Take {key} = {listed[joints[0]]:g} for {_names(case, joints)}, as the log shows."
    yield words, ((("controller", key), value_text(listed)),)


def zero_position(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """A zero that is a quarter or half a turn away."""
    said, joints = re.search(r"position_offset to (\S+) rad", case.step), case.concerned()[:1]
    if said is None or not joints:
        return
    place = (*case.table, "position_offset")
    known = case.value(*place) or [0.0] * len(case.joints)
    if len(known) != len(case.joints):
        return
    made = [float(x) for x in known]
    made[joints[0]] = round(made[joints[0]] + float(said[1]), 4)
    yield f"Move the zero of {_names(case, joints)} by {said[1]} rad.", ((place, value_text(made)),)


def unit_of_time(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """Units of stamps that make a robot's rate of them."""
    rate = case.evidence.get("rate")
    factor = UNITS_OF["t"].get(str(case.value(*case.table, "units", "t") or "s"), 1.0)
    if not rate:
        return
    for unit in likely_time_units(1.0 / (rate * factor)):
        place = (*case.table, "units", "t")
        yield f"The stamps are in {unit}.", ((place, value_text(unit)),)


def _reversed(case: RemarkCase, channel: str, called: str) -> Iterator[tuple[str, Edits]]:
    joints = case.concerned()
    edit = _turned(case, channel, joints)
    if joints and edit is not None:
        yield f"Reverse the sign of the {called} of {_names(case, joints)}.", (edit,)


def _turned(case: RemarkCase, channel: str, joints: list[int]) -> tuple[Any, str] | None:
    """Units of a channel with the other sign for some joints; None where one has no sign."""
    units = case.unit(channel, len(case.joints))
    made = [_negative(channel, u) if j in joints else u for j, u in enumerate(units)]
    if any(unit is None for j, unit in enumerate(made) if j in joints):
        return None
    made = [1.0 if unit is None else unit for unit in made]  # of which nothing is said: SI
    return unit_edit(case.table, channel, made)


def _negative(channel: str, unit: Any) -> Any:
    """A unit with the other sign, as a factor to SI; None for one that cannot have one."""
    if isinstance(unit, dict):
        return unit | {"gain": -unit["gain"]} if "gain" in unit else None
    if isinstance(unit, str) and unit in COMMAND:
        return None
    factor = UNITS_OF[channel].get(unit) if isinstance(unit, str) else unit
    if unit is not None and factor is None:
        return None
    return -float(1.0 if factor is None else factor)


def _is_read(case: RemarkCase, channel: str) -> bool:
    return case.value(*case.table, "columns", channel) is not None


def _names(case: RemarkCase, joints: list[int]) -> str:
    return ", ".join(case.joints[j] for j in joints)
