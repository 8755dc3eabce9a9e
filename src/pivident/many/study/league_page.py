"""All conditions of a study side by side, as one self-contained HTML page.

A table for each figure, a row for each method, a column for each condition.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from markupsafe import Markup

from pivident.many.study.study_text import number, percent
from pivident.many.study.summary import NOMINAL_COVERAGE, MethodSummary, Summary
from pivident.report.builder import page_environment, page_of


@dataclass(frozen=True)
class Standing:
    """A figure that methods are compared by."""

    heading: str  # of its table
    note: str  # what it is
    value: Callable[[MethodSummary], float]
    shown: Callable[[float], str]  # value as text
    #: Which value of a column is emphasised: the least, the one nearest to the nominal coverage,
    #: or none.
    best: Literal["least", "nominal", "none"] = "least"

    def distance(self, value: float) -> float:
        """From what would be best; infinite where there is no value."""
        if not math.isfinite(value):
            return math.inf
        return abs(value - NOMINAL_COVERAGE) if self.best == "nominal" else value


def _missed(m: MethodSummary) -> float:
    return float(m.failed + m.not_converged + m.simulations_diverged)


#: What is compared, in the order of the page.
STANDINGS = (
    Standing(
        "Error of a run",
        "Median of |θ̂ − θ|/|θ| over runs and parameters [%].",
        lambda m: 100.0 * m.median_relative_error,
        number,
    ),
    Standing(
        "Error of the parameters, of a run",
        "Median over the runs of d_β = 100 (2/b) Σ |β̂ − β|/(|β̂| + |β|) [%].",
        lambda m: m.merit.d_beta,
        number,
    ),
    Standing(
        "Error of the parameters, at their mean",
        "d_β of the mean estimate [%]: what is left when noise is averaged out is bias.",
        lambda m: m.merit_of_mean.d_beta if m.merit_of_mean else math.nan,
        number,
    ),
    Standing(
        "Error of the torque, of a run",
        "Median over the runs of d_τ = 100 mean ‖τ̂ − τ‖/‖τ‖ on a second motion without noise [%].",
        lambda m: m.merit.d_tau,
        number,
    ),
    Standing(
        "Error of the torque, at the mean parameters",
        "d_τ of the mean estimate [%].",
        lambda m: m.merit_of_mean.d_tau if m.merit_of_mean else math.nan,
        number,
    ),
    Standing(
        "Coverage",
        "Share of runs and parameters whose truth lies within two reported standard errors; "
        f"{100 * NOMINAL_COVERAGE:.1f} % is nominal.",
        lambda m: m.coverage,
        lambda value: percent(value, 1),
        "nominal",
    ),
    Standing("Time", "Median of an identification [s].", lambda m: m.seconds, number),
    Standing(
        "Simulations",
        "Median number of simulations of the control loop in an identification; those of cloe, "
        "clie and ml carry the tangents of all parameters.",
        lambda m: m.simulations,
        number,
        "none",
    ),
    Standing(
        "Runs that went wrong",
        "Runs without an estimate, estimates that did not converge, and those with which the "
        "second motion cannot be simulated.",
        _missed,
        lambda value: f"{value:.0f}",
        "none",
    ),
)  # fmt: skip


def render_league(summaries: Mapping[str, Summary]) -> str:
    """The page as text.

    Args:
        summaries: of the conditions, by name.
    """
    first = next(iter(summaries.values()))
    methods = list(dict.fromkeys(name for s in summaries.values() for name in s.methods))
    tables = []
    for standing in STANDINGS:
        values = {
            name: [
                standing.value(s.methods[name]) if name in s.methods else math.nan
                for s in summaries.values()
            ]
            for name in methods
        }
        best = _best(standing, values)
        cells = {
            name: [
                (standing.shown(v) if math.isfinite(v) else "–", name in best[k])
                for k, v in enumerate(row)
            ]
            for name, row in values.items()
        }
        tables.append((standing, cells))
    environment = page_environment("pivident.many.study")
    runs = {name: summary.runs for name, summary in summaries.items()}
    content = environment.get_template("league.html").render(
        runs=runs, tables=tables, description=first.description, conditions=list(summaries)
    )
    name = first.scenario.partition("/")[0]
    return page_of(
        environment,
        f"Study {name}: {len(methods)} methods in {len(summaries)} conditions",
        [("league", "Methods and conditions", Markup(content))],
    )


def _best(standing: Standing, values: Mapping[str, list[float]]) -> list[set[str]]:
    """Names of the methods whose value is best, by column."""
    columns = len(next(iter(values.values())))
    if standing.best == "none":
        return [set()] * columns
    found = []
    for k in range(columns):
        distances = {name: standing.distance(row[k]) for name, row in values.items()}
        least = min(distances.values())
        found.append({n for n, d in distances.items() if d == least and math.isfinite(d)})
    return found
