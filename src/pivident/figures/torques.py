"""Measured and reconstructed torque, with the error between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import percent
from pivident.figures.paper import (
    ERROR,
    MEASURED,
    POINTS,
    chosen_joints,
    chosen_recording,
    hide_unused,
    new_figure,
    panels,
    paper_style,
    plain,
)
from pivident.report.downsampling import kept_samples, stretches

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

    Rows that did not vote are shaded.

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
    chosen, record = chosen_joints(result, joints), chosen_recording(result, recording)
    t = record.t - record.t[0]
    with paper_style():
        rows, across = panels(len(chosen), columns)
        figure, axes = new_figure(rows, across, columns=columns)
        for ax, j in zip(axes, chosen, strict=False):
            fit = result.joints[j]
            tau, model = record.tau[:, j], record.tau_model[:, j]
            for start, stop in stretches(np.asarray(record.mask, dtype=bool)[:, j], t):
                ax.axvspan(start, stop, color="#000000", alpha=0.07, linewidth=0)
            lines: tuple[tuple[np.ndarray, dict[str, Any], str], ...] = (
                (tau, {"color": MEASURED, "linewidth": 1.8}, "measured"),
                (model, {"color": "#000000", "linewidth": 0.8}, "reconstructed"),
                (tau - model, {"color": ERROR, "linewidth": 0.8, "linestyle": ":"}, "error"),
            )
            for y, style, name in lines:
                kept = kept_samples(np.asarray(y, dtype=float), POINTS)
                ax.plot(t[kept], y[kept], label=name, **style)
            quantity = "torque" if fit.torque_unit == "N m" else "force"
            ax.set(ylabel=f"{quantity} [{fit.torque_unit}]", xlim=(0.0, float(t[-1])))
            ax.set_title(f"{plain(fit.name)}, relative error {percent(100 * fit.relative_error)}")
        for ax in axes[max(len(chosen) - across, 0) : len(chosen)]:
            ax.set_xlabel("time [s]")
        hide_unused(axes, len(chosen))
        handles, names = axes[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper center", ncols=3)
    return figure
