"""Figures as a page shows them: colours, lines and axes; text and grid take the page's colours."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pivident.foundation.document.curves import Curve, Curves
from pivident.foundation.document.plot import LEGEND, Plot, Trace, kept_samples, packed

#: Colours of the methods, and of the joints, on white; then they repeat. After Okabe and Ito
#: (2008), distinct for any colour vision; vermilion is kept for errors.
METHOD_COLOURS = (
    "#0072b2", "#b87a00", "#009e73", "#b5568f", "#2f8fc7", "#7a7430", "#6a51a3", "#8c564b",
    "#a6323e", "#3f7f3f",
)  # fmt: skip

MEASURED, ERROR, SHADE = "#7f8999", "#d55e00", "rgba(138, 147, 163, 0.22)"

#: What each of these colours becomes on a dark page.
DARK_COLOURS = {
    "#0072b2": "#4ba3dd",
    "#b87a00": "#e69f00",
    "#009e73": "#2fc79a",
    "#b5568f": "#e08fbf",
    "#2f8fc7": "#7cc7f2",
    "#7a7430": "#b9b25a",
    "#6a51a3": "#a894dd",
    "#8c564b": "#c9958b",
    "#a6323e": "#ec8f97",
    "#3f7f3f": "#8bcf8b",
    MEASURED: "#98a2b3",
    ERROR: "#ff8a3d",
}


#: Points of a trace.
POINTS = 3000


@dataclass(frozen=True)
class Figure:
    """A drawing with its words."""

    plot: Plot
    height: int  # height on the page [px]
    title: str  # what stands above it, plain text
    label: str  # the drawing in words, for those who do not see it
    note: str = ""  # what stands below it, plain text, may be empty
    #: where the x axis is time: whose. Figures of one recording show the same window.
    recording: str = ""
    start: float = 0.0  # instant at which that axis is zero, on the recording's clock [s]


def colour(method: int) -> str:
    """Colour of a method by its index."""
    return METHOD_COLOURS[method % len(METHOD_COLOURS)]


def drawn(
    curves: Curves, points: int = POINTS, recording: str = "log", zero: float | None = None
) -> Figure:
    """Curves as a figure of a page.

    Args:
        curves: the lines.
        points: of each of them.
        recording: whose time it is.
        zero: instant at which the axis is zero [s]; None: the first one.
    """
    zero = float(curves.t[0]) if zero is None else zero
    plot = empty_plot(curves.axis, "time [s]", traces_of(curves.t - zero, curves.curves, points))
    return Figure(plot, 250, curves.title, curves.label, curves.note, recording, zero)


def empty_plot(
    y_title: str,
    x_title: str | None = None,
    traces: Iterable[Trace] = (),
    *,
    x: Mapping[str, Any] | None = None,
    y: Mapping[str, Any] | None = None,
    legend: bool = False,
    **layout: Any,
) -> Plot:
    """Axes without decoration.

    Args:
        y_title: of the ordinate.
        x_title: of the abscissa; None: none.
        traces: what is drawn, the last on top.
        x: further attributes of the abscissa.
        y: further attributes of the ordinate.
        legend: whether there is one.
        layout: further parts of the layout.
    """
    plot = Plot(
        *traces,
        margin={"l": 58, "r": 12, "t": 8, "b": 42},
        showlegend=legend,
        hovermode="closest",
        xaxis={"automargin": False, "zeroline": False},
        yaxis={"title": {"text": y_title, "standoff": 4}, "zeroline": True},
    )
    plot.x_axis(x_title, **(x or {}))
    plot.update(yaxis=y or {}, **({"legend": LEGEND} | layout if legend else layout))
    return plot


def line(
    t: np.ndarray, y: np.ndarray, points: int, name: str, line_colour: str, *, width: float
) -> Trace:
    """A signal over time, with so many points."""
    kept = kept_samples(np.asarray(y, dtype=float), points)
    return {
        "type": "scatter",
        "x": packed(t[kept]),
        "y": packed(y[kept]),
        "mode": "lines",
        "name": name,
        "line": {"color": line_colour, "width": width},
    }


def traces_of(t: np.ndarray, curves: Sequence[Curve], points: int) -> list[Trace]:
    """Curves as lines in the colours of their roles."""
    shades = {"measured": MEASURED, "error": ERROR}
    return [
        line(t, one.values, points, one.name, shade, width=one.width)
        for one in curves
        for shade in [shades[one.role] if isinstance(one.role, str) else colour(one.role)]
    ]
