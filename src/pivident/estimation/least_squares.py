"""IDIM-LS: ordinary and weighted least squares on the inverse dynamic model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from pivident.estimation.decimated import DecimatedRecord, decimate_record, decimated_sums
from pivident.estimation.decimated_answer import decimated_answer
from pivident.estimation.full_rate import (
    FullRateRecord,
    accumulate,
    records_without_instruments,
)
from pivident.estimation.full_rate_answer import full_rate_answer
from pivident.estimation.identification import Identification, Iteration
from pivident.estimation.inner_signals import with_inner
from pivident.estimation.iteration import relative_residual, torque_units
from pivident.estimation.kinematics import Kinematics, estimate_kinematics
from pivident.estimation.load_dependence import (
    MAX_PASSES,
    estimate_without_load,
    has_settled,
)
from pivident.estimation.methods import Bandpass, LeastSquares
from pivident.estimation.normal_equations import JointSums, Solution, solve
from pivident.estimation.problem import Problem
from pivident.signals.prefilter import Prefilter


def identify_ls(
    problem: Problem, method: LeastSquares, say: Callable[[str], None]
) -> Identification:
    """θ = (Σ ΦᵀΦ/λ_j)⁻¹ Σ Φᵀτ/λ_j, λ_j from each joint's own least squares (Gautier 1997).

    Biased where the positions were measured inside a feedback loop. Friction that grows with the
    load is estimated again with the load of the last estimate until that stands still.

    Args:
        problem: robot, recordings, parameters.
        method: options.
        say: progress.
    """
    say(f"{method.label}: filtering the records")
    kinematics = [estimate_kinematics(r, method.signals) for r in problem.recordings]
    return least_squares_on(problem, method, kinematics, say)


def least_squares_on(
    problem: Problem,
    method: LeastSquares,
    kinematics: Sequence[Kinematics],
    say: Callable[[str], None],
) -> Identification:
    """The same on given motions and torques.

    Args:
        problem: robot, recordings, parameters.
        method: options.
        kinematics: one for each recording.
        say: progress.
    """
    limits = [problem.speed_limits(r) for r in problem.recordings]
    theta = estimate_without_load(problem, kinematics, limits)
    history: list[Iteration] = []
    for _ in range(MAX_PASSES):
        known = [with_inner(problem.regressor, k, theta) for k in kinematics]
        made = _made(problem, method, known, limits)
        solution, variance = _solve(problem, method, made.sums)
        residual = relative_residual(made.sums, solution.theta, variance)
        change = 0.0 if theta is None else _change(solution.theta, theta)
        history.append(Iteration(solution.theta, change, residual))
        std = np.sqrt(np.diag(solution.covariance))
        settled = theta is None or has_settled(solution.theta, theta, std)
        if settled:
            break
        theta = solution.theta
        say(f"load from estimate {len(history)}: parameters change by {100 * change:.3g} %")
    if made.decimated:
        return decimated_answer(
            problem, method, made.decimated, made.sums, solution, variance, history, settled
        )
    return full_rate_answer(
        problem,
        method,
        made.full,
        [Prefilter()] * problem.robot.size,
        made.sums,
        solution,
        variance,
        history,
        settled,
        torque_units(problem),
    )


class _Equations(NamedTuple):
    """Normal equations and the records that they are made of, decimated or at full rate."""

    sums: list[JointSums]
    decimated: list[DecimatedRecord]
    full: list[FullRateRecord]


def _made(
    problem: Problem,
    method: LeastSquares,
    kinematics: list[Kinematics],
    limits: list[np.ndarray],
) -> _Equations:
    regressor = problem.regressor
    if isinstance(method.signals, Bandpass):
        records = [
            decimate_record(regressor, k, method.signals, lim)
            for k, lim in zip(kinematics, limits, strict=True)
        ]
        return _Equations(decimated_sums(regressor, records), records, [])
    full = records_without_instruments(kinematics, limits)
    filters = [Prefilter()] * problem.robot.size
    return _Equations(accumulate(regressor, full, filters), [], full)


def _change(theta: np.ndarray, last: np.ndarray) -> float:
    """Largest change relative to the larger of both values."""
    size = np.maximum(np.maximum(np.abs(theta), np.abs(last)), 1e-300)
    return float((np.abs(theta - last) / size).max())


def _solve(
    problem: Problem, method: LeastSquares, sums: list[JointSums]
) -> tuple[Solution, np.ndarray]:
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
    return solution, variance
