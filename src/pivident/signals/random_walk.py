"""Integrated random walk smoothing: from positions to q, dq and ddq, in white or coloured noise.

The smoother of order m assumes that the m-th difference of the trajectory is white noise and
chooses the only free number, the noise-to-variance ratio, by maximum likelihood. It is the
``irwsm`` of Brunot et al. 2018, (P-27), for m = 2. Derivatives are recentred on the sample,

    dq_k = (T_{k+1} - T_{k-1}) / 2h,     ddq_k = (T_{k+1} - 2 T_k + T_{k-1}) / h²,

because the slope state of the model is a forward difference that lies half a sample ahead.
m = 3 (white third difference, bounded jerk) is the default: with m = 2 maximum likelihood keeps a
bandwidth that is right for positions and far too wide for accelerations.

Integrated random walk smoothing of encoders whose noise has spectral lines.

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
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from pivident.foundation.common_work import kept_numbers, once
from pivident.foundation.errors import NonFiniteSamples, RecordingError
from pivident.foundation.scratch import working_array
from pivident.foundation.text.display import Displayed
from pivident.foundation.threads import run_in_threads, thread_count
from pivident.signals.coloured_walk_likelihood import (
    NoiseColour,
    coloured_fit,
    estimate_coloured_nvr,
)
from pivident.signals.counted_positions import nvr_of_counts
from pivident.signals.random_walk_likelihood import MIN_NVR, diffuse_fit, estimate_nvr
from pivident.signals.random_walk_model import (
    ORDERS,
    derivative_noise,
    f50_from_nvr,
    log_nvr_std,
    required_f50,
)
from pivident.signals.spectral_lines import LineSearch, SpectralLine, find_lines, noise_colour

#: A record must have at least this many samples.
MIN_RECORD = 20
#: Samples at each end that a regression should skip: the smoother is one-sided there.
EDGE = 50
#: Order whose half power tells motion from noise, and the samples that it takes and looks at.
HALF_POWER_ORDER, MIN_MOTION, MAX_MOTION = 3, 100, 20_000
#: Fields of a smoothed signal that have an entry, or a column, per channel.
PER_CHANNEL = "q dq ddq nvr f50 noise_std on_bound log_nvr_std log_likelihood".split()


@dataclass(frozen=True, eq=False)
class SmoothedSignal(Displayed):
    """A smoothed record with its derivatives and the properties of the smoother.

    Trajectories have the shape of the input, (samples,) or (samples, channels). The other arrays
    hold one number per channel and have shape () or (channels,). Orders may be compared by
    ``log_likelihood`` where the differences are large (hundreds).

    Attributes:
        q: smoothed positions [rad or m].
        dq: speeds [rad/s or m/s].
        ddq: accelerations [rad/s² or m/s²].
        nvr: noise-to-variance ratio, per sample of this rate.
        f50: frequency at which the smoother's gain is one half [Hz], or infinite.
        noise_std: √r̂, standard deviation of the measurement noise [rad or m].
        on_bound: whether the NVR was searched and ended on a bound (or on f50_max).
        log_nvr_std: standard error of ln NVR, shape () or (channels,); NaN: given or on a bound.
        log_likelihood: exact, diffuse, shape () or (channels,).
        order: m.
        rate: sampling rate [Hz].
    """

    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    nvr: np.ndarray
    f50: np.ndarray
    noise_std: np.ndarray
    on_bound: np.ndarray
    log_nvr_std: np.ndarray
    log_likelihood: np.ndarray
    order: int
    rate: float

    @property
    def edge(self) -> int:
        """Samples to skip at each end: 50, or the smoother's memory rate/(2π f50) if longer."""
        return max(EDGE, math.ceil(self.rate / (2 * math.pi * float(np.min(self.f50)))))

    @property
    def ddq_noise(self) -> np.ndarray:
        """Standard deviation of the noise left in ddq, shape () or (channels,) [rad/s²]."""
        return self._derivative_noise()[..., 1]

    def advice(self, dynamic_frequency: float, loss: float = 1e-3) -> list[str]:
        """One line per channel: whether the bandwidth is wide enough, and the noise it passes.

        Args:
            dynamic_frequency: of the motion that is to be kept [Hz].
            loss: share of its amplitude that it may lose.
        """
        needed = required_f50(dynamic_frequency, self.order, loss)
        lines = []
        for channel, (f50, ddq_noise, bound) in enumerate(
            np.broadcast(self.f50, self.ddq_noise, self.on_bound)
        ):
            verdict = "keeps" if f50 >= needed else "damps"
            line = (
                f"channel {channel}: f50 {f50:.1f} Hz {verdict} the motion up to "
                f"{dynamic_frequency:g} Hz (needs {needed:.1f} Hz), "
                f"acceleration noise {ddq_noise:.3g}"
            )
            lines.append(line + "; the search ended on a bound" if bound else line)
        return lines

    def channel(self, index: int) -> SmoothedSignal:
        """One channel of several, trajectories of shape (samples,).

        Args:
            index: of the channel.
        """
        return replace(self, **{name: getattr(self, name).T[index] for name in PER_CHANNEL})

    def _derivative_noise(self) -> np.ndarray:
        pairs = [
            derivative_noise(float(nvr), self.order, self.rate, float(std))
            for nvr, std in np.broadcast(self.nvr, self.noise_std)
        ]
        return np.array(pairs).reshape(*self.nvr.shape, 2)


def irwsm(
    y: ArrayLike,
    rate: float,
    order: int = 3,
    nvr: float | Sequence[float] | None = None,
    passes: int = 1,
    *,
    f50_max: float | None = None,
) -> SmoothedSignal:
    """Integrated random walk smoother: smooth positions and their first two derivatives, (P-27).

    A channel without visible noise (constant, say) is returned unchanged within rounding, with
    ``on_bound`` set and ``noise_std`` close to zero.

    >>> t = np.arange(2000) / 1000.0
    >>> noise = 1e-4 * np.random.default_rng(0).normal(size=t.size)
    >>> smoothed = irwsm(np.sin(3.0 * t) + noise, rate=1000.0)
    >>> bool(abs(smoothed.ddq + 9.0 * np.sin(3.0 * t))[smoothed.edge : -smoothed.edge].max() < 0.3)
    True

    Args:
        y: positions [rad or m], of one channel (samples,) or of several (samples, channels).
        rate: sampling rate [Hz].
        order: m, whose m-th difference is taken for white noise; 2 as in CAPTAIN and in the paper,
            3 bounds the jerk.
        nvr: noise-to-variance ratio, one for all or one per channel; None: by maximum likelihood.
        passes: two smooth the differences of the smoothed positions once more, as the paper does;
            the second search normally ends on its upper bound, since smooth differences have no
            white noise left, and the accelerations are then those of a single pass.
        f50_max: largest bandwidth [Hz], for records whose quantisation or coloured noise makes
            maximum likelihood smooth too little.

    Returns:
        Positions, speeds and accelerations of the shape of ``y``, and the smoother's properties.

    Raises:
        RecordingError: fewer than 20 samples, or a value that is not finite.
    """
    signal = np.asarray(y, dtype=float)
    if signal.ndim == 2:
        return smooth_channels(signal, rate, order, nvr, passes, f50_max=f50_max)
    return smooth_channels(
        np.atleast_1d(signal)[:, None], rate, order, nvr, passes, f50_max=f50_max, threads=1
    ).channel(0)


def smooth_channels(
    y: np.ndarray,
    rate: float,
    order: int = 3,
    nvr: float | Sequence[float] | None = None,
    passes: int = 1,
    *,
    f50_max: float | None = None,
    threads: int | None = None,
) -> SmoothedSignal:
    """Smooth several channels on a pool of threads; see :func:`irwsm` for the arguments."""
    y = np.asarray(y, dtype=float)
    check_positions(y, rate, order, passes)
    samples, channels = y.shape
    given = np.broadcast_to(np.asarray(np.nan if nvr is None else nvr, dtype=float), channels)
    trajectories = working_array((3, channels, samples))
    figures = np.empty((5, channels))

    def work(channel: int) -> None:
        fixed = None if np.isnan(given[channel]) else float(given[channel])
        q, forward, figures[:, channel] = _smooth_channel(
            y[:, channel], rate, order, fixed, f50_max
        )
        if passes == 2:
            forward, _, _ = _smooth_channel(forward, rate, order, fixed, f50_max)
        trajectories[0, channel] = q
        differentiate(forward, rate, trajectories[1, channel], trajectories[2, channel])

    with ThreadPoolExecutor(max(1, min(channels, threads or thread_count()))) as pool:
        list(pool.map(work, range(channels)))
    return SmoothedSignal(
        q=trajectories[0].T,
        dq=trajectories[1].T,
        ddq=trajectories[2].T,
        nvr=figures[0],
        f50=np.array([f50_from_nvr(x, order, rate) for x in figures[0]]),
        noise_std=figures[1],
        on_bound=figures[2] > 0,
        log_nvr_std=figures[3],
        log_likelihood=figures[4],
        order=order,
        rate=rate,
    )


def _smooth_channel(
    y: np.ndarray, rate: float, order: int, nvr: float | None, f50_max: float | None
) -> tuple[np.ndarray, np.ndarray, tuple[float, float, bool, float, float]]:
    """Smoothed record, its forward differences, and nvr, √r, on_bound, std of ln NVR, log L."""
    # Constants pass unchanged, so the mean is subtracted: it would only cost digits.
    mean = float(np.mean(y))
    y = y - mean
    on_bound, log_std = False, math.nan
    if nvr is None:
        estimate = estimate_nvr(y, rate, order, f50_max)
        nvr, on_bound = estimate.nvr, estimate.on_bound
        log_std = math.nan if on_bound else log_nvr_std(nvr, order, y.size)
    elif not MIN_NVR[order] <= nvr < math.inf:
        raise RecordingError(
            f"NVR {nvr:.3g} at {rate:g} Hz",
            advice=f"order {order} is smoothed accurately from {MIN_NVR[order]:g} (f50 "
            f"{f50_from_nvr(MIN_NVR[order], order, rate):.3g} Hz) upwards: decimate the record "
            "first, or lower the order",
        )
    fit = diffuse_fit(y, nvr, order)
    figures = (nvr, math.sqrt(fit.noise_variance), on_bound, log_std, fit.log_likelihood)
    return fit.level + mean, np.diff(fit.level), figures


def differentiate(forward: np.ndarray, rate: float, dq: np.ndarray, ddq: np.ndarray) -> None:
    """Central dq and ddq from the forward differences; the outermost samples repeat a neighbour."""
    dq[1:-1] = (forward[1:] + forward[:-1]) * (rate / 2)
    ddq[1:-1] = (forward[1:] - forward[:-1]) * rate**2
    ddq[0], ddq[-1] = ddq[1], ddq[-2]
    dq[0], dq[-1] = dq[1] - ddq[1] / rate, dq[-2] + ddq[-2] / rate


def half_power_frequencies(q: np.ndarray, rate: float) -> np.ndarray:
    """Frequency at which each joint's motion sinks into the noise of its encoder [Hz].

    It is the half-power frequency of the smoother of order 3: accelerations above it are mostly
    noise, whatever filter they are made with. Of a long record the part with the longest path is
    looked at.

    Args:
        q: positions, shape (samples, joints) [rad or m].
        rate: sampling rate [Hz].

    Returns:
        Frequencies, shape (joints,); infinite for a joint without visible noise, and in a record
        that is too short for an estimate.
    """
    found = np.full(q.shape[1], np.inf)
    if len(q) < MIN_MOTION:
        return found

    for j in range(q.shape[1]):
        y = _longest_path(np.ascontiguousarray(q[:, j]))
        # several checks of a log ask for the same channel, and each has its own copy of it
        key = "half-power frequency", y.tobytes(), rate
        found[j] = once(key, partial(_half_power_frequency, y, rate))
    return found


def _half_power_frequency(y: np.ndarray, rate: float) -> float:
    """The same of one channel, all of whose samples are looked at."""

    def search() -> np.ndarray:
        nvr = nvr_of_counts(y, rate, HALF_POWER_ORDER)
        if nvr is None:
            nvr = estimate_nvr(y - y.mean(), rate, HALF_POWER_ORDER).nvr
        return np.array(f50_from_nvr(nvr, HALF_POWER_ORDER, rate))

    return float(kept_numbers(("half-power frequency", y, rate), (), search))


def _longest_path(y: np.ndarray) -> np.ndarray:
    """The `MAX_MOTION` samples of a channel in which it travels most; a shorter one as it is."""
    if y.size <= MAX_MOTION:
        return y
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(y, prepend=y[0])))])
    first = int(np.argmax(path[MAX_MOTION:] - path[:-MAX_MOTION]))
    return y[first : first + MAX_MOTION]


def check_positions(y: np.ndarray, rate: float, order: int, passes: int) -> None:
    """Refuse what cannot be smoothed."""
    if y.ndim != 2 or y.shape[0] < MIN_RECORD or y.shape[1] == 0:
        raise RecordingError(
            f"positions of shape {y.shape} cannot be smoothed",
            advice=f"expected at least {MIN_RECORD} samples of one or more channels",
        )
    if order not in ORDERS or passes not in (1, 2) or not rate > 0:
        raise RecordingError(
            f"smoother of order {order} with {passes} pass(es) at rate {rate:g} Hz",
            advice=f"orders are {ORDERS}, passes 1 or 2, the rate is positive",
        )
    wrong = ~np.isfinite(y)
    if wrong.any():
        sample, channel = np.argwhere(wrong)[0]
        count = int(wrong[:, channel].sum())
        raise NonFiniteSamples("position", str(channel), int(sample), count)


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
        parts[channel] = _smooth_coloured_channel(
            y[:, channel], rate, order, colours[channel], f50_max
        )

    run_in_threads(smooth, [channel for channel in channels if lines[channel]])
    columns = {
        name: np.stack([getattr(parts[channel], name) for channel in channels], axis=-1)
        for name in PER_CHANNEL
    }
    signal = SmoothedSignal(**columns, order=order, rate=rate)
    return ColouredSmoothing(signal, lines, tuple(colours.get(c) for c in channels))


def _smooth_coloured_channel(
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
