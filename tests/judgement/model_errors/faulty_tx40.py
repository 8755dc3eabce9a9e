"""Records of a simulated TX40 with one thing wrong, and what is known of it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.experiment.simulated_tx40 import tx40_scenario
from pivident.judgement.model_errors.cause import Cause
from pivident.judgement.model_errors.cause_rows import smoothed
from pivident.judgement.model_errors.named_causes import all_causes, reach_of


@cache
def right_problem(seed: int = 2) -> tuple[Problem, np.ndarray]:
    """A problem in which nothing is wrong, and its true parameters."""
    problem, truth = tx40_scenario("fine", seed)
    return problem, np.array([truth[p.name] for p in problem.regressor.parameters])


@cache
def right_estimate() -> Identification:
    """IDIM-PIV of it."""
    return identify(right_problem()[0], "piv")


@cache
def causes() -> dict[str, Cause]:
    """All causes by their words."""
    problem, _ = right_problem()
    reach = reach_of(smoothed(problem, right_estimate()))
    return {str(c): c for c in all_causes(problem, right_estimate(), reach)}


def with_fault(cause: Cause, size: np.ndarray) -> Problem:
    """The problem from which a cause of that size has to be corrected."""
    assert cause.correct is not None
    return cause.correct(right_problem()[0], -np.asarray(size))


def with_uneven_friction(joint: int, size: float) -> Problem:
    """The right problem with dry friction that grows along the travel, by a size [N m] each way."""
    problem, _ = right_problem()
    (kinematics,) = smoothed(problem, right_estimate())
    (recording,) = problem.recordings
    q, dq = kinematics.q[joint], kinematics.dq[joint]
    tau = recording.tau.copy()
    tau[:, joint] += size * np.sign(dq) * (2.0 * (q - q.min()) / np.ptp(q) - 1.0)
    return replace(problem, recordings=(replace(recording, tau=tau),))
