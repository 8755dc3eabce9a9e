"""Frequency responses of the filters: differentiation by band-pass filters, and the prefilters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pivident.estimation.identification import Identification
from pivident.studies.figures.paper_style import (
    FigureError,
    chosen_joints,
    chosen_recording,
    legend_above,
    line_style,
    new_figure,
    paper_style,
    plain,
)

if TYPE_CHECKING:
    from pivident.studies.figures.paper_style import Figure, Panels

#: Frequencies of a curve.
_POINTS = 600


def figure_of_bandpass(
    rate: float, cutoff: float, order: int = 4, *, columns: int = 1, ax: Panels = None
) -> Figure:
    """Bode diagram of the recipe of `bandpass`: low-pass both ways, central difference, product.

    Forwards and backwards the low-pass has the gain |H(f)|² and no phase; the central difference is
    j sin(2πf/f_s) f_s.

    Args:
        rate: sampling rate f_s [Hz].
        cutoff: -3 dB in one run of the low-pass [Hz].
        order: order of one run.
        columns: width, 1 or 2 columns of a page.
        ax: axes to draw into, one for each panel in order of reading; None: a new figure.

    Returns:
        The figure; `save_figure` writes it.
    """
    from scipy.signal import butter, freqz

    frequency = np.geomspace(rate / 2.0e4, 0.499 * rate, _POINTS)
    b, a = butter(order, cutoff, fs=rate)
    low = np.abs(freqz(b, a, frequency, fs=rate)[1]) ** 2
    difference = 1j * np.sin(2.0 * np.pi * frequency / rate) * rate
    curves = {
        "derivative": 2j * np.pi * frequency,
        "central difference": difference,
        "low-pass, both ways": low + 0j,
        "band-pass": low * difference,
    }
    with paper_style(ax):
        figure, (gain, phase) = new_figure(2, columns=columns, ax=ax, row_height=1.7, share_x=True)
        for k, (label, response) in enumerate(curves.items()):
            level = 20.0 * np.log10(np.maximum(np.abs(response), 1e-12))
            gain.semilogx(frequency, level, label=label, **line_style(k))
            phase.semilogx(frequency, np.degrees(np.angle(response)), **line_style(k))
        gain.set(ylabel="gain [dB]", ylim=(-60.0, 90.0))
        phase.set(ylabel="phase [°]", xlabel="frequency [Hz]", ylim=(-10.0, 100.0))
        legend_above(figure, gain, 2, ax)
    return figure


def figure_of_prefilters(
    result: Identification,
    joints: Sequence[str | int] | None = None,
    *,
    columns: int = 1,
    ax: Panels = None,
) -> Figure:
    """Gain |A N/D| of each joint's prefilter over that at the lowest frequency, in decibel.

    Args:
        result: an identification at the full rate that still holds its equations.
        joints: names or numbers from 1; None: all.
        columns: width, 1 or 2 columns of a page.
        ax: axes to draw into, one for each panel in order of reading; None: a new figure.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: it holds no equations, has no prefilter, or there is no such joint.
    """
    chosen, equations = chosen_joints(result, joints), result.equations
    if equations is None:
        raise FigureError(
            "the identification holds no equations, as after reading it from a file",
            advice="identify again",
        )
    if not equations.full_rate:
        raise FigureError(f"{result.method} filters by a band-pass and has no prefilters")
    rate = chosen_recording(result, 0).whitened_rate
    frequency = np.geomspace(rate / 2.0e4, 0.5 * rate, _POINTS)
    with paper_style(ax):
        figure, (panel,) = new_figure(1, columns=columns, ax=ax, row_height=2.1)
        for k, j in enumerate(chosen):
            gain = np.abs(equations.filters[j].response(frequency, rate))
            decibel = 20.0 * np.log10(np.maximum(gain / max(gain[0], 1e-300), 1e-300))
            name = plain(result.robot.joint_names[j])
            panel.semilogx(frequency, decibel, label=name, **line_style(k))
        panel.set(xlabel="frequency [Hz]", ylabel="gain [dB], lowest frequency 0")
        panel.legend(ncols=2)
    return figure
