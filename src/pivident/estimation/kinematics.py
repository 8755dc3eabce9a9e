"""From a recording to what the equations need: positions, speeds, accelerations, aligned torque.

A position filter must leave the motion alone and keep noise out of the accelerations, where least
squares takes it for motion. Which of the two is at stake depends on the record: at 1 kHz with a
fine encoder nothing below 50 Hz is noise, at 100 Hz with 14 bits most of what is above 10 Hz is.
Unless a recipe says otherwise, each joint is cut off where its motion sinks into its noise, and
never beyond what the decimation keeps or the rate holds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pivident.data.logs.timestamps import clear_of_unusable
from pivident.data.recording.recording import Recording
from pivident.estimation.signal_recipes import Algebraic, Bandpass, RandomWalk, SignalRecipe
from pivident.foundation.common_work import once
from pivident.foundation.errors import RecordingError, RecordingTooShort
from pivident.foundation.scratch import working_array
from pivident.foundation.threads import run_in_threads
from pivident.loop.motion.motion import MIN_RUN, Kinematics, aligned_torque
from pivident.signals.algebraic import algebraic_derivative, half_gain_product
from pivident.signals.bandpass import EDGE, bandpass
from pivident.signals.coloured_walk_likelihood import NoiseColour
from pivident.signals.counted_positions import has_visible_counts, nvr_of_counts
from pivident.signals.decimation import fewest_samples
from pivident.signals.instants import derivatives_at_instants, torque_at_instants
from pivident.signals.random_walk import (
    SmoothedSignal,
    WalkSmoother,
    half_power_frequencies,
    smooth_channels,
    smooth_with_lines,
)
from pivident.signals.spectral_lines import SpectralLine

#: Samples beside a torque that its value at the instant is made from, to a thousandth.
NUMEROV = 3

#: Cut-off over the half-power frequency: the Butterworth filter then keeps 96 % there.
ABOVE_HALF_POWER = 1.5

#: Largest cut-off over the band that decimation keeps, whose edge then loses a thousandth.
ABOVE_BAND = 2.5

#: Largest share of the sampling rate, and fewest periods of a cut-off in a record: its ends, five
#: periods each, are dropped.
SHARE_OF_RATE, MIN_PERIODS = 0.45, 20.0


def estimate_kinematics(recording: Recording, signals: SignalRecipe) -> Kinematics:
    """Differentiate the positions and put the torque where the derivatives are.

    Args:
        recording: the run.
        signals: the recipe.

    Returns:
        Positions, speeds, accelerations and torques on the valid samples.

    Raises:
        RecordingTooShort: fewer than `MIN_RUN` samples would remain between the ends.
        RecordingError: a cut-off that the recording's rate does not allow.
    """
    return once(("kinematics", recording, signals), lambda: _kinematics(recording, signals))


def _kinematics(recording: Recording, signals: SignalRecipe) -> Kinematics:
    """The same, computed."""
    signals = settled_recipe(signals, [recording])
    walks = isinstance(signals, RandomWalk)
    ends = (EDGE, EDGE) if isinstance(signals, RandomWalk) else signals.ends(recording.rate)
    if recording.samples < (needed := samples_needed(signals, recording.rate)):
        raise RecordingTooShort(recording.samples, needed)
    f50 = encoder_std = np.full(recording.joints, np.nan)
    lines: tuple[tuple[SpectralLine, ...], ...] = ()
    smoothers: tuple[WalkSmoother | None, ...] = ()
    halves: list[int] = []  # samples on each side of the windows that the torque passes
    if isinstance(signals, Bandpass):
        motion = _bandpassed(recording, signals)
    elif isinstance(signals, Algebraic):
        motion = _in_windows(recording, signals)
        halves = signals.halves(recording.rate, recording.joints) if signals.filters_torque else []
    else:
        smoothed, lines, smoothers = _random_walk(recording, signals)
        motion = (smoothed.q, smoothed.dq, smoothed.ddq)
        ends = (smoothed.edge, smoothed.edge)
        f50, encoder_std = np.atleast_1d(smoothed.f50), np.atleast_1d(smoothed.noise_std)
    q, dq, ddq = (np.ascontiguousarray(x.T) for x in motion)
    tau = working_array(q.shape)
    # Wrenches are values at instants: torques that are half a period late would contradict them.
    align = signals.align or recording.wrench_torque is not None
    at_instants = align and not isinstance(signals, Bandpass)
    lost = [(0, 0)] * recording.joints
    measured = None if recording.valid is None else np.ascontiguousarray(recording.valid.T)

    def work(j: int) -> None:
        torque = aligned_torque(recording, j, align)
        lost[j] = torque.lost_start, torque.lost_end
        averaged = at_instants and torque.is_average
        tau[j] = torque_at_instants(torque.tau) if averaged else torque.tau
        if measured is not None:  # by all samples that the torque was moved from
            reach = NUMEROV * averaged
            first, last = torque.lost_start + reach, torque.lost_end + reach
            measured[j] = clear_of_unusable(measured[j], first, last)
        if recording.wrench_torque is not None:
            tau[j] += recording.wrench_torque[:, j]
        if at_instants and walks:
            dq[j], ddq[j] = derivatives_at_instants(dq[j], ddq[j])
        if halves:
            tau[j] = _in_window(tau[j], halves[j], recording.rate, signals, 0)
            lost[j] = lost[j][0] + halves[j], lost[j][1] + halves[j]

    run_in_threads(work, range(recording.joints))
    start = max(ends[0], *(first for first, _ in lost))
    stop = recording.samples - max(ends[1], *(last for _, last in lost))
    if stop - start < MIN_RUN:
        raise RecordingTooShort(recording.samples, recording.samples - (stop - start) + MIN_RUN)
    return Kinematics(
        recording, q, dq, ddq, tau, start, stop, f50, encoder_std, lines, smoothers,
        measured=measured,
    )  # fmt: skip


def samples_needed(signals: SignalRecipe, rate: float) -> int:
    """Samples that a settled recipe drops at the ends, and those that it needs between them."""
    if isinstance(signals, RandomWalk):
        return 2 * EDGE + MIN_RUN
    between = fewest_samples(signals.factor(rate), signals.convention)
    return sum(signals.ends(rate)) + max(MIN_RUN, between)


def settled_recipe(signals: SignalRecipe, recordings: Sequence[Recording]) -> SignalRecipe:
    """The recipe with its cut-offs or windows and its band in numbers.

    Of several recordings the largest cut-off of each joint is taken, and the band of the slowest.

    Args:
        signals: the recipe; where nothing is open it is returned as it is.
        recordings: what it is for.
    """
    if isinstance(signals, RandomWalk):
        return signals
    settled: Any = signals
    if signals.decimation is None and signals.bandwidth is None:
        settled = replace(settled, bandwidth=signals.band(min(r.rate for r in recordings)))
    if isinstance(signals, Bandpass) and signals.cutoff is None:
        found = np.max([_cutoffs(signals, r) for r in recordings], axis=0)
        at_instants = True if signals.at_instants is None else signals.at_instants
        return replace(settled, cutoff=_rounded(found), at_instants=at_instants)
    if isinstance(signals, Algebraic) and signals.window is None:
        found = np.max([_cutoffs(signals, r) for r in recordings], axis=0)
        product = half_gain_product(signals.degree, signals.exponent)
        return replace(settled, window=_rounded(product / found))
    return settled


def _rounded(values: np.ndarray) -> tuple[float, ...]:
    """Three digits of each."""
    return tuple(float(f"{value:.3g}") for value in values)


def _bandpassed(recording: Recording, signals: Bandpass) -> tuple[np.ndarray, ...]:
    """q, dq and ddq behind the band-pass, shape (samples, joints) each."""
    cutoffs = signals.cutoffs(recording.joints)
    if recording.slowed and not cutoffs.max() < recording.rate / 2:
        raise RecordingError(
            f"recording {recording.name!r}: the position filter has a cut-off of "
            f"{cutoffs.max():g} Hz, but at {recording.rate:g} Hz there is nothing above "
            f"{recording.rate / 2:g} Hz",
            advice=recording.slowed,
        )
    passed = bandpass(
        recording.q,
        recording.rate,
        cutoffs,
        signals.order,
        median=signals.median,
        padlen=signals.padlen,
        at_instants=bool(signals.at_instants),
    )
    return passed.q, passed.dq, passed.ddq


def _in_windows(recording: Recording, signals: Algebraic) -> tuple[np.ndarray, ...]:
    """q, dq and ddq by algebraic differentiation, shape (samples, joints) each."""
    halves = signals.halves(recording.rate, recording.joints)
    made = np.empty((3, recording.joints, recording.samples))

    def work(j: int) -> None:
        own = np.ascontiguousarray(recording.q[:, j])
        for n in range(3):
            made[n, j] = _in_window(own, halves[j], recording.rate, signals, n)

    run_in_threads(work, range(recording.joints))
    return tuple(x.T for x in made)


def _in_window(
    x: np.ndarray, half: int, rate: float, signals: SignalRecipe, derivative: int
) -> np.ndarray:
    """A derivative of one signal by its window, shape (samples,)."""
    assert isinstance(signals, Algebraic)
    return algebraic_derivative(x, half, rate, derivative, signals.degree, signals.exponent)


def _cutoffs(signals: Bandpass | Algebraic, recording: Recording) -> np.ndarray:
    """Cut-off of each joint for one recording, shape (joints,) [Hz]."""
    rate = recording.rate
    band = np.full(recording.joints, signals.band(rate))
    if isinstance(
        signals, Algebraic
    ):  # at the full rate, too: counts have no white noise to sink in
        counted = [has_visible_counts(q) for q in recording.q.T]
        band = np.where(counted, np.minimum(band, Algebraic().band(rate)), band)
    highest = np.minimum(ABOVE_BAND * band, SHARE_OF_RATE * rate)
    lowest = np.minimum(np.maximum(MIN_PERIODS / recording.duration, 0.05 * highest), highest)
    found = once(("half power", recording), lambda: half_power_frequencies(recording.q, rate))
    return np.clip(ABOVE_HALF_POWER * found, lowest, highest)


def _random_walk(
    recording: Recording, signals: RandomWalk
) -> tuple[SmoothedSignal, tuple[tuple[SpectralLine, ...], ...], tuple[WalkSmoother | None, ...]]:
    """Smoothed positions, lines of their noise where the recipe has them searched, the smoothers.

    Rounding noise has a recipe of its own, and no lines are looked for beside it.
    """
    searched = signals.measurement_noise == "auto" and signals.passes == 1
    counts = _nvr_of_counts(recording, signals) if searched else None
    lines: tuple[tuple[SpectralLine, ...], ...] = ()
    colours: tuple[NoiseColour | None, ...] = (None,) * recording.joints
    if searched and counts is None:
        coloured = smooth_with_lines(
            recording.q, recording.rate, signals.order, f50_max=signals.f50_max
        )
        smoothed, lines, colours = coloured.signal, coloured.lines, coloured.colours
    else:
        smoothed = smooth_channels(
            recording.q,
            recording.rate,
            signals.order,
            counts,
            passes=signals.passes,
            f50_max=signals.f50_max,
        )
    if signals.passes > 1:
        return smoothed, lines, ()
    smoothers = tuple(
        None if has_visible_counts(y) else WalkSmoother(float(nvr), signals.order, colour)
        for y, nvr, colour in zip(recording.q.T, smoothed.nvr, colours, strict=True)
    )
    return smoothed, lines, smoothers


def _nvr_of_counts(recording: Recording, signals: RandomWalk) -> list[float] | None:
    """NVR of the channels whose counts are visible, NaN for the others; None if none are."""
    found = [math.nan] * recording.joints

    def work(j: int) -> None:
        if has_visible_counts(recording.q[:, j]):
            nvr = nvr_of_counts(recording.q[:, j], recording.rate, signals.order, signals.f50_max)
            found[j] = math.nan if nvr is None else nvr

    run_in_threads(work, range(recording.joints))
    return None if all(math.isnan(nvr) for nvr in found) else found
