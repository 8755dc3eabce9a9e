"""Torques over time: measured and reconstructed, as predicted of a log, and of a control law."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.estimation.identification import Identification
from pivident.foundation.document.plot import stretches
from pivident.foundation.text.numbers import percent
from pivident.judgement.report.identification_figures import torque_curves
from pivident.loop.simulation.control_loop import FittedLaw
from pivident.studies.figures.paper_style import (
    ERROR,
    MEASURED,
    FigureError,
    chosen_signals,
    draw_curves,
    draw_trace,
    joint_panels,
    joints_named,
    legend_above,
    new_figure,
    paper_style,
    plain,
)
from pivident.studies.prediction.prediction import Prediction

if TYPE_CHECKING:
    from pivident.studies.figures.paper_style import Figure, Panels

#: Measured, predicted and error, as Brunot et al. (2018, figure 4) draw them.
_MEASURED = {"color": "#0072B2", "linewidth": 1.4}
_PREDICTED = {"color": "#D55E00", "linewidth": 0.9, "linestyle": (0, (4, 1.5))}
_COMPARED: dict[str | int, dict[str, Any]] = {
    "measured": _MEASURED,
    0: _PREDICTED,
    "error": {"color": "#000000", "linewidth": 0.7, "linestyle": ":"},
}
#: The same of what was fitted.
_FITTED: dict[str | int, dict[str, Any]] = {
    "measured": {"color": MEASURED, "linewidth": 1.8},
    0: {"color": "#000000", "linewidth": 0.8},
    "error": {"color": ERROR, "linewidth": 0.8, "linestyle": ":"},
}


def figure_of_torques(
    result: Identification,
    joints: Sequence[str | int] | None = None,
    *,
    recording: str | int = 0,
    columns: int = 2,
    ax: Panels = None,
) -> Figure:
    """Measured torque, reconstructed torque Φθ, and their difference, one panel for each joint.

    Rows that were not used are shaded.

    Args:
        result: an identification with its signals.
        joints: names or numbers from 1; None: all.
        recording: its name or index.
        columns: width, 1 or 2 columns of a page.
        ax: axes to draw into, one for each panel in order of reading; None: a new figure.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: there are no signals, or no such joint or recording.
    """
    chosen, record, t = chosen_signals(result, joints, recording)
    with paper_style(ax):
        figure, axes = joint_panels(len(chosen), columns=columns, ax=ax, xlabel="time [s]")
        for panel, j in zip(axes, chosen, strict=True):
            for start, stop in stretches(~np.asarray(record.used, dtype=bool)[:, j], t):
                panel.axvspan(start, stop, color="#000000", alpha=0.07, linewidth=0)
            draw_curves(panel, torque_curves(result, record, j, 0), _FITTED)
            fit = result.joints[j]
            panel.set_title(
                f"{plain(fit.name)}, relative error {percent(100 * fit.relative_error)}"
            )
        legend_above(figure, axes[0], 3, ax)
    return figure


def figure_of_predictions(
    predictions: Prediction | Sequence[Prediction],
    joints: Sequence[str | int] | None = None,
    *,
    columns: int = 2,
    ax: Panels = None,
) -> Figure:
    """Measured and predicted torque with their difference: a row for each joint.

    Predictions by several results stand side by side.

    Args:
        predictions: what `predict` returns for a log with torques, by one result or several.
        joints: names or numbers from 1; None: all.
        columns: width, 1 or 2 columns of a page.
        ax: axes to draw into, one for each panel in order of reading; None: a new figure.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: a log has no torques, there is no prediction, or no such joint.
    """
    made = [predictions] if isinstance(predictions, Prediction) else list(predictions)
    if not made:
        raise FigureError("there is no prediction to draw", advice="give at least one")
    chosen = joints_named(made[0].robot.joint_names, joints)
    with paper_style(ax):
        figure, axes = new_figure(
            len(chosen), len(made), columns=columns, ax=ax, row_height=1.3, share_x=True
        )
        for k, own in enumerate(made):
            if own.tau is None:
                raise FigureError(f"the log {own.recording!r} has no torques to compare with")
            for panel, j in zip(axes[k :: len(made)], chosen, strict=True):
                draw_curves(panel, own.curves(j, own.moving), _COMPARED)
                unit = own.robot.joints[j].torque_unit
                panel.set_ylabel(f"{plain(own.robot.joint_names[j])} [{unit}]" if k == 0 else "")
            axes[k].set_title(plain(own.method))
            axes[-len(made) + k].set_xlabel("time [s]")
        legend_above(figure, axes[0], 3, ax)
    return figure


def figure_of_control_law(
    law: FittedLaw, joint: str | int, *, columns: int = 1, ax: Panels = None
) -> Figure:
    """Recorded output of one joint's law, that of the identified law, and their difference.

    Args:
        law: what `identify_controller` or `identify_free_law` returns.
        joint: name, or number from 1.
        columns: width, 1 or 2 columns of a page.
        ax: axes to draw into, one for each panel in order of reading; None: a new figure.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: there is no such joint.
    """
    (j,) = joints_named(law.joint_names, [joint])
    output, model = law.output[:, j], law.model[:, j]
    t = np.arange(len(output)) / law.rate
    known = np.isfinite(output) & np.isfinite(model)
    size = np.sqrt(np.mean(output[known] ** 2))
    left = np.sqrt(np.mean((output - model)[known] ** 2)) / size
    with paper_style(ax):
        figure, (above, below) = new_figure(2, columns=columns, ax=ax, row_height=1.5, share_x=True)
        draw_trace(above, t, output, label="recorded", **_MEASURED)
        draw_trace(above, t, model, label="identified law", **_PREDICTED)
        draw_trace(below, t, output - model, color="#000000", linewidth=0.7)
        name = plain(law.joint_names[j])
        above.set(ylabel="output [u]", title=f"{name}: {percent(100 * left)} left unexplained")
        below.set(ylabel="difference [u]", xlabel="time [s]", xlim=(0.0, float(t[-1])))
        legend_above(figure, above, 2, ax)
    return figure
