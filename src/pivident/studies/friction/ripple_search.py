"""Search for ripple in one joint's residual: lines over the position against lines in time.

The likeliest line is subtracted and the rest is searched again, until the next line could be noise.
At each step the best line over a position competes with the best line of constant frequency, such
as mains hum or a resonance; if the speed varies, only one of them is narrow. A likelier line in
time is subtracted as such and does not count as ripple.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification
from pivident.foundation.errors import ExperimentError
from pivident.robot.description import Robot
from pivident.signals.filters import fast_length
from pivident.studies.friction.order_spectrum import (
    HIGHEST_FREQUENCY,
    OrderSpectrum,
)
from pivident.studies.friction.ripple_lines import (
    DISTINGUISHABLE,
    Angle,
    JointRipple,
    NamedOrder,
    Ripple,
    TimeLine,
    angles_of,
)
from pivident.studies.friction.ripple_measures import (
    LAGS,
    best_lag,
    highest_order,
    joint_spectra,
    marked_beside,
    measured_line,
    most_significant,
    named_findings,
    visibility_notes,
    visited_grid,
)
from pivident.studies.friction.ripple_series import (
    ResidualSeries,
    Wave,
    WaveFit,
    delayed,
    fit_waves,
    residual_series,
    settled_rows,
    whitened,
)

#: Maximum number of lines of constant frequency subtracted from a joint.
MAX_TIME_LINES = 8

#: Smallest number of periods of a line in time in a recording.
MIN_PERIODS = 8.0

#: Half the neighbourhood of a frequency, in independent frequencies.
_NEIGHBOURS = 60

#: Padding of the Fourier transform in time.
_PADDING = 4


def find_ripple(
    identification: Identification,
    recordings: Sequence[Recording] | None = None,
    *,
    named: Sequence[NamedOrder] = (),
    highest: float | None = None,
    cycles: float = 4.0,
    alpha: float = 0.05,
    most: int = 6,
    lag: float | None = None,
) -> Ripple:
    """Search the residual τ - Φθ of every joint for ripple, joint by joint.

    Args:
        identification: result of any method.
        recordings: recordings whose residual is searched at the full rate, with smoothed
            positions; None: the rows that the estimator used, which some methods decimate.
        named: expected orders.
        highest: largest order [cycles per revolution, or rad/m]; None: 16 per motor revolution,
            or the limit of the sampling rate if no gear is known.
        cycles: smallest number of cycles over the visited positions. Fewer cycles cannot be
            distinguished from model errors, which vary with the posture.
        alpha: false-alarm probability per joint, over all orders tried.
        most: maximum number of lines per joint.
        lag: delay of the torque relative to the positions [s]; None: estimated from the strongest
            line of each joint, up to three sampling periods.

    Returns:
        The lines of each joint with their amplitudes, and what they belong to.

    Raises:
        ExperimentError: a recording has other joints than the robot, or a named order names an
            unknown joint.
        IdentificationError: there are no residuals.
    """
    robot = identification.robot
    names = [joint.name for joint in robot.joints]
    for wanted in named:
        if wanted.joint is not None and wanted.joint not in names:
            raise ExperimentError(
                f"named order {wanted.name!r} is of joint {wanted.joint!r}",
                advice=f"the robot has {', '.join(names)}",
            )
    series = residual_series(identification, recordings)
    own = [[wanted for wanted in named if wanted.joint in (None, name)] for name in names]
    return Ripple(
        tuple(
            search_joint(robot, j, series, own[j], highest, cycles, alpha, most, lag)
            for j in range(len(names))
        ),
        alpha,
    )


def search_joint(
    robot: Robot,
    joint: int,
    series: Sequence[ResidualSeries],
    named: Sequence[NamedOrder],
    highest: float | None,
    cycles: float,
    alpha: float,
    most: int,
    lag: float | None = None,
) -> JointRipple:
    """All ripple lines of one joint; see ``find_ripple``."""
    angles, unit = angles_of(robot, joint), robot.joints[joint].torque_unit
    tops = [highest_order(robot, series, joint, angle, highest) for angle in angles]
    grids = [visited_grid(series, joint, a, top) for a, top in zip(angles, tops, strict=True)]
    tried = len(LAGS) if lag is None else 1
    if lag is None:
        lag = best_lag(series, joint, angles, grids, cycles, alpha)
    series = [delayed(one, lag) for one in series]
    found = _taken_out(series, joint, angles, grids, (cycles, alpha, most, tried))
    fit, owners, first, spectra = found.fit, found.owners, found.first, found.left
    lines = [
        measured_line(
            robot, joint, series, angles[o], fit, n, spectra[o], named,
            (found.chances[n], found.beside_time[n]), unit, lag,
        )
        for n, o in enumerate(owners)
        if o >= 0
    ]  # fmt: skip
    # a line that was significant alone may vanish beside the lines found after it
    lines = [line for line in lines if line.interval[0] > 0.0]
    lines.sort(key=lambda line: -line.amplitude)
    lines = [marked_beside(line, lines[:n], angles, spectra) for n, line in enumerate(lines)]
    notes = [
        note
        for angle, spectrum, top in zip(angles, first, tops, strict=True)
        for note in visibility_notes(series, joint, angle, spectrum, top, cycles, unit)
    ]
    asked = [
        finding
        for angle, spectrum in zip(angles, first, strict=True)
        for finding in named_findings(robot, joint, angle, spectrum, named, cycles)
    ]
    return JointRipple(
        robot.joints[joint].name, unit, tuple(lines), tuple(_time_lines(fit, owners)), angles,
        first, spectra, tuple(asked), tuple(notes),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Found:
    """Waves subtracted from a residual one after the other."""

    fit: WaveFit  # all of them together
    owners: list[int]  # index of the angle of each wave; -1: a line in time
    chances: list[float]  # false-alarm probability of each when it was found
    # gain in log-likelihood, in floors, after subtracting the best line in time
    beside_time: list[float]
    first: tuple[OrderSpectrum, ...]  # spectra of the residual
    left: tuple[OrderSpectrum, ...]  # spectra without the lines


def _taken_out(
    series: Sequence[ResidualSeries],
    joint: int,
    angles: Sequence[Angle],
    grids: Sequence[np.ndarray],
    limits: tuple[float, float, int, int],
) -> _Found:
    """Subtract the likeliest line, one after the other, until the next one could be noise."""
    cycles, alpha, most, lags = limits
    waves: list[Wave] = []
    owners: list[int] = []
    chances: list[float] = []
    beside: list[float] = []
    first: tuple[OrderSpectrum, ...] | None = None
    while True:
        fit = fit_waves(series, joint, waves)
        if waves:  # again, with the noise model of the residual without them
            fit = fit_waves(series, joint, fit.waves, (fit.noise, fit.scale))
        waves = list(fit.waves)
        spectra = joint_spectra(series, joint, angles, grids, fit, cycles, lags)
        first = first or spectra
        best = most_significant([_apart(s, a, waves) for s, a in zip(spectra, angles, strict=True)])
        if best is None or best[2] > alpha or sum(owner >= 0 for owner in owners) >= most:
            break
        which, k, chance = best
        spectrum, angle = spectra[which], angles[which].coefficients
        band = _band(series, joint, angle, float(spectrum.orders[k]))
        frequency = _best_in_time(series, joint, fit, band)
        lines = [Wave(None, 2.0 * math.pi * frequency, r) for r in range(len(series))]
        line = Wave(angle, float(spectrum.orders[k]))
        over_position = _gained(series, joint, fit, [line])
        in_time = _gained(series, joint, fit, lines) - (len(lines) - 1) if frequency else 0.0
        if in_time > over_position + DISTINGUISHABLE * max(float(spectrum.floor[k]), 1.0):
            if sum(owner < 0 for owner in owners) >= MAX_TIME_LINES * len(series):
                break
            waves += lines
            owners += [-1] * len(lines)
            chances += [chance] * len(lines)
            beside += [0.0] * len(lines)
        else:
            known = lines if frequency else []
            gain = _gained(series, joint, fit, [*known, line]) - max(in_time, 0.0)
            beside.append(max(gain, 0.0) / max(float(spectrum.floor[k]), 1.0))
            waves.append(line)
            owners.append(which)
            chances.append(chance)
    return _Found(fit, owners, chances, beside, first, spectra)


def _gained(
    series: Sequence[ResidualSeries], joint: int, fit: WaveFit, more: Sequence[Wave]
) -> float:
    """Log-likelihood gained by further refined waves, with an unchanged noise model."""
    after = fit_waves(series, joint, [*fit.waves, *more], (fit.noise, fit.scale))
    rows = [
        sum(
            float(np.sum(whitened(fit.filter, e - fit.noise.mean)[used] ** 2))
            for e, used in (
                (e, settled_rows(s.used[:, joint], fit.noise.order))
                for s, e in zip(series, left, strict=True)
            )
        )
        for left in (fit.left, after.left)
    ]
    return 0.5 * (rows[0] - rows[1])


def _apart(spectrum: OrderSpectrum, angle: Angle, waves: Sequence[Wave]) -> OrderSpectrum:
    """The spectrum without the orders that the record cannot distinguish from given waves."""
    searched = spectrum.searched.copy()
    for wave in waves:
        if wave.coefficients is angle.coefficients and spectrum.orders.size:
            near = int(np.argmin(np.abs(spectrum.orders - wave.order)))
            searched &= np.abs(spectrum.orders - wave.order) > spectrum.resolution(near)
    return replace(spectrum, searched=searched)


def _best_in_time(
    series: Sequence[ResidualSeries], joint: int, fit: WaveFit, band: tuple[float, float]
) -> float:
    """Frequency of the most significant line of constant frequency [Hz]; zero if there is none.

    A line may have another phase in each recording, so each recording has two columns.
    """
    from scipy.ndimage import median_filter

    length = fast_length(_PADDING * max(s.t.size for s in series))
    gain = np.zeros(length // 2 + 1)
    for s, left in zip(series, fit.left, strict=True):
        used = settled_rows(s.used[:, joint], fit.noise.order)
        white = np.where(used, whitened(fit.filter, left - fit.noise.mean), 0.0)
        gain += np.abs(np.fft.rfft(white, length)) ** 2 / max(int(used.sum()), 1)
    frequency = np.arange(gain.size) * series[0].rate / length
    longest = max(s.t.size for s in series) / series[0].rate
    reach = min(2 * _NEIGHBOURS * _PADDING + 1, gain.size // 4 * 2 + 1)
    floor = median_filter(gain, reach, mode="nearest")
    top = min(band[1], 0.5 * HIGHEST_FREQUENCY * series[0].rate)
    inside = (frequency >= max(band[0], MIN_PERIODS / longest)) & (frequency <= top)
    if not inside.any():
        return 0.0
    ratio = np.where(inside, gain / np.maximum(floor, 1e-12), 0.0)
    return float(frequency[int(np.argmax(ratio))])


def _band(
    series: Sequence[ResidualSeries], joint: int, angle: np.ndarray, order: float
) -> tuple[float, float]:
    """Frequencies that an order passes through [Hz]; only a line there can be confused with it."""
    speed = np.concatenate([np.abs(s.dq @ angle)[s.used[:, joint]] for s in series])
    low, high = np.quantile(speed, [0.02, 0.98]) * order / (2.0 * math.pi)
    return 0.95 * float(low), 1.05 * float(high)


def _time_lines(fit: WaveFit, owners: Sequence[int]) -> Iterator[TimeLine]:
    """Lines of constant frequency; one for all recordings that were searched together."""
    count = 1 + max((w.record for w in fit.waves if w.record >= 0), default=0)
    alone = [n for n, owner in enumerate(owners) if owner < 0]
    for start in range(0, len(alone), count):
        group = alone[start : start + count]
        sizes = [float(np.linalg.norm(fit.coefficients[n])) for n in group]
        largest = group[int(np.argmax(sizes))]
        yield TimeLine(fit.waves[largest].order / (2.0 * math.pi), max(sizes))
