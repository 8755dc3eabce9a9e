"""An identification as files: ``identification.json`` for programs, ``parameters.csv`` for sheets.

The JSON is strict: numbers that are not finite are written as null. It holds the whole robot and
the sums of the fitted record, so that `load_identification` gets back everything but the signals.
"""

from __future__ import annotations

import csv
import io
from os import PathLike
from typing import Any

from pivident.control_law.law_gravity import JointGravity
from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import parameter_rows
from pivident.estimation.problem import Loop
from pivident.files import atomic_folder
from pivident.robot.robot_values import robot_values
from pivident.text.plain_values import json_of_entries, plain

#: Version of the layout of ``identification.json``.
SCHEMA = 2

#: Columns of ``parameters.csv``; σ in the unit of its row, the relative one in percent.
CSV_COLUMNS = ("name", "value", "std", "robust_std", "relative_std", "unit", "expression")


def save_identification(identification: Identification, folder: str | PathLike[str]) -> None:
    """Write ``identification.json`` and ``parameters.csv`` into a folder, all or nothing.

    Args:
        identification: the result.
        folder: folder to create or to write into; its other files stay.

    Raises:
        PividentError: the folder cannot be written.
    """
    with atomic_folder(folder) as build:
        for name, text in (
            ("identification.json", to_json(identification)),
            ("parameters.csv", to_csv(identification)),
        ):
            # File names may hold bytes that are no text; they become escapes.
            (build / name).write_text(text, encoding="utf-8", errors="backslashreplace")


def to_dict(identification: Identification) -> dict[str, Any]:
    """The result as plain values, ready for JSON; signals are left out.

    Args:
        identification: the result.
    """
    parameters = [
        {key: getattr(row, key) for key in CSV_COLUMNS} for row in parameter_rows(identification)
    ]
    loop = identification.loop_values or {
        "controller": controller_values(identification.loop),
        "reference": reference_values(identification.loop),
    }
    content = {
        "schema": SCHEMA,
        "method": identification.method,
        "robot": identification.robot.name,
        "converged": bool(identification.converged),
        "iterations": identification.iterations,
        "parameters": parameters,
        "covariance": identification.covariance,
        "robust_covariance": identification.robust_covariance,
        "formula_covariance": identification.formula_covariance,
        "relative_error": identification.relative_error,
        "joints": identification.joints,
        "history": identification.history,
        "condition": identification.condition,
        "controller": loop["controller"],
        "reference": loop["reference"],
        "options": identification.options,
        "warnings": [warning.as_json() for warning in identification.warnings],
        "sources": identification.sources,
        "version": identification.version,
        "robot_description": robot_values(identification.robot),
        "torque_sums": torque_sums_values(identification),
    }
    return {key: plain(value) for key, value in content.items()}


def controller_values(loop: Loop | None) -> list[dict[str, Any]] | None:
    """The law that was found, one entry for each joint; None where none was.

    Args:
        loop: the loop; a law told from the noise in it has no error and no saturated samples.
    """
    if loop is None or (loop.identified is None and not loop.feedback):
        return None
    if loop.identified is None:
        return [
            {
                "joint": own.name,
                "terms": ("kp", "kd"),
                "gains": (own.kp, own.kd),
                "std": (own.kp_std, own.kd_std),
                "differentiator": _differentiator(own.averaged),
                "relative_error": None,
                "saturated": None,
                "f_tests": {},
                "gravity": None,
            }
            for own in loop.feedback
        ]
    return [
        {
            "joint": law.name,
            "terms": law.terms,
            "gains": law.gains,
            "std": law.std,
            "differentiator": _differentiator(
                law.averaged, law.derivative_time, law.derivative_time_std
            ),
            "relative_error": law.relative_error,
            "saturated": law.saturated,
            "f_tests": law.f_tests,
            "gravity": gravity_values(law.gravity),
        }
        for law in loop.identified.joints
    ]


def gravity_values(gravity: JointGravity | None) -> dict[str, Any] | None:
    """The gravity model in the law of one joint; None where it has none.

    Args:
        gravity: the model.
    """
    if gravity is None:
        return None
    return {
        "at": "q" if gravity.place == "gravity" else "q_ref",
        "parameters": [p.name for p in gravity.parameters],
        "values": gravity.values,
        "std": gravity.std,
        "units": [p.unit for p in gravity.parameters],
        "f_test": gravity.statistic,
    }


def reference_values(loop: Loop | None) -> list[dict[str, Any]] | None:
    """The references that were reconstructed, one for each recording; None where none was.

    Args:
        loop: the loop.
    """
    if loop is None or not loop.reconstructed:
        return None
    return [
        {
            "kind": own.kind,
            "moves": None if own.moves is None else len(own.moves.moves),
            "rms": own.rms,
            "relative": own.relative,
            "freedom": own.freedom,
        }
        for own in loop.reconstructed
    ]


def torque_sums_values(identification: Identification) -> dict[str, Any] | None:
    """Sums of the fitted record as plain values; None where neither they nor signals are there.

    Args:
        identification: the result.
    """
    sums = identification.torque_sums
    if sums is None and identification.recordings:
        from pivident.estimation.torque_sums import torque_sums

        sums = torque_sums(identification)
    return None if sums is None else sums.to_values()


def _differentiator(averaged: bool, time: float = 0.0, std: float = 0.0) -> dict[str, Any]:
    kind = "two_sample_means" if averaged else "lag" if time else "backward_difference"
    return {"kind": kind, "time": time, "std": std}


def to_json(identification: Identification) -> str:
    """Strict JSON with one line for each parameter, joint, iteration and row of a matrix."""
    return json_of_entries(to_dict(identification))


def to_csv(identification: Identification) -> str:
    """The parameters as a table with a header; numbers that are not finite are left empty."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for row in parameter_rows(identification):
        writer.writerow([plain(getattr(row, column)) for column in CSV_COLUMNS])
    return stream.getvalue()
