"""IDIM-PIV: instrumental variables with prefilters from the identified noise.

Brunot, Janot, Young and Carrillo (2018), section 4.3. The torque residual of joint j is filtered by
the inverse of the controller, which turns it back into encoder noise (P-26), and an AR model A_j of
what comes out whitens it, (P-29):

    L_j = λ_j^(-1/2) A_j(z⁻¹) C_j⁻¹(z⁻¹)

is applied to instruments, observation matrix and torque (D6). λ_j^-1 on both sides, as (P-22) and
(P-28) print it, is ``as_printed``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from pivident.errors import (
    IdentificationError,
    MassMatrixNotPositiveDefinite,
    SimulationDiverged,
)
from pivident.estimation.answer import answer, loop_warnings
from pivident.estimation.full_rate import (
    FullRateRecord,
    records_with_instruments,
    records_without_instruments,
)
from pivident.estimation.identification import Identification
from pivident.estimation.instrument_choice import (
    Chosen,
    InstrumentSource,
    choose,
    instead_of_loop,
    may_do_without,
    without_loop,
)
from pivident.estimation.iteration import (
    Estimate,
    Pass,
    Run,
    Say,
    Signals,
    Simulated,
    Steps,
    initial_pass,
    least_squares_pass,
    simulate,
    solve,
    start_number,
)
from pivident.estimation.methods import InstrumentalVariables, OutputError, PrefilteredIV
from pivident.estimation.noise_identification import Prefilters, Whitening
from pivident.estimation.problem import Problem
from pivident.instruments.given_motion import InstrumentsUsed

#: Estimates before the one that may be the last: noise models come from the residuals of both.
MIN_ESTIMATES = 2


def piv(steps: Steps, say: Say) -> tuple[Estimate, Run]:
    """The iteration of section 4.3, until parameters and residual stand still.

    1. Initialisation: θ⁰ from nominal values or least squares, noise filters H_j = 1.
    2. Iteration: (a) simulate the auxiliary model with θ of the last estimate, which makes the
       instruments; (b) solve (P-28) behind the prefilters; (c) noise models from its residual,
       (P-29) and (P-30).

    A simulation keeps one core busy: (c) goes on beside (a) of the next iteration.
    """
    last, run = steps.start(), Run()
    with ThreadPoolExecutor(1) as beside:
        noise = beside.submit(steps.noise_models, last, last.theta)
        for _ in range(steps.method.max_iterations):
            simulated = simulate(steps, last, run)  # (a)
            prefilters = noise.result()
            if simulated.halvings:  # θ could not be simulated: the residual is that of another one
                prefilters = steps.noise_models(last, simulated.theta)
            last = estimate = solve(steps, last, simulated, prefilters)  # (b)
            run = run.after(steps, estimate, simulated.halvings)
            say(str(run))
            if run.converged:
                break
            noise = beside.submit(steps.noise_models, estimate, estimate.theta)  # (c)
    return estimate, run


def identify_piv(problem: Problem, method: PrefilteredIV, say: Say) -> Identification:
    """Iterate instruments, estimate and noise models.

    A law that was found from the record may describe poorly where the noise comes from, and its
    inverse remembers standstill for long. Then the iteration is done with its inverse and without,
    and the more precise estimate is taken.
    """
    say(f"{method.label}: smoothing the records")
    signals = Signals.of(problem, method)
    loop = problem.loop
    if method.prefilter != "auto" or loop is None or loop.identified is None:
        return _identified(signals, method, say)
    direct = _identified(signals, replace(method, prefilter="direct"), say)
    if direct.loop is None:  # other instruments: no law is inverted
        return direct
    say("once more with the inverse of the law")
    try:
        inverse = _identified(signals, replace(method, prefilter="controller"), say)
    except IdentificationError:  # the inverse forgets too slowly
        return direct
    if inverse.loop is None:
        return direct
    return min(direct, inverse, key=lambda found: (not found.converged, _log_deviation(found)))


def _identified(signals: Signals, method: PrefilteredIV, say: Say) -> Identification:
    """The iteration with the prefilter that the method names."""

    def steps(chosen: Chosen) -> PrefilteredSteps:
        whitening = Whitening.of(
            signals.problem, method, chosen.kinematics, simulated=chosen.used.kind == "loop"
        )
        own = signals.with_kinematics(chosen.kinematics)
        return PrefilteredSteps(own, method, chosen.source, whitening)

    made, estimate, run, used = with_instruments(signals, method, steps, say)
    warnings = loop_warnings(signals.problem, estimate, used)
    warnings += made.whitening.warnings(estimate.prefilters)
    return answer(signals.problem, method, estimate, run, warnings, used)


def _log_deviation(found: Identification) -> float:
    """Mean of ln σ over the parameters."""
    return float(np.mean(np.log(found.std)))


AnySteps = TypeVar("AnySteps", bound=Steps)


def with_instruments(
    signals: Signals,
    method: InstrumentalVariables | PrefilteredIV,
    steps: Callable[[Chosen], AnySteps],
    say: Say,
    differences: bool = True,
) -> tuple[AnySteps, Estimate, Run, InstrumentsUsed]:
    """The iteration with the instruments that the method asks for, or the best there are.

    A loop whose law was found or declared, rather than given, may turn out not to carry the
    simulation; then the record itself makes the instruments.
    """
    problem = signals.problem
    chosen = choose(problem, method, signals.kinematics, differences)
    try:
        made = steps(chosen)
        return made, *piv(made, say), chosen.used
    except (SimulationDiverged, MassMatrixNotPositiveDefinite) as error:
        if not may_do_without(problem, method):
            raise
        reason = instead_of_loop(error)
        say(reason)
    chosen = without_loop(signals.kinematics, reason)
    made = steps(chosen)
    return made, *piv(made, say), chosen.used


def full_rate_start(
    signals: Signals,
    method: InstrumentalVariables | PrefilteredIV | OutputError,
    prefilters: Prefilters,
) -> Pass:
    """θ⁰ of a method at the full rate, with prefilters that need no noise model."""
    nominal = initial_pass(signals.problem, prefilters)
    if not start_number(method):
        return nominal
    records = records_without_instruments(signals.measured(signals.without_load), signals.limits)
    return least_squares_pass(signals, nominal, records)


@dataclass(frozen=True, eq=False)
class PrefilteredSteps:
    """The steps of IDIM-PIV."""

    signals: Signals
    method: PrefilteredIV
    auxiliary: InstrumentSource
    whitening: Whitening

    earliest = MIN_ESTIMATES + 1
    always_by_window = False
    repeatable = True

    def start(self) -> Pass:
        """θ⁰: least squares behind the inverse controllers."""
        return full_rate_start(self.signals, self.method, self.whitening.initial())

    def noise_models(self, last: Pass, theta: np.ndarray) -> Prefilters:
        """Step (c): inverse controllers and whiteners of what they leave of the residual."""
        return self.whitening.fitted(last.prefilters, last.number, theta, last.records)

    def equations(
        self, last: Pass, simulated: Simulated, prefilters: Prefilters
    ) -> tuple[Sequence[FullRateRecord], Prefilters]:
        """Φ(q̂), Z = Φ(q_s) and τ of all recordings."""
        signals, load = self.signals, self.signals.load(last.number, simulated.theta)
        measured = signals.measured(load, simulated.motions)
        records = records_with_instruments(
            measured, signals.simulated(simulated.motions, load), signals.limits
        )
        prefilters.exclude(records)
        return records, prefilters
