"""Parts of drawings that several of them have: packed numbers, bands, legends."""

from __future__ import annotations

import numpy as np

from pivident.report.drawing_library import go

#: A legend in one row above the axes.
LEGEND = {"orientation": "h", "y": 1.02, "yanchor": "bottom"}


def packed(x: np.ndarray) -> np.ndarray:
    """Single precision: plotly writes it in 5 characters per number."""
    return np.asarray(x, dtype=np.float32)


def band(
    x: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    colour: str,
    *,
    opacity: float = 0.18,
    axis: str = "y",
) -> go.Scatter:
    """Filled between two curves; neither the legend nor the pointer shows it."""
    return go.Scatter(
        x=packed(np.concatenate([x, x[::-1]])),
        y=packed(np.concatenate([high, low[::-1]])),
        yaxis=axis,
        mode="lines",
        fill="toself",
        fillcolor=colour,
        opacity=opacity,
        line={"width": 0},
        hoverinfo="skip",
        showlegend=False,
    )
