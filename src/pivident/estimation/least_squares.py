"""IDIM-LS: ordinary and weighted least squares on the inverse dynamic model."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pivident.estimation.decimated import decimate_record, decimated_sums
from pivident.estimation.decimated_answer import decimated_answer
from pivident.estimation.full_rate import accumulate, records_without_instruments
from pivident.estimation.full_rate_answer import full_rate_answer
from pivident.estimation.identification import Identification, Iteration
from pivident.estimation.iteration import relative_residual, torque_units
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.methods import Bandpass, LeastSquares
from pivident.estimation.normal_equations import JointSums, Solution, solve
from pivident.estimation.problem import Problem
from pivident.signals.prefilter import Prefilter


def identify_ls(
    problem: Problem, method: LeastSquares, say: Callable[[str], None]
) -> Identification:
    """θ = (Σ ΦᵀΦ/λ_j)⁻¹ Σ Φᵀτ/λ_j, λ_j from each joint's own least squares (Gautier 1997).

    Biased where the positions were measured inside a feedback loop.

    Args:
        problem: robot, recordings, parameters.
        method: options.
        say: progress.
    """
    say(f"{method.label}: filtering the records")
    kinematics = [estimate_kinematics(r, method.signals) for r in problem.recordings]
    limits = [problem.speed_limits(r) for r in problem.recordings]
    regressor = problem.regressor
    if isinstance(method.signals, Bandpass):
        records = [
            decimate_record(regressor, k, method.signals, lim)
            for k, lim in zip(kinematics, limits, strict=True)
        ]
        sums = decimated_sums(regressor, records)
        solution, variance, history = _solve(problem, method, sums)
        return decimated_answer(problem, method, records, sums, solution, variance, history, True)
    full = records_without_instruments(kinematics, limits)
    filters = [Prefilter()] * problem.robot.size
    sums = accumulate(regressor, full, filters)
    solution, variance, history = _solve(problem, method, sums)
    return full_rate_answer(
        problem,
        method,
        full,
        filters,
        sums,
        solution,
        variance,
        history,
        True,
        torque_units(problem),
    )


def _solve(
    problem: Problem, method: LeastSquares, sums: list[JointSums]
) -> tuple[Solution, np.ndarray, list[Iteration]]:
    """One solution; its variances are those of the weights, or the common one without weights."""
    own = np.array([s.own_variance() for s in sums])
    if method.weighted:
        variance = own
        solution = solve(sums, variance, problem.names)
    else:
        ones = np.ones(len(sums))
        theta = solve(sums, ones, problem.names).theta
        rows = sum(s.rows for s in sums)
        common = sum(s.residual_sum(theta) for s in sums) / max(rows - theta.size, 1)
        variance = np.full(len(sums), max(common, 1e-300))
        solution = solve(sums, variance, problem.names)
    residual = relative_residual(sums, solution.theta, variance)
    return solution, variance, [Iteration(solution.theta, 0.0, residual)]
