"""Integrated random walk smoothing of encoders whose noise has spectral lines.

The smoother of ``random_walk`` assumes white measurement noise. It treats a line close to the
motion's band, a mechanical resonance at 200 Hz, say, as motion: maximum likelihood widens the
bandwidth until the line passes, and all noise below it passes too. A line far above does not pass,
but raises the floor and narrows the bandwidth slightly too far.

Here each channel's lines are found first (``spectral_lines``). Its noise is then white plus an
AR(2) process per line, the NVR maximises the exact likelihood given this colour
(``coloured_walk_likelihood``), and the smoother becomes a low-pass with notches. Channels without
lines are smoothed as before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pivident.signals.coloured_walk_likelihood import (
    NoiseColour,
    coloured_fit,
    estimate_coloured_nvr,
)
from pivident.signals.random_walk import (
    PER_CHANNEL,
    SmoothedSignal,
    check_positions,
    differentiate,
    smooth_channels,
)
from pivident.signals.random_walk_likelihood import diffuse_fit
from pivident.signals.random_walk_model import f50_from_nvr, log_nvr_std
from pivident.signals.spectral_lines import LineSearch, SpectralLine, find_lines, noise_colour
from pivident.threads import run_in_threads


@dataclass(frozen=True, eq=False)
class WalkSmoother:
    """The smoother S of one channel: a linear operator, once its ratio is chosen."""

    nvr: float  # noise-to-variance ratio, per sample
    order: int  # of the random walk
    colour: NoiseColour | None = None  # of the measurement noise; None: white

    def smoothed(self, y: np.ndarray) -> np.ndarray:
        """S y of a channel, shape (samples,)."""
        mean = float(np.mean(y))  # passes unchanged, and would only cost digits
        if self.colour is None:
            return diffuse_fit(y - mean, self.nvr, self.order).level + mean
        return coloured_fit(y - mean, self.nvr, self.order, self.colour).level + mean

    def band(self, rate: float) -> float:
        """Frequency that it halves [Hz], at a sampling ``rate`` [Hz]."""
        return f50_from_nvr(self.nvr, self.order, rate)


@dataclass(frozen=True, eq=False)
class ColouredSmoothing:
    """A record smoothed with the colour of its noise; lines per channel, the strongest first.

    ``noise_std``, ``nvr`` and ``f50`` of the signal refer to the white floor of the noise, without
    the lines; ``log_nvr_std`` assumes white noise.
    """

    signal: SmoothedSignal
    lines: tuple[tuple[SpectralLine, ...], ...]  # empty for white noise
    colours: tuple[NoiseColour | None, ...]  # of the noise of each channel, None for white noise


def smooth_with_lines(
    y: np.ndarray, rate: float, order: int = 3, *, f50_max: float | None = None
) -> ColouredSmoothing:
    """Smooth several channels, each with the colour that its noise has."""
    y = np.asarray(y, dtype=float)
    check_positions(y, rate, order, passes=1)
    channels = range(y.shape[1])
    searches: dict[int, LineSearch] = {}

    def search(channel: int) -> None:
        searches[channel] = find_lines(y[:, channel], rate, order)

    run_in_threads(search, channels)
    lines = tuple(searches[channel].lines for channel in channels)
    white = [channel for channel in channels if not lines[channel]]
    if len(white) == len(channels):
        signal = smooth_channels(y, rate, order, f50_max=f50_max)
        return ColouredSmoothing(signal, lines, (None,) * len(channels))
    parts: dict[int, SmoothedSignal] = {}
    colours = {c: noise_colour(searches[c], rate) for c in channels if lines[c]}
    if white:
        together = smooth_channels(y[:, white], rate, order, f50_max=f50_max)
        parts = {channel: together.channel(i) for i, channel in enumerate(white)}

    def smooth(channel: int) -> None:
        parts[channel] = _smooth_channel(y[:, channel], rate, order, colours[channel], f50_max)

    run_in_threads(smooth, [channel for channel in channels if lines[channel]])
    columns = {
        name: np.stack([getattr(parts[channel], name) for channel in channels], axis=-1)
        for name in PER_CHANNEL
    }
    signal = SmoothedSignal(**columns, order=order, rate=rate)
    return ColouredSmoothing(signal, lines, tuple(colours.get(c) for c in channels))


def _smooth_channel(
    y: np.ndarray, rate: float, order: int, colour: NoiseColour, f50_max: float | None
) -> SmoothedSignal:
    """One channel with lines."""
    mean = float(np.mean(y))
    centred = y - mean
    estimate = estimate_coloured_nvr(centred, rate, order, colour, f50_max)
    fit = coloured_fit(centred, estimate.nvr, order, colour)
    dq, ddq = np.empty(y.size), np.empty(y.size)
    differentiate(np.diff(fit.level), rate, dq, ddq)
    std = math.nan if estimate.on_bound else log_nvr_std(estimate.nvr, order, y.size)
    return SmoothedSignal(
        q=fit.level + mean,
        dq=dq,
        ddq=ddq,
        nvr=np.array(estimate.nvr),
        f50=np.array(f50_from_nvr(estimate.nvr, order, rate)),
        noise_std=np.array(math.sqrt(fit.noise_variance)),
        on_bound=np.array(estimate.on_bound),
        log_nvr_std=np.array(std),
        log_likelihood=np.array(fit.log_likelihood),
        order=order,
        rate=rate,
    )
