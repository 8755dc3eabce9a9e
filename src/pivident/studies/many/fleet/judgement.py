"""Assessment of a fleet: control charts, alarms and wear, and its text for terminals."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pivident.foundation.extras import require
from pivident.foundation.text.display import Displayed
from pivident.studies.many.fleet.baseline import Baseline, fit_baseline
from pivident.studies.many.fleet.control_chart import (
    Alarm,
    Chart,
    Wear,
    draw_charts,
    find_alarms,
    separate_wear,
)
from pivident.studies.many.fleet.identify_fleet import Fleet
from pivident.studies.many.fleet.series import Series, watched_series

if TYPE_CHECKING:
    import polars as pl


@dataclass(frozen=True, eq=False)
class Judgement(Displayed):
    """A fleet with everything that was found out about it.

    Attributes:
        fleet: the estimates.
        baselines: of each watched parameter.
        charts: of each parameter and robot with records after the baseline.
        alarms: one for each chart that was left, the clearest first.
        wear: of each watched parameter.
        notes: what must be known to read the rest, whole sentences.
    """

    fleet: Fleet  # the estimates
    baselines: tuple[Baseline, ...]  # of each watched parameter
    charts: tuple[Chart, ...]  # of each parameter and robot with records after the baseline
    alarms: tuple[Alarm, ...]  # one for each chart with records outside, the clearest first
    wear: tuple[Wear, ...]  # of each watched parameter
    notes: tuple[str, ...]  # reservations, whole sentences

    @property
    def level(self) -> float:
        """Probability of one false alarm or more, at most."""
        return self.fleet.template.fleet.level

    @property
    def tests(self) -> int:
        """Number of tests that share the level."""
        return self.charts[0].tests if self.charts else 0


def judge(fleet: Fleet) -> Judgement:
    """Charts, alarms and wear of all watched parameters."""
    entry = fleet.template.fleet
    series = watched_series(fleet.rows, fleet.logs, entry.watch, entry.baseline_records)
    groups: dict[str, list[Series]] = {}
    for one in series:
        groups.setdefault(one.parameter, []).append(one)
    baselines = [fit_baseline(own, entry.baseline) for own in groups.values()]
    charts = draw_charts(baselines, entry.level, entry.planned_records)
    return Judgement(
        fleet,
        tuple(baselines),
        tuple(charts),
        tuple(find_alarms(charts)),
        tuple(separate_wear(b) for b in baselines),
        tuple(_notes(fleet, baselines, charts)),
    )


def parameter_table(fleet: Fleet) -> pl.DataFrame:
    """One row for each log and parameter, and one for each log that failed.

    Columns are the parts of the pattern (``robot``, ``day`` …), ``time``, ``log`` and the results;
    ``std`` is that of the method, ``relative_error`` that of the whole fit.
    """
    pl = require("polars", extra="tables", purpose="the study of a fleet")
    names = [name for name, _ in fleet.logs[0].captures]
    logs = pl.DataFrame(
        {
            "task": [log.name for log in fleet.logs],
            **{_column(name): [dict(log.captures)[name] for log in fleet.logs] for name in names},
            "time": [log.time or None for log in fleet.logs],
            "position": [log.position for log in fleet.logs],
            "log": [", ".join(p.rpartition("/")[2] for p in log.paths) for log in fleet.logs],
        },
        schema_overrides={"time": pl.String},
    ).with_row_index("order")
    table = fleet.rows.with_columns(pl.int_range(pl.len()).alias("row"))
    return logs.join(table, on="task", how="inner").sort("order", "row").drop("order", "row")


def promise(judgement: Judgement) -> str:
    """Meaning of the level in one sentence."""
    entry = judgement.fleet.template.fleet
    period = (
        "in this report (a report on more records has tests of its own)"
        if entry.planned_records is None
        else f"in all reports until a robot has {entry.planned_records} judged records"
    )
    return (
        f"If no parameter has changed, the probability of one alarm or more, over all robots, "
        f"parameters and records {period}, is at most {100 * judgement.level:g} %."
    )


def _notes(fleet: Fleet, baselines: list[Baseline], charts: list[Chart]) -> list[str]:
    """Reservations that the charts do not show."""
    pl = require("polars", extra="tables", purpose="the study of a fleet")
    entry, notes = fleet.template.fleet, []
    failed = fleet.failures
    if len(failed):
        notes.append(
            f"{len(failed)} of {len(fleet.logs)} logs gave no estimate; they are listed below."
        )
    lazy = fleet.rows.filter(pl.col("converged").not_())["task"].n_unique()
    if lazy:
        notes.append(f"{lazy} estimate(s) did not converge and are in no chart.")
    judged = {c.series.robot for c in charts}
    early = [robot for robot in fleet.robots if robot not in judged]
    if early:
        shown = ", ".join(early[:3]) + (f" and {len(early) - 3} more" if len(early) > 3 else "")
        notes.append(
            f"{len(early)} robot(s) have no record after the baseline ({shown}): "
            + (
                f"the first {entry.baseline_records} records of each are its baseline."
                if entry.baseline == "robot"
                else "a robot is compared with at least two others."
            )
        )
    few = [b for b in baselines if 0 < b.degrees < 8] if entry.baseline == "robot" else []
    if few:
        notes.append(
            f"The scatter between records has only {few[0].degrees} degree(s) of freedom, so the "
            "limits are wide; more baseline records or more robots narrow them."
        )
    if entry.temperature is not None and any(b.temperature is None for b in baselines):
        notes.append(
            "Temperature is not separated: it is missing in some records, or did not change "
            "within the baselines."
        )
    if entry.planned_records is not None and charts:
        most = max(c.difference.size for c in charts)
        if most > entry.planned_records:
            notes.append(
                f"There are {most} tested records of a robot, more than planned_records = "
                f"{entry.planned_records}; the level holds for this report alone."
            )
    return notes


def _column(name: str) -> str:
    """Column of a part of the pattern; own columns keep their names."""
    own = {"task", "time", "position", "log", "order", "row", "sha256", "method", "computed",
           "converged", "iterations", "samples", "relative_error", "condition", "seconds", "joint",
           "parameter", "unit", "value", "std", "robust_std", "friction", "temperature", "error",
           "message"}  # fmt: skip
    return f"{name}_part" if name in own else name


def judgement_text(judgement: Judgement, most: int) -> str:
    """Alarms in sentences, failed logs, and notes."""
    fleet = judgement.fleet
    lines = [
        f"{len(fleet.robots)} robot(s), {len(fleet.logs)} log(s), method "
        f"{fleet.template.method_name}: {len(judgement.alarms)} alarm(s)",
        *(f"! {alarm_sentence(alarm)}" for alarm in judgement.alarms[:most]),
        *_more(len(judgement.alarms) - most, "alarms"),
        *(
            f"- {row['task']}: {row['error']}: {row['message']}"
            for row in fleet.failures.head(most).iter_rows(named=True)
        ),
        *_more(len(fleet.failures) - most, "logs without an estimate"),
        *judgement.notes,
        promise(judgement),
        "",
    ]
    return "\n".join(lines)


def alarm_sentence(alarm: Alarm) -> str:
    """Robot, joint, time and size of a change."""
    share, low, high = (100.0 * value for value in alarm.relative)
    of_level = f", {share:+.3g} % ({low:+.3g} to {high:+.3g} %)" if math.isfinite(share) else ""
    return (
        f"{alarm.robot}, {alarm.joint}: {alarm.parameter} has changed since {alarm.time} by "
        f"{alarm.change:+.3g} {alarm.unit} (95 %: {alarm.low:+.3g} to {alarm.high:+.3g}){of_level}"
    )


def _more(count: int, what: str) -> list[str]:
    return [f"  and {count} more {what}"] if count > 0 else []
