"""The answer of an estimator that worked at the full sampling rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pivident.estimation.covariance.sandwich import sandwich
from pivident.estimation.covariance.stationary_noise import stationary_covariance
from pivident.estimation.equations import Equations
from pivident.estimation.full_rate import FullRateRecord, filtered, residual_of
from pivident.estimation.identification import FittedRecording, Identification, Iteration
from pivident.estimation.iteration import joint_fits, make_identification, sum_of_squares
from pivident.estimation.methods import (
    CovarianceKind,
    InstrumentalVariables,
    LeastSquares,
    PrefilteredIV,
)
from pivident.estimation.normal_equations import JointSums, Solution
from pivident.estimation.problem import Problem
from pivident.estimation.whitening import NoiseModel
from pivident.signals.prefilter import Prefilter
from pivident.text.finding import Finding


def full_rate_answer(
    problem: Problem,
    method: LeastSquares | InstrumentalVariables | PrefilteredIV,
    records: Sequence[FullRateRecord],
    filters: Sequence[Prefilter],
    sums: Sequence[JointSums],
    solution: Solution,
    variance: np.ndarray,
    history: Sequence[Iteration],
    converged: bool,
    noise_units: Sequence[str],
    weight_power: float = 1.0,
    models: Sequence[NoiseModel] = (),
    at_bound: Sequence[bool] = (),
    warnings: Sequence[Finding] = (),
    reported: CovarianceKind = "formula",
) -> Identification:
    """Residuals, scores and plots on all samples.

    Args:
        problem: what was given.
        method: how it was estimated.
        records: recordings with instruments and votes.
        filters: prefilter of each joint.
        sums: normal equations of the last iteration.
        solution: the solution.
        variance: λ of each joint, shape (joints,).
        history: iterations.
        converged: whether they converged.
        noise_units: unit of √λ of each joint.
        weight_power: power of λ in the weights.
        models: noise models, where there are any.
        at_bound: whether their orders are the largest allowed.
        warnings: what was noticed.
        reported: which covariance is the estimate's.
    """
    regressor, theta = problem.regressor, solution.theta
    errors = [
        (residual_of(regressor, r.kinematics, theta), r.kinematics.tau, r.votes) for r in records
    ]
    whitened = [filtered(error, filters) for error, _, _ in errors]
    for residual in whitened:
        residual /= np.sqrt(variance)[:, None]
    fits = joint_fits(
        problem,
        errors,
        sum(r.kinematics.stop - r.kinematics.start for r in records),
        np.sqrt(variance),
        noise_units,
        np.mean([r.kinematics.f50 for r in records], axis=0),
        np.mean([r.kinematics.encoder_std for r in records], axis=0),
        [m.order for m in models],
        at_bound,
    )
    # one figure for all joints: each weighted by its own unfiltered error
    spread = np.array([max(f.rms_error, 1e-300) ** 2 for f in fits])
    error, total = (
        sum(sum_of_squares(e[i], e[2]) @ (1.0 / spread) for e in errors) for i in (0, 1)
    )
    if _is_stationary(problem, reported, weight_power):
        robust = stationary_covariance(regressor, records, filters, sums, variance, whitened)
    else:
        robust = sandwich(sums, theta, variance, weight_power)
    fitted = []
    for r, (residual, _, _), white in zip(records, errors, whitened, strict=True):
        k = r.kinematics
        model = np.subtract(k.tau, residual, out=residual)
        white[~r.votes] = np.nan
        part = slice(k.start, k.stop)
        fitted.append(
            FittedRecording(
                k.recording.name,
                k.recording.t[part],
                k.q[:, part].T,
                k.dq[:, part].T,
                k.ddq[:, part].T,
                k.recording.q[part],
                k.tau[:, part].T,
                model[:, part].T,
                ~r.votes[:, part].T,
                white[:, part].T,
                k.recording.rate,
                None if k.recording.q_ref is None else k.recording.q_ref[part],
                k.recording.account,
                k.recording.torque_scale,
            )
        )
    answer = make_identification(
        problem,
        method,
        solution,
        robust,
        reported,
        history,
        converged,
        fits,
        float(np.sqrt(error / total)),
        fitted,
        warnings,
    )
    equations = Equations(
        regressor, tuple(records), tuple(filters), np.asarray(variance), weight_power
    )
    return replace(answer, equations=equations)


def _is_stationary(problem: Problem, reported: CovarianceKind, weight_power: float) -> bool:
    """Whether the residual is taken for stationary noise, which it is on simulated records."""
    if reported in ("stationary", "sandwich"):
        return reported == "stationary"
    return weight_power == 1.0 and all(r.simulated for r in problem.recordings)
