"""Instruments from interleaved halves: regressors from the even samples, instruments from the odd.

White noise of the encoders is independent from one sample to the next. The motion smoothed from
the even samples and that from the odd ones share the motion and none of that noise, so that the
errors of smoothed regressors, which bias least squares towards zero, do not correlate with the
instruments. Where the feedback has answered to the noise, both halves have moved with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from pivident.loop.instruments.given_motion import (
    GivenMotions,
    InstrumentKind,
    agreement,
    correlated,
)
from pivident.loop.instruments.reference_response import virtual_motion
from pivident.loop.motion.motion import MIN_RUN, Kinematics
from pivident.signals.cubic_spline import cubic_spline
from pivident.signals.instants import differences_at_instants
from pivident.signals.random_walk import WalkSmoother, smooth_channels

#: Correlation of neighbouring samples' noise from which on it is not white.
COLOURED = 0.2


def interleaved_instruments(kinematics: Sequence[Kinematics]) -> GivenMotions:
    """Both halves, smoothed, at all samples.

    Raises:
        IdentificationError: a half is too short to be smoothed.
    """
    motions, regressors, coloured = [], [], np.zeros(len(kinematics[0].q))
    for kin in kinematics:
        recording = kin.recording
        if recording.samples < 4 * MIN_RUN:
            HALVES.absent(f"recording {recording.name!r} has {recording.samples} samples")
        even, odd = (_half(kin, first) for first in (0, 1))
        dq, ddq = np.empty((2, *even.q.shape))
        differences_at_instants(even.q, recording.rate, 0, dq, ddq)
        regressors.append(replace(kin, q=even.q, dq=dq, ddq=ddq, smoothers=even.smoothers))
        motions.append(virtual_motion(replace(kin, q=odd.q)))
        coloured = np.maximum(coloured, np.abs(_neighbours(kin)))
    said = "the noise of neighbouring positions is correlated"
    shares = correlated(said, kinematics[0].recording.joint_names, coloured, COLOURED)
    return GivenMotions(HALVES, motions, (), agreement(regressors, motions), shares, regressors)


@dataclass(frozen=True, eq=False)
class HalfSmoother:
    """The smoother S of one channel by every other of its samples."""

    walk: WalkSmoother  # at half the rate
    first: int  # of the samples that it sees

    def smoothed(self, y: np.ndarray) -> np.ndarray:
        """S y of a channel, at all samples, shape (samples,)."""
        own = np.ascontiguousarray(y[self.first :: 2])
        return _at_all(self.walk.smoothed(own), self.first, len(y))

    def band(self, rate: float) -> float:
        """Frequency that it halves [Hz], at a sampling ``rate`` [Hz]."""
        return self.walk.band(0.5 * rate)


class Half(NamedTuple):
    """The motion that every other sample shows."""

    q: np.ndarray  # at all samples, shape (joints, samples)
    smoothers: tuple[HalfSmoother | None, ...]  # None where counts are visible: no linear operator


def _half(kin: Kinematics, first: int) -> Half:
    """Every other sample smoothed at half the rate."""
    recording = kin.recording
    made = smooth_channels(recording.q[first::2], 0.5 * recording.rate)
    q = np.ascontiguousarray(_at_all(made.q, first, recording.samples).T)
    smoothers = tuple(
        None if whole is None else HalfSmoother(WalkSmoother(float(nvr), made.order), first)
        for nvr, whole in zip(np.atleast_1d(made.nvr), kin.smoothers, strict=False)
    )
    return Half(q, smoothers)


def _at_all(half: np.ndarray, first: int, samples: int) -> np.ndarray:
    """Every other sample and what lies between them, along axis 0."""
    return cubic_spline(np.arange(first, samples, 2), half)(np.arange(samples))


def _neighbours(kin: Kinematics) -> np.ndarray:
    """Correlation of q - q̂ with its neighbour beyond what smoothing makes of white noise.

    Taking a smooth motion from white noise leaves neighbours correlated by no more than minus the
    share that was taken.
    """
    rest = (kin.recording.q.T - kin.q)[:, kin.start : kin.stop]
    rest = rest - rest.mean(axis=1, keepdims=True)
    square = np.maximum(np.sum(rest**2, axis=1), 1e-300)
    lag = np.sum(rest[:, 1:] * rest[:, :-1], axis=1) / square
    kept = np.minimum(2.0 * kin.f50 / kin.recording.rate, 1.0)
    kept = np.where(np.isfinite(kept), kept, 1.0)
    return np.where(lag < 0.0, np.minimum(lag + kept, 0.0), lag)


#: Every other sample of the positions.
HALVES = InstrumentKind(
    "halves",
    "every other sample of the positions",
    "white noise of the encoders",
    "coloured noise, and noise to which the feedback has answered",
    make=interleaved_instruments,
)
