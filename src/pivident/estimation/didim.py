"""DIDIM: the observation matrix itself comes from the simulated loop, with its counts if any.

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

DIDIM of a loop whose control law reads an encoder of few counts.

A law that reads q in whole counts shakes the robot: its torque steps with each count, the joint
answers, and dry friction, a sign on a smooth motion, becomes the mean over what shakes. Neither the
smoothed positions nor a loop simulated without counts know of that; both are biased, friction by
several percent. Simulated with its counts the loop shakes alike, but not in step with the machine.
What many such loops have in common, each with its counts at another place, is the expected
observation matrix. With two means over different loops,

    θ ← (Σ Φ̄_bᵀ Φ̄_a/λ_j)⁻¹ Σ Φ̄_bᵀ τ/λ_j,    Φ̄ = (1/K) Σ_k F_p Φ(q_k)

q_k simulated with the θ before and F_p the parallel decimation, the torque differs from Φ̄_a θ by
what shakes in either, and the instruments Φ̄_b share nothing with that. Once θ is near, the means go
over the loops of all iterations, so that the estimate stands still although no loop repeats itself.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, cast

import numpy as np

from pivident.estimation.answer import answer, law_findings
from pivident.estimation.auxiliary_model import AuxiliaryModel, settled_starts, simulated_kinematics
from pivident.estimation.decimated import DecimatedRecord, decimate_record, decimated_columns
from pivident.estimation.equation_record import EquationRecord
from pivident.estimation.full_rate import FullRateRecord, records_without_instruments
from pivident.estimation.identification import Identification
from pivident.estimation.instrumental_variables import UnfilteredSteps
from pivident.estimation.iteration import Pass, Signals, Simulated, start_number
from pivident.estimation.kinematics import settled_recipe
from pivident.estimation.method import Handles, Say
from pivident.estimation.noise_identification import MODEL_ERROR, Prefilters, Whitening
from pivident.estimation.prefiltered_iv import PrefilteredIV, full_rate_start, piv
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Bandpass
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.finding import Finding
from pivident.loop.instruments.given_motion import InstrumentsUsed
from pivident.loop.motion.motion import SimulatedMotion, with_inner

#: Iterations behind the inverse controller alone: as long as θ is wrong the residual shows it, and
#: a noise model of that would be a high-pass filter that the iteration then hardly gets through.
WITHOUT_NOISE_MODEL = 2
#: Iterations that look at the start anew: parameters are near their final values from the second.
LOOKS_AT_START = 2
#: Ratio of position error to encoder noise from which on positions know more than the simulation.
FAR_FROM_MEASURED = 2.0
#: Name of the result.
LABEL = "DIDIM (loops with counts)"
#: What every other estimate is told where the law reads whole counts.
NOT_SIMULATED = Finding(
    "warning",
    "loop",
    "counts",
    "The control law reads whole counts and shakes the robot, which makes friction seem smaller: "
    "the estimate may be biased by more than its standard errors.",
    next_step="Compare with didim, which simulates the loop with its counts, and with oloe, which "
    "the recorded torques drive.",
)
#: Loops of each mean that an iteration adds.
LOOPS = 3
#: Estimates after which θ is near: means begin anew until then.
NEAR = 2
#: Places of counts go on by this share of a count from one iteration to the next: the golden ratio
#: leaves no gap and no place twice.
GOLDEN = 0.5 * (5.0**0.5 - 1.0)


def identify_counted(problem: Problem, method: PrefilteredIV, say: Say) -> Identification:
    """Iterate means over simulated loops and the estimate."""
    say(f"{method.label}: the law reads whole counts; {2 * LOOPS} loops in each iteration")
    signals = Signals.of(problem, method)
    auxiliary = AuxiliaryModel(problem, differences=True, kinematics=signals.kinematics)
    recipe = settled_recipe(Bandpass(), problem.recordings)
    assert isinstance(recipe, Bandpass)
    estimate, run = piv(CountedSteps(signals, method, auxiliary, recipe), say)
    notes, warnings = law_findings(problem.loop)
    found = answer(problem, method, estimate, run, [*notes, *warnings], InstrumentsUsed("loop"))
    return dataclasses.replace(found, method=LABEL)


@dataclass(frozen=True, eq=False)
class CountedSteps(UnfilteredSteps):
    """The steps: Φ and Z are means over loops with counts, decimated; no prefilter."""

    auxiliary: AuxiliaryModel  # the loop without counts
    recipe: Bandpass

    repeatable = False  # other loops each time

    def equations(
        self, last: Pass, simulated: Simulated, prefilters: Prefilters
    ) -> tuple[Sequence[DecimatedRecord], Prefilters]:
        """Φ̄_a, Z = Φ̄_b and τ of all recordings, from where the loop has forgotten its start."""
        made = last.number - start_number(self.method)
        again = made < NEAR
        earlier = [] if again else cast(Sequence[DecimatedRecord], last.records)
        own = self._records(last, simulated) if again else earlier
        load = self.signals.load(last.number, simulated.theta)
        a, b = (self._means(simulated.theta, load, own, made, half) for half in range(2))
        kept = 1 if again else made - NEAR + 2  # iterations in the means
        records = []
        for record, phi, z in zip(own, a, b, strict=True):
            if record.z is not None:  # that of the iterations before
                phi, z = record.phi + (phi - record.phi) / kept, record.z + (z - record.z) / kept
            records.append(dataclasses.replace(record, phi=phi, z=z))
        return records, prefilters

    def _records(self, last: Pass, simulated: Simulated) -> list[DecimatedRecord]:
        """Rows of all recordings, and which of them are used, by the loop without counts."""
        signals, theta = self.signals, simulated.theta
        regressor, load = signals.problem.regressor, signals.load(last.number, theta)
        starts = settled_starts(self.auxiliary, theta, simulated.motions, signals.kinematics)
        moved = [
            with_inner(regressor, simulated_kinematics(*parts), load)
            for parts in zip(signals.kinematics, simulated.motions, starts, strict=True)
        ]
        return [
            decimate_record(regressor, k, self.recipe, own)
            for k, own in zip(moved, signals.limits, strict=True)
        ]

    def _means(
        self,
        theta: np.ndarray,
        load: np.ndarray,
        records: Sequence[DecimatedRecord],
        iteration: int,
        half: int,
    ) -> list[np.ndarray]:
        """Φ̄ of each recording over the loops of one half, packed, shape (entries, rows)."""
        starts = [r.kinematics.start for r in records]
        loops = offsets(self.signals.problem, iteration)[half::2]
        columns = [self._columns(self._loops(o).simulate(theta), load, starts) for o in loops]
        return [np.mean(own, axis=0) for own in zip(*columns, strict=True)]

    def _columns(
        self, motions: Sequence[SimulatedMotion], load: np.ndarray, starts: Sequence[int]
    ) -> list[np.ndarray]:
        """F_p Φ of simulated motions."""
        regressor = self.signals.problem.regressor
        own = zip(
            self.signals.simulated(motions, load), self.signals.kinematics, starts, strict=True
        )
        return [
            decimated_columns(
                regressor,
                motion,
                slice(start, k.stop),
                self.recipe.factor(k.recording.rate),
                self.recipe.convention,
            )
            for motion, k, start in own
        ]

    def _loops(self, offset: np.ndarray) -> AuxiliaryModel:
        """The loops with counts that lie elsewhere by an offset, shape (joints,) [rad or m]."""
        loop = self.signals.problem.loop
        assert loop is not None
        made = copy.copy(self.auxiliary)
        made.signals = [
            (dataclasses.replace(s, count=loop.counts(offset.size), noise=offset[None]), start)
            for s, start in made.signals
        ]
        return made


def offsets(problem: Problem, iteration: int) -> np.ndarray:
    """Where the counts of each loop lie, evenly over one, shape (2 LOOPS, joints) [rad or m]."""
    assert problem.loop is not None
    size, loops = problem.robot.size, 2 * LOOPS
    rng = np.random.default_rng(iteration)
    places = np.stack([rng.permutation(loops) for _ in range(size)], axis=1) / loops
    return ((places + GOLDEN * iteration) % 1.0 - 0.5) * problem.loop.counts(size)


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
        if problem.reads_counts:
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
        fitted = self.whitening.fitted(prefilters, made + 1 - WITHOUT_NOISE_MODEL, theta, records)
        if all(model.excess <= MODEL_ERROR for model in fitted.models):
            prefilters = fitted
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
