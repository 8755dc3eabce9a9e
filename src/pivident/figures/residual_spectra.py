"""Spectra of the whitened residuals, against what white noise may have.

Averaged over windows of Hann with half overlap that have no gap, P(f)·rate/2 of a white residual of
unit variance is 1 at every frequency. With K windows it is χ² with ν degrees of freedom over ν;
ν = 2K/(1 + (K-1)/(18 K)) allows for the overlap, in which neighbours are correlated by 1/6
(Welch 1967).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pivident.estimation.identification import Identification
from pivident.figures.paper import (
    FigureError,
    chosen_joints,
    chosen_recording,
    hide_unused,
    line_style,
    new_figure,
    panels,
    paper_style,
    plain,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Samples of a window: at most, and at least.
_LONGEST, _SHORTEST = 1024, 32

#: Windows that a spectrum is averaged over, at least; fewer make it erratic.
_FEWEST = 8


def averaged_spectrum(pieces: Sequence[np.ndarray], rate: float) -> tuple[np.ndarray, ...] | None:
    """Spectrum of a signal with gaps, over that of white noise of unit variance.

    Args:
        pieces: one signal for each recording, NaN where there is none.
        rate: sampling rate [Hz].

    Returns:
        Frequencies [Hz], spectrum, and the number ν of its degrees of freedom; None where the
        stretches without a gap are too short.
    """
    length = _LONGEST
    while length >= _SHORTEST:
        windows = [window for piece in pieces for window in _windows(piece, length)]
        if len(windows) >= _FEWEST:
            break
        length //= 2
    else:
        return None
    taper = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(length) + 0.5) / length)
    block = np.array(windows)
    block = block - block.mean()
    power = np.abs(np.fft.rfft(block * taper, axis=1)) ** 2 / np.sum(taper**2)
    count = len(windows)
    freedom = 2.0 * count / (1.0 + (count - 1.0) / (18.0 * count))
    inner = slice(2, length // 2)  # the mean is gone, and the ends are not χ² with two degrees
    frequency = np.fft.rfftfreq(length, 1.0 / rate)[inner]
    return frequency, power.mean(axis=0)[inner], np.array(freedom)


def figure_of_residual_spectra(
    result: Identification, joints: Sequence[str | int] | None = None, *, columns: int = 2
) -> Figure:
    """Spectrum of each joint's whitened residual, with the band that 95 % of white noise keeps to.

    Args:
        result: an identification with its signals.
        joints: names or numbers from 1; None: all.
        columns: width, 1 or 2 columns of a page.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: there are no signals, too few samples, or no such joint.
    """
    from scipy.stats import chi2

    chosen = chosen_joints(result, joints)
    rate = chosen_recording(result, 0).whitened_rate
    with paper_style():
        rows, across = panels(len(chosen), columns)
        figure, axes = new_figure(rows, across, columns=columns, row_height=1.4)
        for ax, j in zip(axes, chosen, strict=False):
            name = result.robot.joint_names[j]
            found = averaged_spectrum([r.whitened[:, j] for r in result.recordings], rate)
            if found is None:
                raise FigureError(
                    f"the residual of {name} has too few samples without a gap for a spectrum; "
                    "leave this joint out, or take a longer record"
                )
            frequency, power, freedom = found
            low, high = chi2.ppf([0.025, 0.975], freedom) / freedom
            ax.axhspan(low, high, color="#000000", alpha=0.12, linewidth=0, label="95 % of white")
            ax.loglog(frequency, power, label="residual", **line_style(1) | {"linestyle": "-"})
            ax.set(ylabel="power / white", title=plain(name))
            ax.set_ylim(min(0.1, 0.8 * float(power.min())), max(10.0, 1.2 * float(power.max())))
        for ax in axes[max(len(chosen) - across, 0) : len(chosen)]:
            ax.set_xlabel("frequency [Hz]")
        hide_unused(axes, len(chosen))
        handles, names = axes[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper center", ncols=2)
    return figure


def _windows(piece: np.ndarray, length: int) -> list[np.ndarray]:
    """Windows with half overlap that hold no NaN."""
    found, start = [], 0
    while start + length <= piece.size:
        window = piece[start : start + length]
        gaps = np.flatnonzero(~np.isfinite(window))
        if gaps.size:
            start += int(gaps[-1]) + 1
        else:
            found.append(window)
            start += length // 2
    return found
