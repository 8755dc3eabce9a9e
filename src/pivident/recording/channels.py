"""Channels of a recording: their names, what its torques are, and the arrays they are kept in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from pivident.errors import RecordingError
from pivident.robot.wrench_sensor import WrenchSensor
from pivident.scratch import working_array

#: Fields that hold samples, besides the inputs.
CHANNELS = ("q", "tau", "q_ref", "dq_ref", "ddq_ref", "q_link", "dq")

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
