"""An identification as files: ``identification.json`` for programs, ``parameters.csv`` for sheets.

The JSON is strict: numbers that are not finite are written as null. It holds the whole robot and
the sums of the fitted record, so that `load_identification` gets back everything but the signals.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from os import PathLike
from typing import Any

from pivident.estimation.identification import Identification, torque_sums
from pivident.estimation.method import Arma, AutoRegressive, Method, Repetition
from pivident.estimation.methods import METHODS, name_of
from pivident.estimation.parameter_rows import parameter_rows
from pivident.estimation.signal_recipes import RECIPES
from pivident.foundation.errors import PividentError
from pivident.foundation.files import atomic_folder
from pivident.foundation.options import Options
from pivident.foundation.text.plain_values import csv_table, json_of_entries, plain
from pivident.loop.simulation.control_loop import Loop
from pivident.robot.robot_values import robot_values

#: Version of the layout of ``identification.json``.
SCHEMA = 4

#: Columns of ``parameters.csv``; σ and the interval of ±2σ in the unit of the row, the relative σ
#: in percent.
CSV_COLUMNS = (
    "name", "value", "std", "low", "high", "relative_std", "method_std", "unit", "expression",
)  # fmt: skip


def save_identification(identification: Identification, folder: str | PathLike[str]) -> None:
    """Write ``identification.json`` and ``parameters.csv`` into a folder, all or nothing."""
    with atomic_folder(folder) as build:
        for name, text in (
            ("identification.json", to_json(identification)),
            ("parameters.csv", to_csv(identification)),
        ):
            # File names may hold bytes that are no text; they become escapes.
            (build / name).write_text(text, encoding="utf-8", errors="backslashreplace")


def to_dict(identification: Identification) -> dict[str, Any]:
    """The result as plain values, ready for JSON; signals are left out."""
    parameters = [
        {key: getattr(row, key) for key in CSV_COLUMNS} for row in parameter_rows(identification)
    ]
    loop = identification.loop_values or _loop_values(identification.loop)
    instruments = identification.instruments
    fitted, noise = identification.fitted_range, identification.equation_noise
    simulation = identification.simulation
    content = {
        "schema": SCHEMA,
        "method": identification.method,
        "kind": None if identification.method_used is None else name_of(identification.method_used),
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
        "instruments": None if instruments is None else instruments.to_values(),
        "options": identification.options,
        "warnings": [warning.as_json() for warning in identification.warnings],
        "sources": identification.sources,
        "version": identification.version,
        "readings": list(identification.readings),
        "motion": None if fitted is None else fitted.to_values(),
        "robot_description": robot_values(identification.robot),
        "torque_sums": torque_sums_values(identification),
        "equation_noise": noise and noise.to_values(),
        "simulation": simulation and simulation.to_values(),
    }
    return {key: plain(value) for key, value in content.items()}


def _loop_values(loop: Loop | None) -> dict[str, Any]:
    """Law and reference that were found from the record; None where they were given."""
    if loop is None:
        return {"controller": None, "reference": None}
    return {"controller": loop.law_values(), "reference": loop.reference_values()}


def torque_sums_values(identification: Identification) -> dict[str, Any] | None:
    """Sums of the fitted record as plain values; None where neither they nor signals are there."""
    sums = identification.torque_sums
    if sums is None and identification.recordings:
        sums = torque_sums(identification)
    return None if sums is None else sums.to_values()


def to_json(identification: Identification) -> str:
    """Strict JSON with one line for each parameter, joint, iteration and row of a matrix."""
    return json_of_entries(to_dict(identification))


def to_csv(identification: Identification) -> str:
    """The parameters as a table with a header; numbers that are not finite are left empty."""
    rows = parameter_rows(identification)
    cells = ([plain(getattr(row, column)) for column in CSV_COLUMNS] for row in rows)
    return csv_table(CSV_COLUMNS, cells)


#: Classes of recipes by the option that holds one.
_RECIPES = {"signals": tuple(RECIPES.values()), "noise": (AutoRegressive, Repetition, Arma)}


def method_of_options(options: Mapping[str, Any], kind: str | None, label: str) -> Method | None:
    """The method whose options these are; None: of no method of this version.

    Args:
        options: options as plain values.
        kind: name of a method of the same class; None: files of schema 3 and before do not say it.
        label: name of the result.
    """
    values = {key: value for key, value in options.items() if key not in ("mask", "regressor")}
    if kind is None and options.get("regressor") == "simulated":
        kind = "didim"
    try:
        for key, classes in _RECIPES.items():
            if key in values:
                values[key] = _recipe(classes, values[key])
        if kind is not None:
            return _with_values(type(METHODS[kind]), values)
    except (TypeError, ValueError, KeyError, AttributeError, PividentError):
        return None
    for method in METHODS.usable().values():
        try:
            candidate = _with_values(type(method), values)
        except (TypeError, ValueError, AttributeError, PividentError):
            continue
        if label.startswith(candidate.label):
            return candidate
    return None


def _recipe(classes: Sequence[type[Options]], values: Mapping[str, Any]) -> Any:
    """The recipe that has just these options."""
    for each in classes:
        if set(values) == {f.name for f in fields(each)}:
            return _with_values(each, values)
    raise ValueError(f"no recipe has the options {', '.join(values)}")


def _with_values(kind: Any, values: Mapping[str, Any]) -> Any:
    """A class with options from a file, whose lists are tuples."""
    return kind(**{k: tuple(v) if isinstance(v, list) else v for k, v in values.items()})
