"""Friction against speed, of one result or of several."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import method_labels
from pivident.studies.comparison.entry import entry_of
from pivident.studies.comparison.friction_curves import friction_curves
from pivident.studies.comparison.groups import difference_of_geometry
from pivident.studies.figures.paper_style import (
    FigureError,
    chosen_joints,
    joint_panels,
    legend_above,
    line_style,
    paper_style,
    plain,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pivident.studies.figures.paper_style import Panels


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
