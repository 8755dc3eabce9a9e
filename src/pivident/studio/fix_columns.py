"""Fixes that name other columns, or the same in another order."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from pivident.init.experiment_text import value_text
from pivident.robot.naming import URDF_FILES
from pivident.studio.remark_case import Edits, RemarkCase
from pivident.text.toml_places import Place

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
