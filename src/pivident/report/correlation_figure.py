"""Map of the correlations between the estimates of all parameters."""

from __future__ import annotations

import html

import numpy as np

from pivident.report.plotly_figures import Figure, empty_plot
from pivident.validation.parameter_correlation import STRONG_CORRELATION, ParameterCorrelation

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
