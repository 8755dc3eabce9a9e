"""What an estimate is compared with: the description's own model, and the plain law.

A torque error says little by itself. It is held against that of three others on the same held-out
motion, in the same band: the model of the robot's description where it has masses, a least squares
of all base parameters with viscous and Coulomb friction and an offset on each joint, and no torque
at all, whose error is 100 %.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.method import Method
from pivident.estimation.problem import NOTHING_KNOWN, Problem
from pivident.foundation.errors import PividentError
from pivident.judgement.validation.held_out.cross_validation import CrossValidation, judged_on
from pivident.judgement.validation.held_out.folds import JudgedMotion
from pivident.judgement.validation.held_out.prediction import PredictionError, pooled
from pivident.robot.description import INERTIAL, Robot
from pivident.robot.friction import DEFAULT_FRICTION

#: Place of the mass among the ten inertial parameters of a link.
MASS = INERTIAL.index("m")


@dataclass(frozen=True, eq=False)
class Baselines:
    """Torque errors of other models on the held-out motion of a result.

    Attributes:
        description: of the description's own model; None where it has no masses.
        plain_law: of the plain law; None where it cannot be estimated.
        described_mass: sum of the masses of all links after the description [kg].
    """

    description: PredictionError | None = None
    plain_law: PredictionError | None = None
    described_mass: float = 0.0

    @property
    def errors(self) -> dict[str, float]:
        """Torque errors by what they are of [%]."""
        there = {"description": self.description, "plain law": self.plain_law}
        return {name: e.total_in_band for name, e in there.items() if e is not None}


@dataclass(frozen=True, eq=False)
class _DescribedModel:
    """The model of a robot's description, friction included where it has some."""

    robot: Robot
    regressor: Regressor
    theta: np.ndarray

    def predict(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """Φθ, shape (samples, joints) [N m or N]."""
        return self.regressor.torque(q, dq, ddq, self.theta)


def baselines(
    problem: Problem,
    motion: JudgedMotion,
    judged: CrossValidation,
    least_squares: Method,
    folds: int,
    gap: float | None = None,
) -> Baselines:
    """Errors of the description and of the plain law.

    Args:
        problem: what was given, all of its parameters.
        motion: its smoothed recordings.
        judged: the result that is compared, whose stretches are judged on.
        least_squares: by which the plain law is estimated.
        folds: blocks that were held out in turn.
        gap: left out on either side of a block [s].
    """
    masses = [float(link.inertia[MASS]) for link in problem.robot.tree.links if link.is_body]
    try:
        plain = _plain_law(problem, motion, least_squares, folds, gap)
    except PividentError:
        plain = None
    described = _described(problem, motion, judged) if any(masses) else None
    return Baselines(described, plain, sum(masses))


def _plain_law(
    problem: Problem, motion: JudgedMotion, method: Method, folds: int, gap: float | None
) -> PredictionError:
    """Least squares with viscous and Coulomb friction and an offset, of all base parameters."""
    robot = problem.robot
    if robot.torque_side == "motor" and not robot.base_joints:
        robot = robot.with_friction(DEFAULT_FRICTION)
    plain = replace(problem, robot=robot, parameters=None, initial={}, loop=None, **NOTHING_KNOWN)
    return judged_on(
        replace(motion, problem=plain), method, folds, gap, None, lambda line: None
    ).prediction


def _described(
    problem: Problem, motion: JudgedMotion, judged: CrossValidation
) -> PredictionError | None:
    """The description's model on the stretches of a result."""
    base = problem.base
    theta = base.values(nominal_values(problem.robot, base.standard))
    model = _DescribedModel(problem.robot, regressor_of(problem.robot, base.parameters), theta)
    judges = {judge.recording.name: judge for judge in (motion.unseen or motion.fitted)}
    errors = []
    for name, judge in judges.items():
        spans = [h.span(judge.recording) for h in judged.held_out if h.recording == name]
        errors += judge.score(model, spans)
    return pooled(errors) if errors else None
