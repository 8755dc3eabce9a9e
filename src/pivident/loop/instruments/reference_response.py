"""Instruments from a reference: what the closed loop, identified or virtual, makes of it.

In closed loop q = T(z) q_ref + S(z) n with n the noise, whatever the law. T is identified joint by
joint from speeds, and T q_ref is free of the noise of the record but for the few coefficients of T.
Neither law nor masses are needed, and nothing can diverge. Speed commands are integrated; what the
integral drifts away from the positions is slower than any motion, and is taken from them.

That holds if the reference does not itself answer to the noise: an outer loop that makes commands
from measured positions does. What is new in its command at an instant is then correlated with
what was new in the positions a little before.

T is a short series of Laguerre filters,

    y = Σ_i c_i L_i(z) x + e,   L_0 = √(1-a²)/(1 - a z⁻¹),   L_i = L_{i-1} (z⁻¹ - a)/(1 - a z⁻¹)

Laguerre filters are orthonormal for white x, and a few of them describe any well-damped response
once their time constant T, a = exp(-1/(T rate)), is about right (Wahlberg 1991). T and the number
of terms are those of the smallest BIC. The response is linear in c: a fit needs no iteration.

Instruments from a virtual computed-torque loop around the smoothed motion.

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
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr, solve_triangular

from pivident.data.recording.recording import Recording
from pivident.foundation.distributions import chi_square
from pivident.foundation.errors import IdentificationError
from pivident.foundation.text.numbers import percent
from pivident.loop.instruments.given_motion import (
    GivenMotions,
    InstrumentKind,
    agreement,
)
from pivident.loop.motion.motion import MOTION_BAND, Kinematics, SimulatedMotion
from pivident.signals.cubic_spline import cubic_spline
from pivident.signals.filters import (
    butterworth_sections,
    forwards_and_backwards,
    recursion,
    steady_state,
)
from pivident.signals.noise_models import fit_ar, whiten
from pivident.signals.random_walk import smooth_channels

#: Frequency below which an integrated speed command is held at the measured positions, as a share
#: of the inverse of the record's length, and at most this many Hz.
ANCHORED, MAX_ANCHORED = 5.0, 0.2
#: Samples after which an outer loop has answered to a noisy position.
ANSWERED_WITHIN = 10
#: A reference answers to the noise if this share of what is new in it does, significantly.
ANSWERED_SHARE, ANSWERED_LEVEL = 0.12, 1e-4
#: Largest order of the models that make signals white.
WHITENING_ORDER = 40
#: Damping ζ of the error dynamics: the flattest gain.
DAMPING = np.sqrt(0.5)
#: The bandwidth stays below the sampling rate divided by this.
RATE_OVER_BANDWIDTH = 8.0
#: Periods of the bandwidth after which the loop has forgotten where it started.
FORGOTTEN_PERIODS = 1.5


@dataclass(frozen=True)
class Answer:
    """How much of what is new in a joint's reference answers to noise just before."""

    share: float  # 0 to 1
    p_value: float  # probability of a larger share by chance

    @property
    def matters(self) -> bool:
        """Whether it is significant and not small."""
        return self.share > ANSWERED_SHARE and self.p_value < ANSWERED_LEVEL


def response_instruments(kinematics: Sequence[Kinematics]) -> GivenMotions:
    """T q_ref of all recordings.

    Raises:
        IdentificationError: a recording has neither reference nor speed commands.
    """
    motions, responses, answers = [], [], []
    for kin in kinematics:
        motion, own = _of_recording(kin)
        motions.append(motion)
        responses.append(own)
        answers.append(answers_to_noise(kin))
    names = kinematics[0].recording.joint_names
    noisy = [
        f"{name!r} ({percent(100 * max(a.share for a in own))} of it)"
        for name, own in zip(names, zip(*answers, strict=True), strict=True)
        if any(a.matters for a in own)
    ]
    shares = ""
    if noisy:
        shares = f"the reference answers to the noise of the positions: {', '.join(noisy)}"
    found = tuple(
        f"{kin.recording.name!r}: the response explains "
        + ", ".join(
            f"{percent(100 * r.explained)} of the speed of {name!r}"
            for name, r in zip(names, own, strict=True)
        )
        + (" (integrated speed commands)" if kin.recording.q_ref is None else "")
        for kin, own in zip(kinematics, responses, strict=True)
    )
    return GivenMotions(RESPONSE, motions, found, agreement(kinematics, motions), shares)


def _of_recording(kin: Kinematics) -> tuple[SimulatedMotion, list[LinearResponse]]:
    """T q_ref of one recording, and T of each joint."""
    recording, used = kin.recording, slice(kin.start, kin.stop)
    position, speed = reference_motion(recording)
    q, responses = np.empty(kin.q.shape), []
    for j in range(recording.joints):
        response = fit_response(speed[:, j], kin.dq[j], used)
        made = response.of(position[:, j])
        rest = kin.q[j] - made
        q[j] = made + (_slow(rest, recording) if recording.q_ref is None else rest[used].mean())
        responses.append(response)
    return SimulatedMotion(q, recording.rate), responses


def reference_motion(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Position and speed of the reference, shape (samples, joints), smoothed as positions are.

    Steps of a rounded or held reference are no motion.
    """
    if recording.q_ref is not None:
        smoothed = smooth_channels(recording.q_ref, recording.rate)
        return smoothed.q, smoothed.dq
    if recording.dq_ref is None:
        RESPONSE.absent(f"recording {recording.name!r} has no q_ref and no dq_ref")
    return _integrated(recording)


def _integrated(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Speed commands and their integral (trapezoids), from the first measured position on."""
    dq = recording.dq_ref
    assert dq is not None
    steps = 0.5 * (dq[1:] + dq[:-1]) / recording.rate
    position = np.concatenate([np.zeros((1, recording.joints)), np.cumsum(steps, axis=0)])
    smoothed = smooth_channels(position + recording.q[0], recording.rate)
    return smoothed.q, smoothed.dq


def _slow(x: np.ndarray, recording: Recording) -> np.ndarray:
    """What of a signal is slower than any motion."""
    cutoff = min(ANCHORED * recording.rate / recording.samples, MAX_ANCHORED)
    low_pass = butterworth_sections(2, cutoff, recording.rate)
    return forwards_and_backwards(low_pass, x, x.size // 2, held=True)


def answers_to_noise(kin: Kinematics) -> list[Answer]:
    """Whether each joint's reference answers to the noise of the positions, one for each joint.

    Innovations e of the reference and w of q - q̂, both behind autoregressive models of their own,
    are uncorrelated at all lags where the reference knows nothing of q (Haugh 1976):

        N Σ_d r_d² ~ χ²,   r_d = corr(e_k, w_{k-d}),   d = 0 … `ANSWERED_WITHIN`
    """
    recording, used = kin.recording, slice(kin.start, kin.stop)
    reference = recording.dq_ref if recording.q_ref is None else recording.q_ref
    assert reference is not None
    found = []
    for j in range(recording.joints):
        news = _innovations(np.diff(reference[used, j], 2))
        noise = _innovations(recording.q[used, j] - kin.q[j, used])
        if news is None or noise is None:
            found.append(Answer(0.0, 1.0))
            continue
        length = min(news.size, noise.size)
        x, y = news[-length:], noise[-length:]
        scale = np.sqrt((x @ x) * (y @ y))
        r = [float(x[d:] @ y[: length - d]) / scale for d in range(ANSWERED_WITHIN + 1)]
        share = float(np.sum(np.square(r)))
        found.append(Answer(share, float(chi_square.sf(length * share, len(r)))))
    return found


def _innovations(x: np.ndarray) -> np.ndarray | None:
    """What is new in each sample of a signal, None where nothing is."""
    try:
        model = fit_ar(x, WHITENING_ORDER, "bic")
    except IdentificationError:
        return None
    return whiten(model, x - model.mean)[model.order :]


#: Time constants tried [sampling periods], and the largest number of terms.
TIME_CONSTANTS = (1.5, 3.0, 6.0, 12.0, 25.0, 50.0, 100.0, 200.0, 400.0)
MAX_TERMS = 8
#: A further column must be new by this much of its length, or its coefficient is arbitrary.
NEW_SHARE = 1e-3
#: Time constants of the slowest term after which a response has forgotten where it started.
FORGOTTEN = 6.0


@dataclass(frozen=True, eq=False)
class LinearResponse:
    """How one signal follows another.

    Attributes:
        time_constant: T [sampling periods].
        coefficients: of x one sample ahead, of x itself, then c_i, shape (2 + terms,).
        explained: share of the variance of y.
    """

    time_constant: float
    coefficients: np.ndarray
    explained: float

    @property
    def settling(self) -> int:
        """Samples until the start of the record is forgotten."""
        terms = len(self.coefficients) - 2
        return int(np.ceil(FORGOTTEN * self.time_constant * max(terms, 1) ** 0.5))

    def of(self, x: np.ndarray) -> np.ndarray:
        """The response to a signal that was mirrored at its first value before, (samples,)."""
        margin, terms = min(self.settling, x.size - 1), len(self.coefficients) - 2
        extended = odd_extension(x, margin)
        first = extended[0]
        columns = _columns(extended - first, self.time_constant, terms)[:, margin:][:, : x.size]
        gain = float(self.coefficients @ _gains(self.time_constant, terms))
        return self.coefficients @ columns + gain * first


def odd_extension(x: np.ndarray, margin: int) -> np.ndarray:
    """A signal with so many samples more at both ends, mirrored at the end points."""
    before = 2.0 * x[0] - x[margin:0:-1]
    return np.concatenate([before, x, 2.0 * x[-1] - x[-2 : -2 - margin : -1]])


def fit_response(x: np.ndarray, y: np.ndarray, used: slice) -> LinearResponse:
    """The response of y to x with the smallest BIC.

    Args:
        x: signal that is followed, shape (samples,).
        y: signal that follows it, shape (samples,).
        used: samples of y that are fitted.

    Returns:
        The response; that of a signal x without any motion explains nothing.
    """
    target = y[used]
    total, best = float(target @ target), None
    for time_constant in TIME_CONSTANTS:
        if FORGOTTEN * time_constant > 0.1 * target.size:
            break
        columns = _columns(x, time_constant, MAX_TERMS)[:, used].T
        scale = np.sqrt(np.sum(columns**2, axis=0))
        if not scale.all():
            break
        q, r = qr(columns / scale, mode="economic")
        shares = q.T @ target
        left = total - np.cumsum(shares**2)
        for terms in range(MAX_TERMS + 1):
            count = 2 + terms
            if abs(r[count - 1, count - 1]) < NEW_SHARE:
                break  # the columns so far say all that there is
            variance = max(left[count - 1], 1e-12 * total) / target.size
            score = target.size * np.log(variance) + count * np.log(target.size)
            if best is None or score < best[0]:
                own = solve_triangular(r[:count, :count], shares[:count]) / scale[:count]
                best = (score, time_constant, own, 1.0 - left[count - 1] / total)
    if best is None:
        return LinearResponse(TIME_CONSTANTS[0], np.zeros(2), 0.0)
    return LinearResponse(best[1], best[2], float(np.clip(best[3], 0.0, 1.0)))


def _columns(x: np.ndarray, time_constant: float, terms: int) -> np.ndarray:
    """X ahead, x, L_0 x, L_1 x, …, shape (2 + terms, samples)."""
    a = np.exp(-1.0 / time_constant)
    out = np.empty((2 + terms, x.size))
    out[0, :-1], out[0, -1] = x[1:], 2.0 * x[-1] - x[-2]
    out[1] = x
    for i in range(terms):
        numerator = [np.sqrt(1.0 - a**2)] if i == 0 else [-a, 1.0]
        out[2 + i] = recursion(
            np.array(numerator), np.array([1.0, -a]), x if i == 0 else out[1 + i]
        )
    return out


def _gains(time_constant: float, terms: int) -> np.ndarray:
    """What each column makes of a constant, shape (2 + terms,): all-pass stages keep it."""
    a = np.exp(-1.0 / time_constant)
    return np.r_[1.0, 1.0, np.full(terms, np.sqrt(1.0 - a**2) / (1.0 - a))]


#: The recorded reference through the identified response of the loop.
RESPONSE = InstrumentKind(
    "response",
    "the recorded reference through the identified response of the loop",
    "noise and disturbances that the feedback brings into the motion",
    "errors of the model, and noise that the reference itself has",
    exogenous=True,
    floating="a floating base has no reference that it follows",
    make=response_instruments,
)


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
    omega = 2.0 * rate * np.tan(np.pi * bandwidth / rate)  # the bilinear transform keeps f
    k = 2.0 * rate  # s = k (1 - z⁻¹)/(1 + z⁻¹) in ω²/(s² + 2 D ω s + ω²)
    b = omega**2 * np.array([1.0, 2.0, 1.0])
    damped = 2.0 * DAMPING * omega * k
    a = np.array([k**2 + damped + omega**2, 2.0 * (omega**2 - k**2), k**2 - damped + omega**2])
    delay = 2.0 * DAMPING / omega * rate
    margin = min(int(np.ceil(FORGOTTEN_PERIODS * rate / bandwidth)) + 2, q.size - 1)
    extended = odd_extension(q, margin)
    made = recursion(b, a, extended, steady_state(b, a) * extended[0])
    at = np.arange(q.size) + margin + delay
    return cubic_spline(np.arange(made.size), made)(np.minimum(at, made.size - 1.0))


#: A virtual computed-torque loop around the smoothed motion.
VIRTUAL = InstrumentKind(
    "virtual",
    "a virtual computed-torque loop around the smoothed motion",
    "noise above the bandwidth of the virtual loop",
    "noise within that bandwidth, and disturbances",
    floating="a floating base has no motors that a law could command",
    make=virtual_instruments,
)
