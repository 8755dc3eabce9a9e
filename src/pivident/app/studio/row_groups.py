"""Lines of the experiment file in the groups of their signals, with the names of their keys."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pivident.app.studio.rows import Row
from pivident.foundation.text.repair import Place
from pivident.foundation.text.sentences import capital

#: Keys that most files have, in words; all others go by their names.
LABELS = {
    "robot.model": "Robot",
    "robot.friction": "Friction of all joints",
    "robot.rotor_inertia": "Rotor inertias",
    "robot.reduction": "Gear ratios",
    "robot.drive_gain": "Gains of the drives",
    "robot.joints": "Joints",
    "robot.frozen": "Joints that do not move",
    "robot.gravity": "Direction of gravity",
    "recording.files": "Log",
    "recording.name": "Name of the run",
    "recording.rate": "Sampling rate",
    "recording.control_rate": "Rate of the control loop",
    "recording.part": "Trim",
    "recording.resample": "Interpolate onto a uniform clock",
    "recording.delay": "Torque later than position",
    "recording.drive_delay": "Delay of the drives",
    "recording.side": "Side of the gear",
    "recording.torque_side": "Where torque is measured",
    "recording.torque_timing": "What a torque sample is",
    "recording.position_offset": "Added to positions",
    "recording.saturation": "Torques cut off at a limit",
    "recording.allow_constant": "Joints that do not move",
    "recording.column_names": "Names of the columns",
    "controller.type": "Control law",
    "controller.reference": "Source of the reference",
    "controller.kp": "Proportional gains",
    "controller.kd": "Derivative gains",
    "controller.ki": "Integral gains",
    "controller.kv": "Gains of the speed loop",
    "controller.drive_gain": "Torque per output of the law",
    "controller.limit": "Largest output of the law",
    "controller.feed_forward": "Feed-forward",
    "identify.methods": "Methods",
    "identify.mask": "Samples at standstill",
    "identify.parameters": "Parameters",
    "validation.folds": "Held-out blocks",
    "output.folder": "Folder of results",
    "output.title": "Title of the report",
}

#: Signals in words.
SIGNALS = {
    "t": "time", "q": "position", "dq": "speed", "tau": "torque", "q_ref": "reference position",
    "dq_ref": "reference speed", "ddq_ref": "reference acceleration",
    "q_link": "position behind the gear",
}  # fmt: skip


def label_of(place: Place) -> str:
    """A key in words; empty for one that goes by its name."""
    names = [part for part in place if isinstance(part, str)]
    table, key = names[-2:] if len(names) > 1 else ("", names[0])
    if table == "units" and key in SIGNALS:
        return f"Unit of {SIGNALS[key]}"
    if table == "columns" and key in SIGNALS:
        return f"Column{'' if key == 't' else 's'} of {SIGNALS[key]}"
    return LABELS.get(".".join(names), "")


#: Groups in their order: name, heading, and the channels that are drawn beside it.
GROUPS = (
    ("robot", "Robot", ()),
    ("log", "Log and clock", ()),
    ("q", "Positions", ("q", "dq")),
    ("tau", "Torques", ("tau",)),
    ("q_ref", "Reference", ("q_ref", "dq_ref", "ddq_ref")),
    ("columns", "Columns of the file", ()),
    ("controller", "Control loop", ()),
    ("identify", "Estimation", ()),
    ("other", "Other tables", ()),
)

#: Groups of the channels that a line is about.
OF_CHANNEL = {
    "q": "q", "dq": "q", "q_link": "q", "tau": "tau", "q_ref": "q_ref", "dq_ref": "q_ref",
    "ddq_ref": "q_ref",
}  # fmt: skip

#: How sure a line is, in words.
SURE = {
    "certain": "seen",
    "likely": "likely",
    "assumed": "ASSUMED, please check",
    "given": "given",
    "": "not set",
}

#: Keys that a file cannot do without.
NEEDED = (("robot",), ("robot", "model"))

#: Most columns of a file that are drawn as they are.
MAX_COLUMNS = 8


def row_groups(rows: Sequence[Row], signals: dict[str, Any]) -> list[dict[str, Any]]:
    """Groups that have lines or signals.

    Args:
        rows: lines of the experiment file.
        signals: what signals there are; empty where they have not been read.
    """
    drawn = {c["name"]: c for c in signals.get("channels", [])}
    undescribed = [name for name in drawn if name.startswith("column.")][:MAX_COLUMNS]
    found = []
    for name, title, channels in GROUPS:
        own = [row for row in rows if group_of(row) == name]
        names = undescribed if name == "columns" else [c for c in channels if c in drawn]
        figures = [_figure(drawn[channel], signals["recordings"]) for channel in names]
        if own or figures:
            shown = [_shown(row) for row in own]
            found.append({"name": name, "title": title, "rows": shown, "channels": figures})
    return found


def group_of(row: Row) -> str:
    """Name of the group of a line."""
    if row.channel in OF_CHANNEL and row.table.startswith("recording"):
        return OF_CHANNEL[row.channel]
    first = row.table.partition(".")[0]
    return {
        "robot": "robot",
        "recording": "log",
        "controller": "controller",
        "identify": "identify",
        "validation": "identify",
        "output": "identify",
    }.get(first, "other")


def _shown(row: Row) -> dict[str, Any]:
    """A line as its form shows it."""
    known = {name: getattr(row, name) for name in row.__dataclass_fields__}
    return known | {
        "label": label_of(row.place),
        "place": list(row.place),
        "shown": ".".join(str(p) for p in row.place[1:] if not isinstance(p, int)) or row.key,
        "words": SURE[row.sure],
        "options": _options(row),
        "removable": row.place not in NEEDED,
    }


def _options(row: Row) -> list[dict[str, str]]:
    """What a line may be, where that is a few things."""
    if not row.choices or "list" in row.kind or (row.value or "").startswith(("[", "{")):
        return []
    values = list(dict.fromkeys([*([row.value] if row.value is not None else []), *row.choices]))
    options = [{"value": value, "words": value.strip('"')} for value in values]
    if row.value is None:
        options.insert(0, {"value": "", "words": "choose"})
    return options


def _figure(channel: dict[str, Any], recordings: list[dict[str, Any]]) -> dict[str, Any]:
    """A signal as the script draws it."""
    lines = [
        {"name": name, "unit": unit}
        for name, unit in zip(channel["lines"], channel["units"], strict=True)
    ]
    runs = [
        {"number": number, **{k: recordings[number][k] for k in ("name", "start", "duration")}}
        for number in channel["recordings"]
    ]
    title = capital(channel["title"])
    return {
        "name": channel["name"],
        "title": title,
        "label": f"{title} over time of {', '.join(channel['lines'])}",
        "content": {"channel": channel["name"], "recordings": runs, "joints": lines},
    }
