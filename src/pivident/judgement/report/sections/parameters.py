"""Estimates of all parameters and what they depend on, compared with each other and by joint."""

from __future__ import annotations

import html
import math
from functools import cached_property
from typing import Any

import numpy as np

from pivident.estimation.parameter_rows import (
    CONTRADICTION,
    aligned_rows,
    largest_difference,
    parameter_rows,
    range_texts,
)
from pivident.estimation.summary import name_lines, range_line
from pivident.foundation.document.plot import Figure, empty_plot
from pivident.judgement.report.intervals import interval_drawing
from pivident.judgement.report.sections.base import Section
from pivident.judgement.validation.parameter_correlation import (
    STRONG_CORRELATION,
    ParameterCorrelation,
    parameter_correlation,
)


class ComparisonSection(Section):
    """Value and relative σ of each method, largest difference in combined σ."""

    title = "Methods compared"
    anchor = "comparison"

    @property
    def applies(self) -> bool:
        """Only with several methods."""
        return self.data.several

    def context(self) -> dict[str, Any]:
        """One entry per parameter with its rows, difference and drawing."""
        labels = self.data.labels
        entries: list[dict[str, Any]] = []
        for name, rows in aligned_rows(self.data.identifications, self.data.truth).items():
            distance, i, j = largest_difference(rows)
            entries.append(
                {
                    "name": name,
                    "rows": rows,
                    "any": next(row for row in rows if row is not None),
                    "distance": distance,
                    "pair": f"{labels[i]} – {labels[j]}",
                    "contradicts": distance > CONTRADICTION,
                    "drawing": interval_drawing(
                        rows,
                        labels,
                        with_zero=False,
                        consistent=self.data.consistent.get(name, ()),
                        nominal=self.data.nominal.get(name, math.nan),
                    ),
                }
            )
        return {
            "labels": labels,
            "consistent": sorted(
                {(c.method, c.label) for own in self.data.consistent.values() for c in own}
            ),
            "nominal": any(entry["drawing"].nominal is not None for entry in entries),
            "entries": entries,
            "truth": bool(self.data.truth),
            "contradiction": CONTRADICTION,
        }


#: Blue for -1, almost nothing for 0, orange for 1, on white as on black.
_SCALE = [[0.0, "#2f7fd1"], [0.5, "rgba(138, 147, 163, 0.12)"], [1.0, "#e07b00"]]

#: Pairs that the words list.
_LISTED = 5

#: Size of the names [px] up to so many parameters, and beyond.
_FONTS, _SMALLEST_FONT = ((20, 11), (40, 9)), 8

#: Size of a cell and of the rest [px].
_CELL, _REST, _SMALLEST, _LARGEST = 13, 120, 300, 780


def correlation_figure(correlation: ParameterCorrelation) -> Figure:
    """Parameters against parameters, colour for ρ."""
    names = [html.escape(name, quote=False) for name in correlation.names]
    matrix = correlation.matrix.copy()
    np.fill_diagonal(matrix, np.nan)
    plot = empty_plot("")
    plot.add(
        "heatmap",
        z=np.round(matrix, 3).astype(np.float32),
        x=names,
        y=names,
        zmin=-1,
        zmax=1,
        colorscale=_SCALE,
        colorbar={"title": {"text": "ρ"}, "thickness": 12, "len": 0.6},
        hovertemplate="%{y} and %{x}: ρ = %{z:.2f}<extra></extra>",
        hoverongaps=False,
    )
    size = next((size for most, size in _FONTS if len(names) <= most), _SMALLEST_FONT)
    ticks = {"dtick": 1, "tickfont": {"size": size}, "automargin": True, "showgrid": False}
    plot.update(xaxis={"tickangle": -90} | ticks, yaxis={"autorange": "reversed"} | ticks)
    pairs = correlation.largest(_LISTED)
    listed = ", ".join(f"{a} and {b} {rho:+.2f}" for a, b, rho in pairs)
    strong = f"{correlation.strong} pair{'s' if correlation.strong != 1 else ''}"
    note = f"largest: {listed}; {strong} with |ρ| of {STRONG_CORRELATION:g} or more"
    return Figure(
        plot,
        height=int(np.clip(_REST + _CELL * len(names), _SMALLEST, _LARGEST)),
        title="Correlations of the estimates",
        label=f"Map of the correlations between {len(names)} parameters: {note}",
        note=note,
    )


class ParametersSection(Section):
    """One table per method."""

    title = "Parameters"
    anchor = "parameters"

    def context(self) -> dict[str, Any]:
        """Rows and drawings of each method."""
        data = self.data
        methods = list(data.diagnostics.identifications)
        tables = []
        for k, (label, identification) in enumerate(
            zip(data.labels, data.identifications, strict=True)
        ):
            rows = parameter_rows(identification, data.truth)
            ranges = data.diagnostics.ranges.get(methods[k], ())
            others = [None] * k
            drawings = [
                interval_drawing(
                    [*others, row],
                    data.labels,
                    with_zero=True,
                    consistent=[c for c in data.consistent.get(row.name, ()) if c.method == k],
                )
                for row in rows
            ]
            tables.append(
                {
                    "label": label,
                    "method": k,
                    "opened": self.opened(k),
                    "rows": list(
                        zip(rows, drawings, range_texts(identification.names, ranges), strict=True)
                    ),
                    "range_line": range_line(ranges),
                }
            )
        held = any(i.simulation is not None and i.simulation.held for i in data.identifications)
        return {
            "tables": tables,
            "truth": bool(data.truth),
            "several": data.several,
            "held": held,
            "name_lines": name_lines(data.identifications),
        }


class CorrelationSection(Section):
    """One map per method."""

    title = "Correlations of the parameters"
    anchor = "correlations"

    @cached_property
    def correlations(self) -> tuple[ParameterCorrelation | None, ...]:
        """Of each result, None where its standard errors are not known."""
        return tuple(parameter_correlation(i) for i in self.data.identifications)

    @property
    def applies(self) -> bool:
        """Only where standard errors are known."""
        return any(own is not None for own in self.correlations)

    def context(self) -> dict[str, Any]:
        """One gallery per method."""
        return {
            "galleries": [
                self.gallery(k, correlation_figure(own))
                for k, own in enumerate(self.correlations)
                if own is not None
            ],
            "several": self.data.several,
            "strong": STRONG_CORRELATION,
        }


class JointsSection(Section):
    """One row per joint and method."""

    title = "Fit of each joint"
    anchor = "joints"

    def context(self) -> dict[str, Any]:
        """Joint fits with the unit of their positions."""
        data = self.data
        return {
            "tables": [
                (
                    label,
                    k,
                    [
                        (fit, joint.position_unit)
                        for fit, joint in zip(
                            identification.joints, identification.robot.joints, strict=True
                        )
                    ],
                    identification.relative_error,
                )
                for k, (label, identification) in enumerate(
                    zip(data.labels, data.identifications, strict=True)
                )
            ],
            "several": data.several,
            "fitted": data.fitted,
        }
