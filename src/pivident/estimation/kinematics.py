"""From a recording to what the equations need: positions, speeds, accelerations, aligned torque."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pivident.errors import RecordingError, RecordingTooShort
from pivident.estimation.methods import Bandpass, RandomWalk
from pivident.recording.recording import Recording
from pivident.scratch import working_array
from pivident.signals.alignment import AlignedTorque, align_torque
from pivident.signals.bandpass import EDGE, bandpass
from pivident.signals.coloured_walk import smooth_with_lines
from pivident.signals.counted_positions import has_visible_counts, nvr_of_counts
from pivident.signals.instants import derivatives_at_instants, torque_at_instants
from pivident.signals.random_walk import SmoothedSignal, smooth_channels
from pivident.signals.spectral_lines import SpectralLine
from pivident.threads import run_in_threads

#: Samples that must remain between the ends that the filters distort.
MIN_RUN = 100


@dataclass(frozen=True, eq=False)
class Kinematics:
    """Estimated motion of one recording, time **last**, with the torque on the same instants."""

    recording: Recording  # where it comes from
    q: np.ndarray  # positions [rad or m], shape (joints, samples); ``dq ddq tau`` likewise
    dq: np.ndarray  # speeds
    ddq: np.ndarray  # accelerations
    tau: np.ndarray  # torque [N m or N]
    start: int  # first sample that may be used
    stop: int  # one past the last
    #: half-power frequency of the smoother [Hz], shape (joints,); NaN with a band-pass.
    f50: np.ndarray
    #: Measurement noise found [rad or m], shape (joints,); NaN with a band-pass. Where there are
    #: lines, its white floor.
    encoder_std: np.ndarray
    #: Spectral lines found in each joint's measurement noise; empty where not searched.
    lines: tuple[tuple[SpectralLine, ...], ...] = ()
    #: Columns with memory or load, shape (inner entries, samples), see ``Regressor.inner``; None
    #: where they were not made.
    inner: np.ndarray | None = None

    def stretch(self, span: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, dq and ddq on some samples."""
        return self.q[:, span], self.dq[:, span], self.ddq[:, span]


def estimate_kinematics(recording: Recording, signals: Bandpass | RandomWalk) -> Kinematics:
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
    known = signals.ends(recording.rate) if isinstance(signals, Bandpass) else (EDGE, EDGE)
    if recording.samples < sum(known) + MIN_RUN:
        raise RecordingTooShort(recording.samples, sum(known) + MIN_RUN)
    unknown = np.full(recording.joints, np.nan)
    lines: tuple[tuple[SpectralLine, ...], ...] = ()
    if isinstance(signals, Bandpass):
        if recording.slowed and not signals.cutoff < recording.rate / 2:
            raise RecordingError(
                f"recording {recording.name!r}: the position filter has a cut-off of "
                f"{signals.cutoff:g} Hz, but at {recording.rate:g} Hz there is nothing above "
                f"{recording.rate / 2:g} Hz; {recording.slowed}"
            )
        passed = bandpass(
            recording.q,
            recording.rate,
            signals.cutoff,
            signals.order,
            median=signals.median,
            padlen=signals.padlen,
        )
        motion = (passed.q, passed.dq, passed.ddq)
        ends, f50, encoder_std = signals.ends(recording.rate), unknown, unknown
    else:
        smoothed, lines = _random_walk(recording, signals)
        motion = (smoothed.q, smoothed.dq, smoothed.ddq)
        ends = (smoothed.edge, smoothed.edge)
        f50, encoder_std = np.atleast_1d(smoothed.f50), np.atleast_1d(smoothed.noise_std)
    q, dq, ddq = (np.ascontiguousarray(x.T) for x in motion)
    tau = working_array(q.shape)
    at_instants = signals.align and isinstance(signals, RandomWalk)
    lost = [(0, 0)] * recording.joints

    def work(j: int) -> None:
        torque = _aligned(recording, j, signals.align)
        lost[j] = torque.lost_start, torque.lost_end
        averaged = at_instants and torque.is_average
        tau[j] = torque_at_instants(torque.tau) if averaged else torque.tau
        if at_instants:
            dq[j], ddq[j] = derivatives_at_instants(dq[j], ddq[j])

    run_in_threads(work, range(recording.joints))
    start = max(ends[0], *(first for first, _ in lost))
    stop = recording.samples - max(ends[1], *(last for _, last in lost))
    if stop - start < MIN_RUN:
        raise RecordingTooShort(recording.samples, recording.samples - (stop - start) + MIN_RUN)
    return Kinematics(recording, q, dq, ddq, tau, start, stop, f50, encoder_std, lines)


def usable_samples(kinematics: Kinematics) -> np.ndarray:
    """Samples between the ends that the smoother distorts, shape (joints, samples)."""
    usable = np.zeros(kinematics.q.shape, bool)
    usable[:, kinematics.start : kinematics.stop] = True
    return usable


def _aligned(recording: Recording, joint: int, align: bool) -> AlignedTorque:
    """Torque of one joint on the instants of the positions.

    A declared delay is taken out in any case.
    """
    return align_torque(
        np.ascontiguousarray(recording.tau[:, joint]),
        recording.rate,
        recording.torque_timing if align else "sampled",
        control_rate=recording.control_rate,
        delay=recording.delay - recording.drive_delay,
    )


def _random_walk(
    recording: Recording, signals: RandomWalk
) -> tuple[SmoothedSignal, tuple[tuple[SpectralLine, ...], ...]]:
    """Smoothed positions, and the lines of their noise where the recipe has them searched.

    Rounding noise has a recipe of its own, and no lines are looked for beside it.
    """
    searched = signals.measurement_noise == "auto" and signals.passes == 1
    counts = _nvr_of_counts(recording, signals) if searched else None
    if searched and counts is None:
        coloured = smooth_with_lines(
            recording.q, recording.rate, signals.order, f50_max=signals.f50_max
        )
        return coloured.signal, coloured.lines
    smoothed = smooth_channels(
        recording.q,
        recording.rate,
        signals.order,
        counts,
        passes=signals.passes,
        f50_max=signals.f50_max,
    )
    return smoothed, ()


def _nvr_of_counts(recording: Recording, signals: RandomWalk) -> list[float] | None:
    """NVR of the channels whose counts are visible, NaN for the others; None if none are."""
    found = [math.nan] * recording.joints

    def work(j: int) -> None:
        if has_visible_counts(recording.q[:, j]):
            nvr = nvr_of_counts(recording.q[:, j], recording.rate, signals.order, signals.f50_max)
            found[j] = math.nan if nvr is None else nvr

    run_in_threads(work, range(recording.joints))
    return None if all(math.isnan(nvr) for nvr in found) else found
