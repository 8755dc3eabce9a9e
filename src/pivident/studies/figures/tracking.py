"""Positions over time: reference and measured motion, and the reference that was reconstructed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification
from pivident.foundation.text.numbers import format_significant
from pivident.studies.figures.paper_style import (
    MEASURED,
    FigureError,
    chosen_signals,
    draw_trace,
    joints_named,
    legend_above,
    line_style,
    new_figure,
    paper_style,
    plain,
)

if TYPE_CHECKING:
    from pivident.studies.figures.paper_style import Figure, Panels


def figure_of_tracking(
    result: Identification,
    joints: Sequence[str | int] | None = None,
    *,
    recording: str | int = 0,
    columns: int = 2,
    ax: Panels = None,
) -> Figure:
    """Reference and measured position on the left, their difference on the right.

    Args:
        result: an identification whose recording has a reference.
        joints: names or numbers from 1; None: all.
        recording: its name or index.
        columns: width, 1 or 2 columns of a page.
        ax: axes to draw into, one for each panel in order of reading; None: a new figure.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: there is no reference, or no such joint or recording.
    """
    chosen, record, t = chosen_signals(result, joints, recording)
    if record.q_ref is None:
        raise FigureError(
            f"the recording {record.name!r} has no reference",
            advice="log q_ref, or have it reconstructed",
        )
    with paper_style(ax):
        figure, axes = new_figure(
            len(chosen), 2, columns=columns, ax=ax, row_height=1.35, share_x=True
        )
        for left, right, j in zip(axes[::2], axes[1::2], chosen, strict=True):
            unit = result.robot.joints[j].position_unit
            q, q_ref = record.q_measured[:, j], record.q_ref[:, j]
            apart = q_ref - q
            draw_trace(left, t, q, label="measured", color=MEASURED, linewidth=1.8)
            draw_trace(left, t, q_ref, label="reference", **line_style(1))
            draw_trace(right, t, apart, **line_style(0))
            rms = format_significant(float(np.sqrt(np.mean(apart**2))))
            left.set(ylabel=f"position [{unit}]", title=plain(result.robot.joint_names[j]))
            right.set(ylabel=f"error [{unit}]", title=f"reference less position, rms {rms} {unit}")
        for panel in axes[-2:]:
            panel.set(xlabel="time [s]", xlim=(0.0, float(t[-1])))
        legend_above(figure, axes[0], 2, ax)
    return figure


def figure_of_reference(
    recording: Recording,
    joint: str | int,
    *,
    unit: str = "rad",
    columns: int = 1,
    ax: Panels = None,
) -> Figure:
    """Position, speed and acceleration of a joint's reference, one above the other.

    What was not recorded is the central difference of what was.

    Args:
        recording: a recording with its reference.
        joint: name, or number from 1.
        unit: of the position, rad or m.
        columns: width, 1 or 2 columns of a page.
        ax: axes to draw into, one for each panel in order of reading; None: a new figure.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: there is no reference, or no such joint.
    """
    if recording.q_ref is None:
        raise FigureError(f"the recording {recording.name!r} has no reference", advice="log q_ref")
    (j,) = joints_named(recording.joint_names, [joint])
    q = recording.q_ref[:, j]
    dq = _given(recording.dq_ref, j, q, recording.rate)
    ddq = _given(recording.ddq_ref, j, dq, recording.rate)
    t = np.arange(len(q)) / recording.rate
    with paper_style(ax):
        figure, axes = new_figure(3, columns=columns, ax=ax, row_height=1.2, share_x=True)
        for panel, x, name, own in zip(
            axes,
            (q, dq, ddq),
            ("position", "speed", "acceleration"),
            ("", "/s", "/s²"),
            strict=True,
        ):
            draw_trace(panel, t, x, **line_style(0))
            panel.set_ylabel(f"{name} [{unit}{own}]")
        axes[0].set_title(plain(recording.joint_names[j]))
        axes[-1].set(xlabel="time [s]", xlim=(0.0, float(t[-1])))
    return figure


def _given(recorded: np.ndarray | None, j: int, x: np.ndarray, rate: float) -> np.ndarray:
    """A recorded derivative, or that of x."""
    return np.gradient(x, 1.0 / rate) if recorded is None else recorded[:, j]
