"""Instruments from interleaved halves: regressors from the even samples, instruments from the odd.

White noise of the encoders is independent from one sample to the next. The motion smoothed from
the even samples and that from the odd ones share the motion and none of that noise, so that the
errors of smoothed regressors, which bias least squares towards zero, do not correlate with the
instruments. Where the feedback has answered to the noise, both halves have moved with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pivident.instruments.given_motion import GivenMotions, agreement, correlated, not_there
from pivident.instruments.virtual_loop import virtual_motion
from pivident.motion.kinematics import MIN_RUN, Kinematics
from pivident.signals.instants import differences_at_instants
from pivident.signals.random_walk import smooth_channels

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
            not_there("halves", f"recording {recording.name!r} has {recording.samples} samples")
        even, odd = (_half(recording.q, first, recording.rate) for first in (0, 1))
        dq, ddq = np.empty((2, *even.shape))
        differences_at_instants(even, recording.rate, 0, dq, ddq)
        regressors.append(replace(kin, q=even, dq=dq, ddq=ddq))
        motions.append(virtual_motion(replace(kin, q=odd)))
        coloured = np.maximum(coloured, np.abs(_neighbours(kin)))
    names = kinematics[0].recording.joint_names
    said = "the noise of neighbouring positions is correlated"
    shares = correlated(said, names, coloured, COLOURED)
    return GivenMotions("halves", motions, (), agreement(regressors, motions), shares, regressors)


def _half(q: np.ndarray, first: int, rate: float) -> np.ndarray:
    """Every other sample smoothed at half the rate, at all samples, shape (joints, samples)."""
    from scipy.interpolate import CubicSpline

    smoothed = smooth_channels(q[first::2], 0.5 * rate).q
    at = np.arange(first, len(q), 2)
    return np.ascontiguousarray(CubicSpline(at, smoothed)(np.arange(len(q))).T)


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
