"""Instruments from a second sensor: positions of a second encoder.

The noise of two sensors is independent, so that of the first does not correlate with instruments
from the second. Positions that are computed from the first encoder are no second sensor: their
noise is that of the first, and shows in them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.instruments.given_motion import GivenMotions, agreement, correlated, not_there
from pivident.motion.kinematics import Kinematics
from pivident.motion.motion import SimulatedMotion
from pivident.signals.random_walk import smooth

#: Correlation of the noise of both sensors from which on they are one.
SAME_SENSOR = 0.3


def sensor_instruments(kinematics: Sequence[Kinematics]) -> GivenMotions:
    """Smoothed positions of the second encoders.

    Raises:
        IdentificationError: a recording has none.
    """
    motions, same = [], np.zeros(len(kinematics[0].q))
    for kin in kinematics:
        recording = kin.recording
        if recording.q_link is None:
            not_there("sensor", f"recording {recording.name!r} has no second encoder (q_link)")
        q = np.stack([_smoothed(kin, recording.q_link[:, j], j) for j in range(len(kin.q))])
        motions.append(SimulatedMotion(q, recording.rate))
        same = np.maximum(same, np.abs(_common_noise(kin, recording.q_link.T - q)))
    names = kinematics[0].recording.joint_names
    shares = correlated("the noise of both encoders is correlated", names, same, SAME_SENSOR)
    return GivenMotions("sensor", motions, (), agreement(kinematics, motions), shares)


def _smoothed(kin: Kinematics, positions: np.ndarray, j: int) -> np.ndarray:
    """Positions of the second encoder within the band of the first one's smoothed motion."""
    band = kin.f50[j] if np.isfinite(kin.f50[j]) else None
    return smooth(positions, kin.recording.rate, f50_max=band).q


def _common_noise(kin: Kinematics, other: np.ndarray) -> np.ndarray:
    """Correlation of what smoothing leaves of both sensors, shape (joints,)."""
    part = slice(kin.start, kin.stop)
    x = (kin.recording.q.T - kin.q)[:, part]
    y = other[:, part]
    x, y = x - x.mean(axis=1, keepdims=True), y - y.mean(axis=1, keepdims=True)
    scale = np.sqrt(np.sum(x**2, axis=1) * np.sum(y**2, axis=1))
    return np.sum(x * y, axis=1) / np.maximum(scale, 1e-300)
