"""Instruments from a virtual computed-torque loop around the smoothed motion.

Computed torque cancels the robot's own dynamics, whatever its parameters, and leaves the error
dynamics that it was given:

    ddq_s = ω² (q̂ - q_s) - 2 ζ ω dq_s,      ω = 2π f,  ζ = 1/√2

So nothing has to be known, and nothing can diverge. The loop follows the motion and not the noise
above its bandwidth f; the delay that it has at low frequencies, 2ζ/ω, is taken out. f is that of
robots' motion, at most an eighth of the sampling rate and the frequency at which noise prevails in
the positions. Noise within the bandwidth stays: the power that noise has in an acceleration grows
with f⁵, so little of it does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.instruments.given_motion import GivenMotions, InstrumentKind, agreement
from pivident.instruments.reference_response import odd_extension
from pivident.motion.kinematics import MOTION_BAND, Kinematics
from pivident.motion.motion import SimulatedMotion

#: Damping ζ of the error dynamics: the flattest gain.
DAMPING = np.sqrt(0.5)

#: The bandwidth stays below the sampling rate divided by this.
RATE_OVER_BANDWIDTH = 8.0

#: Periods of the bandwidth after which the loop has forgotten where it started.
FORGOTTEN_PERIODS = 1.5


def virtual_instruments(kinematics: Sequence[Kinematics]) -> GivenMotions:
    """The motion that a virtual computed-torque loop makes of the smoothed one."""
    motions = [virtual_motion(kin) for kin in kinematics]
    bands = [[bandwidth(kin, j) for j in range(len(kin.q))] for kin in kinematics]
    names = kinematics[0].recording.joint_names
    listed = ", ".join(
        f"{f:.3g} Hz of {name!r}" for name, f in zip(names, np.mean(bands, axis=0), strict=True)
    )
    found = (f"bandwidths {listed}",)
    return GivenMotions(VIRTUAL, motions, found, agreement(kinematics, motions))


def virtual_motion(kin: Kinematics) -> SimulatedMotion:
    """q_s of one recording."""
    rate = kin.recording.rate
    q = np.stack([followed(kin.q[j], rate, bandwidth(kin, j)) for j in range(len(kin.q))])
    return SimulatedMotion(q, rate)


def bandwidth(kin: Kinematics, j: int) -> float:
    """F of one joint [Hz]: the band of a robot's motion, as far as rate and noise leave it."""
    rate, noise_prevails = kin.recording.rate, kin.f50[j]
    highest = noise_prevails if np.isfinite(noise_prevails) else rate
    return float(min(MOTION_BAND, rate / RATE_OVER_BANDWIDTH, highest))


def followed(q: np.ndarray, rate: float, bandwidth: float) -> np.ndarray:
    """q_s of one joint without its delay, shape (samples,).

    Before and after the record the motion goes on as it does when it is mirrored at its ends.
    """
    from scipy.interpolate import CubicSpline
    from scipy.signal import bilinear, lfilter, lfilter_zi

    omega = 2.0 * rate * np.tan(np.pi * bandwidth / rate)  # the bilinear transform keeps f
    b, a = bilinear([omega**2], [1.0, 2.0 * DAMPING * omega, omega**2], rate)
    delay = 2.0 * DAMPING / omega * rate
    margin = min(int(np.ceil(FORGOTTEN_PERIODS * rate / bandwidth)) + 2, q.size - 1)
    extended = odd_extension(q, margin)
    made = lfilter(b, a, extended, zi=lfilter_zi(b, a) * extended[0])[0]
    at = np.arange(q.size) + margin + delay
    return CubicSpline(np.arange(made.size), made)(np.minimum(at, made.size - 1.0))


#: A virtual computed-torque loop around the smoothed motion.
VIRTUAL = InstrumentKind(
    "virtual",
    "a virtual computed-torque loop around the smoothed motion",
    "noise above the bandwidth of the virtual loop",
    "noise within that bandwidth, and disturbances",
    floating="a floating base has no motors that a law could command",
    make=virtual_instruments,
)
