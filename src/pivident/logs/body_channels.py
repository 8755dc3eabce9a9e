"""Channels that belong to a body and not to the joints: wrenches, and the pose of a base.

columns = {q = …, tau = …, wrench = {floor = ["fx", "fy", "fz", "mx", "my", "mz"]}}
    columns = {q = …, tau = …, base = {position = ["x", "y", "z"], rpy = ["r", "p", "y"]}}
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pivident.errors import RecordingError
from pivident.robot.naming import nearest
from pivident.robot.wrench_sensor import COMPONENTS

#: Tables of such channels.
TABLES = ("wrench", "base")

#: Channels of a base, and their columns.
BASE_COLUMNS = {
    "position": ("x", "y", "z"),
    "quaternion": ("x", "y", "z", "w"),
    "rpy": ("roll", "pitch", "yaw"),
    "twist": ("vx", "vy", "vz", "wx", "wy", "wz"),
}


def body_channels(tables: Mapping[str, Any]) -> dict[str, Any]:
    """What is said of such channels, by names such as ``wrench.floor`` and ``base.position``.

    Args:
        tables: by channel, as in the tables ``columns`` and ``units`` of a recording.

    Raises:
        RecordingError: a table is none, or a channel of a base is not known.
    """
    found = {}
    for table in TABLES:
        own = tables.get(table) or {}
        if not isinstance(own, Mapping):
            raise RecordingError(
                f"{table} is {own!r}; it is a table, such as {table} = "
                + (
                    '{floor = ["fx", …]}'
                    if table == "wrench"
                    else '{position = ["x", "y", "z"], …}'
                )
            ).about("columns", table)
        for name, said in own.items():
            if table == "base" and name not in BASE_COLUMNS:
                raise RecordingError(
                    f"a base has no channel {name!r}", advice=nearest(name, BASE_COLUMNS)
                ).about("columns", table, name)
            found[f"{table}.{name}"] = said
    return found


def columns_of(channel: str) -> tuple[str, ...]:
    """What the columns of such a channel are called; empty for a channel of joints."""
    table, _, name = channel.partition(".")
    if table == "wrench":
        return COMPONENTS
    return BASE_COLUMNS[name] if table == "base" else ()
