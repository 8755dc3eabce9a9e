"""Parameters with their intervals, of one result or of several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import aligned_rows, method_labels
from pivident.figures.paper_style import (
    MAX_HEIGHT,
    FigureError,
    line_style,
    new_figure,
    paper_style,
    plain,
)
from pivident.report.intervals import interval_drawing
from pivident.robot.naming import nearest

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Height of one parameter, and of each result beyond the first [inch].
_ROW, _FURTHER = 0.17, 0.07


def figure_of_intervals(
    results: Identification | Sequence[Identification],
    parameters: Sequence[str] | None = None,
    *,
    labels: Sequence[str] | None = None,
    truth: Mapping[str, float] | None = None,
    columns: int = 1,
) -> Figure:
    """Estimates ±2σ of every parameter, each on a scale of its own, with the numbers at its side.

    Parameters differ by orders of magnitude and by unit, so there is no common axis. One result is
    drawn against zero, several against each other; zero is a dotted and a known value a dashed mark
    where they lie on the scale. The numbers are those of the last result.

    Args:
        results: one or several of the same robot.
        parameters: names of those that are drawn, in this order; None: all.
        labels: names of the results; None: their methods.
        truth: known values by parameter name.
        columns: width, 1 or 2 columns of a page.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: an unknown parameter, or labels that do not fit.
    """
    many = [results] if isinstance(results, Identification) else list(results)
    labels = list(labels or method_labels(many))
    if len(labels) != len(many) or not many:
        raise FigureError(f"there are {len(labels)} labels for {len(many)} results")
    table = aligned_rows(many, truth)
    for name in parameters or ():
        if name not in table:
            raise FigureError(f"there is no parameter {name!r}; {nearest(name, table)}")
    names = list(parameters or table)
    height = min(len(names) * (_ROW + _FURTHER * (len(many) - 1)) + 0.3, MAX_HEIGHT - 0.35)
    with paper_style():
        figure, (ax,) = new_figure(1, columns=columns, row_height=height)
        step = 0.7 / len(many)
        texts = []
        for row, name in enumerate(names):
            drawing = interval_drawing(table[name], labels, with_zero=len(many) == 1)
            for place, dashes in ((drawing.zero, ":"), (drawing.truth, "--")):
                if place is not None:
                    ax.plot([place] * 2, [row - 0.45, row + 0.45], dashes, color="#777777", lw=0.7)
            for i in drawing.intervals:
                y = row + (i.method - (len(many) - 1) / 2) * step
                style = line_style(i.method, marker=True)
                ax.plot([i.left, i.right], [y, y], color=style["color"], lw=1.1)
                ax.plot(
                    i.middle, y, ls="none", marker=style["marker"], color=style["color"], ms=2.8
                )
            last = [r for r in table[name] if r is not None][-1]
            texts.append(last.in_words)
        ax.set_ylim(len(names) - 0.4, -0.6)
        ax.set_xlim(0.0, 100.0)
        ax.set_xticks([])
        ax.set_yticks(range(len(names)), [plain(name) for name in names])
        ax.grid(visible=False)
        side = ax.twinx()
        side.set_ylim(ax.get_ylim())
        side.set_yticks(range(len(names)), texts)
        for both in (ax, side):
            both.tick_params(length=0)
            for spine in both.spines.values():
                spine.set_visible(False)
        if len(many) > 1:
            for k, label in enumerate(labels):
                style = line_style(k, marker=True)
                ax.plot([], [], marker=style["marker"], color=style["color"], label=plain(label))
            figure.legend(loc="outside upper center", ncols=min(len(many), 4))
    return figure
