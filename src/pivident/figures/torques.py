"""Measured and reconstructed torque, with the error between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pivident.estimation.identification import Identification
from pivident.figures.joint_panels import chosen_signals, draw_trace, joint_panels, legend_above
from pivident.figures.paper_style import ERROR, MEASURED, paper_style, plain
from pivident.report.plot_parts import stretches
from pivident.text.numbers import percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figure_of_torques(
    result: Identification,
    joints: Sequence[str | int] | None = None,
    *,
    recording: str | int = 0,
    columns: int = 2,
) -> Figure:
    """Measured torque, reconstructed torque Φθ, and their difference, one panel for each joint.

    Rows that were not used are shaded.

    Args:
        result: an identification with its signals.
        joints: names or numbers from 1; None: all.
        recording: its name or index.
        columns: width, 1 or 2 columns of a page.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: there are no signals, or no such joint or recording.
    """
    chosen, record, t = chosen_signals(result, joints, recording)
    with paper_style():
        figure, axes = joint_panels(len(chosen), columns=columns, xlabel="time [s]")
        for ax, j in zip(axes, chosen, strict=True):
            fit = result.joints[j]
            tau, model = record.tau[:, j], record.tau_model[:, j]
            for start, stop in stretches(~np.asarray(record.used, dtype=bool)[:, j], t):
                ax.axvspan(start, stop, color="#000000", alpha=0.07, linewidth=0)
            draw_trace(ax, t, tau, label=record.torque_label, color=MEASURED, linewidth=1.8)
            draw_trace(ax, t, model, label="reconstructed", color="#000000", linewidth=0.8)
            draw_trace(ax, t, tau - model, label="error", color=ERROR, linewidth=0.8, linestyle=":")
            quantity = "force" if fit.torque_unit == "N" else "torque"
            ax.set(ylabel=f"{quantity} [{fit.torque_unit}]", xlim=(0.0, float(t[-1])))
            ax.set_title(f"{plain(fit.name)}, relative error {percent(100 * fit.relative_error)}")
        legend_above(figure, axes[0], 3)
    return figure
