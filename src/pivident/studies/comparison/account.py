"""A comparison as files: a page, a table for sheets, strict JSON, and a table for LaTeX.

A comparison as one HTML page that needs nothing else, in the look of the report.
"""

from __future__ import annotations

import html
import math
from os import PathLike
from typing import Any

import numpy as np
from markupsafe import Markup

from pivident.foundation.document.plot import (
    LEGEND,
    Figure,
    Trace,
    band,
    colour,
    empty_plot,
    packed,
)
from pivident.foundation.document.table import Table
from pivident.foundation.files import atomic_folder
from pivident.foundation.text.identifiers import latex_name, latex_text, one_line
from pivident.foundation.text.numbers import (
    format_significant,
    latex_number,
    latex_unit,
    with_spread,
)
from pivident.foundation.text.plain_values import json_of_entries, plain
from pivident.foundation.version import __version__
from pivident.judgement.report.builder import page_environment, page_of
from pivident.judgement.report.intervals import Interval, IntervalDrawing
from pivident.studies.comparison.compared_results import (
    ComparedParameter,
    ComparedResults,
    Difference,
    Estimate,
)
from pivident.studies.comparison.friction_curves import FrictionCurve, JointFriction
from pivident.studies.comparison.remarks import findings, level_sentence, rows_text, share_text
from pivident.studies.comparison.side_by_side import (
    difference_text,
    estimate_text,
    format_z,
    pair_columns,
    value_columns,
)

#: Version of the layout of ``comparison.json``.
SCHEMA = 1
#: Names of the files.
PAGE, TABLE, JSON, LATEX = (f"comparison.{kind}" for kind in ("html", "csv", "json", "tex"))
#: Columns of a difference, which is from the first result. Ends of intervals are at 2σ.
_OF_DIFFERENCE = (
    "difference", "difference_low", "difference_high", "relative_percent", "z", "p_value",
    "p_adjusted", "significant",
)  # fmt: skip
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
    environment = page_environment("pivident.studies.comparison")
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
    sections = [
        (key, heading, Markup(environment.get_template(f"compare_{key}.html").render(content)))
        for key, heading in HEADINGS.items()
        if shown.get(key, True)
    ]
    robots = ", ".join(dict.fromkeys(e.robot.name for e in comparison.entries))
    return page_of(environment, f"{robots}: {len(comparison.entries)} results compared", sections)


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

    intervals = [
        Interval(k, place(e.value, e.value), place(e.low, e.value), place(e.high, e.value))
        for k, e in present
    ]
    words = "; ".join(f"{comparison.labels[k]} {estimate_text(e)} {p.unit}" for k, e in present)
    return IntervalDrawing(
        intervals=tuple(intervals),
        zero=place(0.0, 0.0) if low <= 0.0 <= high else None,
        truth=None,
        low=with_spread(low, extent / 10.0)[0],
        high=with_spread(high, extent / 10.0)[0],
        label=f"{p.name}: {words}",
    )


def save_comparison(comparison: ComparedResults, folder: str | PathLike[str]) -> None:
    """Write page, table, JSON and LaTeX into a folder, all or nothing."""
    texts = {
        PAGE: render_page(comparison),
        TABLE: comparison_table(comparison).to_csv(),
        JSON: json_of_entries(to_values(comparison)),
        LATEX: to_latex(comparison),
    }
    with atomic_folder(folder) as build:
        for name, text in texts.items():
            (build / name).write_text(text, encoding="utf-8", errors="backslashreplace")


def comparison_table(comparison: ComparedResults) -> Table:
    """One row for each parameter and result that has it, with the difference from the first."""
    rows = [
        {"parameter": p.name, "unit": p.unit, "group": p.expression, "result": label}
        | {"value": estimate.value, "low": estimate.low, "high": estimate.high}
        | _difference_values(comparison, found)
        for p in comparison.parameters
        for label, estimate, found in zip(
            comparison.labels, p.estimates, p.differences, strict=True
        )
        if estimate is not None
    ]
    meanings = {
        "low": "lower end of the interval, at 2σ",
        "high": "upper end",
        "difference": "from the first result",
        "p_adjusted": "after Holm, among all differences of the comparison",
    }
    return Table.of_rows("parameters", rows, meanings)


def to_values(comparison: ComparedResults) -> dict[str, Any]:
    """The comparison as plain values, ready for JSON."""
    content = {
        "schema": SCHEMA,
        "version": __version__,
        "level": comparison.alpha,
        "tests": comparison.tests,
        "correction": "Holm",
        "interval": "2 sigma",
        "one_machine": comparison.one_machine,
        "results": [
            {
                "label": entry.label,
                "kind": entry.kind,
                "method": entry.method,
                "robot": entry.robot.name,
                "parameters": len(entry.names),
                "left_out": entry.left_out,
                "relative_error": entry.relative_error,
                "condition": entry.condition,
                "rows": entry.samples,
                "converged": entry.converged,
                "may_share_record_with_first": same,
                "version": entry.version,
                "inputs": entry.inputs,
                "source": entry.source,
            }
            for entry, same in zip(comparison.entries, comparison.same_record, strict=True)
        ],
        "parameters": [_parameter_values(comparison, p) for p in comparison.parameters],
        "torques": [
            {
                "record_of": comparison.labels[t.record],
                "relative_error": dict(zip(comparison.labels, t.error.tolist(), strict=True)),
                "relative_difference": dict(zip(comparison.labels, t.apart.tolist(), strict=True)),
            }
            for t in comparison.torques
        ],
        "friction": [
            {
                "joint": joint.name,
                "speed_unit": joint.speed_unit,
                "torque_unit": joint.torque_unit,
                "speed": joint.speed,
                "curves": [
                    {
                        "result": comparison.labels[c.entry],
                        "torque": c.torque,
                        "std": c.std,
                        "left_out": c.left_out,
                    }
                    for c in joint.curves
                ],
            }
            for joint in comparison.friction
        ],
        "findings": findings(comparison),
        "notes": [level_sentence(comparison), *comparison.notes],
    }
    return {key: plain(value) for key, value in content.items()}


def to_latex(comparison: ComparedResults) -> str:
    r"""A booktabs table: every parameter with ±2σ in each result, to be read in by ``\input``."""
    labels, entries = [latex_text(one_line(x)) for x in comparison.labels], comparison.entries
    values, heads = value_columns(comparison), labels
    if len(labels) == 2:
        values, heads = pair_columns(comparison), [*labels, "Difference", "$z$"]
    rows = [
        [f"${latex_name(one_line(p.name))}$", latex_unit(p.unit), *map(_latex_cell, cells)]
        for p, *cells in zip(comparison.parameters, *(own for _, _, own in values), strict=True)
    ]
    errors = [
        "--"
        if math.isnan(e.relative_error)
        else rf"{latex_number(format_significant(100.0 * e.relative_error, 2))}\,\%"
        for e in entries
    ]
    conditions = [latex_number(format_significant(e.condition)) for e in entries]
    blank = [""] * (len(heads) - len(labels))
    below = [
        ["Torque error", "", *errors, *blank],
        ["Condition number", "", *conditions, *blank],
    ]
    return "\n".join(
        [
            "% " + one_line(f"Comparison of {', '.join(comparison.labels)}."),
            r"% In the preamble: \usepackage{amsmath,booktabs}",
            rf"\begin{{tabular}}{{ll{'r' * len(heads)}}}",
            r"\toprule",
            " & ".join(["Parameter", "Unit", *heads]) + r" \\",
            r"\midrule",
            *(" & ".join(row) + r" \\" for row in rows),
            r"\midrule",
            *(" & ".join(row) + r" \\" for row in below),
            r"\bottomrule",
            r"\end{tabular}",
            "% Values and differences with 2 sigma. " + one_line(level_sentence(comparison)),
            *(f"% {one_line(note)}" for note in comparison.notes),
            "",
        ]
    )


def _latex_cell(text: str) -> str:
    """``0.12±0.01 *`` with exponents set as powers of ten and a mark that takes no room."""
    number, mark, _ = text.partition(" *")
    value, _, spread = number.strip().partition("±")
    shown = latex_number(value if spread else value.removeprefix("+"))
    shown += f" $\\pm$ {latex_number(spread)}" if spread else ""
    return shown + r"\rlap{*}" * bool(mark)


def _parameter_values(comparison: ComparedResults, p: ComparedParameter) -> dict[str, Any]:
    return {
        "name": p.name,
        "unit": p.unit,
        "group": p.expression,
        "estimates": {
            label: None if e is None else _estimate_values(e)
            for label, e in zip(comparison.labels, p.estimates, strict=True)
        },
        "differences": {
            label: None if d is None else _difference_values(comparison, d)
            for label, d in zip(comparison.labels[1:], p.differences[1:], strict=True)
        },
    }


def _estimate_values(estimate: Estimate) -> dict[str, Any]:
    return {
        "value": estimate.value,
        "low": estimate.low,
        "high": estimate.high,
        "from_groups": estimate.from_groups,
    }


def _difference_values(comparison: ComparedResults, found: Difference | None) -> dict[str, Any]:
    if found is None:
        return dict.fromkeys(_OF_DIFFERENCE)
    values = (found.value, found.low, found.high, found.relative, found.z, found.p_value)
    marked = comparison.is_marked(found)
    return dict(zip(_OF_DIFFERENCE, (*values, found.p_adjusted, marked), strict=True))
