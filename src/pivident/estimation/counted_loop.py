"""DIDIM of a loop whose control law reads an encoder of few counts.

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
from typing import cast

import numpy as np

from pivident.estimation.answer import answer, law_findings
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.decimated import DecimatedRecord, decimate_record, decimated_columns
from pivident.estimation.identification import Identification
from pivident.estimation.instrumental_variables import UnfilteredSteps
from pivident.estimation.iteration import Pass, Signals, Simulated, start_number
from pivident.estimation.kinematics import settled_recipe
from pivident.estimation.method import Say
from pivident.estimation.noise_identification import Prefilters
from pivident.estimation.prefiltered_iv import PrefilteredIV, piv
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Bandpass
from pivident.estimation.simulated_kinematics import settled_starts, simulated_kinematics
from pivident.instruments.given_motion import InstrumentsUsed
from pivident.motion.motion import SimulatedMotion, with_inner
from pivident.text.finding import Finding

#: Name of the result.
LABEL = "DIDIM (loops with counts)"

#: What every other estimate is told where the law reads whole counts.
NOT_SIMULATED = Finding(
    "warning",
    "loop",
    "counts",
    "The control law reads whole counts and shakes the robot, which makes friction seem smaller: "
    "the estimate may be biased by more than its standard errors.",
    next_step="Compare with didim, which simulates the loop with its counts.",
)

#: Loops of each mean that an iteration adds.
LOOPS = 3

#: Estimates after which θ is near: means begin anew until then.
NEAR = 2

#: Places of counts go on by this share of a count from one iteration to the next: the golden ratio
#: leaves no gap and no place twice.
GOLDEN = 0.5 * (5.0**0.5 - 1.0)


def reads_counts(problem: Problem) -> bool:
    """Whether the control law is known to read whole counts of some joint."""
    joints = problem.robot.size - problem.robot.base_joints
    return problem.loop is not None and bool(problem.loop.counts(joints).any())


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
