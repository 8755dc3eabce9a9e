"""Whole periods of a recording, and what their Fourier lines give.

A signal of period T₀ has lines at k/T₀ and nothing between them. Over a whole number of samples per
period a discrete transform finds them without leakage, so that derivatives are exact up to the
highest line that is kept,

    dⁿq/dtⁿ = Σ_k (2πi k/T₀)ⁿ Q_k exp(2πi k t/T₀)

and the torque is put where the positions are by a factor on each line. With h the sampling period
and s the shift of `pivident.signals.alignment`, a torque that is held for w acts as

    T_k sinc(w k/T₀) exp(-2πi s h k/T₀)

Noise has no period: what differs from one period to the next is noise, and nothing else is
(Pintelon and Schoukens, System Identification, 2012, ch. 2).

The equations on the lines come in two halves of the periods that are each other's instruments.
Mean positions of each half make its Φ, its mean torque τ. The lines 0 … K of each
column are held as the 2K + 1 samples that they are the transform of. By Parseval sums over these
samples are sums over the lines, and a weight w_k on each line is a filter that runs around the
period. The rows of both halves stand side by side, instant by instant, so that whatever
is summed by windows of time holds both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.data.recording.repeated_motion import find_period
from pivident.dynamics.regressor import Regressor
from pivident.estimation.decimated import DecimatedRecord
from pivident.estimation.equation_record import FittedRecording, JointColumns
from pivident.foundation.errors import IdentificationError
from pivident.signals.alignment import torque_shift
from pivident.signals.prefilter import Prefilter

#: Periods that are needed: two that are compared, behind the transient.
MIN_PERIODS = 2

#: Largest distance of a given period from a whole number of samples.
WHOLE = 1e-3


@dataclass(frozen=True)
class WholePeriods:
    """Where the periods of a recording lie."""

    start: int  # first sample
    length: int  # samples of a period
    count: int  # number of periods

    def split(self, x: np.ndarray) -> np.ndarray:
        """A signal (joints, samples) by periods, shape (joints, periods, samples of one)."""
        stop = self.start + self.count * self.length
        return x[:, self.start : stop].reshape(len(x), self.count, self.length)

    def filled(self, x: np.ndarray, samples: int) -> np.ndarray:
        """All periods (joints, samples of all) on all samples, repeated before and after them."""
        at = np.arange(samples) - self.start
        whole = self.count * self.length
        at = np.where(at < 0, at % self.length, at)
        at = np.where(at >= whole, whole - self.length + at % self.length, at)
        return x[:, at]


def whole_periods(recording: Recording, period: float | None, transient: int) -> WholePeriods:
    """The last whole periods of a recording.

    Args:
        recording: the run.
        period: length of a period [s]; None: from the reference, or else the positions.
        transient: periods at the start in which the loop still settles.

    Returns:
        Their place.

    Raises:
        IdentificationError: there is no period, or too few of them; says what to do.
    """
    name, rate = recording.name, recording.rate
    if period is None:
        length = find_period(recording)
        if length is None:
            raise IdentificationError(
                f"recording {name!r} has no whole periods: its reference repeats nowhere within "
                "one sample, and lines of a motion that is not periodic leak. Run one period of a "
                f"motion over and over, {MIN_PERIODS + transient} times or more (the Fourier "
                "motions of pivident excite, or a multisine), or use piv or iv"
            )
    else:
        length = round(period * rate)
        if length < 8 or abs(length - period * rate) > WHOLE:
            raise IdentificationError(
                f"a period of {period:g} s has {period * rate:g} samples in recording {name!r}",
                advice=f"it needs a whole number: {max(length, 8) / rate:.9g} s would have one",
            )
    count = recording.samples // length - transient
    if count < MIN_PERIODS:
        raise IdentificationError(
            f"recording {name!r} has {recording.samples / length:.3g} periods of "
            f"{length / rate:.4g} s, and {transient} of them is left to the transient",
            advice=f"{MIN_PERIODS} more are needed to tell noise from motion: repeat the motion "
            "more often, or set transient = 0 if the log begins in steady motion",
        )
    return WholePeriods(recording.samples - count * length, length, count)


def derivatives_on_lines(
    q: np.ndarray, rate: float, highest: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, speeds and accelerations of whole periods, up to a highest line of each joint.

    Args:
        q: positions [rad or m], shape (joints, samples of one period or of several).
        rate: sampling rate [Hz].
        highest: frequency up to which lines are kept, shape (joints,) [Hz].

    Returns:
        q, dq and ddq, each of the shape of ``q``.
    """
    samples = q.shape[1]
    frequency = np.fft.rfftfreq(samples, 1.0 / rate)
    limit = np.minimum(highest, frequency[(samples - 1) // 2])
    spectrum = np.fft.rfft(q, axis=1) * (frequency <= limit[:, None])
    turn = 2j * np.pi * frequency
    first, second = (np.fft.irfft(spectrum * turn**n, samples, axis=1) for n in (1, 2))
    return np.fft.irfft(spectrum, samples, axis=1), first, second


def torque_on_lines(tau: np.ndarray, recording: Recording) -> np.ndarray:
    """Torque of whole periods at the instants of the positions, of the shape of ``tau`` [N m or N].

    ``tau``: logged torque, shape (joints, samples of one period or of several).
    """
    rate, timing = recording.rate, recording.torque_timing
    frequency = np.fft.rfftfreq(tau.shape[1], 1.0 / rate)
    delay = recording.delay - recording.drive_delay
    shift = torque_shift(rate, timing, control_rate=recording.control_rate, delay=delay) / rate
    factor = np.exp(-2j * np.pi * frequency * shift)
    if timing == "held":
        factor *= np.sinc(frequency / max(rate, recording.control_rate))
    elif timing == "averaged":
        factor /= np.sinc(frequency / rate)
    return np.fft.irfft(factor * np.fft.rfft(tau, axis=1), tau.shape[1], axis=1)


def low_lines(x: np.ndarray, lines: int) -> np.ndarray:
    """The lines 0 to ``lines`` of whole periods (…, samples), as 2 lines + 1 samples of each."""
    length, rows = x.shape[-1], 2 * lines + 1
    kept = np.fft.rfft(x, axis=-1)[..., : lines + 1]
    return np.fft.irfft(kept * (rows / length), rows, axis=-1)


def window_around(slow: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """One where a joint moves, zero where it is slow and up to ``reach`` around, smooth between.

    Args:
        slow: instants of a period that are left out, shape (joints, samples of a period).
        reach: of each joint, to either side, shape (joints,) [samples]; the way back to one is as
            long.

    Returns:
        The window of each joint, of the shape of ``slow``.
    """
    length = slow.shape[1]
    at = np.minimum(np.arange(length), length - np.arange(length))
    made = []
    for own, far in zip(slow, reach, strict=True):
        wide = (at <= 1.5 * far).astype(float)
        bell = np.where(at <= 0.5 * far + 1.0, 1.0 + np.cos(np.pi * at / (0.5 * far + 1.0)), 0.0)
        out = _around(own.astype(float), wide) > 0.5
        made.append(1.0 - np.clip(_around(out.astype(float), bell / bell.sum()), 0.0, 1.0))
    return np.stack(made)


def _around(x: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """Circular convolution, shape (samples of a period,)."""
    return np.fft.irfft(np.fft.rfft(x) * np.fft.rfft(kernel), x.size)


def low_lines_of_all(x: np.ndarray, lines: int) -> np.ndarray:
    """The same of periods (joints, periods, samples) that follow each other, without inner edges.

    They are low-passed in one, as far as the highest line and half a line beyond it, so that fast
    noise does not leak from the edges of each period; shape (joints, periods, 2 lines + 1).
    """
    joints, count, length = x.shape
    rows = 2 * lines + 1
    kept = np.fft.rfft(x.reshape(joints, -1), axis=1)[:, : count * rows // 2 + 1]
    low = np.fft.irfft(kept * (rows / length), count * rows, axis=1)
    return low.reshape(joints, count, rows)


Rows = TypeVar("Rows")

#: Number of halves.
HALVES = 2


@dataclass(frozen=True, eq=False)
class PeriodicRecord(DecimatedRecord):
    """Lines of one recording; rows are instants of one period, each for both halves."""

    weights: np.ndarray = field(kw_only=True)  # w of each line, shape (joints, lines + 1)

    def whitened(
        self, residual: np.ndarray, filters: Sequence[Prefilter], variance: np.ndarray
    ) -> np.ndarray:
        """Weighted residuals of unit variance, shape (joints, rows)."""
        white = [self._weighted(x[None], j)[0] for j, x in enumerate(residual)]
        return np.stack(white) / np.sqrt(np.where(variance > 0, variance, 1.0))[:, None]

    def fitted(
        self, regressor: Regressor, theta: np.ndarray, residual: np.ndarray, whitened: np.ndarray
    ) -> FittedRecording:
        """Signals for plots over one period: means of both halves."""
        index = np.rint(self.sample_numbers).astype(int)[::HALVES]
        torques = _mean(self.tau), _mean(self.tau - residual)
        white = _mean(whitened) * np.sqrt(HALVES)
        used = self.used[:, ::HALVES]
        t = self.t[::HALVES]
        rate, white = float((t.size - 1) / (t[-1] - t[0])), np.where(used, white, np.nan)
        return FittedRecording.at(self.kinematics, index, t, torques, used, white, rate)

    def _columns(
        self, regressor: Regressor, joint: int, extra: np.ndarray | None = None
    ) -> JointColumns:
        """Φ, Z and τ of a joint, weighted; further instruments there are none."""
        own = slice(regressor.offsets[joint], regressor.offsets[joint + 1])
        assert self.z is not None
        phi, z = self._weighted(self.phi[own], joint), self._weighted(self.z[own], joint)
        return phi, z, None, self._weighted(self.tau[joint : joint + 1], joint)[0]

    def _weighted(self, x: np.ndarray, joint: int) -> np.ndarray:
        """Columns (columns, rows) with the weights on their lines."""
        halves = x.reshape(len(x), -1, HALVES)
        lines = np.fft.rfft(halves, axis=1) * self.weights[joint][None, :, None]
        return np.fft.irfft(lines, halves.shape[1], axis=1).reshape(x.shape)


def _mean(x: np.ndarray) -> np.ndarray:
    """Mean of both halves, shape (joints, instants)."""
    return x.reshape(len(x), -1, HALVES).mean(axis=2)
