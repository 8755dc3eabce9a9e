"""IDIM-PIV: instrumental variables with prefilters from the identified noise.

Brunot, Janot, Young and Carrillo (2018). The torque residual of joint j is filtered by the
inverse of the controller, which turns it back into encoder noise (P-26), and an AR model A_j of
what comes out whitens it, (P-29):

    L_j = λ_j^(-1/2) A_j(z⁻¹) C_j⁻¹(z⁻¹)

is applied to instruments, observation matrix and torque (D6). λ_j^-1 on both sides, as (P-22) and
(P-28) print it, is ``as_printed``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.full_rate import (
    FullRateRecord,
    accumulate,
    records_with_instruments,
    records_without_instruments,
)
from pivident.estimation.full_rate_answer import full_rate_answer
from pivident.estimation.identification import Identification
from pivident.estimation.inner_signals import with_inner
from pivident.estimation.iteration import (
    iterate,
    loop_warnings,
    torque_units,
    weighted_solution,
)
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.load_dependence import estimate_without_load
from pivident.estimation.methods import PrefilteredIV
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import Problem
from pivident.estimation.simulated_motion import SimulatedMotion
from pivident.estimation.whitening import Whitening

#: Estimates before the one that may be the last: noise models come from the residuals of both.
MIN_ESTIMATES = 2


def identify_piv(
    problem: Problem, method: PrefilteredIV, say: Callable[[str], None]
) -> Identification:
    """Iterate noise models, instruments and estimate.

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
    auxiliary = AuxiliaryModel(problem, differences=True, kinematics=kinematics, torque=False)
    limits = [problem.speed_limits(r) for r in problem.recordings]
    whitening = Whitening(problem, method, kinematics)
    power = 2.0 if method.as_printed else 1.0
    regressor, first = problem.regressor, estimate_without_load(problem, kinematics, limits)
    known = [with_inner(regressor, k, first) for k in kinematics]
    made = {"records": records_without_instruments(known, limits)}
    start = None
    if method.start == "least-squares":
        start = _least_squares(problem, made["records"], whitening, power)
    estimates = 0 if start is None else 1
    earliest = MIN_ESTIMATES + 1 - estimates

    def prepare(k: int, theta: np.ndarray) -> None:
        whitening.fit(k + estimates, theta, made["records"])

    def stage(k: int, theta: np.ndarray, motions: list[SimulatedMotion]) -> list[JointSums]:
        carried = theta if k or start is not None or first is None else first
        made["records"] = records_with_instruments(
            [with_inner(regressor, kin, carried) for kin in kinematics],
            [with_inner(regressor, motion, carried) for motion in motions],
            limits,
        )
        whitening.take_votes(made["records"])
        may_be_last = k + 1 >= min(earliest, method.max_iterations)
        return accumulate(
            problem.regressor, made["records"], whitening.filters, by_window=may_be_last
        )

    sums, solution, variance, history, converged = iterate(
        problem,
        auxiliary,
        stage,
        method.tolerance,
        method.max_iterations,
        say,
        power,
        lambda: tuple(m.order for m in whitening.models),
        earliest=earliest,
        covariance=method.covariance,
        start=start,
        prepare=prepare,
    )
    direct = method.prefilter == "direct"
    return full_rate_answer(
        problem,
        method,
        made["records"],
        whitening.filters,
        sums,
        solution,
        variance,
        history,
        converged,
        torque_units(problem) if direct else whitening.units(),
        power,
        whitening.models,
        whitening.at_bound,
        [*loop_warnings(problem, sums, variance), *whitening.warnings()],
        method.covariance,
    )


def _least_squares(
    problem: Problem, records: Sequence[FullRateRecord], whitening: Whitening, power: float
) -> np.ndarray:
    """IDIM-LS behind the inverse controllers: nearer to the answer than nominal values are."""
    sums = accumulate(problem.regressor, records, whitening.filters, by_window=False)
    start = problem.initial_values()
    return weighted_solution(sums, problem.names, start, power)[0].theta
