"""A fitted simulator as files: the robot's file, tables, text and page.

A fitted simulator as one HTML page, in the look of the report.
"""

from __future__ import annotations

import math
from os import PathLike
from typing import Any

import numpy as np
from markupsafe import Markup

from pivident.export.differences import RobotFile
from pivident.files import atomic_folder
from pivident.report.builder import page_environment, page_of
from pivident.report.plotly_figures import Figure, errors_figure
from pivident.simulators.held_out import HeldOut, milli
from pivident.simulators.robot_files import ENDINGS
from pivident.simulators.simulator_fit import FittedValue, SimulatorFit
from pivident.simulators.simulator_text import findings, simulator_text
from pivident.text.numbers import format_significant, with_spread
from pivident.text.plain_values import csv_table, plain, write_json

#: Version of the layout of ``simulator.json``.
SCHEMA = 1
#: Columns of ``simulator.csv``; values, standard errors and intervals in the unit of their row.
CSV_COLUMNS = ("quantity", "joint", "value", "std", "lower", "upper", "start", "unit")
#: Points of a trace.
POINTS = 2000


def file_name(robot: RobotFile) -> str:
    """Name of the robot's file in the folder of results."""
    return "actuators.py" if robot.format == "isaac" else f"robot{ENDINGS[robot.format]}"


def simulator_page(fit: SimulatorFit, held_out: HeldOut | None) -> str:
    """The page: values with intervals, and the errors on held-out motion before and after."""
    environment = page_environment("pivident.simulators")
    values = environment.get_template("simulator_values.html").render(
        headline=(
            f"{len(fit.values)} values from {fit.samples} samples of {fit.robot.size} joints, "
            "positions only"
        ),
        rows=[_row(value) for value in fit.values],
        findings=findings(fit, held_out),
    )
    sections = [("values", "Fitted values", Markup(values))]
    if held_out is not None:
        body = environment.get_template("simulator_held_out.html").render(_errors(held_out))
        sections.append(("held-out", f"Errors on {held_out.name}", Markup(body)))
    return page_of(environment, f"{fit.robot.name}: fitted simulator", sections)


def _row(value: FittedValue) -> dict[str, str]:
    shown = (format_significant(value.value), "–")
    if math.isfinite(value.std):
        shown = with_spread(value.value, value.value - value.low)
    return {
        "joint": value.joint or "all",
        "quantity": value.quantity,
        "value": shown[0],
        "spread": shown[1],
        "unit": value.unit,
        "start": format_significant(value.start),
    }


def _errors(held_out: HeldOut) -> dict[str, Any]:
    """What the section on held-out motion shows."""
    rms = held_out.rms()
    rows = []
    for j, joint in enumerate(held_out.robot.joints):
        cells = [milli(float(own[j])) for own in rms.values()]
        unit = "mrad" if joint.position_unit == "rad" else "mm"
        rows.append({"joint": joint.name, "cells": cells, "unit": unit})
    return {
        "titles": list(rms),
        "rows": rows,
        "sentences": held_out.sentences(),
        "figures": [_figure(held_out, j) for j in range(held_out.robot.size)],
    }


def _figure(held_out: HeldOut, j: int) -> Figure:
    """Position errors of one joint before and after."""
    joint, rms = held_out.robot.joints[j], held_out.rms()
    unit = "mrad" if joint.position_unit == "rad" else "mm"
    seen = slice(held_out.first, None)
    errors = {
        title: 1e3 * (held_out.q - own)[seen, j]
        for title, own in (("before", held_out.before), ("after", held_out.after))
        if np.isfinite(rms[title][j])
    }
    note = ", ".join(
        f"{title} {format_significant(1e3 * float(rms[title][j]))} {unit} rms" for title in errors
    )
    return errors_figure(joint.name, unit, held_out.t[seen], errors, POINTS, note)


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
