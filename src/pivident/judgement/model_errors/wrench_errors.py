"""Force sensors whose frame is another one than described.

By virtual work a wrench f in axes that are turned by R in truth adds J(q)ᵀ (R f - f) to the
torques, whatever the parameters are. Small turns and displacements of the frame are causes as those
of the geometry are; a wrong convention (axes named in another order, an opposite sign, the axes of
the world in place of the link's) is one cause each, which explains all or nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import permutations, product

import numpy as np

from pivident.data.recording.recording import MeasuredWrench, Recording
from pivident.estimation.problem import Problem
from pivident.judgement.model_errors.cause import Cause, RecordMotion, thinned
from pivident.judgement.model_errors.motion_errors import AXES, DEGREE, MILLIMETRE, PERCENT
from pivident.robot.description import Robot
from pivident.robot.frames import Pose, rotation_about
from pivident.robot.measured_base import link_places, sensor_link, wrench_torques
from pivident.robot.wrench_sensor import WrenchSensor

#: Largest sizes that are believed, by unit.
LARGEST = {"mm": 500.0, "°": 45.0, "%": 50.0}

#: Least and largest size of a wrong convention, which explains all of a difference or is none [%].
WHOLE = 70.0, 130.0

#: Step of the differences by which columns of small errors are made, in their unit.
STEP = 1e-3

#: A sensor that is described otherwise, by an error of some size.
Change = Callable[[WrenchSensor, float], WrenchSensor]


def wrench_causes(problem: Problem) -> Iterator[Cause]:
    """Turns, displacements, scale and conventions of every force sensor."""
    for k, sensor in enumerate(problem.robot.sensors):
        for axis, name in enumerate(AXES):
            what = f"correction of the angle of the sensor's frame about its {name}"
            yield _small(problem, k, what, "°", _turned(axis))
        for axis, name in enumerate(AXES):
            what = f"correction of the place of the sensor's origin along its {name}"
            yield _small(problem, k, what, "mm", _moved(axis))
        yield _scale(problem, k, sensor)
        yield from _conventions(problem, k, sensor)


def _small(problem: Problem, k: int, what: str, unit: str, change: Change) -> Cause:
    """A turn or displacement of a sensor's frame."""

    def columns(motion: RecordMotion) -> np.ndarray:
        own = wrench_of(problem, k, motion)
        robot, sensor, q = motion.robot, problem.robot.sensors[k], motion.q.T
        after, before = (wrench_torques(robot, s, q, own) for s in (change(sensor, STEP), sensor))
        # what the equations lack is the torque of the sensor as it is
        return -(after - before).T[None] / STEP

    def correct(given: Problem, size: np.ndarray) -> Problem:
        return with_sensor(given, k, change(given.robot.sensors[k], float(size[0])))

    subject = problem.robot.sensors[k].name
    return Cause(
        "wrench frame", subject, what, unit, columns, 1, correct, LARGEST[unit], is_smooth=True
    )


def _scale(problem: Problem, k: int, sensor: WrenchSensor) -> Cause:
    """A sensor whose forces are off by a factor."""

    def columns(motion: RecordMotion) -> np.ndarray:
        own = wrench_of(problem, k, motion)
        return PERCENT * wrench_torques(motion.robot, sensor, motion.q.T, own).T[None]

    def correct(given: Problem, size: np.ndarray) -> Problem:
        factor = 1.0 / (1.0 + PERCENT * float(size[0]))
        return _with_values(given, k, lambda values, q: factor * values)

    what = "excess of the measured force and moment"
    return Cause(
        "wrench gain", sensor.name, what, "%", columns, 1, correct, LARGEST["%"], is_smooth=True
    )


def _conventions(problem: Problem, k: int, sensor: WrenchSensor) -> Iterator[Cause]:
    """Axes in another order, the opposite sign, and the axes of the world."""
    yield _otherwise(problem, k, "the wrench acts in the opposite direction", lambda f, q: -f)
    for matrix, words in axis_orders():

        def turned(f: np.ndarray, q: np.ndarray, matrix: np.ndarray = matrix) -> np.ndarray:
            return np.hstack([f[:, :3] @ matrix.T, f[:, 3:] @ matrix.T])

        what = f"the axes x, y, z of the log are {words} of the described frame"
        yield _otherwise(problem, k, what, turned)
    link = sensor_link(problem.robot, sensor)
    if problem.robot.joints[link].motion == "held":
        return  # the axes of its link are those of the world

    def in_world(f: np.ndarray, q: np.ndarray) -> np.ndarray:
        axes = link_places(problem.robot, link, q)[0] @ sensor.frame.rotation
        return np.hstack([np.einsum("sji,sj->si", axes, part) for part in (f[:, :3], f[:, 3:])])

    what = "the wrench was logged in the axes of the world"
    yield _otherwise(problem, k, what, in_world)


def axis_orders() -> Iterator[tuple[np.ndarray, str]]:
    """The 23 right-handed axes that coordinate axes can be but themselves, in words."""
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[list(order), range(3)] = signs  # column i: where axis i of the log points
            if np.linalg.det(matrix) < 0.0 or np.array_equal(matrix, np.eye(3)):
                continue
            words = ", ".join(
                ("-" if sign < 0 else "") + AXES[axis]
                for axis, sign in zip(order, signs, strict=True)
            )
            yield matrix, words


#: What a logged wrench is in the described frame, from it and the positions, samples first.
Convention = Callable[[np.ndarray, np.ndarray], np.ndarray]


def _otherwise(problem: Problem, k: int, what: str, meant: Convention) -> Cause:
    """A wrench that is another one in the described frame."""

    def columns(motion: RecordMotion) -> np.ndarray:
        own, q = wrench_of(problem, k, motion), motion.q.T
        missing = PERCENT * (meant(own, q) - own)
        return -wrench_torques(motion.robot, problem.robot.sensors[k], q, missing).T[None]

    def correct(given: Problem, size: np.ndarray) -> Problem:
        return _with_values(given, k, meant)

    subject = problem.robot.sensors[k].name
    return Cause(
        "wrench frame",
        subject,
        what,
        "% of the difference",
        columns,
        1,
        correct,
        WHOLE[1],
        WHOLE[0],
        is_positive=True,
        is_smooth=True,
    )


def wrench_of(problem: Problem, k: int, motion: RecordMotion) -> np.ndarray:
    """What a sensor measured at the samples of a motion, shape (samples, 6)."""
    recording = problem.recordings[motion.number]
    stride = round(recording.rate / motion.rate)
    return thinned(recording.wrenches[k].values.T, recording.rate, stride).T[: motion.q.shape[1]]


def with_sensor(problem: Problem, k: int, sensor: WrenchSensor) -> Problem:
    """The problem with one of its sensors described otherwise."""
    sensors = (*problem.robot.sensors[:k], sensor, *problem.robot.sensors[k + 1 :])
    robot = replace(problem.robot, sensors=sensors)
    made = (
        _with_wrench(robot, r, k, MeasuredWrench(sensor, r.wrenches[k].values))
        for r in problem.recordings
    )
    return replace(problem, robot=robot, recordings=tuple(made))


def _with_values(problem: Problem, k: int, meant: Convention) -> Problem:
    """The problem with other values of one sensor."""

    def changed(recording: Recording) -> Recording:
        own = recording.wrenches[k]
        values = meant(own.values, recording.q)
        return _with_wrench(problem.robot, recording, k, MeasuredWrench(own.sensor, values))

    return replace(problem, recordings=tuple(changed(r) for r in problem.recordings))


def _with_wrench(robot: Robot, recording: Recording, k: int, wrench: MeasuredWrench) -> Recording:
    """A recording with another wrench, and its torques."""
    wrenches = (*recording.wrenches[:k], wrench, *recording.wrenches[k + 1 :])
    torque = np.sum(
        [wrench_torques(robot, w.sensor, recording.q, w.values) for w in wrenches], axis=0
    )
    return replace(recording, wrenches=wrenches, wrench_torque=torque)


def _turned(axis: int) -> Change:
    """The frame turned about one of its axes [°]."""

    def change(sensor: WrenchSensor, size: float) -> WrenchSensor:
        turn = rotation_about(np.eye(3)[axis], size * DEGREE)
        frame = Pose(sensor.frame.rotation @ turn, sensor.frame.translation)
        return replace(sensor, frame=frame)

    return change


def _moved(axis: int) -> Change:
    """The origin moved along one of the frame's axes [mm]."""

    def change(sensor: WrenchSensor, size: float) -> WrenchSensor:
        frame = sensor.frame
        moved = frame.translation + size * MILLIMETRE * frame.rotation[:, axis]
        return replace(sensor, frame=Pose(frame.rotation, moved))

    return change
