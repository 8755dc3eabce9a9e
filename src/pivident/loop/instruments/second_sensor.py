"""Instruments from a second sensor: positions of a second encoder, or measured speeds.

The noise of two sensors is independent, so that of the first does not correlate with instruments
from the second. Positions or speeds that are computed from the first encoder are no second sensor:
their noise is that of the first, and shows in them.

What smoothing leaves of a channel is its noise. If one channel was computed from the other, by
whatever filter, its noise is that of the other, filtered. Two sensors have nothing in common.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import solveh_banded

from pivident.foundation.text.numbers import percent
from pivident.loop.instruments.given_motion import (
    GivenMotions,
    InstrumentKind,
    agreement,
    correlated,
)
from pivident.loop.motion.motion import Kinematics, SimulatedMotion
from pivident.signals.random_walk import irwsm, smooth_channels

#: Share of the noise of one channel that may come from the other: two sensors have 0.05 on real
#: records, speeds that were computed from the positions 0.4 and more.
SAME_SENSOR = 0.1

#: Factor of a speed against the derivative of the position from which on its unit is another.
OTHER_UNIT = 1.5

#: Time in which integrated speeds may drift before they follow the positions [s].
DRIFT = 10.0

#: Channels of a second sensor, the better first, and what they are.
SENSORS = {
    "q_link": "positions of the second encoders (q_link)",
    "dq": "measured speeds (dq)",
}


def sensor_instruments(kinematics: Sequence[Kinematics]) -> GivenMotions:
    """Smoothed positions of the second encoders, or integrated measured speeds.

    Raises:
        IdentificationError: a recording has neither, or its speeds have another unit.
    """
    first = None
    for channel in SENSORS:
        if all(getattr(kin.recording, channel) is not None for kin in kinematics):
            made = _instruments(kinematics, channel)
            if not made.shares_noise:
                return made
            first = first or made
    if first is None:
        listed = ", ".join(repr(kin.recording.name) for kin in kinematics)
        SENSOR.absent(
            f"{listed}: neither a second encoder (q_link) nor speeds with noise of their own (dq)",
        )
    return first


def _instruments(kinematics: Sequence[Kinematics], channel: str) -> GivenMotions:
    """The motion that one channel has seen, and whether its noise is that of the first encoders."""
    motions, same = [], np.zeros(len(kinematics[0].q))
    for kin in kinematics:
        recording = kin.recording
        values = getattr(recording, channel)
        smoothed = np.stack([_smoothed(kin, values[:, j], j) for j in range(len(kin.q))])
        q = smoothed if channel == "q_link" else _integrated(kin, smoothed)
        motions.append(SimulatedMotion(q, recording.rate))
        same = np.maximum(same, explained_noise(recording.q, values, recording.rate))
    said = f"the noise of the {SENSORS[channel]} is correlated with that of the positions"
    found = (
        f"From {SENSORS[channel]}; the noise of the positions explains at most "
        f"{percent(100 * max(float(same.max()), 0.0))} of theirs."
    )
    shares = correlated(said, kinematics[0].recording.joint_names, same, SAME_SENSOR)
    return GivenMotions(SENSOR, motions, (found,), agreement(kinematics, motions), shares)


def _smoothed(kin: Kinematics, values: np.ndarray, j: int) -> np.ndarray:
    """Samples of the second sensor within the band of the first one's smoothed motion."""
    band = kin.f50[j] if np.isfinite(kin.f50[j]) else None
    return irwsm(values, kin.recording.rate, f50_max=band).q


def _integrated(kin: Kinematics, dq: np.ndarray) -> np.ndarray:
    """Positions from speeds, ∫ dq dt without what drifts away from the smoothed positions.

    The drift is a broken line with a knot every ten seconds: the positions' own noise enters by
    two numbers in ten seconds.
    """
    recording = kin.recording
    for j, name in enumerate(recording.joint_names):
        factor = float(dq[j] @ kin.dq[j] / max(kin.dq[j] @ kin.dq[j], 1e-300))
        if not 1.0 / OTHER_UNIT < factor < OTHER_UNIT:
            SENSOR.absent(
                f"dq of joint {name!r} is {factor:.3g} times the derivative of its positions in "
                f"recording {recording.name!r}; check its unit under [recording.units]",
            )
    steps = 0.5 * (dq[:, 1:] + dq[:, :-1]) / recording.rate
    integral = np.concatenate((np.zeros((len(dq), 1)), np.cumsum(steps, axis=1)), axis=1)
    return integral - _broken_line(integral - kin.q, max(1, round(recording.duration / DRIFT)))


def _broken_line(x: np.ndarray, pieces: int) -> np.ndarray:
    """Broken line of equal pieces nearest to x, shape (channels, samples), in least squares."""
    at = np.linspace(0.0, pieces, x.shape[1])
    left = np.minimum(at.astype(int), pieces - 1)
    share = at - left  # of the knot on the right of a sample
    knots = pieces + 1
    gram = np.zeros((2, knots))  # tridiagonal: above the diagonal, and the diagonal
    gram[0, 1:] = np.bincount(left, (1.0 - share) * share, pieces)
    gram[1] = np.bincount(left, (1.0 - share) ** 2, knots) + np.bincount(left + 1, share**2, knots)
    right = np.stack(
        [
            np.bincount(left, (1.0 - share) * row, knots)
            + np.bincount(left + 1, share * row, knots)
            for row in x
        ],
        axis=1,
    )
    level = solveh_banded(gram, right).T
    return (1.0 - share) * level[:, left] + share * level[:, left + 1]


#: Samples before and after each one from which its noise is explained.
LAGS = 16


def explained_noise(x: np.ndarray, y: np.ndarray, rate: float) -> np.ndarray:
    """Share of the noise of y that a filter of the noise of x explains, shape (channels,).

    The coefficient of determination, adjusted for the 2·16 + 1 coefficients, of

        e_y(k) = Σ_i b_i e_x(k + i),    i = -16 … 16,

    with e what smoothing at the bandwidth of maximum likelihood leaves. About 0 for two sensors,
    1 for a speed that was computed from its positions; rounding of y and motion that smoothing did
    not take lie in between.

    Args:
        x: samples of one sensor, shape (samples, channels), any unit.
        y: samples of the other, likewise; a position and a speed may be compared.
        rate: sampling rate [Hz].
    """
    left_x, left_y = (signal - smooth_channels(signal, rate).q for signal in (x, y))
    return np.array([_explained(*pair) for pair in zip(left_x.T, left_y.T, strict=True)])


def _explained(x: np.ndarray, y: np.ndarray) -> float:
    """Adjusted share of the variance of y, (samples,), that lags of x explain."""
    y = y[LAGS : len(y) - LAGS]
    freedom = len(y) - 2 * (LAGS + 1)
    if freedom < 1 or not np.ptp(y):
        return 0.0
    lagged = np.lib.stride_tricks.sliding_window_view(x, 2 * LAGS + 1)
    lagged, y = lagged - lagged.mean(axis=0), y - y.mean()
    total = float(y @ y)
    rest = y - lagged @ np.linalg.lstsq(lagged, y, rcond=None)[0]
    return 1.0 - float(rest @ rest) / total * (len(y) - 1) / freedom


#: A second sensor of the same motion.
SENSOR = InstrumentKind(
    "sensor",
    "a second sensor of the same motion",
    "the noise of the first sensor",
    "noise and disturbances to which the feedback has answered",
    make=sensor_instruments,
)
