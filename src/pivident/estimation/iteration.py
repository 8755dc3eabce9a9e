"""What LS, IV and PIV share: weights, the fixed-point iteration, and the making of the answer."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from pivident.errors import MassMatrixNotPositiveDefinite, SimulationDiverged
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.covariance.sandwich import sandwich
from pivident.estimation.exogeneity import durbin_wu_hausman
from pivident.estimation.identification import (
    FittedRecording,
    Identification,
    Iteration,
    JointFit,
)
from pivident.estimation.methods import CovarianceKind
from pivident.estimation.normal_equations import JointSums, Solution, solve
from pivident.estimation.problem import Loop, Problem
from pivident.estimation.signs import sign_warnings
from pivident.estimation.simulated_motion import SimulatedMotion
from pivident.logs.torque_scale import scale_sentences

#: Condition number from which on a motion hardly separates some parameters.
LARGE_CONDITION = 200.0

#: Methods whose instruments come from the simulated loop.
_WITH_LOOP = ("IDIM-IV", "IDIM-PIV", "DIDIM")

#: A parameter smaller than so many deviations is near zero: its change is compared with them.
NEAR_ZERO = 5.0

Stage = Callable[[int, np.ndarray, list[SimulatedMotion]], list[JointSums]]

#: Work on iteration number and parameters that needs no instruments.
Preparation = Callable[[int, np.ndarray], None]


def joint_variances(sums: Sequence[JointSums], theta: np.ndarray) -> np.ndarray:
    """λ_j: residual variance of each joint at θ, with its degrees of freedom, shape (joints,)."""
    return np.array(
        [
            max(s.residual_sum(theta), 1e-30 * max(s.tt, 1e-300)) / max(s.rows - s.columns.size, 1)
            for s in sums
        ]
    )


def weighted_solution(
    sums: Sequence[JointSums], names: Sequence[str], start: np.ndarray, weight_power: float
) -> tuple[Solution, np.ndarray]:
    """Solve with weights from the residual, twice, so that weights and estimate agree.

    Args:
        sums: normal equations.
        names: parameter names.
        start: parameters of the first weights.
        weight_power: see ``solve``.

    Returns:
        The solution and the variances λ that belong to it.
    """
    theta = start
    for _ in range(3):
        variance = joint_variances(sums, theta)
        solution = solve(sums, variance, names, weight_power)
        theta = solution.theta
    return solution, joint_variances(sums, theta)


def iterate(
    problem: Problem,
    auxiliary: AuxiliaryModel,
    stage: Stage,
    tolerance: float,
    max_iterations: int,
    say: Callable[[str], None],
    weight_power: float = 1.0,
    orders: Callable[[], tuple[int, ...]] = tuple,
    earliest: int = 2,
    covariance: CovarianceKind = "formula",
    start: np.ndarray | None = None,
    prepare: Preparation | None = None,
) -> tuple[list[JointSums], Solution, np.ndarray, list[Iteration], bool]:
    """Simulate, build the equations, solve; until parameters and residual stand still.

    Both must change by less than ``tolerance``: the parameters relative to the larger of their
    size and five standard deviations (with a tolerance of 1 %, a twentieth of a deviation for a
    parameter near zero), and at the same time by less than a fifth of a standard deviation; the
    residual relative to itself.

    Args:
        problem: what is given.
        auxiliary: makes the instruments.
        stage: builds the normal equations from iteration number, parameters and instruments.
        tolerance: of both criteria.
        max_iterations: stop after so many.
        say: progress.
        weight_power: see ``solve``.
        orders: orders of the noise models after a stage.
        earliest: first iteration that may be the last.
        covariance: which deviations the change is compared with.
        start: parameters of the first simulation, approached from the problem's initial values
            where they cannot be simulated; None: those initial values.
        prepare: called for each iteration beside its simulation, before ``stage``.

    Returns:
        Last normal equations, their solution and variances, the history, whether it converged.
    """
    theta = problem.initial_values()
    previous: np.ndarray | None = None
    if start is not None:
        previous, theta = theta, start
    residual = np.inf
    history: list[Iteration] = []
    doubt = ""
    for k in range(max_iterations):
        try:
            motions, theta, halvings = _simulate(auxiliary, previous, theta, k, prepare)
        except (SimulationDiverged, MassMatrixNotPositiveDefinite) as error:
            if doubt:
                error.add_note(doubt)
            raise
        sums = stage(k, theta, motions)
        solution, variance = weighted_solution(sums, problem.names, theta, weight_power)
        doubt = _poor_motion(solution)
        std = np.sqrt(np.diag(solution.covariance))
        if covariance != "formula" and k + 1 >= earliest:
            robust = sandwich(sums, solution.theta, variance, weight_power)
            std = np.sqrt(np.diag(robust))
        step = np.abs(solution.theta - theta)
        change = float((step / np.maximum(np.abs(solution.theta), NEAR_ZERO * std)).max())
        settled = float((step / std).max())
        last, residual = residual, relative_residual(sums, solution.theta, variance)
        history.append(Iteration(solution.theta, change, residual, halvings, orders()))
        say(
            f"iteration {k + 1}: parameters change by {100 * change:.3g} %, "
            f"residual {100 * residual:.3g} %"
        )
        previous, theta = theta, solution.theta
        still = change < tolerance and settled < 0.2
        if k + 1 >= earliest and still and abs(residual - last) < tolerance * residual:
            return sums, solution, variance, history, True
    return sums, solution, variance, history, False


def _simulate(
    auxiliary: AuxiliaryModel,
    previous: np.ndarray | None,
    theta: np.ndarray,
    k: int,
    prepare: Preparation | None,
) -> tuple[list[SimulatedMotion], np.ndarray, int]:
    """Simulate, and prepare the iteration beside it: one record keeps one core busy only."""
    if prepare is None:
        return auxiliary.simulate_or_halve(previous, theta)
    with ThreadPoolExecutor(1) as beside:
        prepared = beside.submit(prepare, k, theta)
        motions, used, halvings = auxiliary.simulate_or_halve(previous, theta)
        prepared.result()
    if halvings:
        prepare(k, used)
    return motions, used, halvings


def relative_residual(sums: Sequence[JointSums], theta: np.ndarray, variance: np.ndarray) -> float:
    """‖τ - Φθ‖/‖τ‖ over all joints, each weighted by 1/λ_j."""
    error = sum(s.residual_sum(theta) / v for s, v in zip(sums, variance, strict=True))
    total = sum(s.tt / v for s, v in zip(sums, variance, strict=True))
    return float(np.sqrt(error / total)) if total > 0 else 0.0


def option_values(method: Any) -> dict[str, Any]:
    """A method's options as plain values."""
    return dataclasses.asdict(method)


def loop_warnings(problem: Problem, sums: Sequence[JointSums], variance: np.ndarray) -> list[str]:
    """What has to be said about instruments from this loop.

    Args:
        problem: what is given.
        sums: normal equations of the last iteration.
        variance: λ of each joint, shape (joints,).
    """
    if problem.loop is None:
        return []
    known = [*problem.loop.notes]
    if problem.loop.reconstructed or problem.loop.reference == "smoothed":
        known.append(str(durbin_wu_hausman(sums, variance, len(problem.names))))
    if problem.loop.identified is not None:
        known += problem.loop.identified.warnings
    if problem.loop.reference == "smoothed":
        return [
            *known,
            "The reference was not recorded: the smoothed measurement stands for it, with the "
            "declared control law as a virtual one. Instruments then share the noise that the "
            "smoother let through.",
        ]
    return known


def simulated_loop(problem: Problem, method: Any) -> Loop | None:
    """The loop that a method simulates, None where it does without."""
    return problem.loop if method.label.startswith(_WITH_LOOP) else None


def method_label(problem: Problem, method: Any) -> str:
    """Name of a method, with Ĉ where its instruments come from an identified law."""
    loop = simulated_loop(problem, method)
    identified = loop is not None and (loop.identified is not None or loop.feedback)
    return f"{method.label} (Ĉ)" if identified else method.label


def _poor_motion(solution: Solution) -> str:
    """What to do about parameters that the motion does not tell apart; empty if it does."""
    if solution.condition <= LARGE_CONDITION:
        return ""
    return (
        f"The motion hardly separates {', '.join(solution.weakest)} (condition number "
        f"{solution.condition:.0f}): add a second, different motion, or estimate fewer parameters."
    )


def make_identification(
    problem: Problem,
    method: Any,
    solution: Solution,
    robust_covariance: np.ndarray,
    reported: CovarianceKind,
    history: Sequence[Iteration],
    converged: bool,
    joints: Sequence[JointFit],
    relative_error: float,
    recordings: Sequence[FittedRecording],
    warnings: Sequence[str],
) -> Identification:
    """Put the answer together; see :class:`Identification` for the fields."""
    from pivident.version import __version__

    covariance = solution.covariance if reported == "formula" else robust_covariance
    std = np.sqrt(np.diag(covariance))
    parameters = problem.regressor.parameters
    signs = sign_warnings(problem.robot, parameters, problem.names, solution.theta, std)
    scales = [s for r in problem.recordings for s in r.torque_scale]
    noticed = [*warnings, *signs, *scale_sentences(scales)]
    if doubt := _poor_motion(solution):
        noticed.append(doubt)
    if not converged:
        noticed.insert(
            0,
            f"Not converged after {len(history)} iterations; the last change was "
            f"{100 * history[-1].change:.2g} %. Look at the convergence plot before using it.",
        )
    sources = {s.name: s.sha256 for r in problem.recordings for s in r.sources}
    return Identification(
        method=method_label(problem, method),
        robot=problem.robot,
        parameters=parameters,
        names=problem.names,
        expressions=problem.expressions,
        theta=solution.theta,
        covariance=covariance,
        robust_covariance=robust_covariance,
        formula_covariance=solution.covariance,
        converged=converged,
        history=tuple(history),
        joints=tuple(joints),
        relative_error=relative_error,
        condition=solution.condition,
        recordings=tuple(recordings),
        options=option_values(method) | {"mask": problem.mask},
        warnings=tuple(noticed),
        sources=sources,
        version=__version__,
        loop=simulated_loop(problem, method),
    )


def joint_fits(
    problem: Problem,
    errors: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]],
    usable: int,
    noise_std: np.ndarray,
    noise_units: Sequence[str],
    f50: np.ndarray,
    encoder_std: np.ndarray,
    orders: Sequence[int] = (),
    at_bound: Sequence[bool] = (),
) -> list[JointFit]:
    """How each joint was fitted.

    Args:
        problem: what is given.
        errors: for each recording τ - Φθ, τ and votes, each (joints, rows).
        usable: rows that a joint would have without a mask.
        noise_std: √λ of each joint.
        noise_units: its unit.
        f50: of the smoother [Hz], shape (joints,).
        encoder_std: found by the smoother [rad or m], shape (joints,).
        orders: of the noise models.
        at_bound: whether the order is the largest allowed.
    """
    fits = []
    squares_of_joints = np.sum([sum_of_squares(e, v) for e, _, v in errors], axis=0)
    torque_of_joints = np.sum([sum_of_squares(t, v) for _, t, v in errors], axis=0)
    for j, joint in enumerate(problem.robot.joints):
        squares, torque = squares_of_joints[j], torque_of_joints[j]
        rows = sum(int(v[j].sum()) for _, _, v in errors)
        fits.append(
            JointFit(
                name=joint.name,
                torque_unit="N m" if joint.kind == "revolute" else "N",
                relative_error=float(np.sqrt(squares / max(torque, 1e-300))),
                rms_error=float(np.sqrt(squares / max(rows, 1))),
                noise_std=float(noise_std[j]),
                noise_unit=noise_units[j],
                ar_order=int(orders[j]) if len(orders) else 0,
                ar_at_bound=bool(at_bound[j]) if len(at_bound) else False,
                rows=rows,
                masked=1.0 - rows / max(usable, 1),
                f50=float(f50[j]),
                encoder_std=float(encoder_std[j]),
            )
        )
    return fits


def sum_of_squares(signal: np.ndarray, votes: np.ndarray) -> np.ndarray:
    """Sum of the squares of the samples that vote, shape (joints,).

    Args:
        signal: shape (joints, samples).
        votes: likewise.
    """
    return np.array([np.sum(own[voted] ** 2) for own, voted in zip(signal, votes, strict=True)])


def torque_units(problem: Problem) -> list[str]:
    """N m or N, for each joint."""
    return ["N m" if j.kind == "revolute" else "N" for j in problem.robot.joints]


def position_units(problem: Problem) -> list[str]:
    """Unit of each joint's position, rad or m."""
    return ["rad" if j.kind == "revolute" else "m" for j in problem.robot.joints]
