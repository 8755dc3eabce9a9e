"""A robot on feet that stand, whose contact forces nobody measures.

Feet that do not move close loops between the robot and the ground. With the pose of the base as
independent coordinates the legs follow, dq = N dq_base, and the unknown contact forces leave the
model as those of any loop do:

    Nᵀ Y(q, dq, ddq) θ = Nᵀ Sᵀ τ + Nᵀ Σ Jᵀ f

with τ of the motors in the legs and f of the sensors that there are. Where a foot stands is the
mean of where the log puts it; a foot that leaves its place slips, and the equations do not hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.foundation.errors import RecordingError
from pivident.loop.motion.motion import aligned_torque
from pivident.robot.closed_chains import closed_robot
from pivident.robot.constraints import Closure
from pivident.robot.description import Robot
from pivident.robot.frames import Pose
from pivident.robot.measured_base import BASE_JOINTS, link_places
from pivident.signals.instants import torque_at_instants

#: How far a foot may be from its place, for a moment and on average [m].
MAX_DISTANCE, MAX_MEAN_DISTANCE = 0.01, 0.003


def on_planted_feet(
    robot: Robot, recordings: Sequence[Recording]
) -> tuple[Robot, tuple[Recording, ...]]:
    """The mechanism of a robot and its ground, and its recordings.

    Args:
        robot: a robot on a floating base with `Robot.contacts`.
        recordings: runs in one stance, with the joints of the base and of the legs.

    Returns:
        The robot whose joints are those of its base, its legs closed over the ground; and its
        recordings, in which the torques of the legs are torques at the base.

    Raises:
        RecordingError: a foot leaves its place; names it, the sample and the distance.
        RobotDescriptionError: the contacts do not determine the legs; names joints.
    """
    names = [contact.link for contact in robot.contacts]
    paths = [_feet(robot, recording) for recording in recordings]
    stands = np.mean(np.concatenate(paths), axis=0)
    for recording, path in zip(recordings, paths, strict=True):
        _check_stands(recording, path, stands, names)
    closures = [
        Closure(
            f"foot of {contact.link}",
            (robot.link_index(contact.link), -1),
            (Pose(np.eye(3), contact.point), Pose(np.eye(3), place)),
        )
        for contact, place in zip(robot.contacts, stands, strict=True)
    ]
    bare = replace(robot, contacts=(), sensors=())
    posture = np.mean([recording.q.mean(axis=0) for recording in recordings], axis=0)
    driven = robot.joint_names[robot.base_joints :]
    closed = closed_robot(bare, BASE_JOINTS, closures, posture=posture, driven=driven)
    return closed, tuple(_at_the_base(closed, recording) for recording in recordings)


def _feet(robot: Robot, recording: Recording) -> np.ndarray:
    """Where the log puts the feet, shape (samples, feet, 3) [m]."""
    found = []
    for contact in robot.contacts:
        rotation, origin = link_places(robot, robot.link_index(contact.link), recording.q)
        found.append(origin + rotation @ contact.point)
    return np.stack(found, axis=1)


def _check_stands(
    recording: Recording, path: np.ndarray, stands: np.ndarray, names: Sequence[str]
) -> None:
    """Refuse a foot that leaves its place."""
    away = np.linalg.norm(path - stands, axis=2)
    for foot, name in enumerate(names):
        k, mean = int(np.argmax(away[:, foot])), float(away[:, foot].mean())
        if away[k, foot] > MAX_DISTANCE or mean > MAX_MEAN_DISTANCE:
            raise RecordingError(
                f"recording {recording.name!r}: the foot of {name!r} does not stand: it is "
                f"{1e3 * away[k, foot]:.3g} mm from its place at sample {k}, {1e3 * mean:.3g} mm "
                "on average",
                advice="cut the record to one stance (part), measure the contact forces "
                "([[wrench]]), or check pose, encoders and the length of the leg",
            )


def _at_the_base(robot: Robot, recording: Recording) -> Recording:
    """The recording of the base alone, with Nᵀ (τ + Jᵀ f) of all joints as torque upon it."""
    q = recording.q[:, : robot.size]
    still = np.zeros_like(q).T
    gain = ClosedChains(robot).motion(q.T, still, still).gain
    torque = np.stack(
        [_at_instants(recording, j) for j in range(recording.joints)], axis=1
    )  # of the motors
    if recording.wrench_torque is not None:
        torque = torque + recording.wrench_torque
    return replace(
        recording,
        joint_names=robot.joint_names,
        q=q,
        tau=np.zeros_like(q),
        q_ref=None,
        dq_ref=None,
        ddq_ref=None,
        dq=None,
        inputs={},
        delay=0.0,
        drive_delay=0.0,
        torque_timing="sampled",
        wrench_torque=np.einsum("iat,ti->ta", gain, torque),
    )


def _at_instants(recording: Recording, joint: int) -> np.ndarray:
    """Torque of one motor at the instants of the positions, shape (samples,)."""
    aligned = aligned_torque(recording, joint)
    return torque_at_instants(aligned.tau) if aligned.is_average else aligned.tau
