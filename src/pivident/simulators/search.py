"""The search of one branch: where it starts, the approach, and the fit.

Starts are tried in turns until a fit settles: what the equations of motion give along the measured
motion (`equation_start`), then the description with shares of the joints' scales in place of what
it lacks. A loop that is unstable with that little inertia is tried with more.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from pivident.errors import IdentificationError, RankDeficientRegressor
from pivident.estimation.output_error.fit import fit_simulation
from pivident.estimation.output_error.simulated_errors import POSITIONS
from pivident.estimation.output_error.simulation_fit import FitOptions, SimulationFit
from pivident.estimation.output_error.stretch import Stretch
from pivident.estimation.output_error.unknowns import Unknown, values_of, with_values
from pivident.simulators.approach import approached
from pivident.simulators.equation_start import equation_start
from pivident.simulators.joint_quantities import JointQuantity

#: Factors of the armature where the search starts: a loop that is unstable with little is tried
#: again with more.
HEAVIER = (1.0, 4.0, 16.0)

#: Fits that did not settle after which no further start is tried.
MAX_UNSETTLED = 2

#: All positions are compared, and their errors count as white.
OPTIONS = FitOptions(channels=(POSITIONS,), noise=None, bandwidth=0.0)


def searched(
    stretches: Sequence[Stretch], sought: Sequence[JointQuantity], say: Callable[[str], None]
) -> tuple[SimulationFit, np.ndarray]:
    """The fit of one branch, and what its values count from, shape (unknowns,).

    A fit that does not settle is begun anew from the next start; of several the one with the
    smallest errors is kept.

    Raises:
        SimulationDiverged: the loop is unstable from wherever the search starts; names the joint.
        RankDeficientRegressor: the record does not determine some quantities; names them.
    """
    unknowns = [own.unknown for own in sought]
    best: tuple[SimulationFit, np.ndarray] | None = None
    failure: IdentificationError | None = None
    unsettled = 0
    for begin in _starts(stretches, sought):
        try:
            near = approached(begin, unknowns, say)
            found = fit_simulation(near, unknowns, OPTIONS, say)
        except RankDeficientRegressor:
            raise
        except IdentificationError as error:
            failure = failure or error
            continue
        if best is None or np.sum(found.rms[POSITIONS] ** 2) < np.sum(best[0].rms[POSITIONS] ** 2):
            best = found, _offsets(near[0], unknowns)
        if found.converged:
            return found, _offsets(near[0], unknowns)
        unsettled += 1
        if unsettled == MAX_UNSETTLED:
            break
        say("did not settle; begun anew from another start")
    if best is None:
        assert failure is not None
        raise failure
    return best


def _starts(
    stretches: Sequence[Stretch], sought: Sequence[JointQuantity]
) -> Iterator[list[Stretch]]:
    """Records beside loops from which a search may start, the most promising first."""
    unknowns = [own.unknown for own in sought]
    yield _with(stretches, unknowns, equation_start(stretches, unknowns))
    heavy = [own.unknown for own in sought if own.quantity == "armature"]
    armature = values_of(stretches[0].loop, heavy)
    for factor in HEAVIER if heavy else HEAVIER[:1]:
        yield _with(stretches, heavy, factor * armature)


def _with(
    stretches: Sequence[Stretch], unknowns: Sequence[Unknown], values: np.ndarray
) -> list[Stretch]:
    """Stretches beside loops with other values."""
    return [own.with_loop(with_values(own.loop, unknowns, values)) for own in stretches]


def _offsets(stretch: Stretch, unknowns: Sequence[Unknown]) -> np.ndarray:
    """What the fit counts an unknown from: encoder offsets from those of the loop."""
    noise, offsets = stretch.loop.signals.noise, np.zeros(len(unknowns))
    for k, unknown in enumerate(unknowns):
        if unknown.direction.kind == "encoder_offset" and noise is not None:
            offsets[k] = noise[0, unknown.direction.joint]
    return offsets
