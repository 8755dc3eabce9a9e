"""IDIM-IV: instruments from the simulated closed loop remove the bias of least squares.

Janot, Vandanjon and Gautier (2014): with q_s simulated from the current parameters,

    θ = (Σ Φ(q_s)ᵀ Φ(q̂)/λ_j)⁻¹ Σ Φ(q_s)ᵀ τ/λ_j

repeated until it stands still: the iteration of IDIM-PIV with prefilters of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from pivident.estimation.answer import answer, loop_warnings
from pivident.estimation.decimated import DecimatedRecord, decimate_record
from pivident.estimation.full_rate import FullRateRecord, records_with_instruments
from pivident.estimation.identification import Identification
from pivident.estimation.instrument_choice import Chosen, InstrumentSource
from pivident.estimation.iteration import Pass, Say, Signals, Simulated, Steps, initial_pass
from pivident.estimation.methods import Bandpass, InstrumentalVariables
from pivident.estimation.noise_identification import Prefilters
from pivident.estimation.prefiltered_iv import with_instruments
from pivident.estimation.problem import Problem
from pivident.estimation.standstill import decided_by_residual, noisy_standstill
from pivident.motion.kinematics import torque_of


def identify_iv(problem: Problem, method: InstrumentalVariables, say: Say) -> Identification:
    """Iterate instruments and estimate."""
    say(f"{method.label}: smoothing the records")
    signals, recipe = Signals.of(problem, method), method.signals

    def steps(chosen: Chosen) -> Steps:
        own = signals.with_kinematics(chosen.kinematics)
        if isinstance(recipe, Bandpass):
            return DecimatedSteps(own, method, chosen.source, recipe)
        return FullRateSteps(own, method, chosen.source)

    full_rate = not isinstance(recipe, Bandpass)
    _, estimate, run, used = with_instruments(signals, method, steps, say, full_rate)
    return answer(problem, method, estimate, run, loop_warnings(problem, estimate, used), used)


@dataclass(frozen=True, eq=False)
class DecimatedSteps:
    """The literature's form: everything through the parallel decimation, no prefilter."""

    signals: Signals
    method: InstrumentalVariables
    auxiliary: InstrumentSource
    recipe: Bandpass

    earliest = 2
    start_number = 0
    always_by_window = True

    def start(self) -> Pass:
        """Nominal values."""
        return initial_pass(self.signals.problem, Prefilters(()))

    def noise_models(self, last: Pass, theta: np.ndarray) -> Prefilters:
        """None."""
        return last.prefilters

    def equations(
        self, last: Pass, simulated: Simulated, prefilters: Prefilters
    ) -> tuple[Sequence[DecimatedRecord], Prefilters]:
        """Φ(q̂), Z = Φ(q_s) and τ of all recordings, decimated; Φ and τ only once."""
        signals, load = self.signals, self.signals.load(last.number, simulated.theta)
        regressor = signals.problem.regressor
        again = not last.records or regressor.depends_on_load  # then Φ changes with θ
        made = cast(Sequence[DecimatedRecord], last.records)
        earlier = [None] * len(signals.kinematics) if again else made
        records = [
            decimate_record(regressor, kin, self.recipe, limits, motion, before)
            for kin, limits, motion, before in zip(
                signals.measured(load),
                signals.limits,
                signals.simulated(simulated.motions, load),
                earlier,
                strict=True,
            )
        ]
        return records, prefilters


@dataclass(frozen=True, eq=False)
class FullRateSteps:
    """No decimation and no prefilter: smoother and aligned torque do the work."""

    signals: Signals
    method: InstrumentalVariables
    auxiliary: InstrumentSource

    earliest = 3
    start_number = 0
    always_by_window = True

    def start(self) -> Pass:
        """Nominal values."""
        return initial_pass(self.signals.problem, Prefilters.none(self.signals.problem))

    def noise_models(self, last: Pass, theta: np.ndarray) -> Prefilters:
        """None."""
        return last.prefilters

    def equations(
        self, last: Pass, simulated: Simulated, prefilters: Prefilters
    ) -> tuple[Sequence[FullRateRecord], Prefilters]:
        """Φ(q̂), Z = Φ(q_s) and τ; the first estimate's residual decides about standstill."""
        signals, load = self.signals, self.signals.load(last.number, simulated.theta)
        problem, measured = signals.problem, signals.measured(load)
        records = records_with_instruments(
            measured, signals.simulated(simulated.motions, load), signals.limits
        )
        if last.number == 1 and decided_by_residual(problem):
            residuals = [k.tau - torque_of(problem.regressor, k, simulated.theta) for k in measured]
            noisy = noisy_standstill(problem, prefilters.filters, records, residuals)
            prefilters = replace(prefilters, without_standstill=noisy)
        prefilters.exclude(problem, records)
        return records, prefilters
