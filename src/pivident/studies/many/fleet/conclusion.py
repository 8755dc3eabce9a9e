"""Files of an assessed fleet: table of parameters, alarms, page in the style of the report."""

from __future__ import annotations

import html
import io
import json
import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from markupsafe import Markup

from pivident.foundation.document.plot import (
    ERROR,
    LEGEND,
    MEASURED,
    SHADE,
    Figure,
    Plot,
    colour,
    empty_plot,
)
from pivident.foundation.text.numbers import with_spread
from pivident.foundation.text.plain_values import plain
from pivident.foundation.text.sentences import plural
from pivident.foundation.text.toml import toml_lines
from pivident.judgement.report.builder import page_environment, page_of
from pivident.studies.many.fleet.control_chart import Alarm, Chart, Rate
from pivident.studies.many.fleet.identify_fleet import Fleet
from pivident.studies.many.fleet.judgement import Judgement, judge, parameter_table, promise

#: Blue for a decrease, red for an increase, transparent for no change; legible on white and black.
DIVERGING = [
    [0.0, "rgb(33, 102, 172)"],
    [0.35, "rgb(146, 197, 222)"],
    [0.5, "rgba(138, 147, 163, 0.15)"],
    [0.65, "rgb(244, 165, 130)"],
    [1.0, "rgb(178, 24, 43)"],
]

#: Height of a row of the overview, and of all of them at most [px].
ROW, TALLEST = 18, 1400


def overview_figure(judgement: Judgement) -> Figure | None:
    """Standardised drift of every robot and parameter, the largest first."""
    charts = judgement.charts
    if not charts:
        return None
    parameters = list(dict.fromkeys(c.series.parameter for c in charts))
    worst: dict[str, float] = {}
    for chart in charts:
        size = float(np.abs(chart.slow[-1])) / chart.limit
        worst[chart.series.robot] = max(size, worst.get(chart.series.robot, 0.0))
    robots = sorted(worst, key=lambda name: worst[name])  # the last one is at the top
    drift = np.full((len(robots), len(parameters)), np.nan)
    words = np.full(drift.shape, "", dtype=object)
    rows = {name: k for k, name in enumerate(robots)}
    for chart in charts:
        at = rows[chart.series.robot], parameters.index(chart.series.parameter)
        drift[at] = chart.slow[-1]
        percent = 100.0 * chart.mean[-1] / abs(chart.level) if chart.level else np.nan
        words[at] = f"{percent:+.3g} % ({chart.mean[-1]:+.3g} {html.escape(chart.series.unit)})"
    limit = max(chart.limit for chart in charts)
    plot = empty_plot("")
    plot.add(
        "heatmap",
        z=np.round(drift, 3).tolist(), x=[html.escape(p) for p in parameters],
        y=[html.escape(r) for r in robots], text=words.tolist(),
        hovertemplate="%{y} %{x}: %{z:.2f} standard errors<br>%{text}<extra></extra>",
        zmin=-2 * limit, zmax=2 * limit, colorscale=DIVERGING,
        colorbar={"title": {"text": "standard errors"}, "thickness": 12}, xgap=1, ygap=1,
    )  # fmt: skip
    plot.update(margin={"l": 110, "r": 12, "t": 8, "b": 52})
    plot.y_axis(type="category", automargin=True)
    plot.x_axis(type="category")
    height = min(TALLEST, max(160, 90 + ROW * len(robots)))
    return Figure(
        plot,
        height=height,
        title="Standardised drift of every robot",
        label=f"Standardised drift of {len(robots)} robots and {len(parameters)} parameters",
        note=f"Exponentially weighted mean change at the last record over its standard error; "
        f"an alarm needs {limit:.2f} or more. Robots with the largest drift are at the top.",
    )


def chart_figure(chart: Chart, number: int = 0) -> Figure:
    """Estimates at the reference temperature, limits of a single record, and the running mean."""
    series, first = chart.series, chart.first
    x: Sequence[str | float] = series.times
    judged = chart.level + chart.difference
    plot = empty_plot(f"{html.escape(series.parameter)} [{html.escape(series.unit)}]")
    half = chart.limit * chart.std
    for sign, fill in ((1.0, None), (-1.0, "tonexty")):
        plot.add(
            x=x[first:], y=(chart.level + sign * half).tolist(), mode="lines",
            line={"color": MEASURED, "width": 1, "dash": "dot"}, fill=fill, fillcolor=SHADE,
            hoverinfo="skip", showlegend=False,
        )  # fmt: skip
    if first:
        _points(plot, x[:first], chart.baseline_values, series.std[:first], MEASURED, "baseline")
    _points(plot, x[first:], judged, series.std[first:], colour(number), "records")
    outside = np.flatnonzero(chart.outside).tolist()
    if outside:
        plot.add(
            x=[x[first + k] for k in outside], y=judged[outside].tolist(), mode="markers",
            name="alarm",
            marker={"color": ERROR, "size": 13, "symbol": "circle-open", "line": {"width": 2}},
        )  # fmt: skip
    plot.add(
        x=x[first:], y=(chart.level + chart.mean).tolist(), mode="lines", name="weighted mean",
        line={"color": colour(number), "width": 1.6},
    )  # fmt: skip
    plot.horizontal(chart.level, {"color": MEASURED, "width": 1})
    plot.update(showlegend=True, legend=LEGEND)
    plot.x_axis(type="date" if "-" in series.times[0][1:] else "category")
    last = f"last record {chart.sudden[-1]:+.2f} σ, weighted mean {chart.slow[-1]:+.2f} σ"
    return Figure(
        plot,
        height=300,
        title=f"{series.robot}: {series.parameter}",
        label=f"Control chart of {series.parameter} of {series.robot}: {last}",
        note=f"{last}; an alarm needs {chart.limit:.2f}. Bars: 2σ of each record.",
    )


def _points(
    plot: Plot, x: Sequence[object], y: np.ndarray, std: np.ndarray, tint: str, name: str
) -> None:
    plot.add(
        x=list(x), y=np.asarray(y).tolist(), mode="markers", name=name,
        marker={"color": tint, "size": 6},
        error_y={"type": "data", "array": (2.0 * std).tolist(), "thickness": 1, "width": 0},
    )  # fmt: skip


#: Maximum number of charts, those with alarms first; more would make the page slow.
MAX_CHARTS = 40

#: Number of charts if there are fewer alarms.
MIN_CHARTS = 8

#: Maximum number of robots in the headline.
MAX_NAMED = 6

#: Maximum number of listed failed logs and rates of wear.
MAX_LISTED = 100

HEADINGS = {
    "alarms": "Alarms",
    "overview": "All robots",
    "charts": "Control charts",
    "wear": "Wear and temperature",
    "logs": "Logs without an estimate",
    "provenance": "Provenance",
}


def render_page(judgement: Judgement) -> str:
    """The page as text."""
    fleet = judgement.fleet
    environment = page_environment("pivident.studies.many.fleet")
    environment.globals |= {
        "rate": _rate_text,
        "digits": lambda value: f"{value:.4g}" if math.isfinite(value) else "–",
        "percent_of": lambda share: f"{100.0 * share:+.3g} %" if math.isfinite(share) else "–",
        "alarm_numbers": _alarm_numbers,
        "counted": plural,
    }
    overview = overview_figure(judgement)
    content: dict[str, Any] = {
        "judgement": judgement,
        "fleet": fleet,
        "promise": promise(judgement),
        "headline": _headline(judgement),
        "overview": [] if overview is None else [overview],
        "charts": [chart_figure(c, 0) for c in _drawn(judgement)],
        "rates": _clearest_rates(judgement),
        "failures": list(fleet.failures.head(MAX_LISTED).iter_rows(named=True)),
        "programs": fleet.store.programs(),
        "identity": toml_lines(fleet.template.identity),
    }
    sections = [
        (key, heading, Markup(environment.get_template(f"fleet_{key}.html").render(content)))
        for key, heading in HEADINGS.items()
        if key != "logs" or content["failures"]
    ]
    counts = f"{plural(len(fleet.robots), 'robot')}, {plural(len(fleet.logs), 'log')}"
    return page_of(environment, f"{fleet.template.experiment.title}: {counts}", sections)


def _drawn(judgement: Judgement) -> list[Any]:
    """Charts with alarms, then those with the largest drift."""

    def size(chart: Any) -> float:
        return -max(abs(chart.sudden).max(), abs(chart.slow).max()) / chart.limit

    charts = sorted(judgement.charts, key=size)
    count = max(MIN_CHARTS, len(judgement.alarms))
    return charts[: min(count, MAX_CHARTS)]


def _clearest_rates(judgement: Judgement) -> list[tuple[str, str, str, float, Rate]]:
    """Robot, parameter, unit, level and rate of wear, the clearest first."""
    found = [
        (robot, wear.parameter, wear.unit, wear.level, rate)
        for wear in judgement.wear
        for robot, rate in wear.robots.items()
        if rate is not None and rate.clear
    ]
    return sorted(found, key=lambda f: (f[4].high - f[4].low) / abs(f[4].value))[:MAX_LISTED]


def _rate_text(rate: Rate | None, scale: float = 1.0) -> str:
    """A slope with its interval."""
    if rate is None:
        return "–"
    return f"{rate.value * scale:+.3g} ({rate.low * scale:+.3g} to {rate.high * scale:+.3g})"


def _headline(judgement: Judgement) -> str:
    """How many alarms, and whose."""
    count = Counter(alarm.robot for alarm in judgement.alarms)
    if not count:
        return "No alarm: no watched parameter has changed significantly from its baseline."
    robots = [f"{robot} ({number})" for robot, number in count.most_common()]
    more = f" and {len(robots) - MAX_NAMED} more" if len(robots) > MAX_NAMED else ""
    return f"{plural(count.total(), 'alarm')}: {', '.join(robots[:MAX_NAMED])}{more}."


def _alarm_numbers(alarm: Alarm) -> tuple[str, str, str]:
    """Change and ends of its interval, signed, to the second digit of the interval's half."""
    half = 0.5 * (alarm.high - alarm.low)
    values = (with_spread(x, half)[0] for x in (alarm.change, alarm.low, alarm.high))
    change, low, high = (x if x.startswith("-") else f"+{x}" for x in values)
    return change, low, high


PARAMETERS, ALARMS, PAGE = "parameters.parquet", "alarms.json", "fleet.html"


def conclude_fleet(fleet: Fleet, say: Callable[[str], None] | None = None) -> Judgement:
    """Judge a fleet and write its table, its alarms and its page into the results folder.

    Args:
        fleet: the estimates.
        say: progress.

    Returns:
        The judgement that was written.

    Raises:
        FleetError: a watched parameter was not estimated.
        FleetFolderError: the folder cannot be written to.
    """
    say = say or (lambda line: None)
    buffer = io.BytesIO()
    parameter_table(fleet).write_parquet(buffer)
    fleet.store.write(PARAMETERS, buffer.getvalue())
    say("testing for changes")
    judgement = judge(fleet)
    fleet.store.write(ALARMS, alarms_json(judgement))
    fleet.store.write(PAGE, render_page(judgement))
    return judgement


def alarms_json(judgement: Judgement) -> str:
    """Alarms with their level, as strict JSON: numbers that are not finite are null."""
    fleet, entry = judgement.fleet, judgement.fleet.template.fleet
    content: dict[str, Any] = {
        "schema": 1,
        "level": judgement.level,
        "promise": promise(judgement),
        "tests": judgement.tests,
        "robots": len(fleet.robots),
        "logs": len(fleet.logs),
        "failed": len(fleet.failures),
        "method": fleet.template.method_name,
        "baseline": entry.baseline,
        "baseline_records": entry.baseline_records,
        "alarms": [
            asdict(a)
            | {
                f"relative_{k}": v
                for k, v in zip(("change", "low", "high"), a.relative, strict=True)
            }
            for a in judgement.alarms
        ],
        "parameters": {
            w.parameter: {
                "unit": w.unit,
                "level": w.level,
                "scatter": b.scatter * b.typical_scale,
                "degrees": b.degrees,
                "temperature_per_unit": _rate(w.temperature),
                "wear_per": fleet.axis.unit,
                "wear": {robot: _rate(rate) for robot, rate in w.robots.items()},
            }
            for b, w in zip(judgement.baselines, judgement.wear, strict=True)
        },
        "notes": list(judgement.notes),
    }
    return json.dumps(plain(content), indent=1, allow_nan=False)


def _rate(rate: Rate | None) -> list[float] | None:
    """Value and interval."""
    return None if rate is None else [rate.value, rate.low, rate.high]
