"""An identification as files: ``identification.json`` for programs, ``parameters.csv`` for sheets.

The JSON is strict: numbers that are not finite are written as null. It holds the whole robot and
the sums of the fitted record, so that `load_identification` gets back everything but the signals.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from math import inf, nan
from os import PathLike
from typing import Annotated, Any, TypedDict

import numpy as np

from pivident.dynamics.friction import FrictionWarming
from pivident.estimation.equation_record import MotionRange
from pivident.estimation.identification import Identification, Iteration, JointFit, torque_sums
from pivident.estimation.known_parameters import KnownParameters
from pivident.estimation.method import Arma, AutoRegressive, Method, Repetition
from pivident.estimation.methods import METHODS, name_of
from pivident.estimation.parameter_rows import parameter_rows
from pivident.estimation.signal_recipes import RECIPES
from pivident.estimation.simulation_result import SimulationResult
from pivident.estimation.solved_equations import EquationNoise, TorqueSums
from pivident.foundation.codec import Layout
from pivident.foundation.common_work import once
from pivident.foundation.errors import PividentError
from pivident.foundation.files import atomic_folder
from pivident.foundation.options import Options
from pivident.foundation.text.display import in_one_line
from pivident.foundation.text.finding import Finding
from pivident.foundation.text.plain_values import (
    LATER,
    SPARSE,
    Known,
    Limits,
    Name,
    Null,
    Sized,
    csv_table,
    json_of_entries,
    plain,
)
from pivident.loop.instruments.given_motion import InstrumentsUsed
from pivident.loop.simulation.control_loop import Loop
from pivident.robot.description import TorqueSide
from pivident.robot.robot_values import StoredRobot

IDENTIFICATION = Layout(
    "identification",
    4,
    give="give the file identification.json of a result",
    again="identify again",
    older={1: dict, 2: dict, 3: lambda content: _with_robust_std(content)},
)


@dataclass(frozen=True, kw_only=True)
class ParameterEntry:
    """One estimate; the standard errors that count are those of the covariances.

    Standard errors and the interval of ±2σ in the unit of the row, the relative one in percent.
    """

    name: Name
    value: float
    std: Known
    low: Annotated[Known, LATER] = nan
    high: Annotated[Known, LATER] = nan
    relative_std: Known
    method_std: Annotated[Known, LATER] = nan
    unit: str
    expression: str


#: Columns of ``parameters.csv``.
CSV_COLUMNS = tuple(ParameterEntry.__dataclass_fields__)


class AnyReading(TypedDict):
    """How a log was read: arguments of `load_recording` that always are there."""

    columns: dict[str, Any]
    units: dict[str, Any]
    side: str | dict[str, str]
    rate: float | None
    resample: bool
    samples_axis: int | None
    position_offset: list[float] | None


class Reading(AnyReading, total=False):
    """How a log was read: all arguments."""

    control_rate: float | None
    torque_timing: str | None
    delay: float | None
    drive_delay: float | None
    torque_side: TorqueSide | None


Covariance = Annotated[np.ndarray, Sized("parameters", "parameters"), Null(nan)]
Found = list[dict[str, Any]] | None


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentificationTable:
    """The whole of ``identification.json``."""

    method: Name
    kind: Annotated[str | None, LATER] = None
    robot: Name
    converged: bool
    iterations: int
    parameters: Annotated[tuple[ParameterEntry, ...], Sized("parameters"), Limits(min_length=1)]
    covariance: Covariance
    robust_covariance: Covariance
    formula_covariance: Covariance
    relative_error: Known
    joints: Annotated[tuple[JointFit, ...], Sized("joints")]
    history: tuple[Iteration, ...]
    condition: Annotated[float, Null(inf)]
    controller: Found
    reference: Found
    loop: Annotated[str, SPARSE] = ""  # that was simulated, in words
    instruments: Annotated[InstrumentsUsed | None, LATER] = None
    options: dict[str, Any]
    warnings: tuple[Finding, ...]
    sources: dict[str, str]
    version: str
    readings: Annotated[tuple[Reading, ...], LATER] = ()
    motion: Annotated[MotionRange | None, LATER] = None
    robot_description: Annotated[StoredRobot | None, LATER] = None
    torque_sums: Annotated[TorqueSums | None, LATER] = None
    equation_noise: Annotated[EquationNoise | None, LATER] = None
    simulation: Annotated[SimulationResult | None, LATER] = None
    known: Annotated[KnownParameters, SPARSE] = field(default_factory=KnownParameters)
    friction_warming: Annotated[tuple[FrictionWarming, ...], SPARSE] = ()


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
    own, used = identification, identification.method_used
    rows = ({key: getattr(row, key) for key in CSV_COLUMNS} for row in parameter_rows(own))
    computed = {
        "kind": None if used is None else name_of(used),
        "robot": own.robot.name,
        "parameters": tuple(ParameterEntry(**row) for row in rows),
        "motion": own.fitted_range,
        "robot_description": own.robot,
        "torque_sums": _sums(own),
    } | (own.loop_values or _loop_values(own.loop))
    same = IdentificationTable.__dataclass_fields__.keys() - computed
    table = IdentificationTable(**{key: getattr(own, key) for key in same}, **computed)
    return IDENTIFICATION.header | plain(table)


def _loop_values(loop: Loop | None) -> dict[str, Any]:
    """Law and reference that were found from the record, None where they were given; its name."""
    if loop is None:
        return {"controller": None, "reference": None, "loop": ""}
    found = {"controller": loop.law_values(), "reference": loop.reference_values()}
    return found | {"loop": in_one_line(loop).strip("<>")}


def _sums(identification: Identification) -> TorqueSums | None:
    """Sums of the fitted record; None where neither they nor signals are there."""
    if identification.torque_sums is None and identification.recordings:
        return torque_sums(identification)
    return identification.torque_sums


def _with_robust_std(content: dict[str, Any]) -> dict[str, Any]:
    """Layout 4 of layout 3, whose ``std`` was by the method's covariance, warnings maybe text."""
    rows = [
        {**row, "std": row.get("robust_std"), "method_std": row["std"]}
        for row in content["parameters"]
    ]
    for row in rows:
        row.pop("robust_std", None)
    warnings = [
        plain(Finding("warning", "estimator", "stored", own)) if isinstance(own, str) else own
        for own in content["warnings"]
    ]
    return content | {"parameters": rows, "warnings": warnings}


def to_json(identification: Identification) -> str:
    """Strict JSON with one line for each parameter, joint, iteration and row of a matrix."""
    key = ("identification file", identification)  # the report offers what its folder holds
    return once(key, lambda: json_of_entries(to_dict(identification)))


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
    values = {  # the horizon was called segment in files of earlier versions
        "horizon" if key == "segment" else key: value
        for key, value in options.items()
        if key not in ("mask", "regressor")
    }
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
