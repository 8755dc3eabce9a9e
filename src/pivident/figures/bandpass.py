"""Frequency response of the differentiation by band-pass filters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pivident.figures.joint_panels import legend_above
from pivident.figures.paper_style import line_style, new_figure, paper_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Frequencies of a curve.
_POINTS = 600


def figure_of_bandpass(rate: float, cutoff: float, order: int = 4, *, columns: int = 1) -> Figure:
    """Bode diagram of the recipe of `bandpass`: low-pass both ways, central difference, product.

    Forwards and backwards the low-pass has the gain |H(f)|² and no phase; the central difference is
    j sin(2πf/f_s) f_s.

    Args:
        rate: sampling rate f_s [Hz].
        cutoff: -3 dB in one run of the low-pass [Hz].
        order: order of one run.
        columns: width, 1 or 2 columns of a page.

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
    with paper_style():
        figure, (gain, phase) = new_figure(2, columns=columns, row_height=1.7, share_x=True)
        for k, (label, response) in enumerate(curves.items()):
            level = 20.0 * np.log10(np.maximum(np.abs(response), 1e-12))
            gain.semilogx(frequency, level, label=label, **line_style(k))
            phase.semilogx(frequency, np.degrees(np.angle(response)), **line_style(k))
        gain.set(ylabel="gain [dB]", ylim=(-60.0, 90.0))
        phase.set(ylabel="phase [°]", xlabel="frequency [Hz]", ylim=(-10.0, 100.0))
        legend_above(figure, gain, 2)
    return figure
