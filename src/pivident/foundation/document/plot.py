"""Figures as a page shows them: colours, lines and axes; text and grid take the page's colours.

Drawings as plotly.js takes them: the packed library, bands, legends, packed numbers. plotly's own
classes check each attribute whenever one changes, which would take longer than the rest of a page.
What is gathered here is written as it is. The library that draws the figures is packed: it is two
thirds of a page otherwise.
"""

from __future__ import annotations

import base64
import hashlib
import json
import zlib
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pivident.foundation.document.curves import Curve, Curves
from pivident.foundation.extras import folder_of, require
from pivident.foundation.files import keep
from pivident.foundation.text.plain_values import plain

#: A curve, a row of bars, a map: its kind and attributes.
Trace = dict[str, Any]
#: A legend in one row above the axes.
LEGEND = {"orientation": "h", "y": 1.02, "yanchor": "bottom"}


class Plot:
    """Traces over a layout; their attributes are those of plotly.js.

    Attributes:
        data: the traces, the last on top.
        layout: axes, legend, shapes and the rest.
    """

    def __init__(self, *traces: Trace, **layout: Any) -> None:
        self.data: list[Trace] = [*traces]
        self.layout: dict[str, Any] = layout

    def add(self, kind: str = "scatter", **attributes: Any) -> None:
        """One more trace; see `trace`."""
        self.data.append(trace(kind, **attributes))

    def update(self, **layout: Any) -> None:
        """Change parts of the layout; dictionaries are merged, all else is replaced."""
        self.layout = _merged(self.layout, layout)

    def x_axis(self, title: str | None = None, **attributes: Any) -> None:
        """Change the first x axis."""
        self.update(xaxis=attributes | _titled(title))

    def y_axis(self, title: str | None = None, **attributes: Any) -> None:
        """Change the first y axis."""
        self.update(yaxis=attributes | _titled(title))

    def add_shape(self, kind: str, **attributes: Any) -> None:
        """A line or a rectangle in coordinates of the axes."""
        self.update(shapes=[*self.layout.get("shapes", []), {"type": kind} | attributes])

    def horizontal(self, y: float, line: Mapping[str, Any]) -> None:
        """A line from edge to edge."""
        self.add_shape("line", xref="paper", x0=0, x1=1, y0=y, y1=y, line=line)

    def vertical(self, x: float, line: Mapping[str, Any]) -> None:
        """A line from bottom to top."""
        self.add_shape("line", yref="paper", x0=x, x1=x, y0=0, y1=1, line=line)

    def stack(self, titles: Sequence[str], **attributes: Any) -> None:
        """Axes y, y2, … below each other, over one axis of time; attributes of each of them."""
        gap = 0.065
        height = (1.0 - gap * (len(titles) - 1)) / len(titles)
        axes: dict[str, Any] = {
            "xaxis": {"title": {"text": "time [s]"}, "anchor": f"y{len(titles)}"}
        }
        for k, title in enumerate(titles):
            top = 1.0 - (height + gap) * k
            axes[f"yaxis{k + 1 if k else ''}"] = {
                "domain": [max(top - height, 0.0), top],
                "title": {"text": title, "standoff": 4},
                **attributes,
            }
        self.update(**axes)

    def content(self) -> dict[str, Any]:
        """Traces and layout, arrays as plotly.js unpacks them."""
        return {"data": [_written(trace) for trace in self.data], "layout": self.layout}


def trace(kind: str = "scatter", **attributes: Any) -> Trace:
    """A curve, a row of bars, a map; attributes that are None keep their default."""
    return {"type": kind} | {name: x for name, x in attributes.items() if x is not None}


def packed(x: np.ndarray) -> np.ndarray:
    """Single precision: a page has it in 5 characters per number."""
    return np.asarray(x, dtype=np.float32)


def band(
    x: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    colour: str,
    *,
    opacity: float = 0.18,
    axis: str = "y",
) -> Trace:
    """Filled between two curves; neither the legend nor the pointer shows it."""
    return {
        "type": "scatter",
        "x": packed(np.concatenate([x, x[::-1]])),
        "y": packed(np.concatenate([high, low[::-1]])),
        "yaxis": axis,
        "mode": "lines",
        "fill": "toself",
        "fillcolor": colour,
        "opacity": opacity,
        "line": {"width": 0},
        "hoverinfo": "skip",
        "showlegend": False,
    }


def _titled(title: str | None) -> dict[str, Any]:
    """A title as attribute of an axis."""
    return {} if title is None else {"title": {"text": title}}


def _merged(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    """Both, the new one where they differ."""
    both = {
        name: _merged(old[name], value)
        for name, value in new.items()
        if isinstance(value, Mapping) and isinstance(old.get(name), Mapping)
    }
    return {**old, **new, **both}


def _written(value: Any) -> Any:
    """Arrays of numbers as bytes in base64, wherever a trace has them."""
    if isinstance(value, Mapping):
        return {name: _written(own) for name, own in value.items()}
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "if" or not value.size:
        return value
    kind = np.dtype("i4") if value.dtype.kind == "i" else value.dtype
    numbers = value.astype(kind.newbyteorder("<")).tobytes()
    written = {"dtype": kind.str[1:], "bdata": base64.b64encode(numbers).decode("ascii")}
    return written if value.ndim == 1 else written | {"shape": str(value.shape)[1:-1]}


def kept_samples(y: np.ndarray, points: int) -> np.ndarray:
    """Indices of the samples to draw: first, last, and minimum and maximum of equal stretches.

    Every peak stays at its place and height, which plain decimation does not promise. NaN is never
    an extreme.
    """
    if y.size <= points:
        return np.arange(y.size)
    edges = np.linspace(0, y.size, max(1, (points - 2) // 2) + 1).astype(np.int64)
    start, stop = edges[:-1, None], edges[1:, None]
    at = np.minimum(start + np.arange(np.diff(edges).max()), stop - 1)  # a row for each stretch
    unknown = np.isnan(y)
    low, high = (np.where(unknown, sign * np.inf, y)[at] for sign in (1.0, -1.0))
    kept = np.zeros(y.size, bool)
    kept[np.r_[0, -1, start[:, 0] + low.argmin(axis=1), start[:, 0] + high.argmax(axis=1)]] = True
    return np.flatnonzero(kept)


def stretches(mask: np.ndarray, t: np.ndarray, pixels: int = 500) -> list[tuple[float, float]]:
    """Times (from, to) where a mask holds, at the resolution of a drawing.

    A stretch shorter than one of so many pixels shows if it fills half of it.
    """
    count = min(pixels, mask.size)
    long, shorter = mask.size % count, mask.size // count  # the first ones are longer by a sample
    borders = np.r_[0, np.cumsum(np.where(np.arange(count) < long, shorter + 1, shorter))]
    filled = np.add.reduceat(mask.astype(np.int64), borders[:-1]) >= 0.5 * np.diff(borders)
    edges = np.flatnonzero(np.diff(np.r_[False, filled, False])).reshape(-1, 2)
    return [(float(t[borders[a]]), float(t[borders[b] - 1])) for a, b in edges]


def to_json(content: Mapping[str, Any]) -> str:
    """Traces and layout as plotly writes them: gaps are null, and nothing can end a script."""
    return json.dumps(plain(content), separators=(",", ":")).replace("/", "\\u002f")


def colour_scale(name: str) -> Any:
    """Colours of a map, each with its place from 0 to 1, by plotly's name of the scale."""
    scales = require("plotly.colors", extra="report", purpose="a page with figures")
    return scales.get_colorscale(name)


@dataclass(frozen=True)
class DrawingLibrary:
    """plotly.js as a page carries it; ``inflate.js`` unpacks it when the first figure wants it."""

    packed: str  # deflated (RFC 1951) UTF-8 text in base64
    size: int  # bytes of the text


def library_text() -> str:
    """plotly.js of the installed package; plotly, whose import takes as long as a page, is not."""
    folder = folder_of("plotly", extra="report", purpose="a page with figures")
    return (folder / "package_data" / "plotly.min.js").read_text(encoding="utf-8")


@cache
def drawing_library() -> DrawingLibrary:
    """plotly.js of the installed package."""
    text = library_text().encode("utf-8")
    return DrawingLibrary(deflated(text), len(text))


def deflated(text: bytes, folder: Path = Path(__file__).parent / "__pycache__") -> str:
    """A text deflated, in base64; found again by its digest, and made again where it is damaged."""
    kept = folder / f"{hashlib.sha256(text).hexdigest()}.deflated"
    with suppress(OSError):
        content = kept.read_bytes()
        digest, packed = content[:32], content[32:]
        if hashlib.sha256(packed).digest() == digest:
            return packed.decode("ascii")
    packer = zlib.compressobj(9, wbits=-zlib.MAX_WBITS)  # without header and checksum
    packed = base64.b64encode(packer.compress(text) + packer.flush())
    keep(kept, hashlib.sha256(packed).digest() + packed)
    return packed.decode("ascii")


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
