"""Measured wrenches, and the base that they hold or that floats, in a recording.

A log holds the channels of the joints that have motors. Force sensors add the torques Jᵀ f to the
equations of motion; under a held base, and on a floating one, the six joints of the base come
before those of the log.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pivident.data.recording import checks
from pivident.data.recording.joint_order import in_order_of
from pivident.data.recording.recording import CHANNELS, MeasuredWrench, Recording
from pivident.foundation.errors import RecordingError
from pivident.robot.description import Robot
from pivident.robot.measured_base import base_positions, base_speeds, wrench_torques
from pivident.robot.naming import errors_name
from pivident.robot.wrench_sensor import BASE, COMPONENTS


def with_wrenches(
    recording: Recording,
    robot: Robot,
    values: Mapping[str, np.ndarray] | None = None,
    pose: tuple[np.ndarray, np.ndarray] | None = None,
    twist: np.ndarray | None = None,
) -> Recording:
    """A recording of the joints with motors, and what was measured besides.

    Args:
        recording: one column for each joint that has a motor.
        robot: the robot with its sensors, see `pivident.robot.with_wrench_sensors` and
            `pivident.robot.with_floating_base`.
        values: force and moment of each sensor in its frame, by its name, shape (samples, 6)
            [N, N m].
        pose: of a floating base: its origin in the world, shape (samples, 3) [m], and its axes,
            shape (samples, 3, 3).
        twist: of a floating base: speed of its origin and angular velocity in the world, shape
            (samples, 6) [m/s, rad/s]; with measured speeds ``dq`` of the joints it is a second
            sensor of the motion, see `pivident.loop.instruments.second_sensor`.

    Returns:
        The recording with one column for each joint of the robot.

    Raises:
        RecordingError: a sensor without values, values without a sensor, a base that is measured
            and was not; values that are not finite or constant.
        RobotDescriptionError: a sensor on a link that the robot does not have.
    """
    values = dict(values or {})
    _check_names(recording, robot, values, pose)
    recording = in_order_of(robot.on_fixed_base, recording)
    recording = _with_base(recording, robot, pose, twist)
    measured, torque = [], np.zeros(recording.q.shape)
    for sensor in robot.sensors:
        own = np.asarray(values[sensor.name], dtype=float)
        channel = f"wrench.{sensor.name}"
        checks.check_shape(channel, own, (recording.samples, len(COMPONENTS)))
        checks.check_finite(channel, own, COMPONENTS)
        if not np.ptp(own, axis=0).any():
            raise RecordingError(
                f"recording {recording.name!r}: the wrench of sensor {sensor.name!r} is the same "
                "at every sample",
                advice="map its columns under columns.wrench",
            )
        measured.append(MeasuredWrench(sensor, own))
        torque += wrench_torques(robot, sensor, recording.q, own)
    return replace(recording, wrenches=tuple(measured), wrench_torque=torque if measured else None)


def _check_names(
    recording: Recording,
    robot: Robot,
    values: Mapping[str, np.ndarray],
    pose: object,
) -> None:
    """Refuse measurements without a sensor, and the other way round."""
    names = [sensor.name for sensor in robot.sensors]
    where = f"recording {recording.name!r}"
    for name in names:
        if name not in values:
            raise RecordingError(
                f"{where} has no columns for the wrench sensor {name!r}",
                advice=f'map six, wrench = {{{name} = ["fx", "fy", "fz", "mx", "my", "mz"]}}',
            ).about("columns")
    for name in values:
        if name not in names:
            raise RecordingError(
                f"{where} has columns for a wrench {name!r}, and no sensor of that name is "
                "described",
                advice="add [[wrench]] with its name, link and frame",
            ).about("columns", "wrench", name)
    if robot.base_motion == "measured" and pose is None:
        raise RecordingError(
            f"robot {robot.name!r} has a floating base, and {where} does not hold its pose",
            advice='map base = {position = ["x", "y", "z"], quaternion = ["qx", "qy", "qz", "qw"]}',
        ).about("columns")
    if robot.base_motion == "measured" and not names and not robot.contacts:
        raise RecordingError(
            f"robot {robot.name!r} has a floating base, and nothing holds it: describe the sensors "
            "of its cable or feet by [[wrench]] and map their columns, or its feet that stand by "
            "[[contact]]"
        )
    if robot.base_motion == "held" and not any(s.link == BASE for s in robot.sensors):
        raise RecordingError(
            f"the base of robot {robot.name!r} is held by a force sensor that is not described",
            advice='add it by [[wrench]] with link = "base", and map its columns',
        )
    if robot.base_motion != "measured" and pose is not None:
        raise RecordingError(
            f"{where} holds the pose of a base, but that of robot {robot.name!r} does not move",
            advice="write floating_base = true under [robot], or remove the columns",
        ).about("columns", "base")


def _with_base(
    recording: Recording,
    robot: Robot,
    pose: tuple[np.ndarray, np.ndarray] | None,
    twist: np.ndarray | None,
) -> Recording:
    """The recording with the joints of the base in front: at rest, or at their measured pose."""
    count = robot.base_joints
    if not count:
        return recording
    if recording.q_link is not None:
        raise RecordingError(
            f"recording {recording.name!r} has encoders behind the gears (q_link), which a "
            "measured base does not allow",
            advice="leave out their columns",
        ).about("columns", "q_link")
    still = np.zeros((recording.samples, count))
    base = still if pose is None else _base_positions(recording, pose)
    before = {"q": base, "tau": still, "q_ref": base}
    channels: dict[str, Any] = {
        channel: np.hstack([before.get(channel, still), own])
        for channel in (*CHANNELS, "temperature")
        if (own := getattr(recording, channel)) is not None
    }
    notes = recording.notes
    if robot.base_motion == "measured":  # nothing commands its speed
        channels |= {c: None for c in ("dq", "dq_ref", "ddq_ref") if c in channels}
        if twist is not None and recording.dq is not None:
            checks.check_shape("base.twist", twist, (recording.samples, 6))
            channels["dq"] = np.hstack([base_speeds(base, twist), recording.dq])
        elif twist is not None or recording.dq is not None:
            missing = "the joints" if recording.dq is None else "the base (twist)"
            notes += (
                f"Measured speeds are not used: those of {missing} are missing; map both to have "
                "a second sensor of the motion.",
            )
    return replace(
        recording,
        joint_names=robot.joint_names,
        **channels,
        notes=notes,
        inputs={key: np.hstack([still, own]) for key, own in recording.inputs.items()},
        allow_constant=True,
        saturation="allow",
    )


def _base_positions(recording: Recording, pose: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Positions of the joints of the base; refuses a pose that is none, and names the run."""
    where = f"recording {recording.name!r}"
    for name, part, own in (("position", pose[0], (3,)), ("rotation", pose[1], (3, 3))):
        shape = (recording.samples, *own)
        if np.shape(part) != shape:
            raise RecordingError(
                f"{where}: the {name} of the base has shape {np.shape(part)}",
                advice=f"{shape} is needed",
            ).about("columns", "base")
        bad = np.flatnonzero(~np.isfinite(part).reshape(len(part), -1).all(axis=1))
        if bad.size:
            raise RecordingError(
                f"{where}: the {name} of the base is not finite at sample {bad[0]}, one of "
                f"{bad.size}",
                advice="cut the record to where it was measured (part)",
            ).about("columns", "base")
    with errors_name(where):
        return base_positions(*pose)
