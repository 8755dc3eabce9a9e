"""Figures with a panel for each joint: which joints of which recording, traces and legend."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.figures.paper_style import FigureError, new_figure
from pivident.report.plot_parts import kept_samples
from pivident.robot.naming import nearest

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pivident.estimation.identification import FittedRecording, Identification

#: Points of a trace; more than a printed column resolves.
POINTS = 2400


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
    count: int, *, columns: int, row_height: float = 1.5, xlabel: str = ""
) -> tuple[Figure, list[Axes]]:
    """A figure with so many panels, one or two in a row, and no others visible."""
    across = min(count, 1 if columns == 1 else 2)
    figure, axes = new_figure(
        math.ceil(count / across), across, columns=columns, row_height=row_height
    )
    for ax in axes[count:]:
        ax.set_visible(False)
    for ax in axes[max(count - across, 0) : count]:
        ax.set_xlabel(xlabel)
    return figure, axes[:count]


def draw_trace(ax: Axes, t: np.ndarray, y: np.ndarray, **style: Any) -> None:
    """Draw a signal by at most ``POINTS`` of its samples, every peak among them."""
    kept = kept_samples(np.asarray(y, dtype=float), POINTS)
    ax.plot(t[kept], y[kept], **style)


def legend_above(figure: Figure, ax: Axes, across: int) -> None:
    """One legend for all panels, above them."""
    handles, names = ax.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=across)
