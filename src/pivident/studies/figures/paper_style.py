"""What all figures for papers have in common: sizes, fonts, lines, panels of joints, files.

Figures with a panel for each joint: which joints of which recording, traces and legend.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.foundation.document.curves import Curves
from pivident.foundation.document.plot import kept_samples
from pivident.foundation.errors import PividentError
from pivident.foundation.extras import require
from pivident.foundation.files import atomic_folder
from pivident.foundation.text.identifiers import escaped
from pivident.robot.naming import nearest

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pivident.estimation.identification import FittedRecording, Identification

    #: Axes of the caller, one for each panel; None: a figure of its own.
    Panels = Axes | Sequence[Axes] | np.ndarray | None

#: Width of one and of two columns [inch], as journals of control and robotics print them.
WIDTHS = {1: 3.5, 2: 7.16}
#: Tallest figure, a page's height [inch].
MAX_HEIGHT = 9.2
#: Colours that remain apart with every common colour blindness (Okabe and Ito 2008), in an order of
#: different lightness, each with a dash and a marker of its own.
LINES: tuple[dict[str, Any], ...] = (
    {"color": "#000000", "linestyle": "-", "marker": "o"},
    {"color": "#0072B2", "linestyle": (0, (5, 1.5)), "marker": "s"},
    {"color": "#E69F00", "linestyle": (0, (1, 1)), "marker": "^"},
    {"color": "#D55E00", "linestyle": (0, (4, 1.5, 1, 1.5)), "marker": "D"},
    {"color": "#56B4E9", "linestyle": (0, (8, 2)), "marker": "v"},
    {"color": "#009E73", "linestyle": (0, (2, 2)), "marker": "P"},
)
MEASURED, ERROR = "#9a9a9a", "#D55E00"
#: Type 42 embeds whole outline fonts, as publishers ask for; SVG text becomes outlines.
STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 7.5,
    "axes.titlesize": 8.0,
    "axes.labelsize": 7.5,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 5),
    "axes.formatter.use_mathtext": True,
    "grid.color": "#d9d9d9",
    "grid.linewidth": 0.4,
    "lines.linewidth": 1.0,
    "lines.markersize": 3.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.fontsize": 7.0,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "pdf.fonttype": 42,
    "ps.fonttype": 42,
    "svg.fonttype": "path",
    "svg.hashsalt": "pivident",
    "savefig.dpi": 300,
}
#: Kinds of files that figures are saved as.
KINDS = (".pdf", ".svg", ".png", ".eps")
#: Points of a trace; more than a printed column resolves.
POINTS = 2400


class FigureError(PividentError, ValueError):
    """A figure that cannot be drawn from what there is, or saved as that kind of file."""


@contextmanager
def paper_style(ax: Panels = None) -> Iterator[None]:
    """The style within the context only; the caller's settings come back, and hold for ``ax``."""
    matplotlib = require("matplotlib", extra="figures", purpose="a figure for papers")
    with matplotlib.rc_context(STYLE if ax is None else {}):
        yield


def new_figure(
    rows: int,
    across: int = 1,
    *,
    columns: int = 1,
    row_height: float = 1.5,
    share_x: bool = False,
    ax: Panels = None,
) -> tuple[Figure, list[Axes]]:
    """A figure with a grid of axes, in order of reading; the caller's where ``ax`` is given."""
    if ax is not None:
        return _figure_of(ax, rows * across)
    if columns not in WIDTHS:
        raise FigureError(
            f"columns is {columns!r}", advice="figures have the width of 1 or 2 columns"
        )
    size = (WIDTHS[columns], min(rows * row_height + 0.35, MAX_HEIGHT))
    drawing = require("matplotlib.figure", extra="figures", purpose="a figure for papers")
    figure = drawing.Figure(figsize=size, layout="constrained")
    return figure, list(figure.subplots(rows, across, squeeze=False, sharex=share_x).ravel())


def _figure_of(ax: Panels, count: int) -> tuple[Figure, list[Axes]]:
    """The caller's axes, as many as there are panels, and their figure."""
    axes: list[Axes] = list(np.ravel(np.asarray(ax, dtype=object)))
    if len(axes) != count or not all(hasattr(each, "plot") for each in axes):
        raise FigureError(
            f"{len(axes)} axes are given for {count} panel{'s' * (count != 1)}",
            advice="give one for each, in order of reading, such as "
            f"figure.subplots({count}), or choose joints",
        )
    figure: Any = axes[0].get_figure()
    return figure, axes


def line_style(k: int, marker: bool = False) -> dict[str, Any]:
    """Colour, dash and marker of the k-th line."""
    style = dict(LINES[k % len(LINES)])
    if not marker:
        del style["marker"]
    return style


def plain(text: str) -> str:
    """A name as text: matplotlib would set what stands between dollars as mathematics."""
    return escaped(text).replace("$", r"\$")


def save_figure(figure: Figure, *paths: str | PathLike[str]) -> tuple[Path, ...]:
    """Save a figure with its fonts embedded, as PDF, SVG, PNG (300 dpi) or EPS by the file's name.

    Args:
        figure: the figure.
        paths: files to write.

    Returns:
        The files.

    Raises:
        FigureError: a kind of file that figures are not saved as.
        PividentError: a file cannot be written.
    """
    targets = tuple(Path(path) for path in paths)
    for target in targets:
        if target.suffix.lower() not in KINDS:
            raise FigureError(
                f"{target.name}: figures are saved as {', '.join(KINDS)}", advice="end the name so"
            )
    undated = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
    with paper_style():
        for target in targets:
            kind = target.suffix.lower()
            with atomic_folder(target.parent) as build:
                figure.savefig(build / target.name, format=kind[1:], metadata=undated.get(kind))
    return targets


def chosen_joints(result: Identification, joints: Sequence[str | int] | None) -> list[int]:
    """Indices of joints of a result by name or by number from 1; all without any."""
    return joints_named(result.robot.joint_names, joints)


def joints_named(known: Sequence[str], joints: Sequence[str | int] | None) -> list[int]:
    """Indices among the known joints by name or by number from 1; all without any."""
    names = list(known)
    if joints is None:
        return list(range(len(names)))
    if isinstance(joints, str | int):
        joints = [joints]
    found = []
    for joint in joints:
        if isinstance(joint, int) and 1 <= joint <= len(names):
            found.append(joint - 1)
        elif joint in names:
            found.append(names.index(str(joint)))
        else:
            raise FigureError(
                f"there is no joint {joint!r}",
                advice=f"{nearest(str(joint), names)}; numbers count from 1",
            )
    return found


def chosen_recording(result: Identification, recording: str | int) -> FittedRecording:
    """One recording by its name or its index from 0."""
    if not result.recordings:
        raise FigureError(
            "the identification holds no signals, as after reading it from a file",
            advice="identify again",
        )
    names = [r.name for r in result.recordings]
    if isinstance(recording, int) and 0 <= recording < len(names):
        return result.recordings[recording]
    if recording in names:
        return result.recordings[names.index(str(recording))]
    raise FigureError(
        f"there is no recording {recording!r}", advice=f"there are {', '.join(names)}"
    )


def chosen_signals(
    result: Identification, joints: Sequence[str | int] | None, recording: str | int = 0
) -> tuple[list[int], FittedRecording, np.ndarray]:
    """Indices of joints, a recording, and its time from zero on [s], shape (samples,).

    Joints are names or numbers from 1, all without; a recording is a name or an index from 0.
    """
    chosen, record = chosen_joints(result, joints), chosen_recording(result, recording)
    return chosen, record, record.t - record.t[0]


def joint_panels(
    count: int, *, columns: int, row_height: float = 1.5, xlabel: str = "", ax: Panels = None
) -> tuple[Figure, list[Axes]]:
    """A figure with so many panels, one or two in a row, and no others visible."""
    if ax is not None:
        figure, axes = _figure_of(ax, count)
        for each in axes if xlabel else ():
            each.set_xlabel(xlabel)
        return figure, axes
    across = min(count, 1 if columns == 1 else 2)
    figure, axes = new_figure(
        math.ceil(count / across), across, columns=columns, row_height=row_height
    )
    for each in axes[count:]:
        each.set_visible(False)
    for each in axes[max(count - across, 0) : count]:
        each.set_xlabel(xlabel)
    return figure, axes[:count]


def draw_trace(ax: Axes, t: np.ndarray, y: np.ndarray, **style: Any) -> None:
    """Draw a signal by at most ``POINTS`` of its samples, every peak among them."""
    kept = kept_samples(np.asarray(y, dtype=float), POINTS)
    ax.plot(t[kept], y[kept], **style)


def draw_curves(ax: Axes, curves: Curves, looks: Mapping[str | int, Mapping[str, Any]]) -> None:
    """Draw curves over time, each in the look of its role."""
    t = curves.t - curves.t[0]
    for curve in curves.curves:
        draw_trace(ax, t, curve.values, label=curve.name, **looks[curve.role])
    ax.set(ylabel=curves.axis, xlim=(0.0, float(t[-1])))


def legend_above(figure: Figure, first: Axes, across: int, ax: Panels = None) -> None:
    """One legend for all panels, above them; in the first of the caller's axes."""
    if ax is not None:
        first.legend()
        return
    handles, names = first.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=across)
