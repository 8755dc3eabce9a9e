"""Tables of many results at once: comparisons, studies, fleets, friction against its states."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pivident.foundation.document.table import Table
from pivident.studies.comparison.account import comparison_table
from pivident.studies.comparison.compare import Comparison

if TYPE_CHECKING:
    import polars as pl

    from pivident.studies.friction.friction_study import FrictionStudy


def of_frame(name: str, frame: pl.DataFrame) -> Table:
    """A polars frame as a table."""
    columns = {
        column: frame[column].to_numpy()
        if frame[column].dtype.is_numeric()
        else tuple(frame[column].to_list())
        for column in frame.columns
    }
    return Table(name, columns)


comparison_parameters = comparison_table


def comparison_results(comparison: Comparison) -> Table:
    """One row for each result."""
    rows = [
        {
            "result": e.label,
            "kind": e.kind,
            "method": e.method,
            "robot": e.robot.name,
            "parameters": len(e.names),
            "relative_error_percent": 100.0 * float(e.relative_error),
            "condition": float(e.condition),
            "rows": math.nan if e.samples is None else float(e.samples),
            "converged": e.converged,
            "significant_differences": len(comparison.marked(k)),
            "version": e.version,
            "sha256": "" if e.source is None else e.source.sha256,
            "written": "" if e.source is None else e.source.modified,
        }
        for k, e in enumerate(comparison.entries)
    ]
    return Table.of_rows("results", rows)


def comparison_torques(comparison: Comparison) -> Table:
    """One row for each pair of parameters and record."""
    rows = [
        {
            "parameters_of": label,
            "record_of": comparison.labels[t.record],
            "relative_error_percent": 100.0 * float(t.error[k]),
            "relative_difference_percent": 100.0 * float(t.apart[k]),
        }
        for t in comparison.torques
        for k, label in enumerate(comparison.labels)
    ]
    meanings = {"relative_difference_percent": "from the torque of the record's own result"}
    empty = ("parameters_of", "record_of", "relative_error_percent", "relative_difference_percent")
    return Table.of_rows("torques", rows, meanings, empty)


def comparison_friction(comparison: Comparison) -> Table:
    """One row for each point of each friction curve."""
    rows = [
        {
            "joint": joint.name,
            "result": comparison.labels[curve.entry],
            "speed": float(speed),
            "speed_unit": joint.speed_unit,
            "value": float(torque),
            "low": float(torque - 2.0 * std),
            "high": float(torque + 2.0 * std),
            "torque_unit": joint.torque_unit,
        }
        for joint in comparison.friction
        for curve in joint.curves
        for speed, torque, std in zip(joint.speed, curve.torque, curve.std, strict=True)
    ]
    empty = ("joint", "result", "speed", "speed_unit", "value", "low", "high", "torque_unit")
    return Table.of_rows("friction", rows, empty=empty)


def friction_curves(study: FrictionStudy) -> Table:
    """All functions and maps of friction, one row for each point."""
    from pivident.studies.friction.curves import curves_table

    return of_frame("curves", curves_table(study))
