"""Parameters that are not estimated: left out by choice, or carried in one recording only."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import Parameter, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.model_errors.cause import Cause, Columns
from pivident.model_errors.record_motion import RecordMotion
from pivident.robot.description import Robot

#: A load at the flange: mass and first moments.
LOAD = ("m", "mx", "my", "mz")


def missing_causes(
    robot: Robot, parameters: Sequence[Parameter], recordings: Sequence[str]
) -> Iterator[Cause]:
    """Base parameters that were left out, and loads of single recordings.

    ``parameters``: those that are estimated; ``recordings``: names of the recordings.
    """
    known = {p.name for p in parameters}
    base = base_parameters(robot)
    for name, parameter in zip(base.names, base.parameters, strict=True):
        if parameter.name not in known:
            yield _left_out(robot, name, parameter)
    if robot.constraints is not None:
        return  # it has no flange
    last = robot.size - 1
    stems = {p.stem: p for p in standard_parameters(robot) if p.joint == last}
    own = [stems[stem] for stem in LOAD]  # the mass first, whose amplitude is the size
    for number, recording in enumerate(recordings[1:], start=1):
        yield _carried(robot, own, number, recording)


def _left_out(robot: Robot, name: str, parameter: Parameter) -> Cause:
    torques = _torques_of([parameter])

    joint = robot.tree.joint_names[parameter.joint]
    what = f"{name}, which is not estimated"
    return Cause("missing parameter", joint, what, parameter.unit, torques)


def _carried(robot: Robot, own: Sequence[Parameter], number: int, recording: str) -> Cause:
    torques = _torques_of(own)

    def columns(motion: RecordMotion) -> np.ndarray:
        found = torques(motion)
        return found if motion.number == number else np.zeros_like(found)

    what = f"mass at the flange in {recording} alone"
    name = robot.joint_names[-1]
    return Cause("payload", name, what, "kg", columns, len(own), by_first=True)


def _torques_of(parameters: Sequence[Parameter]) -> Columns:
    """Columns of parameters."""

    @lru_cache(maxsize=1)
    def regressor(robot: Robot) -> Regressor:
        return regressor_of(robot, parameters)

    def columns(motion: RecordMotion) -> np.ndarray:
        matrix = regressor(motion.robot).matrix(motion.q.T, motion.dq.T, motion.ddq.T)
        return np.ascontiguousarray(matrix.transpose(2, 1, 0))

    return columns
