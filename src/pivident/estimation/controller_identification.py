"""Which control law made the torques of a record: gains, structure, and how well it fits.

The error e = q_ref - q_m and the output u of a controller are its own signals, both exact:
encoder noise is part of e. Least squares on the law's terms is therefore consistent, and noise in
the loop helps to tell gains apart. The law is linear in its gains,

    u = kp e - kd D q + [kv_ref D q_ref] + [ki ∫e] + [ka_ref D D q_ref] + [offset]

but for the lag T inside D, over which the fit is projected (variable projection, Golub and
Pereyra 1973). Terms in brackets are taken in one after the other, the best first, as long as an
F-test wants them and they take at least a hundredth of what was left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.errors import ExperimentError, IdentificationError
from pivident.estimation.law_equations import (
    ALWAYS,
    WORTHWHILE,
    Channel,
    Equations,
    Term,
    best_lag,
    channel_of,
    column_of,
    select_terms,
    system_of,
)
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.sandwich import sandwich, windows_of
from pivident.recording.recording import Recording
from pivident.simulation.linear_law import LinearLaw
from pivident.threads import run_in_threads


@dataclass(frozen=True, eq=False)
class JointLaw:
    """The law of one joint.

    Attributes:
        name: name of the joint.
        terms: terms in use.
        gains: their gains, shape (terms,).
        std: robust standard deviations of the gains.
        derivative_time: lag T of the differentiator [s].
        derivative_time_std: its standard deviation [s].
        averaged: whether two-sample means are differenced.
        rms: rms of what the law does not explain [u].
        relative_error: that over the rms of u.
        f_tests: F statistic of every extra term when it was tried last.
        samples: samples used; saturated ones are left out.
        saturated: samples left out.
    """

    name: str
    terms: tuple[Term, ...]
    gains: np.ndarray
    std: np.ndarray
    derivative_time: float
    derivative_time_std: float
    averaged: bool
    rms: float
    relative_error: float
    f_tests: dict[str, float]
    samples: int
    saturated: int

    def gain(self, term: Term) -> float:
        """Gain of a term, zero where it is not used."""
        return float(self.gains[self.terms.index(term)]) if term in self.terms else 0.0

    @property
    def cascade(self) -> tuple[float, float, float, float]:
        """The law as a cascade kv (kp e - v̂): kp [1/s] and its deviation, kv and its deviation.

        The deviation of the ratio is that of independent gains, an upper bound where they are
        positively correlated.
        """
        kp, kv = self.gain("kp"), self.gain("kd")
        std = dict(zip(self.terms, self.std, strict=True))
        ratio = kp / kv
        relative = np.hypot(std["kp"] / kp, std["kd"] / kv)
        return ratio, abs(ratio) * float(relative), kv, float(std["kd"])


@dataclass(frozen=True, eq=False)
class ControllerIdentification:
    """Laws of all joints, with what they were fitted to.

    Attributes:
        law: the controller, ready for a ``Loop``.
        joints: one law per joint.
        recordings: names of the recordings.
        output: recorded output of the first recording, shape (samples, joints) [u].
        model: what the law makes of it.
        rate: sampling rate [Hz].
        warnings: whole sentences.
    """

    law: LinearLaw
    joints: tuple[JointLaw, ...]
    recordings: tuple[str, ...]
    output: np.ndarray
    model: np.ndarray
    rate: float
    warnings: tuple[str, ...]

    def __str__(self) -> str:
        from pivident.estimation.tables import controller_table

        return controller_table(self)


def identify_controller(
    recordings: Sequence[Recording],
    drive_gain: np.ndarray | float = 1.0,
    limit: np.ndarray | float = np.inf,
    terms: Sequence[Term] | None = None,
) -> ControllerIdentification:
    """Find the control law of each joint from its reference, positions and torques.

    Args:
        recordings: runs with a recorded reference, under the same law.
        drive_gain: joint torque per controller output, shape (joints,) or a scalar.
        limit: largest output; samples that reach it are left out, likewise those whose torque
            is visibly cut off.
        terms: terms of the law; None: ``kp`` and ``kd``, and those others that an F-test wants.

    Raises:
        ExperimentError: a recording has no reference.
        IdentificationError: a joint has no error to identify from, or its law pushes away from
            the reference.
    """
    recordings = tuple(recordings)
    for recording in recordings:
        if recording.q_ref is None:
            raise ExperimentError(
                f"recording {recording.name!r} has no reference q_ref, from which the control "
                "error is formed; map its column, or reconstruct it"
            )
    joints = recordings[0].joints
    gain = np.broadcast_to(np.asarray(drive_gain, float), (joints,))
    bound = np.broadcast_to(np.asarray(limit, float), (joints,))
    channels = [[channel_of(r, j, gain[j], bound[j]) for r in recordings] for j in range(joints)]
    found: list[JointLaw | None] = [None] * joints

    def work(j: int) -> None:
        found[j] = _joint_law(recordings[0].joint_names[j], channels[j], terms)

    run_in_threads(work, range(joints))
    laws = [own for own in found if own is not None]
    law = _law_of(laws)
    output = np.stack([own[0].u for own in channels], axis=1)
    model = np.stack(
        [
            np.stack(_columns(own[0], law_of_joint), axis=1) @ law_of_joint.gains
            for own, law_of_joint in zip(channels, laws, strict=True)
        ],
        axis=1,
    )
    warnings = [text for own in laws for text in _warnings(own)]
    names = tuple(r.name for r in recordings)
    return ControllerIdentification(
        law, tuple(laws), names, output, model, recordings[0].rate, tuple(warnings)
    )


def _joint_law(name: str, channels: Sequence[Channel], wanted: Sequence[Term] | None) -> JointLaw:
    """The best differentiator, and for it the terms."""
    error = np.concatenate([(c.q_ref - c.q)[c.use] for c in channels])
    if not error.size or np.ptp(error) == 0.0:
        raise IdentificationError(
            f"joint {name!r} has no control error to identify a law from: its reference equals "
            "the position. Was the position logged as its own reference?"
        )
    candidates = [Equations.build(channels, 0.0, True), Equations.build(channels, 0.0, False)]
    terms, _ = select_terms(candidates[1], wanted)
    lag = best_lag(channels, terms)
    if lag is not None:
        candidates.append(lag)
    chosen = [(equations, *select_terms(equations, wanted)) for equations in candidates]
    best, terms, tests = min(chosen, key=lambda c: c[0].fit(c[1])[1])
    plain = chosen[1]
    if best.fit(terms)[1] * (1.0 + WORTHWHILE) > plain[0].fit(plain[1])[1]:
        best, terms, tests = plain  # the backward difference, where nothing is better
    return _finished(name, channels, best, terms, tests)


def _columns(channel: Channel, law: JointLaw) -> list[np.ndarray]:
    """The columns of a finished law."""
    return [column_of(channel, t, law.derivative_time, law.averaged) for t in law.terms]


def _finished(
    name: str,
    channels: Sequence[Channel],
    equations: Equations,
    terms: tuple[Term, ...],
    tests: dict[str, float],
) -> JointLaw:
    """Gains with robust deviations; the lag's column is the derivative of the fit by T."""
    time, averaged = equations.time, equations.averaged
    gains = equations.fit(terms)[0]
    phi, u = system_of(channels, terms, time, averaged)
    residual = u - phi @ gains
    rss = float(residual @ residual)
    columns = phi
    if time > 0.0:
        step = 1e-4 * time
        ahead = system_of(channels, terms, time + step, averaged)[0] @ gains
        behind = system_of(channels, terms, time - step, averaged)[0] @ gains
        columns = np.column_stack([phi, (ahead - behind) / (2.0 * step)])
    covariance = _robust_covariance(columns, residual)
    std = np.sqrt(np.diag(covariance))
    saturated = sum(c.saturated for c in channels)
    return JointLaw(
        name=name,
        terms=terms,
        gains=gains,
        std=std[: len(terms)],
        derivative_time=time,
        derivative_time_std=float(std[-1]) if time > 0.0 else 0.0,
        averaged=averaged,
        rms=float(np.sqrt(rss / u.size)),
        relative_error=float(np.sqrt(rss / np.sum(u**2))),
        f_tests=tests,
        samples=u.size,
        saturated=saturated,
    )


def _robust_covariance(columns: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Sandwich over smooth windows of the linear fit with these columns."""
    scale = np.sqrt(np.mean(columns**2, axis=0))
    scale[scale == 0.0] = 1.0
    (windows,) = windows_of([residual.size])
    sums = JointSums.empty("", np.arange(scale.size), windows.count)
    shares = list(windows.shares(slice(0, residual.size)))
    sums.add((columns / scale).T, None, residual, None, shares)
    return sandwich([sums], np.zeros(scale.size), np.ones(1)) / np.outer(scale, scale)


def _law_of(laws: Sequence[JointLaw]) -> LinearLaw:
    """The controller of all joints.

    Raises:
        IdentificationError: one pushes away from its reference.
    """
    for law in laws:
        for term in ALWAYS:
            if law.gain(term) < 0.0:
                raise IdentificationError(
                    f"the law found for joint {law.name!r} has {term} = {law.gain(term):.4g} and "
                    f"would push away from the reference; {100 * law.relative_error:.3g} % of "
                    "the output stay unexplained. Check the torque's sign and that q_ref belongs "
                    'to q; if the law cannot be known, declare type = "virtual_pd"'
                )

    def gains(term: Term) -> np.ndarray:
        return np.array([law.gain(term) for law in laws])

    return LinearLaw(
        kp=gains("kp"),
        kd=gains("kd"),
        ki=gains("ki"),
        speed_reference=gains("speed_reference"),
        acceleration_reference=gains("acceleration_reference"),
        offset=gains("offset"),
        derivative_time=np.array([law.derivative_time for law in laws]),
        averaged=np.array([law.averaged for law in laws]),
    )


def _warnings(law: JointLaw) -> list[str]:
    """What has to be said about a law."""
    out = []
    if law.relative_error > 0.1:
        out.append(
            f"The law found for joint {law.name!r} leaves {100 * law.relative_error:.2g} % of its "
            "output unexplained; take its gains as nominal."
        )
    for term, gain, std in zip(law.terms, law.gains, law.std, strict=True):
        if std > 0.5 * abs(gain):
            out.append(
                f"{term} of joint {law.name!r} is {gain:.3g} ± {2 * std:.2g}: this record hardly "
                "tells it."
            )
    return out
