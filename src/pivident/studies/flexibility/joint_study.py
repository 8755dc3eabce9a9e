"""Flexibility of all joints of a recording, and where a rigid model of them stays valid.

Validity of a rigid model of a flexible joint, and the error of its inertia.

A motor that moves a load through a spring has the apparent inertia

    J(ω) = Jm + Jl Re T(ω),   T = (k + jωd) / (k + jωd - Jl ω²) ≈ 1 / (1 - (ω/ω_a)²)

so a rigid model overestimates it by about Jl (ω/ω_a)². With the link's encoder it underestimates
it, J - Jm (ω/ω_a)². The number here is not that law at one frequency: the torque missing in the
rigid model, Jl (T - 1) ddq, is computed from the recorded motion and projected on its columns ddq,
dq, sign(dq) and 1, within the band in which the model would be fitted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pivident.data.recording.joint_order import in_order_of
from pivident.data.recording.recording import Recording
from pivident.foundation.errors import IdentificationError
from pivident.foundation.text.finding import Severity
from pivident.robot.description import Robot
from pivident.signals.bandpass import butterworth, central_difference
from pivident.studies.flexibility.compliance import Compliance, identify_compliances
from pivident.studies.flexibility.measured import Measured
from pivident.studies.flexibility.resonance import Resonance, find_resonance
from pivident.studies.flexibility.two_mass import TwoMassEstimate, identify_two_mass

#: Error of the inertia above which there is a warning, and above which it is an error [%].
WARNING, ERROR = 2.0, 10.0
#: Share of the antiresonance up to which a loop or a filter is acceptable.
REACH = 1.0 / 3.0
#: Share of the acceleration's power that makes up the motion.
MOTION = 0.95
#: Cut-off of usual rigid identification [Hz].
CUTOFF = 50.0


@dataclass(frozen=True)
class RigidValidity:
    """Validity of a rigid model of one joint."""

    recording: str  # name of the run
    joint: str  # name of the joint
    antiresonance: float  # locked-rotor frequency √(k/Jl)/2π [Hz]
    motion_band: float  # frequency below which 95 % of the acceleration's power lies [Hz]
    cutoff: float  # of the signals in the rigid fit [Hz]
    inertia_error: float  # of Jm + Jl in a rigid least-squares fit [%]
    # (J(ω) - J)/J at the edge of the motion's band [%]; infinite beyond the antiresonance
    at_band_edge: float
    viscous_error: float  # of the viscous friction [N m s/rad]
    coulomb_error: float  # of the Coulomb friction [N m]
    missing_torque: float  # rms of the torque missing in the rigid model after the fit [N m]
    severity: Severity
    sentences: tuple[str, ...]


def rigid_validity(
    recording: Recording,
    joint: int = 0,
    *,
    stiffness: float,
    motor_inertia: float,
    load_inertia: float,
    damping: float = 0.0,
    encoder: Literal["motor", "link"] = "motor",
    cutoff: float | None = None,
    bandwidth: float | None = None,
    gamma: float = 150.0,
) -> RigidValidity:
    """Effect of compliance on a rigid model fitted to this record.

    Args:
        recording: the record.
        joint: index of the joint.
        stiffness: k [N m/rad].
        motor_inertia: Jm on the joint side [kg m²].
        load_inertia: Jl [kg m²].
        damping: d [N m s/rad]; 0 stands for 1 % of the critical one.
        encoder: encoder of the positions in the rigid fit.
        cutoff: of the signals in the rigid fit [Hz]; None: 50 Hz, or 40 % of the rate.
        bandwidth: of the control loop [Hz], if known.
        gamma: slope of the smoothed sign of friction [s/rad].

    Returns:
        Bias of the rigid model, and the band in which it is valid.

    Raises:
        IdentificationError: a stiffness or inertia is not positive, or there is no such encoder.
    """
    name = recording.joint_names[joint]
    for label, value in (("stiffness", stiffness), ("load inertia", load_inertia)):
        if not (np.isfinite(value) and value > 0):
            raise IdentificationError(
                f"{label} of joint {name!r} is {value!r}", advice="it must be positive"
            )
    positions = recording.q if encoder == "motor" else recording.q_link
    if positions is None:
        raise IdentificationError(f"recording {recording.name!r} has no link encoder (q_link)")
    rate = recording.rate
    top = min(CUTOFF if cutoff is None else cutoff, 0.4 * rate)
    q = butterworth(positions[:, joint], rate, top)
    dq = central_difference(q, rate)
    ddq = central_difference(dq, rate)
    omega_a = float(np.sqrt(stiffness / load_inertia))
    damping = damping or 0.02 * load_inertia * omega_a
    missing = _missing_torque(
        ddq, rate, stiffness, damping, motor_inertia, load_inertia, encoder, 2 * top
    )
    columns = np.column_stack([ddq, dq, 2 / np.pi * np.arctan(gamma * dq), np.ones(len(q))])
    edge = min(int(np.ceil(rate / top)) + 1, len(q) // 4)
    inner = slice(edge, len(q) - edge)
    found = np.linalg.lstsq(columns[inner], missing[inner], rcond=None)[0]
    left = missing[inner] - columns[inner] @ found
    total = motor_inertia + load_inertia
    antiresonance = omega_a / (2 * np.pi)
    band = _motion_band(ddq[inner], rate)
    ratio = (band / antiresonance) ** 2
    if encoder == "motor":
        at_edge = load_inertia * ratio / (1 - ratio) / total if ratio < 1 else np.inf
    else:
        at_edge = -motor_inertia * ratio / total
    error = 100 * float(found[0]) / total
    severity, sentences = _judged(
        name, antiresonance, band, top, bandwidth, error, 100 * float(at_edge)
    )
    return RigidValidity(
        recording=recording.name,
        joint=name,
        antiresonance=antiresonance,
        motion_band=band,
        cutoff=top,
        inertia_error=error,
        at_band_edge=100 * float(at_edge),
        viscous_error=float(found[1]),
        coulomb_error=float(found[2]),
        missing_torque=float(np.sqrt(np.mean(left**2))),
        severity=severity,
        sentences=sentences,
    )


def _missing_torque(
    ddq: np.ndarray,
    rate: float,
    stiffness: float,
    damping: float,
    motor_inertia: float,
    load_inertia: float,
    encoder: str,
    highest: float,
) -> np.ndarray:
    """Torque of the flexible joint minus that of a rigid one with the same motion [N m]."""
    n = len(ddq)
    # The motion mirrored at its ends is periodic without steps.
    spectrum = np.fft.rfft(np.concatenate([ddq, ddq[::-1]]))
    frequency = np.fft.rfftfreq(2 * n, 1 / rate)
    p = 2j * np.pi * frequency
    if encoder == "motor":
        passed = (damping * p + stiffness) / (load_inertia * p**2 + damping * p + stiffness)
        beyond = load_inertia * (passed - 1)
    else:
        beyond = motor_inertia * load_inertia * p**2 / (damping * p + stiffness)
    beyond = np.where(frequency < highest, beyond, 0.0)
    return np.fft.irfft(beyond * spectrum, 2 * n)[:n]


def _motion_band(ddq: np.ndarray, rate: float) -> float:
    """Frequency below which nearly all of the acceleration's power lies [Hz]."""
    power = np.abs(np.fft.rfft(ddq * np.hanning(len(ddq)))) ** 2
    below = np.cumsum(power) / power.sum()
    return float(np.fft.rfftfreq(len(ddq), 1 / rate)[np.searchsorted(below, MOTION)])


def _judged(
    joint: str,
    antiresonance: float,
    band: float,
    cutoff: float,
    bandwidth: float | None,
    error: float,
    at_edge: float,
) -> tuple[Severity, tuple[str, ...]]:
    """Severity and sentences."""
    severity: Severity = "ok"
    if abs(error) >= WARNING or band > REACH * antiresonance:
        severity = "warning"
    if abs(error) >= ERROR or band >= antiresonance:
        severity = "error"
    size = "without bound" if not np.isfinite(at_edge) else f"by {at_edge:+.2g} %"
    sentences = [
        f"the rigid model's inertia of {joint} is wrong by about {error:+.2g} % on this motion",
        f"95 % of the acceleration's power lies below {band:.3g} Hz, {band / antiresonance:.2g} of "
        f"the locked-rotor frequency {antiresonance:.3g} Hz; the apparent inertia at that edge is "
        f"wrong {size}",
    ]
    if error * at_edge < 0 and abs(error) > 0.1:
        sentences.append(
            "by its sign the error comes from beyond the antiresonance, where the load does not "
            "follow: ripple of gear or torque, or noise of the encoder"
        )
    if bandwidth is not None and bandwidth > REACH * antiresonance:
        sentences.append(
            f"the loop's bandwidth of {bandwidth:.3g} Hz is {bandwidth / antiresonance:.2g} of it: "
            "a rigid simulation does not represent the loop; lower the bandwidth of the virtual law"
        )
        severity = "warning" if severity == "ok" else severity
    if cutoff > REACH * antiresonance and severity != "ok":
        sentences.append(
            f"signals up to {cutoff:.3g} Hz enter the fit; a cut-off below "
            f"{REACH * antiresonance:.2g} Hz would exclude the resonance"
        )
    return severity, tuple(sentences)


@dataclass(frozen=True, eq=False)
class JointFlexibility:
    """Flexibility of one joint from one recording."""

    recording: str  # name of the run
    joint: str  # name of the joint
    sliding: bool  # whether it is prismatic
    compliance: Compliance | None  # from both encoders in slow motion, or None
    two_mass: TwoMassEstimate | None  # from both encoders with inertias, or None
    resonance: Resonance | None  # from the motor's encoder, or None
    # effect on a rigid model, or None if no stiffness is known
    rigid: RigidValidity | None
    notes: tuple[str, ...]  # reasons for missing results


def study_flexibility(
    robot: Robot, recordings: Sequence[Recording], bandwidth: float | None = None
) -> tuple[JointFlexibility, ...]:
    """Every joint of every recording.

    Args:
        robot: the robot, with reduction and nominal inertias.
        recordings: recordings, of which those with ``q_link`` or ``q_ref`` are used.
        bandwidth: of the control loop [Hz], if known.

    Raises:
        IdentificationError: no recording has a link encoder or a reference.
        RecordingError: one has no measured torque.
    """
    recordings = [in_order_of(robot, recording) for recording in recordings]
    for recording in recordings:
        recording.require_torque("stiffness is identified")
    if all(r.q_link is None and r.q_ref is None for r in recordings):
        raise IdentificationError(
            "no recording has a link encoder (q_link) or a reference (q_ref)",
            advice="name the columns of one of them",
        )
    return tuple(
        joint for recording in recordings for joint in _of_recording(robot, recording, bandwidth)
    )


def _of_recording(
    robot: Robot, recording: Recording, bandwidth: float | None
) -> list[JointFlexibility]:
    """All joints of one recording."""
    reduction = np.abs(np.diag(robot.transmission.reduction))
    failure = ""
    compliances: tuple[Compliance, ...] = ()
    if recording.q_link is not None:
        try:
            compliances = identify_compliances(recording, robot.rotor_inertia, reduction)
        except IdentificationError as error:
            failure = str(error)
    total = _nominal_inertia(robot, recording)
    return [
        _of_joint(
            robot,
            recording,
            j,
            compliances[j] if compliances else None,
            float(total[j]),
            failure,
            bandwidth,
        )
        for j in range(robot.size)
    ]


def _of_joint(
    robot: Robot,
    recording: Recording,
    j: int,
    compliance: Compliance | None,
    total: float,
    failure: str,
    bandwidth: float | None,
) -> JointFlexibility:
    """One joint of one recording."""
    notes = [failure] if failure else []
    two_mass, resonance, rigid = None, None, None
    if recording.q_link is not None and robot.size == 1:
        try:
            two_mass = identify_two_mass(recording, j)
        except IdentificationError as error:
            notes.append(str(error))
    motor = float(robot.rotor_inertia[j])
    load = total - motor
    if recording.q_ref is not None:
        resonance = find_resonance(recording, j, load_inertia=load if load > 0 else None)
    known = _stiffness_and_inertias(two_mass, resonance, compliance, motor, load)
    if known is None:
        notes.append("stiffness or inertias are unknown: a rigid model cannot be assessed")
    else:
        stiffness, motor, load, damping = known
        rigid = rigid_validity(
            recording,
            j,
            stiffness=stiffness,
            motor_inertia=motor,
            load_inertia=load,
            damping=damping,
            bandwidth=bandwidth,
        )
    return JointFlexibility(
        recording.name,
        recording.joint_names[j],
        robot.joints[j].kind != "revolute",
        compliance,
        two_mass,
        resonance,
        rigid,
        tuple(notes),
    )


def _nominal_inertia(robot: Robot, recording: Recording) -> np.ndarray:
    """Diagonal of the nominal mass matrix at the mean position, shape (joints,)."""
    from pivident.dynamics.forward import mass_matrix
    from pivident.dynamics.parameters import nominal_values, standard_parameters

    parameters = standard_parameters(robot)
    posture = recording.q.mean(axis=0, keepdims=True)
    return np.diag(mass_matrix(robot, parameters, nominal_values(robot, parameters), posture)[0])


def _stiffness_and_inertias(
    two_mass: TwoMassEstimate | None,
    resonance: Resonance | None,
    compliance: Compliance | None,
    motor: float,
    load: float,
) -> tuple[float, float, float, float] | None:
    """k, Jm, Jl, d from the best source available; nominal inertias if none was identified."""
    if two_mass is not None:
        joint = two_mass.joint
        if min(joint.stiffness, joint.motor_inertia, joint.load_inertia) > 0:
            return joint.stiffness, joint.motor_inertia, joint.load_inertia, max(joint.damping, 0.0)
    if resonance is not None and resonance.seen:
        assert resonance.stiffness and resonance.motor_inertia and resonance.load_inertia
        assert resonance.damping
        return (
            resonance.stiffness.value,
            resonance.motor_inertia.value,
            resonance.load_inertia.value,
            resonance.damping.value,
        )
    if compliance is not None and load > 0:
        stiffness = compliance.stiffness
        softest = stiffness.value if math.isfinite(stiffness.value) else stiffness.low
        if math.isfinite(softest) and softest > 0:
            return softest, motor, load, 0.0
    return None


def summary(found: Sequence[JointFlexibility]) -> dict[str, list[Measured]]:
    """Stiffness of each joint by recording, without withheld ones."""
    stiffness: dict[str, list[Measured]] = {}
    for one in found:
        if one.compliance is not None and one.compliance.stiffness.is_known:
            stiffness.setdefault(one.joint, []).append(one.compliance.stiffness)
    return stiffness
