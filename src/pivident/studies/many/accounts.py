"""Tables of studies and fleets."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from pivident.foundation.document.table import Table
from pivident.studies.many.fleet.identify_fleet import Fleet
from pivident.studies.many.fleet.judgement import Judgement, parameter_table
from pivident.studies.many.study.summary import Summary
from pivident.studies.tables.many_results import of_frame


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
