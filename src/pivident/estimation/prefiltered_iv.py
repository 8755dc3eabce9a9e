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

from pivident.estimation.auxiliary_model import AuxiliaryModel, SimulatedMotion
from pivident.estimation.full_rate import FullRateRecord, accumulate, torque_of, voting
from pivident.estimation.full_rate_answer import full_rate_answer
from pivident.estimation.identification import Identification
from pivident.estimation.iteration import iterate, loop_warnings, position_units, torque_units
from pivident.estimation.kinematics import Kinematics, estimate_kinematics
from pivident.estimation.methods import PrefilteredIV
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import Problem
from pivident.signals.noise_models import ArModel, continued_into_band, fit_ar
from pivident.signals.prefilter import Prefilter
from pivident.simulation.controllers import inverse_controller
from pivident.threads import run_in_threads

#: Iteration (counted from zero) whose AR orders are kept: flips of the criterion must not go on
#: changing the estimate. The models themselves are kept from the next one on: the residual hardly
#: changes any more, and a filter that follows it only delays convergence.
ORDER_FROZEN_AFTER = 1
MODEL_FROZEN_AFTER = 2


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
    auxiliary = AuxiliaryModel(problem, differences=True, kinematics=kinematics)
    limits = [problem.speed_limits(r) for r in problem.recordings]
    whitening = Whitening(problem, method, kinematics)
    made: dict[str, list[FullRateRecord]] = {}

    def stage(k: int, theta: np.ndarray, motions: list[SimulatedMotion]) -> list[JointSums]:
        votes = [
            voting(kin, motion.dq, lim)
            for kin, motion, lim in zip(kinematics, motions, limits, strict=True)
        ]
        whitening.update(k, theta, votes)
        for own in votes:
            whitening.discard_transients(own)
        made["records"] = [
            FullRateRecord(*parts) for parts in zip(kinematics, motions, votes, strict=True)
        ]
        return accumulate(problem.regressor, made["records"], whitening.filters)

    power = 2.0 if method.as_printed else 1.0
    sums, solution, variance, history, converged = iterate(
        problem,
        auxiliary,
        stage,
        method.tolerance,
        method.max_iterations,
        say,
        power,
        lambda: tuple(m.order for m in whitening.models),
        earliest=3,
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
        [*loop_warnings(problem), *whitening.warnings()],
    )


class Whitening:
    """Prefilters of all joints, renewed from the residual at each iteration."""

    def __init__(
        self, problem: Problem, method: PrefilteredIV, kinematics: Sequence[Kinematics]
    ) -> None:
        self.problem, self.method, self.kinematics = problem, method, kinematics
        n = problem.robot.size
        ones = np.ones((n, 1))
        self.numerator, self.denominator = ones, ones
        if method.prefilter == "controller":
            assert problem.loop is not None
            rate = kinematics[0].recording.rate
            self.numerator, self.denominator = inverse_controller(problem.loop.controller, rate, n)
            gain = np.broadcast_to(np.asarray(problem.loop.drive_gain, float), (n,))
            self.numerator = self.numerator / gain[:, None]
        self.models: list[ArModel] = []
        self.at_bound: tuple[bool, ...] = (False,) * n
        self.filters = [Prefilter(self.numerator[j], self.denominator[j]) for j in range(n)]

    def update(self, k: int, theta: np.ndarray, votes: Sequence[np.ndarray]) -> None:
        """Fit the noise models to the residual at θ; none before the first estimate.

        Args:
            k: iteration, counted from zero.
            theta: parameters, shape (parameters,).
            votes: samples that count, one (joints, samples) array for each recording.
        """
        if k == 0 or k > MODEL_FROZEN_AFTER:
            return
        residuals = [
            kin.tau - torque_of(self.problem.regressor, kin, theta) for kin in self.kinematics
        ]
        n = self.problem.robot.size
        models: list[ArModel | None] = [None] * n

        def fit(j: int) -> None:
            order = self.models[j].order if k > ORDER_FROZEN_AFTER else None
            models[j] = self._fit_joint(j, residuals, votes, order)

        run_in_threads(fit, range(n))
        self.models = [m for m in models if m is not None]
        if k == ORDER_FROZEN_AFTER:  # later fits are given their order and cannot tell
            self.at_bound = tuple(m.at_bound for m in self.models)
        self.filters = [
            Prefilter(self.numerator[j], self.denominator[j], self.models[j].coefficients)
            for j in range(n)
        ]

    def _fit_joint(
        self,
        j: int,
        residuals: Sequence[np.ndarray],
        votes: Sequence[np.ndarray],
        order: int | None,
    ) -> ArModel:
        """AR model of one joint's residual behind the inverse controller, all recordings."""
        from scipy.signal import lfilter

        pieces, left_out = [], []
        skip = Prefilter(self.numerator[j], self.denominator[j]).transient()
        for kin, residual, own in zip(self.kinematics, residuals, votes, strict=True):
            usable = slice(kin.start, kin.stop)
            pieces.append(lfilter(self.numerator[j], self.denominator[j], residual[j, usable]))
            out = (
                ~own[j, usable]
                if self.method.noise.on_unmasked
                else np.zeros(pieces[-1].size, bool)
            )
            out[:skip] = True
            left_out.append(out)
            pieces.append(np.zeros(1))  # recordings do not continue each other
            left_out.append(np.ones(1, bool))
        noise = self.method.noise
        model = fit_ar(
            np.concatenate(pieces),
            noise.p_max,
            noise.criterion,
            order=order,
            mask=np.concatenate(left_out),
        )
        recording = self.kinematics[0].recording
        return continued_into_band(model, recording.rate, noise.band(recording))

    def discard_transients(self, votes: np.ndarray) -> None:
        """Take the vote from samples at the start that the filters have not settled on."""
        for j, prefilter in enumerate(self.filters):
            votes[j, : prefilter.transient()] = False

    def units(self) -> list[str]:
        """Unit of the residual behind the inverse controller: the encoder's."""
        return position_units(self.problem)

    def warnings(self) -> list[str]:
        """Sentences about noise models that could not be told apart from a higher order."""
        names = self.problem.robot.joint_names
        return [
            f"Noise model of joint {names[j]!r}: the criterion is still falling at order "
            f"{m.order}; its deviations may be too small. Raise p_max or cap the smoother "
            "(f50_max)."
            for j, m in enumerate(self.models)
            if self.at_bound[j] and not self.method.as_printed
        ]
