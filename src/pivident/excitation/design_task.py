"""What a search for a motion works on: a robot, its limits, what is known of it, what is asked."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pivident.collision.clearances import Clearances
from pivident.excitation.constraints import Constraints
from pivident.excitation.criteria import Criterion, Objective
from pivident.excitation.information import Information, assumed_noise
from pivident.excitation.knowledge import Knowledge
from pivident.excitation.limits import JointLimits
from pivident.excitation.motions import ExcitingMotion, MotionFamily
from pivident.excitation.questions import Question, robot_question
from pivident.excitation.request import DesignRequest, motion_family
from pivident.excitation.torque_bound import TorqueModel
from pivident.robot.description import Robot

#: Samples of the search in the shortest time in which a motion changes its course.
SAMPLES = 12

#: Rate at which standard errors are predicted in the end [Hz].
PREDICTION_RATE = 200.0


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
        samples = constraints.functions.shape[1]
        family = constraints.family
        rate = (samples - 1) / family.duration
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
