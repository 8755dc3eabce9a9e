"""A fitted simulator as files: the robot's file, tables, text and page."""

from __future__ import annotations

from os import PathLike
from typing import Any

from pivident.export.robot_file import RobotFile
from pivident.files import atomic_folder
from pivident.simulators.held_out import HeldOut
from pivident.simulators.robot_files import ENDINGS
from pivident.simulators.simulator_fit import FittedValue, SimulatorFit
from pivident.simulators.simulator_page import simulator_page
from pivident.simulators.simulator_text import findings, simulator_text
from pivident.text.plain_values import csv_table, plain, write_json

#: Version of the layout of ``simulator.json``.
SCHEMA = 1

#: Columns of ``simulator.csv``; values, standard errors and intervals in the unit of their row.
CSV_COLUMNS = ("quantity", "joint", "value", "std", "lower", "upper", "start", "unit")


def file_name(robot: RobotFile) -> str:
    """Name of the robot's file in the folder of results."""
    return "actuators.py" if robot.format == "isaac" else f"robot{ENDINGS[robot.format]}"


def save_simulator(
    fit: SimulatorFit,
    robot: RobotFile | None,
    held_out: HeldOut | None,
    folder: str | PathLike[str],
    *,
    page: bool = True,
) -> None:
    """Write the robot's file, ``simulator.csv``, ``.json``, ``.txt`` and ``.html``, all or nothing.

    Args:
        fit: what was fitted.
        robot: the file of the simulator; None: the values only.
        held_out: errors on held-out motion, or None.
        folder: where.
        page: whether the page is written, which needs plotly.
    """
    with atomic_folder(folder) as build:
        if robot is not None:
            (build / file_name(robot)).write_bytes(robot.content)
        write_json(build / "simulator.json", simulator_values(fit, robot, held_out))
        texts = {
            "simulator.csv": csv_table(CSV_COLUMNS, [_cells(v) for v in fit.values]),
            "simulator.txt": simulator_text(fit, held_out) + "\n",
        }
        if page:
            texts["simulator.html"] = simulator_page(fit, held_out)
        for name, text in texts.items():
            (build / name).write_text(text, encoding="utf-8", errors="xmlcharrefreplace")


def simulator_values(
    fit: SimulatorFit, robot: RobotFile | None, held_out: HeldOut | None
) -> dict[str, Any]:
    """The result as plain values; numbers that are not finite are null."""
    errors = None
    if held_out is not None:
        errors = {
            "motion": held_out.name,
            "joints": list(fit.robot.joint_names),
            "rms": {title: own.tolist() for title, own in held_out.rms().items()},
        }
    content = {
        "schema": SCHEMA,
        "robot": fit.robot.name,
        "file": None if robot is None else file_name(robot),
        "differences": [] if robot is None else list(robot.differences),
        "values": [dict(zip(CSV_COLUMNS, _cells(v), strict=True)) for v in fit.values],
        "kp": fit.kp,
        "kd": fit.kd,
        "rms": dict(zip(fit.robot.joint_names, fit.rms.tolist(), strict=True)),
        "converged": fit.converged,
        "delay_p_value": fit.delay_p_value,
        "held_out": errors,
        "recordings": list(fit.recordings),
        "findings": findings(fit, held_out),
        "version": fit.version,
    }
    return plain(content)


def _cells(value: FittedValue) -> list[Any]:
    numbers = (value.value, value.std, value.low, value.high, value.start)
    return [value.quantity, value.joint, *(plain(x) for x in numbers), value.unit]
