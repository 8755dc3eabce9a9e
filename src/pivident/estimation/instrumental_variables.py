"""IDIM-IV: instruments from the simulated closed loop remove the bias of least squares.

Janot, Vandanjon and Gautier (2014): with q_s simulated from the current parameters,

    θ = (Σ Φ(q_s)ᵀ Φ(q̂)/λ_j)⁻¹ Σ Φ(q_s)ᵀ τ/λ_j

repeated until it stands still: the iteration of IDIM-PIV with prefilters of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, cast

import numpy as np

from pivident.estimation.answer import answer, loop_warnings
from pivident.estimation.decimated import DecimatedRecord, decimate_record
from pivident.estimation.full_rate import FullRateRecord, records_with_instruments
from pivident.estimation.identification import Identification
from pivident.estimation.instrument_choice import Chosen, InstrumentSource
from pivident.estimation.iteration import (
    Estimate,
    Pass,
    Run,
    Signals,
    Simulated,
    Steps,
    initial_pass,
    least_squares_pass,
    start_number,
)
from pivident.estimation.method import Handles, InstrumentalMethod, Say
from pivident.estimation.noise_identification import Prefilters
from pivident.estimation.prefiltered_iv import MIN_ESTIMATES, full_rate_start, piv, with_instruments
from pivident.estimation.problem import EQUATION_ERROR, Problem
from pivident.estimation.signal_recipes import (
    Bandpass,
    Decimated,
    RandomWalk,
    SignalRecipe,
    recipe_name,
)
from pivident.foundation.options import option
from pivident.foundation.text.finding import Finding


@dataclass(frozen=True)
class InstrumentalVariables(InstrumentalMethod):
    """IDIM-IV: instruments Φ(q_s) from the simulated loop, or another motion q_s.

    Attributes:
        signals: ``Bandpass()`` as in the literature, ``Algebraic()``, or ``RandomWalk()`` at full
            rate.

    Example:
        >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> recording = pv.simulate(robot, loop, duration=5.0, encoder=1e-5).recording
        >>> method = pv.InstrumentalVariables(signals=pv.RandomWalk())
        >>> for given in (loop, None):  # without a loop, instruments come from the record
        ...     result = pv.identify(pv.Problem(robot, (recording,), given), method)
        ...     print(result.method, round(result.params["fc1"], 2))
        IDIM-IV (full rate) 4.0
        IDIM-IV (full rate) (response) 4.0
    """

    signals: SignalRecipe = option(
        factory=Bandpass, meaning="how positions become speeds and accelerations"
    )

    handles: ClassVar[Handles] = Handles(law_choice=True, shape_constants=True, payload=True)
    of_computed_torque: ClassVar[tuple[Finding, ...]] = (EQUATION_ERROR,)

    @property
    def is_thinned(self) -> bool:
        """Whether the equations are decimated."""
        return isinstance(self.signals, Decimated) and self.signals.decimation != 1

    @property
    def label(self) -> str:  # type: ignore[override]
        """Name as in the literature."""
        thinned = isinstance(self.signals, Bandpass) or self.is_thinned
        return "IDIM-IV" if thinned else "IDIM-IV (full rate)"

    @property
    def summary(self) -> str:  # type: ignore[override]
        """What it is, in a few words."""
        if self.is_thinned:
            return "instrumental variables on filtered, decimated signals"
        return "instrumental variables: no bias, intervals too wide"

    @property
    def recipes(self) -> tuple[str, ...]:
        """Its own recipe, or the algebraic one; the third makes the other method of the two."""
        return tuple(dict.fromkeys((recipe_name(self.signals), "algebraic")))

    def steps(self, signals: Signals, chosen: Chosen) -> Steps:
        """The parts of its iteration.

        Args:
            signals: the smoothed recordings.
            chosen: the instruments, with the measured motions that go with them.
        """
        around = signals.with_kinematics(chosen.kinematics)
        if isinstance(self.signals, Decimated):
            return DecimatedSteps(around, self, chosen.source, self.signals)
        return FullRateSteps(around, self, chosen.source)

    def estimate(self, problem: Problem, say: Say, *, test_gains: bool = True) -> Identification:
        """Iterate instruments and estimate."""
        say(f"{self.label}: smoothing the records")
        signals = Signals.of(problem, self)

        def iterated(chosen: Chosen) -> tuple[Estimate, Run]:
            return piv(self.steps(signals, chosen), say)

        full_rate = not isinstance(self.signals, Decimated)
        (estimate, run), used = with_instruments(signals, self, iterated, say, full_rate)
        return answer(problem, self, estimate, run, loop_warnings(problem, estimate, used), used)


#: Instrumental variables of the literature, and at the full rate.
IV, IV_FULL_RATE = InstrumentalVariables(), InstrumentalVariables(RandomWalk())


#: Estimates after which rows no longer come and go with the speeds of the simulated joints: of few
#: decimated rows a single one may move the estimate, which takes it in and leaves it out for ever.
KEEPS_ROWS = 4


@dataclass(frozen=True, eq=False)
class DecimatedSteps:
    """The literature's form: everything through the parallel decimation, no prefilter."""

    signals: Signals
    method: InstrumentalVariables
    auxiliary: InstrumentSource
    recipe: Decimated

    earliest = MIN_ESTIMATES + 1
    always_by_window = True
    repeatable = True

    def start(self) -> Pass:
        """θ⁰: least squares on the decimated equations."""
        signals, regressor = self.signals, self.signals.problem.regressor
        nominal = initial_pass(signals.problem, Prefilters(()))
        if not start_number(self.method):
            return nominal
        measured = signals.measured(signals.without_load)
        records = [
            decimate_record(regressor, kin, self.recipe, limits)
            for kin, limits in zip(measured, signals.limits, strict=True)
        ]
        return least_squares_pass(signals, nominal, records)

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
        if last.number - start_number(self.method) >= KEEPS_ROWS:
            records = [replace(r, used=old.used) for r, old in zip(records, made, strict=True)]
        return records, prefilters


@dataclass(frozen=True, eq=False)
class UnfilteredSteps:
    """What all steps have that begin at the full rate and go on without prefilters."""

    signals: Signals
    method: InstrumentalMethod
    auxiliary: InstrumentSource

    earliest = MIN_ESTIMATES + 1
    always_by_window = True
    repeatable = True

    def start(self) -> Pass:
        """θ⁰: least squares at the full rate."""
        return full_rate_start(self.signals, self.method, Prefilters.none(self.signals.problem))

    def noise_models(self, last: Pass, theta: np.ndarray) -> Prefilters:
        """None."""
        return last.prefilters


class FullRateSteps(UnfilteredSteps):
    """No decimation and no prefilter: smoother and aligned torque do the work."""

    def equations(
        self, last: Pass, simulated: Simulated, prefilters: Prefilters
    ) -> tuple[Sequence[FullRateRecord], Prefilters]:
        """Φ(q̂), Z = Φ(q_s) and τ of all recordings."""
        signals, load = self.signals, self.signals.load(last.number, simulated.theta)
        measured = signals.measured(load, simulated.motions)
        return records_with_instruments(
            measured, signals.simulated(simulated.motions, load), signals.limits
        ), prefilters
