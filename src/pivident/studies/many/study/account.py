"""The summary of a study, or of all its conditions side by side, as one self-contained HTML page.

All conditions of a study side by side, as one self-contained HTML page.

A table for each figure, a row for each method, a column for each condition.
"""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from markupsafe import Markup

from pivident.foundation.document.plot import (
    ERROR,
    LEGEND,
    SHADE,
    Figure,
    Plot,
    colour,
    empty_plot as empty_plot,
)
from pivident.foundation.text.numbers import percent as two_digits
from pivident.foundation.text.toml import toml_lines
from pivident.judgement.report.builder import page_environment, page_of
from pivident.studies.many.study.bench import Bench
from pivident.studies.many.study.summary import (
    NOMINAL_COVERAGE,
    MethodSummary,
    Summary,
    number,
    percent,
)

if TYPE_CHECKING:
    import polars as pl

#: Maximum number of runs in the figure of normalised errors; more would make the page slow.
MAX_DRAWN = 400


def render_page(
    summary: Summary, bench: Bench, rows: pl.DataFrame, programs: Sequence[str] = ()
) -> str:
    """The page as text."""
    environment = page_environment("pivident.studies.many.study")
    environment.globals |= {"share": percent, "short": number, "share_of": _share}
    content: dict[str, Any] = {
        "summary": summary,
        "methods": list(summary.methods.items()),
        "nominal": NOMINAL_COVERAGE,
        "programs": programs,
        "identity": toml_lines(bench.scenario.identity),
        "bounded": any(math.isfinite(m.efficiency) for m in summary.methods.values()),
        "sensed": any(math.isfinite(m.spread_over_sensor_bound) for m in summary.methods.values()),
    }
    figures = {
        "result": [],
        "intervals": [coverage_figure(summary), ratio_figure(summary)],
        "accuracy": [standard_error_figure(summary), bias_figure(summary)],
        "runs": list(errors_figures(summary, bench, rows)),
        "parameters": [],
        "merit": [],
        "provenance": [],
    }
    headings = {
        "result": "Result",
        "intervals": "Validity of the intervals",
        "accuracy": "Accuracy of the estimates",
        "runs": "Run by run",
        "parameters": "Parameter by parameter",
        "merit": "Figures of merit on a second motion",
        "provenance": "Provenance",
    }
    templates = {key: environment.get_template(f"study_{key}.html") for key in headings}
    sections = [
        (key, heading, Markup(templates[key].render(figures=figures[key], **content)))
        for key, heading in headings.items()
    ]
    return page_of(environment, f"Study {summary.scenario}: {summary.runs} runs", sections)


def coverage_figure(summary: Summary) -> Figure:
    """Coverage of every parameter with its Wilson interval."""
    plot = empty_plot("covered [%]")
    for k, (name, method) in enumerate(summary.methods.items()):
        share = np.array([p.coverage for p in method.parameters])
        ends = np.array([p.coverage_interval for p in method.parameters]).reshape(-1, 2)
        _points(plot, method, name, k, 100 * share, 100 * ends)
    plot.horizontal(100 * NOMINAL_COVERAGE, {"color": ERROR, "width": 1, "dash": "dash"})
    return Figure(
        plot,
        height=300,
        title="2σ coverage",
        label="Coverage of the 2σ interval of every parameter by every method",
        note=f"Wilson intervals of 95 %; the dashed line is {100 * NOMINAL_COVERAGE:.1f} %, where "
        "they should lie",
    )


def ratio_figure(summary: Summary) -> Figure:
    """Reported over empirical standard error of every parameter."""
    plot = empty_plot("reported/found")
    for k, (name, method) in enumerate(summary.methods.items()):
        _points(plot, method, name, k, [p.predicted_over_empirical for p in method.parameters])
    plot.horizontal(1.0, {"color": ERROR, "width": 1, "dash": "dash"})
    plot.y_axis(type="log")
    return Figure(
        plot,
        height=300,
        title="Reported over empirical standard error",
        label="Mean reported standard error over the standard deviation of the estimates",
        note="above the dashed line intervals are too wide, below too narrow",
    )


def standard_error_figure(summary: Summary) -> Figure:
    """Empirical standard errors and their bound."""
    plot = empty_plot("standard error/|truth| [%]")
    first = next(iter(summary.methods.values()))
    for k, (name, method) in enumerate(summary.methods.items()):
        _points(plot, method, name, k, [_relative(p.spread, p.truth) for p in method.parameters])
    names = [html.escape(p.name) for p in first.parameters]
    for label, key, dash in (("bound (P-23)", "bound", "solid"), ("sensor", "sensor_bound", "dot")):
        bound = [_relative(getattr(p, key), p.truth) for p in first.parameters]
        if any(map(math.isfinite, bound)):
            plot.add(
                x=names, y=bound, name=label, mode="lines",
                line={"color": ERROR, "width": 1.2, "dash": dash, "shape": "hvh"},
            )  # fmt: skip
    plot.y_axis(type="log", exponentformat="power")
    return Figure(
        plot,
        height=320,
        title="Standard error of the estimates",
        label="Empirical relative standard error of every parameter by every method, with bound",
        note="the line is the bound (P-23); dotted: from the torque sensor's noise alone",
    )


def _share(share: float) -> str:
    """A share with two digits as percentage, or a dash."""
    return two_digits(100.0 * share) if math.isfinite(share) else "–"


def bias_figure(summary: Summary) -> Figure:
    """Bias over the standard deviation of the estimate, with its standard error."""
    plot = empty_plot("bias/standard deviation")
    for k, (name, method) in enumerate(summary.methods.items()):
        spread = np.array([p.spread for p in method.parameters])
        with np.errstate(divide="ignore", invalid="ignore"):
            bias = np.array([p.bias for p in method.parameters]) / spread
            error = 2 * np.array([p.bias_std for p in method.parameters]) / spread
        _points(plot, method, name, k, bias, np.stack([bias - error, bias + error], axis=1))
    ends = {"xref": "paper", "x0": 0, "x1": 1, "y0": -0.5, "y1": 0.5}
    plot.add_shape("rect", **ends, line={"width": 0}, fillcolor=SHADE)
    plot.y_axis(autorangeoptions={"include": [-1.0, 1.0]})  # the band is always visible
    return Figure(
        plot,
        height=320,
        title="Bias",
        label="Mean error of every parameter over the standard deviation of the estimate",
        note="±2 standard errors; the grey band is half a standard deviation",
    )


def errors_figures(summary: Summary, bench: Bench, rows: pl.DataFrame) -> Iterator[Figure]:
    """Errors over reported standard errors of each method, one box per parameter."""
    for k, name in enumerate(summary.methods):
        own = rows.filter((rows["method"] == name) & rows["error"].is_null()).head(MAX_DRAWN)
        if own.is_empty():
            continue
        theta, std = (np.array(own[key].to_list()) for key in ("theta", "std"))
        errors = (theta - bench.expected) / std
        plot = empty_plot("error/reported σ")
        for j, parameter in enumerate(bench.estimated):
            low, first, middle, third, high = np.percentile(errors[:, j], [2.3, 25, 50, 75, 97.7])
            plot.add(
                "box",
                name=html.escape(parameter), x=[html.escape(parameter)], lowerfence=[low],
                q1=[first], median=[middle], q3=[third], upperfence=[high],
                marker={"color": colour(k)}, showlegend=False,
            )  # fmt: skip
        for line in (-2.0, 2.0):
            plot.horizontal(line, {"color": ERROR, "width": 1, "dash": "dash"})
        yield Figure(
            plot,
            height=280,
            title=name,
            label=f"Errors of {name} over their reported standard errors, by parameter",
            note="box: half of the runs; whiskers: 95.4 %, which should reach the dashed lines",
        )


def _points(
    plot: Plot,
    method: MethodSummary,
    name: str,
    k: int,
    y: Any,
    ends: np.ndarray | None = None,
) -> None:
    """One point per parameter, with its interval if given."""
    y = np.asarray(y, dtype=float)
    bars = None
    if ends is not None:
        bars = {
            "type": "data",
            "symmetric": False,
            "array": ends[:, 1] - y,
            "arrayminus": y - ends[:, 0],
            "thickness": 1,
            "width": 0,
        }
    plot.add(
        x=[html.escape(p.name) for p in method.parameters],
        y=y,
        error_y=bars,
        name=html.escape(name),
        mode="markers",
        marker={"color": colour(k), "size": 6},
    )
    plot.update(showlegend=True, legend=LEGEND)


def _relative(value: float, truth: float) -> float:
    return 100.0 * value / abs(truth) if truth else math.nan


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
        lambda m: float(m.failed + m.not_converged + m.simulations_diverged),
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
    environment = page_environment("pivident.studies.many.study")
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
