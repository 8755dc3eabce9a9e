"""Instruments from the recorded reference: what the closed loop makes of it, identified.

In closed loop q = T(z) q_ref + S(z) n with n the noise, whatever the law. T is identified joint by
joint from speeds, and T q_ref is free of the noise of the record but for the few coefficients of T.
Neither law nor masses are needed, and nothing can diverge. Speed commands are integrated; what the
integral drifts away from the positions is slower than any motion, and is taken from them.

That holds if the reference does not itself answer to the noise: an outer loop that makes commands
from measured positions does. What is new in its command at an instant is then correlated with
what was new in the positions a little before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.errors import IdentificationError
from pivident.instruments.given_motion import (
    GivenMotions,
    agreement,
    not_there,
)
from pivident.motion.kinematics import Kinematics
from pivident.motion.motion import SimulatedMotion
from pivident.recording.recording import Recording
from pivident.signals.linear_response import LinearResponse, fit_response
from pivident.signals.noise_models import fit_ar, whiten
from pivident.signals.random_walk import smooth_channels
from pivident.text.numbers import percent

#: Frequency below which an integrated speed command is held at the measured positions, as a share
#: of the inverse of the record's length, and at most this many Hz.
ANCHORED, MAX_ANCHORED = 5.0, 0.2

#: Samples after which an outer loop has answered to a noisy position.
ANSWERED_WITHIN = 10

#: A reference answers to the noise if this share of what is new in it does, significantly.
ANSWERED_SHARE, ANSWERED_LEVEL = 0.12, 1e-4

#: Largest order of the models that make signals white.
WHITENING_ORDER = 40


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
    return GivenMotions("response", motions, found, agreement(kinematics, motions), shares)


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
        not_there("response", f"recording {recording.name!r} has no q_ref and no dq_ref")
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
    from scipy.signal import butter, sosfiltfilt

    cutoff = min(ANCHORED * recording.rate / recording.samples, MAX_ANCHORED)
    low_pass = butter(2, cutoff, fs=recording.rate, output="sos")
    return sosfiltfilt(low_pass, x, padtype="constant", padlen=x.size // 2)


def answers_to_noise(kin: Kinematics) -> list[Answer]:
    """Whether each joint's reference answers to the noise of the positions, one for each joint.

    Innovations e of the reference and w of q - q̂, both behind autoregressive models of their own,
    are uncorrelated at all lags where the reference knows nothing of q (Haugh 1976):

        N Σ_d r_d² ~ χ²,   r_d = corr(e_k, w_{k-d}),   d = 0 … `ANSWERED_WITHIN`
    """
    from scipy.special import chdtrc

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
        found.append(Answer(share, float(chdtrc(len(r), length * share))))
    return found


def _innovations(x: np.ndarray) -> np.ndarray | None:
    """What is new in each sample of a signal, None where nothing is."""
    try:
        model = fit_ar(x, WHITENING_ORDER, "bic")
    except IdentificationError:
        return None
    return whiten(model, x - model.mean)[model.order :]
