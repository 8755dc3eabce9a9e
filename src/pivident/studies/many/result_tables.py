"""Tables of studies and fleets.

Tables of many results at once: comparisons, studies, fleets, friction against its states.
"""

from __future__ import annotations

import math
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from pivident.foundation.document.table import Table
from pivident.studies.comparison.compare import Comparison
from pivident.studies.comparison.comparison_files import comparison_table

if TYPE_CHECKING:
    import polars as pl

    from pivident.studies.friction.friction_study import FrictionStudy
    from pivident.studies.many.fleet.identify_fleet import Fleet
    from pivident.studies.many.fleet.judgement import Judgement
    from pivident.studies.many.study.summary import Summary


def study_parameters(summary: Summary) -> Table:
    """One row for each method and parameter of a study."""
    rows = []
    for method, found in summary.methods.items():
        for p in found.parameters:
            low, high = p.coverage_interval
            own = {f.name: getattr(p, f.name) for f in fields(p) if f.name != "coverage_interval"}
            rows.append({"method": method} | own | {"coverage_low": low, "coverage_high": high})
    meanings = {
        "spread": "empirical standard deviation of the estimates",
        "predicted": "mean of the reported standard errors",
        "coverage": "share of runs whose truth lies within 2σ, with its 95 % interval",
    }
    return Table.of_rows("parameters", rows, meanings)


def study_methods(summary: Summary) -> Table:
    """One row for each method of a study."""
    names = (
        "robust_coverage", "median_relative_error", "relative_spread",
        "predicted_over_empirical", "robust_over_empirical", "efficiency", "runs", "records",
        "failed", "not_converged", "simulations", "seconds",
    )  # fmt: skip
    rows = []
    for method, found in summary.methods.items():
        low, high = found.coverage_interval
        own: dict[str, Any] = {"coverage": found.coverage, "coverage_low": low}
        own |= {"coverage_high": high} | {name: getattr(found, name) for name in names}
        rows.append({"method": method} | own)
    return Table.of_rows("methods", rows, {"coverage": "with its 95 % interval"})


def fleet_parameters(fleet: Fleet) -> Table:
    """One row for each log and parameter, and one for each log that failed."""
    from pivident.studies.many.fleet.judgement import parameter_table

    return of_frame("parameters", parameter_table(fleet))


def judgement_parameters(judgement: Judgement) -> Table:
    """The estimates behind a judgement."""
    return fleet_parameters(judgement.fleet)


def judgement_alarms(judgement: Judgement) -> Table:
    """One row for each parameter of a robot that has changed."""
    from pivident.studies.many.fleet.control_chart import Alarm

    names = [f.name for f in fields(Alarm)]
    rows = [
        {name: getattr(alarm, name) for name in names} | {"charts": " ".join(alarm.charts)}
        for alarm in judgement.alarms
    ]
    meanings = {
        "change": "mean change from that record on, with its 95 % interval",
        "charts": "shewhart (sudden) and ewma (slow), those that gave the alarm",
    }
    return Table.of_rows("alarms", rows, meanings, empty=names)


def judgement_wear(judgement: Judgement) -> Table:
    """One row for each robot and watched parameter whose slope over time is known."""
    rows = [
        {
            "robot": robot,
            "parameter": wear.parameter,
            "rate": rate.value,
            "low": rate.low,
            "high": rate.high,
            "confidence": 0.95,
            "clear": rate.clear,
            "level": float(wear.level),
            "unit": wear.unit,
        }
        for wear in judgement.wear
        for robot, rate in wear.robots.items()
        if rate is not None
    ]
    meanings = {"rate": "slope per unit of the fleet's time axis", "level": "mean over the robots"}
    empty = ("robot", "parameter", "rate", "low", "high", "confidence", "clear", "level", "unit")
    return Table.of_rows("wear", rows, meanings, empty)


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
    rows = []
    for joint in comparison.friction:
        for curve in joint.curves:
            for speed, torque, std in zip(joint.speed, curve.torque, curve.std, strict=True):
                rows.append(
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
                )
    empty = ("joint", "result", "speed", "speed_unit", "value", "low", "high", "torque_unit")
    return Table.of_rows("friction", rows, empty=empty)


def friction_curves(study: FrictionStudy) -> Table:
    """All functions and maps of friction, one row for each point."""
    from pivident.studies.friction.curves import curves_table

    return of_frame("curves", curves_table(study))
