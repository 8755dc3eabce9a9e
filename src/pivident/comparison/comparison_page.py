"""A comparison as one HTML page that needs nothing else, in the look of the report."""

from __future__ import annotations

import html
import math
from typing import Any

import numpy as np
from markupsafe import Markup

from pivident.comparison.compared_results import ComparedParameter, ComparedResults
from pivident.comparison.comparison_text import difference_text, estimate_text, format_z
from pivident.comparison.friction_curves import FrictionCurve, JointFriction
from pivident.comparison.remarks import findings, level_sentence, rows_text, share_text
from pivident.report.builder import page_environment, page_of
from pivident.report.intervals import Interval, IntervalDrawing
from pivident.report.plot_parts import LEGEND, Trace, band, packed
from pivident.report.plotly_figures import Figure, colour, empty_plot
from pivident.text.numbers import with_spread

HEADINGS = {
    "glance": "At a glance",
    "parameters": "Parameters",
    "intervals": "Intervals",
    "friction": "Friction",
    "torque": "Torque",
    "provenance": "Provenance",
}

#: Free space left and right of a drawing of intervals [% of its width].
_MARGIN = 6.0

#: Dashes that distinguish curves without colour.
DASHES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot")


def render_page(comparison: ComparedResults) -> str:
    """The page as text."""
    environment = page_environment("pivident.comparison")
    environment.globals |= {
        "estimate_text": estimate_text,
        "difference_text": difference_text,
        "format_z": format_z,
        "share_text": share_text,
        "rows_text": rows_text,
    }
    content: dict[str, Any] = {
        "comparison": comparison,
        "entries": comparison.entries,
        "labels": comparison.labels,
        "findings": findings(comparison),
        "level_sentence": level_sentence(comparison),
        "drawings": [(p, interval_drawing(comparison, p)) for p in comparison.parameters],
        "figures": [friction_figure(comparison, joint) for joint in comparison.friction],
        "unrated": [joint.name for joint in comparison.friction if not joint.rated],
    }
    shown = {"friction": content["figures"], "torque": comparison.torques}
    sections = []
    for key, heading in HEADINGS.items():
        if shown.get(key, True):
            body = environment.get_template(f"compare_{key}.html").render(content)
            sections.append((key, heading, Markup(body)))
    robots = ", ".join(dict.fromkeys(e.robot.name for e in comparison.entries))
    title = f"{robots}: {len(comparison.entries)} results compared"
    return page_of(environment, title, sections)


def friction_figure(comparison: ComparedResults, joint: JointFriction) -> Figure:
    """Friction against speed of one joint by all results, each with its ±2σ band."""
    quantity = "force" if joint.torque_unit == "N" else "torque"
    plot = empty_plot(f"friction {quantity} [{joint.torque_unit}]")
    plot.x_axis(f"speed [{joint.speed_unit}]")
    for curve in joint.curves:
        plot.data += _band_and_line(comparison, joint, curve)
    plot.update(showlegend=True, legend=LEGEND)
    missing = [
        f"{comparison.labels[c.entry]} without {', '.join(c.left_out)}"
        for c in joint.curves
        if c.left_out
    ]
    names = ", ".join(comparison.labels[c.entry] for c in joint.curves)
    ends = f"{joint.speed[0]:.3g} to {joint.speed[-1]:.3g} {joint.speed_unit}"
    return Figure(
        plot,
        height=300,
        title=joint.name,
        label=f"Friction of {joint.name} from {ends} by {names}, with bands of 2σ",
        note=f"Not a function of speed alone, or left out: {'; '.join(missing)}" if missing else "",
    )


def _band_and_line(
    comparison: ComparedResults, joint: JointFriction, curve: FrictionCurve
) -> list[Trace]:
    """One result's curve over its band; the band stays out where there is none."""
    own, traces = colour(curve.entry), []
    if np.isfinite(curve.std).all():
        upper, lower = curve.torque + 2.0 * curve.std, curve.torque - 2.0 * curve.std
        traces.append(band(joint.speed, lower, upper, own))
    traces.append(
        {
            "type": "scatter",
            "x": packed(joint.speed),
            "y": packed(curve.torque),
            "mode": "lines",
            "line": {"color": own, "width": 1.8, "dash": DASHES[curve.entry % len(DASHES)]},
            "name": html.escape(comparison.labels[curve.entry], quote=False),
        }
    )
    return traces


def interval_drawing(comparison: ComparedResults, p: ComparedParameter) -> IntervalDrawing:
    """The intervals of one parameter on a common scale; ends that nothing bounds reach its edge."""
    present = [(k, e) for k, e in enumerate(p.estimates) if e is not None]
    ends = [x for _, e in present for x in (e.low, e.value, e.high) if math.isfinite(x)]
    low, high = min(ends), max(ends)
    extent = (high - low) or abs(high) or 1.0

    def place(x: float, unknown: float) -> float:
        x = unknown if math.isnan(x) else min(max(x, low), high)
        return round(_MARGIN + (100.0 - 2.0 * _MARGIN) * (x - low) / extent, 2)

    intervals = []
    for k, e in present:
        middle = place(e.value, e.value)
        left, right = place(e.low, e.value), place(e.high, e.value)
        intervals.append(Interval(k, middle, left, right, middle, middle))
    words = "; ".join(f"{comparison.labels[k]} {estimate_text(e)} {p.unit}" for k, e in present)
    return IntervalDrawing(
        intervals=tuple(intervals),
        zero=place(0.0, 0.0) if low <= 0.0 <= high else None,
        truth=None,
        low=with_spread(low, extent / 10.0)[0],
        high=with_spread(high, extent / 10.0)[0],
        label=f"{p.name}: {words}",
    )
