"""Which control law made the torques of a record: gains, structure, and how well it fits.

The error e = q_ref - q_m and the output u of a controller are its own signals, both exact:
encoder noise is part of e. Least squares on the law's terms is therefore consistent, and noise in
the loop helps to distinguish gains. The law is linear in its gains,

    u = kp e - kd D q + [kv_ref D q_ref] + [ki ∫e] + [ka_ref D D q_ref] + [offset]

but for the lag T inside D, over which the fit is projected (variable projection, Golub and
Pereyra 1973). Terms in brackets are taken in one after the other, the best first, as long as an
F-test wants them and they take at least a hundredth of what was left. A law that compensates
gravity has g(q) or g(q_ref) besides, with parameters of its own (``law_gravity``).

Where such a law explains little or would push away from its reference, the drive may follow a speed
setpoint with an integrator too stiff for this equation (``speed_setpoint``); a law of that kind is
taken where it explains how every joint departs from its reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.control_law.joint_law import (
    JointLaw,
    controller_table,
    diagnostics_of,
    joint_law,
)
from pivident.estimation.control_law.law_equations import (
    ALWAYS,
    SETPOINT,
    Channel,
    Term,
    channel_of,
)
from pivident.estimation.control_law.law_gravity import (
    gravity_columns,
    gravity_models,
    gravity_notes,
)
from pivident.estimation.control_law.speed_setpoint import (
    EXPLAINED,
    SpeedSetpoint,
    as_seen_by_the_drive,
    speed_setpoint,
)
from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.numbers import plus_minus
from pivident.foundation.threads import run_in_threads
from pivident.loop.simulation.controllers import Cascade
from pivident.loop.simulation.gravity_compensation import GravityCompensated
from pivident.loop.simulation.linear_law import LinearLaw
from pivident.robot.description import Robot

#: Share of the output (rms) that a law on the position error may leave before a speed setpoint is
#: tried in its place.
POOR = 0.3


@dataclass(frozen=True, eq=False)
class ControllerIdentification(Displayed):
    """Laws of all joints, with what they were fitted to.

    Attributes:
        law: the controller, ready for a ``Loop``.
        joints: one law per joint.
        recordings: names of the recordings.
        output: recorded output of the first recording, shape (samples, joints) [u]; of a drive
            with a speed setpoint: its position error q_ref - q [rad or m], NaN where not used.
        model: output of the identified law, shape (samples, joints), in the same unit.
        rate: sampling rate [Hz].
        warnings: whole sentences.
        signals: the recordings as the law sees them: those given, or with the reference as it
            arrives at a drive with a speed setpoint.
        compared: what output and model are; ``unit``: theirs.
        unit: see ``compared``.
        setpoints: speed setpoints of the joints, where the drives follow one.
    """

    law: LinearLaw | Cascade | GravityCompensated
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
        """Recordings as the law sees them: ``signals``, for any runs under the same law.

        Args:
            recordings: runs under the same law.

        Returns:
            The runs, with the reference as it arrives at a drive with a speed setpoint.
        """
        if not self.setpoints:
            return tuple(recordings)
        return tuple(as_seen_by_the_drive(r, self.setpoints) for r in recordings)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(joint.name for joint in self.joints)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader should know of the laws' structure, whole sentences."""
        return tuple(gravity_notes([j.name for j in self.joints], [j.gravity for j in self.joints]))

    def __str__(self) -> str:
        return controller_table(self)


def identify_controller(
    recordings: Sequence[Recording],
    drive_gain: np.ndarray | float = 1.0,
    limit: np.ndarray | float = np.inf,
    terms: Sequence[Term] | None = None,
    robot: Robot | None = None,
) -> ControllerIdentification:
    """Find the control law of each joint from its reference, positions and torques.

    Args:
        recordings: runs with a recorded reference, under the same law.
        drive_gain: joint torque per controller output, shape (joints,) or a scalar.
        limit: largest output; samples that reach it are left out, likewise those whose torque
            is visibly cut off.
        terms: terms of the law; None: ``kp`` and ``kd``, and those others that an F-test wants.
        robot: its geometry determines what gravity does, so that a law that compensates it is found
            too, if no ``terms`` are given; None: laws without gravity only.

    Returns:
        The law of each joint with its gains, their standard errors and its fit.

    Raises:
        ExperimentError: a recording has no reference.
        IdentificationError: a joint has no error to identify from, or its law pushes away from
            the reference.
        RobotDescriptionError: gravity is looked for with a robot of closed loops.
    """
    recordings = tuple(recordings)
    for recording in recordings:
        recording.require_torque("a control law is identified")
        if recording.q_ref is None:
            raise ExperimentError(
                f"recording {recording.name!r} has no reference q_ref, from which the control "
                "error is formed",
                advice="map its column, or reconstruct it",
            )
    joints = recordings[0].joints
    gain = np.broadcast_to(np.asarray(drive_gain, float), (joints,))
    bound = np.broadcast_to(np.asarray(limit, float), (joints,))
    channels = [[channel_of(r, j, gain[j], bound[j]) for r in recordings] for j in range(joints)]
    weights = gravity_columns(robot) if robot is not None and terms is None else [None] * joints
    found: list[tuple[JointLaw, np.ndarray] | None] = [None] * joints

    def work(j: int) -> None:
        name = recordings[0].joint_names[j]
        found[j] = joint_law(name, channels[j], terms, recordings, weights[j], gain[j])

    run_in_threads(work, range(joints))
    laws = [own[0] for own in found if own is not None]
    wrong = any(law.gain(term) < 0.0 for law in laws for term in ALWAYS)
    if terms is None and (wrong or any(law.relative_error > POOR for law in laws)):
        setpoints = _speed_setpoints(channels, recordings)
        if all(own.believable for own in setpoints):
            return _with_setpoints(recordings, channels, setpoints)
        if wrong:
            raise _refusal(laws, setpoints)
    law = _law_of(laws, robot, gain)
    output = np.stack([own[0].u for own in channels], axis=1)
    model = np.stack([own[1] for own in found if own is not None], axis=1)
    warnings = [text for own in laws for text in diagnostics_of(own)]
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
    noise = ", ".join(plus_minus(s.noise_gain, 2 * float(s.std[2])) for s in setpoints)
    seen = ", ".join(f"{100 * s.loop_explained:.2g} %" for s in setpoints)
    left = 100.0 * max(law.relative_error for law in laws)
    return [
        "No law on the position error explains the output. The drives follow a speed setpoint, "
        f"dq_ref + K e + inputs/kv, which leaves {left:.2g} % (rms) of the position error or less. "
        "The reference that is simulated is the setpoint as it arrives, with the known inputs.",
        "The integrator of the speed loop is identified from the output beyond the band of the "
        f"motion, of which the loop explains {seen}; there the speed gains look like {noise}.",
        *(text for law in laws for text in diagnostics_of(law)),
    ]


def _refusal(
    refused: Sequence[JointLaw], setpoints: Sequence[SpeedSetpoint]
) -> IdentificationError:
    """Why neither kind of law is one."""
    law, term = next((law, t) for law in refused for t in ALWAYS if law.gain(t) < 0.0)
    j, own = next((j, s) for j, s in enumerate(setpoints) if not s.believable)
    if own.explained <= EXPLAINED:
        cause = f"explains {100 * own.explained:.3g} % of its position error"
    else:
        gains = (own.position_gain, own.speed_gain, own.noise_gain, own.integral_gain)
        worst = int(np.argmin(np.array(gains) / own.std[:4]))
        which = ("position gain", "speed gain", "speed gain beyond the motion's band", "integrator")
        cause = f"leaves its {which[worst]} at {plus_minus(gains[worst], 2 * own.std[worst])}"
    return IdentificationError(
        f"the law found for joint {law.name!r} has {term} = {law.gain(term):.4g} and would push "
        "away from the reference",
        advice=f"{100 * law.relative_error:.3g} % of the output stay unexplained. A speed setpoint "
        f"does not make up for it: for joint {refused[j].name!r} it {cause}. Check the torque's "
        "sign, that q_ref belongs to q and that all known inputs are mapped; if the law cannot be "
        'known, declare type = "virtual_pd"',
    )


def _law_of(
    laws: Sequence[JointLaw], robot: Robot | None, drive_gain: np.ndarray
) -> LinearLaw | GravityCompensated:
    """The controller of all joints."""
    for law in laws:
        for term in ALWAYS:
            if law.gain(term) < 0.0:
                raise IdentificationError(
                    f"the law found for joint {law.name!r} has {term} = {law.gain(term):.4g} and "
                    "would push away from the reference",
                    advice=f"{100 * law.relative_error:.3g} % of "
                    "the output stay unexplained. Check the torque's sign and that q_ref belongs "
                    'to q; if the law cannot be known, declare type = "virtual_pd"',
                )

    def gains(term: Term) -> np.ndarray:
        return np.array([law.gain(term) for law in laws])

    linear = LinearLaw(
        kp=gains("kp"),
        kd=gains("kd"),
        ki=gains("ki"),
        speed_reference=gains("speed_reference"),
        acceleration_reference=gains("acceleration_reference"),
        offset=gains("offset"),
        derivative_time=np.array([law.derivative_time for law in laws]),
        averaged=np.array([law.averaged for law in laws]),
    )
    if robot is None or all(own.gravity is None for own in laws):
        return linear
    models = gravity_models(robot, [own.gravity for own in laws], drive_gain)
    return GravityCompensated(linear, models.get("gravity"), models.get("gravity_reference"))
