"""Figures of a fleet: drift of all robots, and the chart of one parameter of one robot."""

from __future__ import annotations

import html
from collections.abc import Sequence

import numpy as np

from pivident.many.fleet.control_chart import Chart
from pivident.many.fleet.judgement import Judgement
from pivident.report.plot_parts import LEGEND, Plot
from pivident.report.plotly_figures import ERROR, MEASURED, SHADE, Figure, colour, empty_plot

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
