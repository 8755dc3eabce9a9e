"""DIDIM with prefilters: the observation matrix itself comes from the simulated loop.

Gautier, Janot and Vandanjon (2013) fit the measured torque with the motion that the loop makes of
reference, control law and parameters (*direct and inverse dynamic identification models*), a
closed-loop output error method that needs no measured positions:

    θ ← (Σ Φ(q_s)ᵀ L_jᵀ L_j Φ(q_s))⁻¹ Σ Φ(q_s)ᵀ L_jᵀ L_j τ,    q_s simulated with the θ before

Here L_j is the prefilter of IDIM-PIV: the torque carries the encoder noise that the controller
has answered to, and its inverse turns it back into white noise. With a coarse encoder the gain is
large. Smoothed positions bias the estimate twice, by what the smoother takes from the motion at
the reversals and, since E[f(dq + n)] ≠ f(dq), by what it leaves of the noise in the friction
column; instruments correct neither. q_s has no noise, and is not smoothed.

The price: where model, law or reference are wrong, so is q_s. Two things are looked after.

* Positions at the start are only known to within the encoder's noise; samples before the loop has
  forgotten them are excluded.
* Where the residual is mostly model error, a noise model of it would be a high-pass filter and
  trade Coulomb's friction for viscous one. A joint whose residual is much larger in the motion's
  band than beyond it shows that; the prefilter is then the inverse controller alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pivident.errors import ExperimentError
from pivident.estimation.answer import answer, law_findings
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.counted_loop import identify_counted, reads_counts
from pivident.estimation.equation_record import EquationRecord
from pivident.estimation.full_rate import FullRateRecord, records_without_instruments
from pivident.estimation.identification import Identification
from pivident.estimation.iteration import Pass, Signals, Simulated, start_number
from pivident.estimation.method import Handles, Say
from pivident.estimation.noise_identification import Prefilters, Whitening
from pivident.estimation.prefiltered_iv import PrefilteredIV, full_rate_start, piv
from pivident.estimation.problem import Problem
from pivident.estimation.simulated_kinematics import settled_starts, simulated_kinematics
from pivident.instruments.given_motion import InstrumentsUsed
from pivident.motion.motion import with_inner
from pivident.text.finding import Finding

#: Iterations behind the inverse controller alone: as long as θ is wrong the residual shows it, and
#: a noise model of that would be a high-pass filter that the iteration then hardly gets through.
WITHOUT_NOISE_MODEL = 2

#: Iterations that look at the start anew: parameters are near their final values from the second.
LOOKS_AT_START = 2

#: Ratio of position error to encoder noise from which on positions know more than the simulation.
FAR_FROM_MEASURED = 2.0


@dataclass(frozen=True, kw_only=True)
class Didim(PrefilteredIV):
    """DIDIM: the motion of the simulated loop makes the observation matrix, for coarse encoders.

    Options are those of `PrefilteredIV` but the instruments, which are the observation matrix.
    """

    label: ClassVar[str] = "DIDIM (prefiltered)"
    summary: ClassVar[str] = "for coarse encoders with a known law and reference"
    group: ClassVar[str] = "Methods that fit a simulation"
    handles: ClassVar[Handles] = Handles(
        wrenches=False, computed_torque=False, no_controller=False, no_reference=False
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self._refuse_instruments()
        if self.as_printed:
            raise ExperimentError(
                "as_printed follows the paper to the letter, which takes the measured motion",
                advice="use piv",
            ).about("as_printed")

    @property
    def keys(self) -> tuple[str, ...]:
        """Options that a file may set."""
        return tuple(k for k in super().keys if k not in ("instruments", "as_printed"))

    def estimate(self, problem: Problem, say: Say, *, test_gains: bool = True) -> Identification:
        """Iterate simulation, noise models and estimate."""
        if reads_counts(problem):
            return identify_counted(problem, self, say)
        say(f"{self.label}: noise of the encoders")
        signals = Signals.of(problem, self)
        auxiliary = AuxiliaryModel(problem, differences=True, kinematics=signals.kinematics)
        whitening = Whitening.of(problem, self, signals.kinematics)
        estimate, run = piv(SimulatedSteps(signals, self, auxiliary, whitening), say)
        warnings = [
            *_notes(problem),
            *whitening.warnings(estimate.prefilters),
            *_far_from_measured(estimate.records),
        ]
        return answer(problem, self, estimate, run, warnings, InstrumentsUsed("loop"))


#: DIDIM with prefilters.
DIDIM = Didim()


@dataclass(frozen=True, eq=False)
class SimulatedSteps:
    """The steps of DIDIM: Φ, too, is that of the simulated motion."""

    signals: Signals
    method: Didim
    auxiliary: AuxiliaryModel
    whitening: Whitening

    always_by_window = False
    repeatable = True

    @property
    def earliest(self) -> int:
        """Two with a noise model, the second of which is kept."""
        return start_number(self.method) + WITHOUT_NOISE_MODEL + 2

    def start(self) -> Pass:
        """θ⁰: least squares on the measured motion behind the inverse controllers."""
        return full_rate_start(self.signals, self.method, self.whitening.initial())

    def noise_models(self, last: Pass, theta: np.ndarray) -> Prefilters:
        """Those before: the residual needs the motion that is being simulated."""
        return last.prefilters

    def equations(
        self, last: Pass, simulated: Simulated, prefilters: Prefilters
    ) -> tuple[Sequence[FullRateRecord], Prefilters]:
        """Φ(q_s) and τ from where the loop has forgotten its start, and step (c) on them."""
        signals, theta = self.signals, simulated.theta
        load, made = signals.load(last.number, theta), last.number - start_number(self.method)
        if made < LOOKS_AT_START:
            starts = settled_starts(self.auxiliary, theta, simulated.motions, signals.kinematics)
        else:
            starts = [r.kinematics.start for r in last.records]
        moved = [
            simulated_kinematics(*parts)
            for parts in zip(signals.kinematics, simulated.motions, starts, strict=True)
        ]
        regressor = signals.problem.regressor
        records = records_without_instruments(
            [with_inner(regressor, m, load) for m in moved], signals.limits
        )
        number = made + 1 - WITHOUT_NOISE_MODEL
        fitted = self.whitening.fitted(prefilters, number, theta, records)
        prefilters = prefilters if fitted.show_model_error else fitted
        prefilters.exclude(records)
        return records, prefilters


def _notes(problem: Problem) -> list[Finding]:
    """Reservations about law and reference."""
    notes, warnings = law_findings(problem.loop)
    return [*notes, *warnings]


def _far_from_measured(records: Sequence[EquationRecord]) -> list[Finding]:
    """Joints whose measured positions contradict the simulated ones."""
    squares, noise, samples = 0.0, 0.0, 0
    for kin in (r.kinematics for r in records):
        part = slice(kin.start, kin.stop)
        difference = kin.recording.q[part].T - kin.q[:, part]
        squares = squares + np.sum(difference**2, axis=1)
        noise = noise + kin.encoder_std**2 * difference.shape[1]
        samples += difference.shape[1]
    error, noise = np.sqrt(squares / samples), np.sqrt(noise / samples)
    names = records[0].kinematics.recording.joint_names
    far = [
        f"{name!r} ({own:.2g} against {encoder:.2g})"
        for name, own, encoder in zip(names, error, noise, strict=True)
        if own > FAR_FROM_MEASURED * encoder
    ]
    if not far:
        return []
    text = (
        "The simulated motion is further from the measured one than the encoder's noise explains "
        f"(rms, rad or m): {', '.join(far)}."
    )
    step = "Compare with piv, which uses the measured positions."
    return [Finding("warning", "simulation", "far from measured", text, next_step=step)]
