"""The reference of one joint: position, speed and acceleration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pivident.figures.joint_panels import draw_trace, joints_named
from pivident.figures.paper_style import FigureError, line_style, new_figure, paper_style, plain
from pivident.recording.recording import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figure_of_reference(
    recording: Recording, joint: str | int, *, unit: str = "rad", columns: int = 1
) -> Figure:
    """Position, speed and acceleration of a joint's reference, one above the other.

    What was not recorded is the central difference of what was.

    Args:
        recording: a recording with its reference.
        joint: name, or number from 1.
        unit: of the position, rad or m.
        columns: width, 1 or 2 columns of a page.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: there is no reference, or no such joint.
    """
    if recording.q_ref is None:
        raise FigureError(f"the recording {recording.name!r} has no reference; log q_ref")
    (j,) = joints_named(recording.joint_names, [joint])
    q = recording.q_ref[:, j]
    dq = _given(recording.dq_ref, j, q, recording.rate)
    ddq = _given(recording.ddq_ref, j, dq, recording.rate)
    t = np.arange(len(q)) / recording.rate
    with paper_style():
        figure, axes = new_figure(3, columns=columns, row_height=1.2, share_x=True)
        for ax, x, name, own in zip(
            axes,
            (q, dq, ddq),
            ("position", "speed", "acceleration"),
            ("", "/s", "/s²"),
            strict=True,
        ):
            draw_trace(ax, t, x, **line_style(0))
            ax.set_ylabel(f"{name} [{unit}{own}]")
        axes[0].set_title(plain(recording.joint_names[j]))
        axes[-1].set(xlabel="time [s]", xlim=(0.0, float(t[-1])))
    return figure


def _given(recorded: np.ndarray | None, j: int, x: np.ndarray, rate: float) -> np.ndarray:
    """A recorded derivative, or that of x."""
    return np.gradient(x, 1.0 / rate) if recorded is None else recorded[:, j]
