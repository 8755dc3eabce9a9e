"""Torques of a log that nothing was fitted to: measured, predicted, and what lies between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pivident.figures.joint_panels import draw_trace, joints_named, legend_above
from pivident.figures.paper_style import FigureError, new_figure, paper_style, plain
from pivident.prediction.prediction import Prediction

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Measured, predicted and error, as Brunot et al. (2018, figure 4) draw them.
_MEASURED = {"color": "#0072B2", "linewidth": 1.4}
_PREDICTED = {"color": "#D55E00", "linewidth": 0.9, "linestyle": (0, (4, 1.5))}
_ERROR = {"color": "#000000", "linewidth": 0.7, "linestyle": ":"}


def figure_of_predictions(
    predictions: Prediction | Sequence[Prediction],
    joints: Sequence[str | int] | None = None,
    *,
    columns: int = 2,
) -> Figure:
    """Measured and predicted torque with their difference: a row for each joint.

    Predictions by several results stand side by side.

    Args:
        predictions: what `predict` returns for a log with torques, by one result or several.
        joints: names or numbers from 1; None: all.
        columns: width, 1 or 2 columns of a page.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: a log has no torques, there is no prediction, or no such joint.
    """
    made = [predictions] if isinstance(predictions, Prediction) else list(predictions)
    if not made:
        raise FigureError("there is no prediction to draw; give at least one")
    chosen = joints_named(made[0].robot.joint_names, joints)
    with paper_style():
        figure, axes = new_figure(
            len(chosen), len(made), columns=columns, row_height=1.3, share_x=True
        )
        for k, own in enumerate(made):
            if own.tau is None:
                raise FigureError(f"the log {own.recording!r} has no torques to compare with")
            part = own.moving
            t, error = own.t[part] - own.t[part][0], own.tau[part] - own.tau_model[part]
            for ax, j in zip(axes[k :: len(made)], chosen, strict=True):
                draw_trace(ax, t, own.tau[part, j], label="measured", **_MEASURED)
                draw_trace(ax, t, own.tau_model[part, j], label="predicted", **_PREDICTED)
                draw_trace(ax, t, error[:, j], label="error", **_ERROR)
                unit = own.robot.joints[j].torque_unit
                ax.set_ylabel(f"{plain(own.robot.joint_names[j])} [{unit}]" if k == 0 else "")
                ax.set_xlim(0.0, float(np.max(t)))
            axes[k].set_title(plain(own.method))
            axes[-len(made) + k].set_xlabel("time [s]")
        legend_above(figure, axes[0], 3)
    return figure
