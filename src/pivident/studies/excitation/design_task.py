"""What a search for a motion works on: robot, limits, knowledge, wishes, and whether there is one.

Whether there can be a motion at all: what is refused before a search, and why one found none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.numbers import percent
from pivident.foundation.text.sentences import listed
from pivident.robot.description import Robot
from pivident.studies.collision.clearances import Clearances
from pivident.studies.excitation.constraints import Constraints, TorqueModel
from pivident.studies.excitation.criteria import Criterion, Objective, standard_errors
from pivident.studies.excitation.information import Information, assumed_noise
from pivident.studies.excitation.knowledge import Knowledge
from pivident.studies.excitation.limits import PLANNED_SHARE, ROOM, JointLimits
from pivident.studies.excitation.motions import ExcitingMotion, MotionFamily
from pivident.studies.excitation.questions import Question, robot_question
from pivident.studies.excitation.request import DesignRequest, motion_family

#: Samples of the search in the shortest time in which a motion changes its course.
SAMPLES = 12
#: Rate at which standard errors are predicted in the end [Hz].
PREDICTION_RATE = 200.0
#: Share of its range that a joint must be able to move over in half the time.
LEAST_TRAVEL = 0.01
#: Postures that are tried where no motion was found, and the shares of them that say why.
TRIED_POSTURES, MOST_POSTURES, FEW_POSTURES = 500, 0.8, 0.05


@dataclass(frozen=True, eq=False)
class DesignTask:
    """A robot, its limits, what is known of it, and what is asked."""

    robot: Robot
    request: DesignRequest
    limits: JointLimits
    known: Knowledge
    question: Question
    clearances: Clearances | None

    @property
    def criterion(self) -> Criterion:
        """The criterion in the units of the question."""
        sizes = self.question.sizes(self.known.significant)
        all_asked = len(self.question.asked) == self.question.size
        chosen = None if all_asked else self.question.asked
        return Criterion(self.request.criterion_used, sizes, chosen)

    @property
    def torques(self) -> tuple[TorqueModel, ...]:
        """The present model in each run of the motion; none where no mass is known."""
        known = self.known
        if not known.has_masses:
            return ()
        return tuple(
            TorqueModel(known.regressor, known.model_values + load, known.covariance)
            for load in self.question.loads or (np.zeros(len(known.base)),)
        )

    def family(self, duration: float) -> MotionFamily:
        """Functions of a motion of that duration [s]."""
        return motion_family(self.request.motion, duration, self.limits)

    def constraints(self, family: MotionFamily) -> Constraints:
        """The user's limits, on the grid of the search."""
        rate = SAMPLES / family.time_scale
        return Constraints.of(family, rate, self.limits, self.torques, self.clearances)

    def information(self, rate: float, rounds: int = 1, *, bare: bool = False) -> Information:
        """Information of rounds sampled at a rate [Hz]; bare: of the unweighted matrix."""
        known, size = self.known, self.question.size
        if bare:
            noise = assumed_noise(np.ones(self.robot.size), rate)
            question = robot_question(known.base, known.values)
            size = question.size
            return Information(
                known.regressor, noise, rate, np.zeros((size, size)), question, rounds
            )
        earlier = np.zeros((size, size))
        earlier[: len(known.base), : len(known.base)] = known.earlier
        noise = known.noise
        if self.request.motion != "postures":
            # at rest a joint's speed is noise, and its friction any; one that turns round is not
            noise = replace(noise, standstill=np.zeros(self.robot.size))
        return Information(known.regressor, noise, rate, earlier, self.question, rounds)

    def objective(self, constraints: Constraints) -> Objective:
        """The criterion of motions under constraints."""
        family = constraints.family
        rate = (constraints.functions.shape[1] - 1) / family.duration
        bare = not self.criterion.weighted
        return Objective(
            self.criterion, self.information(rate, family.rounds, bare=bare), constraints
        )

    def predicted(self, motion: ExcitingMotion) -> tuple[np.ndarray, np.ndarray]:
        """Information of a motion at the rate of the prediction, and of its record alone."""
        rate = min(PREDICTION_RATE, self.known.noise.rate)
        rate = max(rate, 2.0 * SAMPLES / motion.family.time_scale)
        made = self.information(rate, motion.family.rounds)
        alone = replace(made, earlier=np.zeros_like(made.earlier)).of(
            motion.one_round.sampled(rate)
        )
        return made.earlier + alone, alone


def check_ranges(task: DesignTask) -> None:
    """Refuse clearances that were made for narrower ranges of the joints: they leave pairs out."""
    if task.clearances is None:
        return
    for j, joint in enumerate(task.clearances.robot.joints):
        own = joint.position_limits
        if own is None or task.limits.low[j] < own[0] or task.limits.high[j] > own[1]:
            made = "without limits" if own is None else f"from {own[0]:g} to {own[1]:g}"
            raise ExperimentError(
                f"the clearances are those of {joint.name} {made}, the motion may go from "
                f"{task.limits.low[j]:g} to {task.limits.high[j]:g} {joint.position_unit}",
                advice="make the clearances of limits.of_robot(robot)",
            ).about("clearances")


def check_start(task: DesignTask) -> None:
    """Refuse a given posture that leaves no room for a motion, or clearances that no posture keeps.

    The search keeps a share of every limit and some room between bodies for what happens between
    its samples; a start beyond them would have no motion.
    """
    start = task.request.start
    if start is None:
        if crowded := _crowded(task, 0):
            raise crowded
        return
    posture, limits = np.array(start, dtype=float), task.limits.within(PLANNED_SHARE)
    if posture.shape != (task.robot.size,) or not np.isfinite(posture).all():
        raise ExperimentError(
            f"start has {posture.size} positions",
            advice=f"one finite number for each of the {task.robot.size} joints is needed",
        ).about("start")
    for j, joint in enumerate(task.robot.joints):
        if not limits.low[j] < posture[j] < limits.high[j]:
            raise ExperimentError(
                f"the start has {joint.name} at {posture[j]:g} {joint.position_unit}",
                advice=f"choose a posture between {limits.low[j]:g} and {limits.high[j]:g}, which "
                f"leaves {50 * (1 - PLANNED_SHARE):.3g} % of its range at either end",
            ).about("start")
    if task.clearances is not None and task.clearances.needed.size:
        distances = task.clearances.distances(posture[None])[:, 0]
        needed = task.clearances.with_more(ROOM).needed
        nearest = int(np.argmin(distances - needed))
        if distances[nearest] < needed[nearest]:
            raise ExperimentError(
                f"at the start, {task.clearances.names[nearest]}: the clearance is "
                f"{1e3 * distances[nearest]:.3g} mm",
                advice=f"{1e3 * needed[nearest]:.3g} mm are needed, up to {1e3 * ROOM:g} mm of "
                "them for the motion; choose another start, or a smaller clearance",
            ).about("start")
    for model in task.torques:
        still = np.zeros((1, task.robot.size))
        torque, margin = model.torque_and_margin((posture[None], still, still))
        over = (np.abs(torque) + margin)[0] / limits.torque
        if over.max() > 1.0:
            joint = task.robot.joints[int(np.argmax(over))]
            raise ExperimentError(
                f"at the start, gravity takes {percent(100 * PLANNED_SHARE * over.max())} of the "
                f"torque limit of {joint.name}, margin of the model included",
                advice="choose another start",
            ).about("start")


def check_travel(task: DesignTask) -> None:
    """Refuse a duration in which a joint hardly moves."""
    travel = 0.5 * task.limits.speed * task.request.duration / (2.0 * task.limits.half)
    slowest = int(np.argmin(travel))
    if travel[slowest] < LEAST_TRAVEL:
        joint = task.robot.joints[slowest]
        raise ExperimentError(
            f"in {task.request.duration:g} s {joint.name} moves over less than "
            f"{100 * LEAST_TRAVEL:g} % of its range at its largest speed, "
            f"{task.limits.speed[slowest]:g} {joint.position_unit}/s",
            advice="give it more time, or a higher limit of the speed",
        ).about("duration")


def why_none(task: DesignTask, allowed: Constraints, duration: float) -> ExperimentError:
    """Why no motion was found."""
    if crowded := _crowded(task, FEW_POSTURES * TRIED_POSTURES):
        return crowded
    postures = _postures(task)
    if task.torques:
        still = np.zeros_like(postures)
        torque, margin = task.torques[-1].torque_and_margin((postures, still, still))
        over = (np.abs(torque) + margin > task.limits.torque).mean(axis=0)
        if over.max() > MOST_POSTURES:
            joint = task.robot.joints[int(np.argmax(over))].name
            return ExperimentError(
                f"the torque limit of {joint} does not hold the arm against gravity in "
                f"{100 * over.max():.0f} % of its postures",
                advice="check the limit and the masses",
            )
    if names := _never_identified(task):
        return ExperimentError(
            f"no motion of this robot identifies {listed(names)}, whatever its limits and duration",
            advice="ask for something else, or with another load",
        )
    quantities = ["position", "speed", "acceleration"]
    quantities += ["jerk"] if np.isfinite(task.limits.jerk).any() else []
    quantities += ["torque"] if task.torques else []
    return ExperimentError(
        f"no motion of {duration:g} s within the limits of {listed(quantities)} determines all "
        f"{task.question.size} parameters ({allowed.family.size} functions for each joint)",
        advice=f"give it more time, such as --duration {2 * duration:g}, or relax the limits",
    )


def _postures(task: DesignTask) -> np.ndarray:
    """Random postures, shape (TRIED_POSTURES, joints)."""
    rng = np.random.default_rng(task.request.seed)
    shape = (TRIED_POSTURES, task.robot.size)
    return task.limits.middle + rng.uniform(-0.9, 0.9, shape) * task.limits.half


def _crowded(task: DesignTask, most: float) -> ExperimentError | None:
    """What is too near in most postures where at most so many random ones are free; else None."""
    if task.clearances is None or not task.clearances.needed.size:
        return None
    distances = task.clearances.distances(_postures(task))
    near = distances < task.clearances.with_more(ROOM).needed[:, None]
    free = int(np.sum(~near.any(axis=0)))
    if free > most:
        return None
    worst = task.clearances.names[int(np.argmax(near.mean(axis=1)))]
    origin = "".join(f" {remark}" for remark in task.clearances.remarks[:1])  # of the bodies
    return ExperimentError(
        f"{free or 'none'} of {TRIED_POSTURES} random postures keep{'' if free else 's'} all "
        f"clearances: what is too near most often is {worst}.{origin} Check the bodies, "
        "obstacles, floor, tool box and clearance, all in metres, or begin at a free posture, "
        "start = […]"
    )


def _never_identified(task: DesignTask) -> list[str]:
    """Unknowns that not even random speeds and accelerations in random postures determine."""
    rng = np.random.default_rng(task.request.seed)
    shape = (max(TRIED_POSTURES, task.question.size), task.robot.size)
    limits = task.limits
    states = (
        limits.middle + rng.uniform(-1.0, 1.0, shape) * limits.half,
        rng.uniform(-1.0, 1.0, shape) * limits.speed,
        rng.uniform(-1.0, 1.0, shape) * limits.acceleration,
    )
    white = Information(
        task.known.regressor,
        assumed_noise(np.ones(task.robot.size), 1.0),
        1.0,
        task.information(1.0).earlier,
        task.question,
    )
    never = np.flatnonzero(np.isinf(standard_errors(white.of(states))))
    asked = np.intersect1d(never, task.question.asked)
    return [task.question.names[k] for k in (asked if asked.size else never)]
