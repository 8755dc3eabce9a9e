"""Signals of one joint in motion for the fit of its deflection.

Torque and acceleration are low-passed with zero phase; the torque of the motor's inertia is
subtracted. The link encoder is shifted by an estimate of its delay. If the reference was recorded,
functions of it serve as instruments, since they are free of measurement noise, and give the
direction of change of the torque.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pivident.errors import IdentificationError
from pivident.flexibility.spectral_equations import BLOCKS
from pivident.recording.recording import Recording
from pivident.signals.bandpass import butterworth, central_difference

#: Smallest number of samples in motion, so that each block of the jackknife has some.
MIN_SAMPLES = 20 * BLOCKS

#: Joints below this share of their highest speed stand still: the sign of friction is not known.
STANDSTILL = 0.02

#: Share of the torque's range over which hysteresis and backlash change sides.
TRANSITION = 0.1


@dataclass(frozen=True, eq=False)
class DeflectionMotion:
    """Moving samples of one joint, shape (samples,) each."""

    t: np.ndarray  # instants [s]
    angle: np.ndarray  # of the motor [rad]
    deflection: np.ndarray  # motor angle over gear ratio less the retimed link angle [rad]
    torque: np.ndarray  # low-passed, less that of the motor's inertia [N m]
    # the torque that follows from the reference; the torque itself without one [N m]
    followed: np.ndarray
    torque_rate: np.ndarray  # derivative of the torque [N m/s]
    speed: np.ndarray  # low-passed [rad/s]
    sign: np.ndarray  # smoothed sign of the speed
    direction: np.ndarray  # in which the torque moves, -1 to 1
    # functions of the reference, shape (samples, functions), or None
    instruments: np.ndarray | None
    # remaining delay of the shifted link encoder and its standard error [s]; None: to be estimated
    known_lag: tuple[float, float] | None
    retimed: float  # by how much the link encoder was moved back [s]
    recorded: tuple[float, float]  # lowest and highest recorded difference of the encoders [rad]


def deflection_motion(
    recording: Recording,
    joint: int,
    motor_inertia: float,
    reduction: float,
    cutoff: float,
    known_lag: tuple[float, float] | None,
    gamma: float | None,
    retimed: float = 0.0,
) -> DeflectionMotion:
    """Signals of the samples in motion.

    ``known_lag``: how much later the link encoder is read, and its standard error [s]. ``gamma``:
    slope of the smoothed sign of friction [s/rad]; None: it changes within 2 % of the highest
    speed. ``retimed``: by how much the link encoder is moved back [s].
    """
    if recording.q_link is None:
        raise IdentificationError(
            f"recording {recording.name!r} has no link encoder; name its columns as q_link, or use "
            "the resonance in the loop (pivident.flexibility.resonance)"
        )
    rate = recording.rate
    cutoff = min(cutoff, 0.4 * rate)
    q, tau = recording.q[:, joint], recording.tau[:, joint]
    if recording.torque_timing == "held" and recording.control_rate <= 1.01 * rate:
        tau = 0.5 * (tau + np.concatenate([tau[:1], tau[:-1]]))
    smooth = butterworth(q, rate, cutoff, 2)
    speed = central_difference(smooth, rate)
    acceleration = central_difference(speed, rate)
    torque = butterworth(tau, rate, cutoff, 2) - motor_inertia * acceleration
    fastest = float(np.abs(speed).max())
    kept = np.abs(speed) > STANDSTILL * fastest
    edge = math.ceil(rate / cutoff)
    kept[:edge] = kept[-edge:] = False
    if kept.sum() < MIN_SAMPLES:
        raise IdentificationError(
            f"joint {recording.joint_names[joint]!r} of recording {recording.name!r} moves for "
            f"{kept.sum()} samples; {MIN_SAMPLES} are needed: record a longer motion"
        )
    if gamma is None:
        sign = np.tanh(speed / (0.5 * STANDSTILL * fastest))
    else:
        sign = 2 / np.pi * np.arctan(gamma * speed)
    raw = q - recording.q_link[:, joint]
    deflection = q - _earlier(recording.q_link[:, joint], rate, retimed)
    functions = _reference_functions(recording)
    followed = torque
    if functions is not None:
        followed = functions @ np.linalg.lstsq(functions[kept], torque[kept], rcond=None)[0]
    direction = _stop(followed, TRANSITION * float(np.ptp(followed[kept])))
    return DeflectionMotion(
        t=recording.t[kept],
        angle=reduction * q[kept],
        deflection=deflection[kept],
        torque=torque[kept],
        followed=followed[kept],
        torque_rate=central_difference(torque, rate)[kept],
        speed=speed[kept],
        sign=sign[kept],
        direction=direction[kept],
        instruments=None if functions is None else functions[kept],
        known_lag=None if known_lag is None else (known_lag[0] - retimed, known_lag[1]),
        retimed=retimed,
        recorded=(float(raw[kept].min()), float(raw[kept].max())),
    )


def _earlier(x: np.ndarray, rate: float, lag: float) -> np.ndarray:
    """x(t + lag) by a cubic spline, held beyond the ends."""
    from scipy.interpolate import CubicSpline

    if lag == 0.0:
        return x
    at = np.arange(len(x), dtype=float)
    return CubicSpline(at, x)(np.clip(at + lag * rate, 0, len(x) - 1))


def _reference_functions(recording: Recording) -> np.ndarray | None:
    """Functions of the reference that determine the torque of a moving arm, free of noise."""
    if recording.q_ref is None:
        return None
    q = recording.q_ref
    dq = central_difference(q, recording.rate)
    ddq = central_difference(dq, recording.rate)
    sign = np.tanh(dq / (STANDSTILL * np.maximum(np.abs(dq).max(axis=0), 1e-12)))
    centred = q - q.mean(axis=0)
    parts = [dq, sign, ddq, dq**2, np.sin(q), np.cos(q), ddq * centred, ddq * centred**2]
    columns = np.column_stack([np.ones(len(q)), *parts])
    return columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)


def _stop(x: np.ndarray, width: float) -> np.ndarray:
    """Stop operator: direction in which x moves, -1 to 1 within a change of x by ``width``."""
    z = np.zeros(len(x))
    scale = 2.0 / max(width, 1e-300)
    for i in range(1, len(x)):
        z[i] = min(1.0, max(-1.0, z[i - 1] + scale * (x[i] - x[i - 1])))
    return z
