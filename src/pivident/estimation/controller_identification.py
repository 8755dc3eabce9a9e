"""Which control law made the torques of a record: gains, structure, and how well it fits.

The error e = q_ref - q_m and the output u of a controller are its own signals, both exact:
encoder noise is part of e. Least squares on the law's terms is therefore consistent, and noise in
the loop helps to tell gains apart. The law is linear in its gains,

    u = kp e - kd D q + [kv_ref D q_ref] + [ki ∫e] + [ka_ref D D q_ref] + [offset]

but for the lag T inside D, over which the fit is projected (variable projection, Golub and
Pereyra 1973). Terms in brackets are taken in one after the other, the best first, as long as an
F-test wants them and they take at least a hundredth of what was left.

Where such a law explains little or would push away from its reference, the drive may follow a speed
setpoint with an integrator too stiff for this equation (``speed_setpoint``); a law of that kind is
taken where it explains how every joint departs from its reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.errors import ExperimentError, IdentificationError
from pivident.estimation.law_equations import (
    ALWAYS,
    SETPOINT,
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
from pivident.estimation.speed_setpoint import (
    EXPLAINED,
    SpeedSetpoint,
    as_seen_by_the_drive,
    speed_setpoint,
)
from pivident.recording.recording import Recording
from pivident.simulation.controllers import Cascade
from pivident.simulation.linear_law import LinearLaw
from pivident.threads import run_in_threads

#: Share of the output (rms) that a law on the position error may leave before a speed setpoint is
#: tried in its place.
POOR = 0.3


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
        output: recorded output of the first recording, shape (samples, joints) [u]; of a drive
            with a speed setpoint: its position error q_ref - q [rad or m], NaN where not used.
        model: what the law makes of it.
        rate: sampling rate [Hz].
        warnings: whole sentences.
        signals: the recordings as the law sees them: those given, or with the reference as it
            arrives at a drive with a speed setpoint.
        compared: what output and model are; ``unit``: theirs.
        unit: see ``compared``.
        setpoints: speed setpoints of the joints, where the drives follow one.
    """

    law: LinearLaw | Cascade
    joints: tuple[JointLaw, ...]
    recordings: tuple[str, ...]
    output: np.ndarray
    model: np.ndarray
    rate: float
    warnings: tuple[str, ...]
    signals: tuple[Recording, ...] = ()
    compared: str = "output"
    unit: str = "u"
    setpoints: tuple[SpeedSetpoint, ...] = ()

    def seen(self, recordings: Sequence[Recording]) -> tuple[Recording, ...]:
        """Recordings as the law sees them: ``signals``, for any runs under the same law."""
        if not self.setpoints:
            return tuple(recordings)
        return tuple(as_seen_by_the_drive(r, self.setpoints) for r in recordings)

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

    Returns:
        The law of each joint with its gains, their deviations and its fit.

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
    wrong = any(law.gain(term) < 0.0 for law in laws for term in ALWAYS)
    if terms is None and (wrong or any(law.relative_error > POOR for law in laws)):
        setpoints = _speed_setpoints(channels, recordings)
        if all(own.believable for own in setpoints):
            return _with_setpoints(recordings, channels, setpoints)
        if wrong:
            raise IdentificationError(_refusal(laws, setpoints))
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
        law, tuple(laws), names, output, model, recordings[0].rate, tuple(warnings), recordings
    )


def _speed_setpoints(
    channels: Sequence[Sequence[Channel]], recordings: Sequence[Recording]
) -> list[SpeedSetpoint]:
    """What a speed setpoint makes of each joint."""
    inputs = [sum(r.inputs.values(), np.zeros(r.q.shape)) for r in recordings]
    found: list[SpeedSetpoint | None] = [None] * len(channels)

    def work(j: int) -> None:
        found[j] = speed_setpoint(channels[j], [i[:, j] for i in inputs])

    run_in_threads(work, range(len(channels)))
    return [own for own in found if own is not None]


def _with_setpoints(
    recordings: tuple[Recording, ...],
    channels: Sequence[Sequence[Channel]],
    setpoints: Sequence[SpeedSetpoint],
) -> ControllerIdentification:
    """The law of drives that follow a speed setpoint."""
    law = Cascade(
        kp=np.array([own.position_gain for own in setpoints]),
        kv=np.array([own.speed_gain for own in setpoints]),
        ki=np.array([own.integral_gain for own in setpoints]),
        speed_feed_forward=1.0,
    )
    laws = tuple(
        _joint_law_of(name, own, sum(c.saturated for c in channel))
        for name, own, channel in zip(recordings[0].joint_names, setpoints, channels, strict=True)
    )
    return ControllerIdentification(
        law,
        laws,
        tuple(r.name for r in recordings),
        np.stack([own.error for own in setpoints], axis=1),
        np.stack([own.model for own in setpoints], axis=1),
        recordings[0].rate,
        tuple(_setpoint_warnings(laws, setpoints)),
        tuple(as_seen_by_the_drive(r, setpoints) for r in recordings),
        "position error",
        "rad or m",
        tuple(setpoints),
    )


def _joint_law_of(name: str, own: SpeedSetpoint, saturated: int) -> JointLaw:
    """One joint's speed setpoint among the other laws."""
    gains = [own.position_gain, own.speed_gain, own.integral_gain, own.delay]
    return JointLaw(
        name=name,
        terms=SETPOINT,
        gains=np.array(gains),
        std=own.std[[0, 1, 3, 4]],
        derivative_time=0.0,
        derivative_time_std=0.0,
        averaged=False,
        rms=own.rms,
        relative_error=float(np.sqrt(1.0 - own.explained)),
        f_tests={},
        samples=own.samples,
        saturated=saturated,
    )


def _setpoint_warnings(laws: Sequence[JointLaw], setpoints: Sequence[SpeedSetpoint]) -> list[str]:
    """What has to be said about laws with a speed setpoint."""
    noise = ", ".join(f"{s.noise_gain:.0f} ± {2 * s.std[2]:.0f}" for s in setpoints)
    seen = ", ".join(f"{100 * s.loop_explained:.2g} %" for s in setpoints)
    left = 100.0 * max(law.relative_error for law in laws)
    return [
        "No law on the position error explains the output. The drives follow a speed setpoint, "
        f"dq_ref + K e + inputs/kv, which leaves {left:.2g} % (rms) of the position error or less. "
        "The reference that is simulated is the setpoint as it arrives, with the known inputs.",
        "The integrator of the speed loop is told from the output beyond the band of the motion, "
        f"of which the loop explains {seen}; there the speed gains look like {noise}.",
        *(text for law in laws for text in _warnings(law)),
    ]


def _refusal(refused: Sequence[JointLaw], setpoints: Sequence[SpeedSetpoint]) -> str:
    """Why neither kind of law is one."""
    law, term = next((law, t) for law in refused for t in ALWAYS if law.gain(t) < 0.0)
    j, own = next((j, s) for j, s in enumerate(setpoints) if not s.believable)
    if own.explained <= EXPLAINED:
        cause = f"explains {100 * own.explained:.3g} % of its position error"
    else:
        gains = (own.position_gain, own.speed_gain, own.noise_gain, own.integral_gain)
        worst = int(np.argmin(np.array(gains) / own.std[:4]))
        which = ("position gain", "speed gain", "speed gain beyond the motion's band", "integrator")
        cause = f"leaves its {which[worst]} at {gains[worst]:.3g} ± {2 * own.std[worst]:.2g}"
    return (
        f"the law found for joint {law.name!r} has {term} = {law.gain(term):.4g} and would push "
        f"away from the reference; {100 * law.relative_error:.3g} % of the output stay "
        f"unexplained. A speed setpoint does not make up for it: for joint {refused[j].name!r} it "
        f"{cause}. Check the torque's sign, that q_ref belongs to q and that all known inputs "
        'are mapped; if the law cannot be known, declare type = "virtual_pd"'
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
