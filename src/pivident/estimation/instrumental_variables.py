"""IDIM-IV: instruments from the simulated closed loop remove the bias of least squares.

Janot, Vandanjon and Gautier (2014): with q_s simulated from the current parameters,

    θ = (Σ Φ(q_s)ᵀ Φ(q̂)/λ_j)⁻¹ Σ Φ(q_s)ᵀ τ/λ_j

repeated until it stands still.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.decimated import decimate_record, decimated_sums
from pivident.estimation.decimated_answer import decimated_answer
from pivident.estimation.full_rate import accumulate, records_with_instruments, torque_of
from pivident.estimation.full_rate_answer import full_rate_answer
from pivident.estimation.identification import Identification
from pivident.estimation.inner_signals import with_inner
from pivident.estimation.iteration import iterate, loop_warnings, torque_units
from pivident.estimation.kinematics import Kinematics, estimate_kinematics
from pivident.estimation.load_dependence import estimate_without_load
from pivident.estimation.methods import Bandpass, InstrumentalVariables
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import Problem
from pivident.estimation.simulated_motion import SimulatedMotion
from pivident.estimation.standstill import (
    decided_by_residual,
    noisy_standstill,
    slow_samples,
)
from pivident.signals.prefilter import Prefilter


def identify_iv(
    problem: Problem, method: InstrumentalVariables, say: Callable[[str], None]
) -> Identification:
    """Iterate instruments and estimate.

    Args:
        problem: robot, recordings, loop, parameters.
        method: options.
        say: progress.

    Raises:
        SimulationDiverged: the controller does not stabilise the simulated robot.
        MassMatrixNotPositiveDefinite: the parameters make no physical mass matrix.
        RankDeficientRegressor: the motion does not separate the parameters.
    """
    say(f"{method.label}: smoothing the records")
    kinematics = [estimate_kinematics(r, method.signals) for r in problem.recordings]
    limits = [problem.speed_limits(r) for r in problem.recordings]
    if isinstance(method.signals, Bandpass):
        return _decimated(problem, method, kinematics, limits, say)
    return _full_rate(problem, method, kinematics, limits, say)


def _decimated(
    problem: Problem,
    method: InstrumentalVariables,
    kinematics: list[Kinematics],
    limits: list[np.ndarray],
    say: Callable[[str], None],
) -> Identification:
    """The literature's form: everything through the parallel decimation."""
    signals = method.signals
    assert isinstance(signals, Bandpass)
    auxiliary = AuxiliaryModel(problem, differences=False, torque=False)
    made: dict[str, list] = {"records": [None] * len(kinematics)}
    regressor, first = problem.regressor, estimate_without_load(problem, kinematics, limits)

    def stage(k: int, theta: np.ndarray, motions: list[SimulatedMotion]) -> list[JointSums]:
        if regressor.depends_on_load:  # Φ changes with θ
            made["records"] = [None] * len(kinematics)
        carried = theta if k or first is None else first
        made["records"] = [
            decimate_record(
                regressor,
                with_inner(regressor, kin, carried),
                signals,
                lim,
                with_inner(regressor, motion, carried),
                earlier,
            )
            for kin, lim, motion, earlier in zip(
                kinematics, limits, motions, made["records"], strict=True
            )
        ]
        return decimated_sums(problem.regressor, made["records"])

    sums, solution, variance, history, converged = iterate(
        problem, auxiliary, stage, method.tolerance, method.max_iterations, say
    )
    return decimated_answer(
        problem, method, made["records"], sums, solution, variance, history, converged,
        loop_warnings(problem, sums, variance),
    )  # fmt: skip


def _full_rate(
    problem: Problem,
    method: InstrumentalVariables,
    kinematics: list[Kinematics],
    limits: list[np.ndarray],
    say: Callable[[str], None],
) -> Identification:
    """No decimation and no prefilter: smoother and aligned torque do the work."""
    auxiliary = AuxiliaryModel(problem, differences=True, kinematics=kinematics, torque=False)
    filters = [Prefilter()] * problem.robot.size
    made: dict[str, list] = {}
    without_standstill = np.zeros(problem.robot.size, bool)
    regressor, first = problem.regressor, estimate_without_load(problem, kinematics, limits)

    def stage(k: int, theta: np.ndarray, motions: list[SimulatedMotion]) -> list[JointSums]:
        carried = theta if k or first is None else first
        moved = [with_inner(regressor, kin, carried) for kin in kinematics]
        instruments = [with_inner(regressor, motion, carried) for motion in motions]
        records = records_with_instruments(moved, instruments, limits)
        if k == 1 and decided_by_residual(problem):
            residuals = [kin.tau - torque_of(regressor, kin, theta) for kin in moved]
            without_standstill[:] = noisy_standstill(problem, filters, records, residuals)
        for record in records:
            record.votes[slow_samples(problem, record) & without_standstill[:, None]] = False
        made["records"] = records
        return accumulate(regressor, records, filters)

    sums, solution, variance, history, converged = iterate(
        problem, auxiliary, stage, method.tolerance, method.max_iterations, say, earliest=3
    )
    return full_rate_answer(
        problem, method, made["records"], filters, sums, solution, variance, history, converged,
        torque_units(problem), warnings=loop_warnings(problem, sums, variance),
    )  # fmt: skip
