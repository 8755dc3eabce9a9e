"""The answer of an estimator that worked on decimated equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pivident.estimation.covariance.sandwich import sandwich
from pivident.estimation.decimated import DecimatedRecord, decimated_torque
from pivident.estimation.equations import Equations
from pivident.estimation.identification import FittedRecording, Identification, Iteration
from pivident.estimation.iteration import (
    joint_fits,
    make_identification,
    relative_residual,
    torque_units,
)
from pivident.estimation.methods import InstrumentalVariables, LeastSquares
from pivident.estimation.normal_equations import JointSums, Solution
from pivident.estimation.problem import Problem
from pivident.text.finding import Finding


def decimated_answer(
    problem: Problem,
    method: LeastSquares | InstrumentalVariables,
    records: Sequence[DecimatedRecord],
    sums: Sequence[JointSums],
    solution: Solution,
    variance: np.ndarray,
    history: Sequence[Iteration],
    converged: bool,
    warnings: Sequence[Finding] = (),
) -> Identification:
    """Residuals, scores and plots on the decimated rows.

    Args:
        problem: what was given.
        method: how it was estimated.
        records: decimated equations.
        sums: their normal equations.
        solution: their solution.
        variance: λ of each joint, shape (joints,).
        history: iterations.
        converged: whether they converged.
        warnings: what was noticed.
    """
    theta = solution.theta
    torques = [decimated_torque(problem.regressor, r, theta) for r in records]
    errors = [(r.tau - m, r.tau, r.votes) for r, m in zip(records, torques, strict=True)]
    unknown = np.full(problem.robot.size, np.nan)
    scale = np.sqrt(np.where(np.asarray(variance) > 0, variance, 1.0))
    fitted = []
    for r, model, (error, _, votes) in zip(records, torques, errors, strict=True):
        recording, k = r.kinematics.recording, r.kinematics
        index = np.round((r.t - recording.start_time) * recording.rate).astype(int)
        rate = 1.0 / np.median(np.diff(r.t)) if r.t.size > 1 else recording.rate
        fitted.append(
            FittedRecording(
                recording.name,
                r.t,
                k.q[:, index].T,
                k.dq[:, index].T,
                k.ddq[:, index].T,
                recording.q[index],
                r.tau.T,
                model.T,
                ~votes.T,
                np.where(votes, error / scale[:, None], np.nan).T,
                float(rate),
                None if recording.q_ref is None else recording.q_ref[index],
                recording.account,
                recording.torque_scale,
            )
        )
    answer = make_identification(
        problem,
        method,
        solution,
        sandwich(sums, theta, variance),
        "formula",
        history,
        converged,
        joint_fits(
            problem,
            errors,
            sum(r.t.size for r in records),
            np.sqrt(variance),
            torque_units(problem),
            unknown,
            unknown,
        ),
        relative_residual(sums, theta, variance),
        fitted,
        warnings,
    )
    return replace(
        answer, equations=Equations(problem.regressor, tuple(records), (), np.asarray(variance))
    )
