"""Flexibility of all joints of a recording, and its effect on a rigid model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.errors import IdentificationError
from pivident.flexibility.compliance import Compliance, identify_compliances
from pivident.flexibility.measured import Measured
from pivident.flexibility.resonance import Resonance, find_resonance
from pivident.flexibility.rigid_validity import RigidValidity, rigid_validity
from pivident.flexibility.two_mass import TwoMassEstimate, identify_two_mass
from pivident.recording.recording import Recording
from pivident.robot.description import Robot


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
            damping = max(joint.damping, 0.0)
            return joint.stiffness, joint.motor_inertia, joint.load_inertia, damping
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
