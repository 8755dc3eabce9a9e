"""A log as plain columns beside its experiment file, so that a fault is an edit of columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pivident.foundation.text.toml import key_text, toml_value

#: Channels that hold positions, so that an encoder's zero and unit concern them all.
POSITIONS = ("q", "q_ref", "q_link")


@dataclass
class PlainLog:
    """An experiment and its log.

    Attributes:
        experiment: tables of the experiment file; ``recording`` is a list.
        runs: channels of each recording in the units of the file: ``t`` of shape (samples,), all
            others (samples, joints).
        joints: names of the joints.
        robot: text of the robot's file.
        gear: positions in the table per position of the joint, shape (joints,): the gear ratio
            where they are those of the motors.
    """

    experiment: dict[str, Any]
    runs: list[dict[str, np.ndarray]]
    joints: tuple[str, ...]
    robot: str
    gear: np.ndarray

    def write(self, folder: Path) -> Path:
        """Write tables, robot and experiment into a new folder; the experiment file."""
        folder.mkdir(parents=True)
        (folder / self.experiment["robot"]["model"]).write_text(self.robot, encoding="utf-8")
        for entry, run in zip(self.experiment["recording"], self.runs, strict=True):
            names = {channel: self.columns_of(channel) for channel in run}
            heading = ",".join(name for own in names.values() for name in own)
            values = np.column_stack([run[channel] for channel in names])
            np.savetxt(folder / entry["files"], values, "%.17g", ",", header=heading, comments="")
        path = folder / "experiment.toml"
        path.write_text("\n".join(_toml_lines(self.experiment)) + "\n", encoding="utf-8")
        return path

    def columns_of(self, channel: str) -> list[str]:
        """Names of a channel's columns in the table."""
        return ["t"] if channel == "t" else [f"{channel}_{joint}" for joint in self.joints]

    def angle_unit(self, joint: int) -> str:
        """Unit of a joint's positions in the table."""
        unit = self.experiment["recording"][0]["units"]["q"]
        return str(unit[joint] if isinstance(unit, list) else unit)


def _toml_lines(tables: Mapping[str, Any], heading: str = "") -> list[str]:
    """Tables as TOML: values first, then each table under a heading of its own."""
    lines, below = [], []
    for key, value in tables.items():
        name = f"{heading}.{key_text(key)}" if heading else key_text(key)
        if isinstance(value, Mapping):
            below += ["", f"[{name}]", *_toml_lines(value, name)]
        elif isinstance(value, list) and value and not heading and isinstance(value[0], Mapping):
            for own in value:
                below += ["", f"[[{name}]]", *_toml_lines(own, name)]
        elif value is not None:
            lines.append(f"{key_text(key)} = {toml_value(value)}")
    return lines + below
