"""Estimates with their intervals and correlations, and how the iteration came to them.

Friction against speed, of one result or of several.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import aligned_rows, method_labels
from pivident.foundation.errors import require_known
from pivident.judgement.report.intervals import interval_drawing
from pivident.studies.comparison.entry import entry_of
from pivident.studies.comparison.friction_curves import friction_curves
from pivident.studies.comparison.groups import difference_of_geometry
from pivident.studies.figures.paper_style import (
    MAX_HEIGHT,
    FigureError,
    chosen_joints,
    joint_panels,
    legend_above,
    line_style,
    new_figure,
    paper_style,
    plain,
)

if TYPE_CHECKING:
    from pivident.studies.figures.paper_style import Figure, Panels

#: Height of one parameter, and of each result beyond the first [inch].
_ROW, _FURTHER = 0.17, 0.07


def figure_of_intervals(
    results: Identification | Sequence[Identification],
    parameters: Sequence[str] | None = None,
    *,
    labels: Sequence[str] | None = None,
    truth: Mapping[str, float] | None = None,
    columns: int = 1,
    ax: Panels = None,
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
        ax: axes to draw into, one for each panel in order of reading; None: a new figure.

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
        require_known(name, table, f"there is no parameter {name!r}", FigureError)
    names = list(parameters or table)
    height = min(len(names) * (_ROW + _FURTHER * (len(many) - 1)) + 0.3, MAX_HEIGHT - 0.35)
    with paper_style(ax):
        figure, (panel,) = new_figure(1, columns=columns, ax=ax, row_height=height)
        step = 0.7 / len(many)
        texts = []
        for row, name in enumerate(names):
            drawing = interval_drawing(table[name], labels, with_zero=len(many) == 1)
            for place, dashes in ((drawing.zero, ":"), (drawing.truth, "--")):
                if place is not None:
                    panel.plot(
                        [place] * 2, [row - 0.45, row + 0.45], dashes, color="#777777", lw=0.7
                    )
            for i in drawing.intervals:
                y = row + (i.method - (len(many) - 1) / 2) * step
                style = line_style(i.method, marker=True)
                panel.plot([i.left, i.right], [y, y], color=style["color"], lw=1.1)
                panel.plot(
                    i.middle, y, ls="none", marker=style["marker"], color=style["color"], ms=2.8
                )
            texts.append([r for r in table[name] if r is not None][-1].in_words)
        panel.set_ylim(len(names) - 0.4, -0.6)
        panel.set_xlim(0.0, 100.0)
        panel.set_xticks([])
        panel.set_yticks(range(len(names)), [plain(name) for name in names])
        panel.grid(visible=False)
        side = panel.twinx()
        side.set_ylim(panel.get_ylim())
        side.set_yticks(range(len(names)), texts)
        for both in (panel, side):
            both.tick_params(length=0)
            for spine in both.spines.values():
                spine.set_visible(False)
        if len(many) > 1:
            for k, label in enumerate(labels):
                style = line_style(k, marker=True)
                panel.plot([], [], marker=style["marker"], color=style["color"], label=plain(label))
            legend_above(figure, panel, min(len(many), 4), ax)
    return figure


#: Parameters whose names can be read at the side of a figure of one and of two columns.
_READABLE = {1: 30, 2: 62}


def figure_of_correlations(
    result: Identification, *, columns: int = 1, ax: Panels = None
) -> Figure:
    """Correlation of every pair of estimates, -1 to 1.

    Positive ones are red, negative blue; in grey both are dark, so the sign of strong ones (beyond
    0.5) is written into the cell where there is room.

    Args:
        result: the identification.
        columns: width, 1 or 2 columns of a page.
        ax: axes to draw into, one for each panel in order of reading; None: a new figure.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: its covariance is not finite.
    """
    std = result.method_std
    if not (np.isfinite(std).all() and (std > 0.0).all()):
        raise FigureError(
            "the covariance is not finite or has zeros", advice="there are no correlations"
        )
    correlation = result.covariance / np.outer(std, std)
    n = len(result.names)
    with paper_style(ax):
        height = 3.0 if columns == 1 else 6.0
        figure, (panel,) = new_figure(1, columns=columns, ax=ax, row_height=height)
        image = panel.imshow(
            correlation, cmap="RdBu_r", vmin=-1.0, vmax=1.0, interpolation="nearest"
        )
        panel.grid(visible=False)
        step = -(-n // _READABLE.get(columns, 30))
        places = np.arange(0, n, step)
        size = float(np.clip(200.0 * columns * step / n, 4.5, 7.0))
        names = [plain(result.names[k]) for k in places]
        panel.set_xticks(places, names, rotation=90, fontsize=size)
        panel.set_yticks(places, names, fontsize=size)
        for a, b in zip(*np.nonzero(np.abs(correlation) > 0.5), strict=True):
            if a != b and n <= _READABLE.get(columns, 30):
                sign = "+" if correlation[a, b] > 0 else "−"
                panel.text(b, a, sign, ha="center", va="center", color="white", fontsize=size)
        figure.colorbar(image, ax=panel, shrink=0.85, label="correlation")
    return figure


def figure_of_convergence(result: Identification, *, columns: int = 1, ax: Panels = None) -> Figure:
    """Distance of all parameters from the estimate in σ, and the criteria, over the iterations.

    Args:
        result: an identification by an iterative method.
        columns: width, 1 or 2 columns of a page.
        ax: axes to draw into, one for each panel in order of reading; None: a new figure.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: it was solved in one step.
    """
    from matplotlib.ticker import MaxNLocator

    history = result.history
    if len(history) < 2:
        raise FigureError(
            f"{result.method} solved its equations in one step",
            advice="there is no iteration to draw",
        )
    fitted = result.simulation is not None
    steps = np.arange(1, len(history) + 1)
    theta = np.array([step.theta for step in history])
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.abs(theta - result.theta) / result.std
    distance[~(np.isfinite(distance) & (distance > 0.0))] = np.nan
    with paper_style(ax):
        figure, (top, bottom) = new_figure(2, columns=columns, ax=ax, row_height=1.5, share_x=True)
        for p, line in zip(result.parameters, distance.T, strict=True):
            top.semilogy(steps, line, lw=0.7, **line_style(p.joint, marker=True) | {"ms": 2.2})
        top.axhline(1.0, color="#555555", lw=0.7, ls="--")
        top.set(ylabel="distance from estimate [σ]", title="parameters, one line each by joint")
        for k, (name, values) in enumerate(
            (
                ("largest relative change", [step.change for step in history]),
                (
                    f"weighted {'simulation' if fitted else 'torque'} error",
                    [step.residual for step in history],
                ),
            )
        ):
            values_percent = 100.0 * np.array(values, dtype=float)
            values_percent[~np.isfinite(values_percent)] = np.nan
            bottom.semilogy(steps, values_percent, label=name, **line_style(k, marker=True))
        bottom.set(xlabel="iteration", ylabel="criterion [%]")
        bottom.xaxis.set_major_locator(MaxNLocator(integer=True))
        bottom.legend()
    return figure


def figure_of_friction(
    results: Identification | Sequence[Identification],
    joints: Sequence[str | int] | None = None,
    *,
    labels: Sequence[str] | None = None,
    columns: int = 2,
    ax: Panels = None,
) -> Figure:
    """Friction by the terms of each law that depend on speed alone, with ±2σ, up to rated speed.

    Args:
        results: one or several of the same robot, friction laws may differ.
        joints: names or numbers from 1; None: all.
        labels: names of the results; None: their methods.
        columns: width, 1 or 2 columns of a page.
        ax: axes to draw into, one for each panel in order of reading; None: a new figure.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: no friction was estimated, the robots differ, or there is no such joint.
    """
    many = [results] if isinstance(results, Identification) else list(results)
    labels = list(labels or method_labels(many))
    if len(labels) != len(many) or not many:
        raise FigureError(f"there are {len(labels)} labels for {len(many)} results")
    for other in many[1:]:
        if apart := difference_of_geometry(many[0].robot, other.robot):
            raise FigureError(f"friction of different robots has no common figure: {apart}")
    wanted = [many[0].robot.joint_names[j] for j in chosen_joints(many[0], joints)]
    entries = [entry_of(i, label) for i, label in zip(many, labels, strict=True)]
    curves = [joint for joint in friction_curves(entries) if joint.name in wanted]
    if not curves:
        raise FigureError("no friction that depends on speed was estimated on these joints")
    with paper_style(ax):
        figure, axes = joint_panels(len(curves), columns=columns, ax=ax, row_height=1.6)
        for panel, joint in zip(axes, curves, strict=True):
            for curve in joint.curves:
                style = line_style(curve.entry)
                if np.isfinite(curve.std).all():
                    ends = (curve.torque - 2.0 * curve.std, curve.torque + 2.0 * curve.std)
                    panel.fill_between(joint.speed, *ends, color=style["color"], alpha=0.2, lw=0)
                panel.plot(joint.speed, curve.torque, label=plain(labels[curve.entry]), **style)
            quantity = "force" if joint.torque_unit == "N" else "torque"
            panel.set(
                xlabel=f"speed [{joint.speed_unit}]",
                ylabel=f"friction {quantity} [{joint.torque_unit}]",
                title=plain(joint.name),
            )
        if len(many) > 1:
            legend_above(figure, axes[0], min(len(many), 4), ax)
    return figure
