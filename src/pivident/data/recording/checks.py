"""Channels of a recording, and what every one has to fulfil, one function per demand.

Channels of a recording: their names, what its torques are, and the arrays they are kept in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from pivident.data.logs import timestamps
from pivident.data.logs.timestamps import moves, runs_of
from pivident.foundation.errors import (
    ConstantChannel,
    NonFiniteSamples,
    PositionsBeyondLimits,
    RecordingError,
    SaturatedSignal,
    ShapeMismatch,
    concerning,
)
from pivident.foundation.scratch import working_array
from pivident.robot.description import Robot, TorqueSide
from pivident.robot.wrench_sensor import WrenchSensor

#: Longest drive_delay that is believed [s]; more is a delay in milliseconds without its 1e-3.
MAX_DRIVE_DELAY = 0.1
#: Shortest run of equal values that counts.
MIN_RUN = 5
#: How much more frequent the limit is than the next value inside the range.
DOMINANCE = 10
#: Fields that hold samples, besides the inputs.
CHANNELS = ("q", "tau", "q_ref", "dq_ref", "ddq_ref", "q_link", "dq")
#: What stands beside them for each sample and joint.
BESIDE = ("wrench_torque", "valid", "weights", "temperature")
#: Which instant a torque sample belongs to, see `Recording.torque_timing`.
TorqueTiming = Literal["held", "averaged", "sampled"]
#: The same in words.
TIMING_WORDS = {
    "held": "applied from its instant until the next control instant",
    "averaged": "the mean over the period before its instant",
    "sampled": "the value at its instant",
}
#: Where the joint torques come from, see `Recording.torque_source`.
TorqueSource = Literal["measured", "law", "none"]
#: The same in sentences, for torques that were not measured.
SOURCE_SENTENCES = {
    "law": (
        "No torque was logged: it is what the control law with the declared gains commands at the "
        "recorded positions."
    ),
    "none": "No torque was logged.",
}
#: What to do with a torque that is cut off at a limit.
Saturation = Literal["refuse", "allow"]


class RecordingOptions(TypedDict, total=False):
    """Fields of a recording that are not signals, see `Recording`."""

    control_rate: float
    torque_timing: TorqueTiming
    delay: float
    drive_delay: float
    start_time: float
    torque_side: TorqueSide
    torque_scale: tuple[Any, ...]
    allow_constant: bool
    saturation: Saturation
    notes: tuple[str, ...]


def usual_timing(side: TorqueSide) -> TorqueTiming:
    """What a torque sample is where nobody says it: motors hold a torque, sensors sample one.

    Args:
        side: where the torque is measured.
    """
    return "sampled" if side == "link" else "held"


def clipped_samples(tau: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Which samples of one joint's torque are cut off.

    Args:
        tau: torque, shape (samples,).
        q: position of the same joint, shape (samples,).

    Returns:
        Truth values, shape (samples,).
    """
    clipped = np.zeros(len(tau), dtype=bool)
    for signal in (tau, -tau):
        limit = signal.max()
        inside = signal[signal < limit]
        if not inside.size:
            continue
        at_limit = signal == limit
        at_next_value = np.count_nonzero(signal == inside.max())
        if np.count_nonzero(at_limit) < DOMINANCE * at_next_value:
            continue
        for start, stop in runs_of(at_limit):
            if stop - start >= MIN_RUN and moves(q, start, stop):
                clipped[start:stop] = True
    return clipped


#: How far beyond its limits a joint may be logged, in spans of its limits.
TOLERATED_REACH = 2.0
#: Share of clipped samples that a torque channel may have.
TOLERATED_CLIPPING = 0.01


def check_shape(channel: str, values: np.ndarray, expected: tuple[int, ...]) -> None:
    """Refuse a channel that is not (samples, joints)."""
    if values.shape != expected:
        raise ShapeMismatch(channel, values.shape, expected)


def check_finite(channel: str, values: np.ndarray, joint_names: Sequence[str]) -> None:
    """Refuse NaN and infinite samples; values (samples, joints)."""
    # A sum is NaN or infinite as soon as one term is: no mask of the whole record is needed. A
    # sum of finite terms could overflow; then the mask finds nothing and the channel passes.
    with np.errstate(invalid="ignore", over="ignore"):
        suspicious = np.flatnonzero(~np.isfinite(values.sum(axis=0)))
    for j in suspicious.tolist():
        bad = np.flatnonzero(~np.isfinite(values[:, j]))
        if bad.size:
            raise NonFiniteSamples(channel, joint_names[j], int(bad[0]), bad.size)


def check_weights(weights: np.ndarray, joint_names: Sequence[str]) -> None:
    """Refuse weights that are not positive numbers; weights (samples, joints)."""
    bad = np.argwhere(~(np.isfinite(weights) & (weights > 0.0)))
    if bad.size:
        k, j = bad[0]
        raise RecordingError(
            f"the weight of {joint_names[j]} at sample {k} is {weights[k, j]:g}",
            advice="weights are finite and above zero; leave samples out with valid",
        ).about("weights")


def check_changing(channel: str, values: np.ndarray, joint_names: Sequence[str]) -> None:
    """Refuse a channel that never changes; values (samples, joints)."""
    constant = np.flatnonzero(values.min(axis=0) == values.max(axis=0))
    if constant.size:
        j = int(constant[0])
        raise ConstantChannel(channel, joint_names[j], float(values[0, j]))


def check_within_reach(channel: str, q: np.ndarray, robot: Robot, unit: object = None) -> None:
    """Refuse positions that no offset explains, which mostly are in another unit."""
    for j, joint in enumerate(robot.joints):
        if joint.position_limits is None:
            continue
        low, high = joint.position_limits
        reach = TOLERATED_REACH * (high - low)
        farthest = float(q[np.argmax(np.abs(q[:, j] - 0.5 * (low + high))), j])
        if low - reach <= farthest <= high + reach:
            continue
        si, other, name = (
            ("rad", "deg", "degrees") if joint.kind == "revolute" else ("m", "mm", "millimetres")
        )
        own = unit[j] if isinstance(unit, (list, tuple)) else unit
        advice = (
            f'are they {name}? set units = {{{channel} = "{other}"}}; or of the motor: side = '
            '"motor", with the reduction of the gears'
        )
        if own is not None and own != si:
            other = ""
            advice = f"check the unit {own!r}, position_offset and the limits of the robot"
        raise PositionsBeyondLimits(channel, joint.name, farthest, (low, high), si, other, advice)


def check_not_saturated(
    channel: str, tau: np.ndarray, q: np.ndarray, joint_names: Sequence[str]
) -> None:
    """Refuse a torque that is cut off during more than one per cent of the recording."""
    for j, joint in enumerate(joint_names):
        clipped = np.flatnonzero(clipped_samples(tau[:, j], q[:, j]))
        if clipped.size > TOLERATED_CLIPPING * len(tau):
            first = int(clipped[0])
            value = float(tau[first, j])
            raise SaturatedSignal(channel, joint, value, clipped.size, len(tau), first)


def check_torques(recordings: Sequence[Any], robot: Robot) -> None:
    """Refuse a driven joint that moves while its measured torque is zero at every sample.

    A joint all of whose samples are left out has no equation that the torque could be missing in.

    Args:
        recordings: the runs, one column for each joint.
        robot: whose joints they are.

    Raises:
        RecordingError: names the joint.
    """
    measured = [r for r in recordings if r.torque_source == "measured"]
    for j, joint in enumerate(robot.joints if measured else ()):
        used = [r for r in measured if r.valid is None or r.valid[:, j].any()]
        if joint.motion == "driven" and not any(r.tau[:, j].any() for r in used):
            if any(np.ptp(r.q[:, j]) for r in used):
                raise RecordingError(
                    f"the torque of joint {joint.name!r} is zero at every sample, and it moves",
                    advice="check its column of tau; no parameter of its drive can be estimated",
                ).about("columns", "tau")


def check_times(**given: float) -> None:
    """Refuse rates, delays and times that mean nothing.

    Args:
        given: ``rate control_rate`` [Hz], ``delay drive_delay start_time`` [s].
    """
    for name in ("rate", "control_rate"):
        with concerning(name):
            timestamps.check_positive(name, given[name])
    for name in ("delay", "drive_delay", "start_time"):
        if not np.isfinite(given[name]):
            raise RecordingError(f"{name} is {given[name]!r} s", advice="a number is needed").about(
                name
            )
    wait = given["drive_delay"]
    if wait < 0:
        raise RecordingError(
            f"drive_delay is {wait:g} s", advice="a torque that is logged late is declared by delay"
        ).about("drive_delay")
    if wait > MAX_DRIVE_DELAY:
        raise RecordingError(
            f"drive_delay is {wait:g} s, longer than any drive takes",
            advice="it is given in seconds, 0.3e-3 for 0.3 ms",
        ).about("drive_delay")


@dataclass(frozen=True, eq=False)
class MeasuredWrench:
    """What one force sensor measured.

    Attributes:
        sensor: where it sits.
        values: force and moment in its frame, shape (samples, 6) [N, N m].
    """

    sensor: WrenchSensor
    values: np.ndarray


def one_column(channel: str, values: ArrayLike) -> np.ndarray:
    """A channel with one column for each joint, where a vector is that of one joint."""
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise RecordingError(f"{channel} is not an array of real numbers ({error})") from error
    return array[:, np.newaxis] if array.ndim == 1 else array


def settled(channel: str, values: Any) -> np.ndarray:
    """A read-only float64 array in C order; one that already is all that is not copied."""
    try:
        array = np.asarray(values)
        if np.iscomplexobj(array):
            raise TypeError("complex numbers")
        if array.dtype == np.float64 and array.flags.c_contiguous and not array.flags.writeable:
            return array
        made = working_array(array.shape)
        made[...] = array
    except (TypeError, ValueError) as error:
        raise RecordingError(f"{channel} is not an array of real numbers ({error})") from error
    made.flags.writeable = False
    return made
