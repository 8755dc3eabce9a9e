"""Account of a fitted simulator: values with intervals, errors on motion the fit has not seen."""

from __future__ import annotations

from typing import Any

import numpy as np

from pivident.foundation.document.curves import Curve, Curves
from pivident.foundation.document.document import Document, Part
from pivident.foundation.document.table import Column, Table
from pivident.foundation.text.numbers import format_significant
from pivident.models.export.differences import RobotFile
from pivident.studies.simulators.held_out import HeldOut, milli
from pivident.studies.simulators.robot_files import ENDINGS
from pivident.studies.simulators.simulator_fit import SimulatorFit

#: Version of the layout of ``simulator.json``.
SCHEMA = 2


def account(fit: SimulatorFit, robot: RobotFile | None, held_out: HeldOut | None) -> Document:
    """Everything that is said of a fitted simulator.

    Args:
        fit: what was fitted.
        robot: the file of the simulator; None: the values only.
        held_out: errors on held-out motion, or None.
    """
    values = values_table(fit)
    headline = (
        f"{fit.robot.name}: {len(fit.values)} values from {fit.samples} samples of "
        f"{fit.robot.size} joints ({', '.join(fit.recordings)}), positions only"
    )
    parts, findings, errors = [Part("Fitted values", (headline, values))], [*fit.findings()], None
    if held_out is not None:
        what = f"Position error of MuJoCo on {held_out.name}, root mean square:"
        blocks = what, errors_table(held_out), f"{held_out.meaning}."
        figures = [error_curves(held_out, j) for j in range(held_out.robot.size)]
        parts.append(Part(f"Errors on {held_out.name}", blocks, figures))
        findings += held_out.findings()
        errors = {"motion": held_out.name, "joints": fit.robot.joint_names, "rms": held_out.rms()}
    stored: dict[str, Any] = {
        "schema": SCHEMA,
        "robot": fit.robot.name,
        "file": None if robot is None else file_name(robot),
        "differences": [] if robot is None else robot.differences,
        "values": values.rows(),
        "kp": fit.kp,
        "kd": fit.kd,
        "rms": dict(zip(fit.robot.joint_names, fit.rms, strict=True)),
        "converged": fit.converged,
        "delay_p_value": fit.delay_p_value,
        "held_out": errors,
        "recordings": fit.recordings,
        "findings": findings,
        "version": fit.version,
    }
    return Document(f"{fit.robot.name}: fitted simulator", parts, findings, stored, values)


def values_table(fit: SimulatorFit) -> Table:
    """Fitted values with their intervals of 95 %, each in the unit of its row."""
    names = ("quantity", "joint", "value", "std", "low", "high", "start", "unit")
    rows = Table.of_rows("values", [{n: getattr(v, n) for n in names} for v in fit.values])
    spread = np.where(np.isfinite(rows["std"]), np.subtract(rows["value"], rows["low"]), np.nan)
    columns = {
        "quantity": Column(rows["quantity"]),
        "joint": Column(rows["joint"], cells=[joint or "all" for joint in rows["joint"]]),
        "value": Column(rows["value"], spread=spread, digits=3),
        "std": Column(rows["std"], shown="files"),
        "lower": Column(rows["low"], shown="files"),
        "upper": Column(rows["high"], shown="files"),
        "start": Column(rows["start"], shown="pages", digits=3),
        "unit": Column(rows["unit"]),
    }
    return Table("values", columns, title="Fitted values with intervals of 95 %")


def errors_table(held_out: HeldOut) -> Table:
    """Root mean square of the position errors by joint, before and after."""
    joints = held_out.robot.joints
    columns = {"joint": Column(held_out.robot.joint_names)}
    columns |= {
        title: Column(1e3 * errors, cells=[*map(milli, errors.tolist())])
        for title, errors in held_out.rms().items()
    }
    columns["unit"] = Column(["mrad" if j.position_unit == "rad" else "mm" for j in joints])
    return Table("held_out", columns, title="Position errors on motion that the fit has not seen")


def error_curves(held_out: HeldOut, j: int) -> Curves:
    """Position errors of one joint before and after."""
    joint, rms = held_out.robot.joints[j], held_out.rms()
    unit = "mrad" if joint.position_unit == "rad" else "mm"
    seen = slice(held_out.first, None)
    made = {
        title: 1e3 * (held_out.q - simulated)[seen, j]
        for title, simulated in (("before", held_out.before), ("after", held_out.after))
        if np.isfinite(rms[title][j])
    }
    notes = [f"{x} {format_significant(1e3 * float(rms[x][j]))} {unit} rms" for x in made]
    curves = [Curve(x, y, "measured" if x == "before" else 0) for x, y in made.items()]
    subject, axis = f"Position error of {joint.name}", f"position error [{unit}]"
    return Curves(joint.name, axis, held_out.t[seen], curves, subject, ", ".join(notes))


def file_name(robot: RobotFile) -> str:
    """Name of the robot's file in the folder of results."""
    return "actuators.py" if robot.format == "isaac" else f"robot{ENDINGS[robot.format]}"
