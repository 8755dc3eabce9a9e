"""The search of one branch: where it starts, the approach, and the fit.

Starts are tried in turns until a fit settles: what the equations of motion give along the measured
motion (`equation_start`), then the description with shares of the joints' scales in place of what
it lacks. A loop that is unstable with that little inertia is tried with more.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from pivident.errors import (
    IdentificationError,
    MassMatrixNotPositiveDefinite,
    SimulationDiverged,
)
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

#: Fits after which no further start is tried; those whose loops diverge do not count.
MAX_TRIED = 2

#: Errors of a simulation that has lost the motion: larger than these shares of the distance between
#: position and reference, and of the motion that was wanted.
MAX_OF_TRACKING, MAX_OF_MOTION = 0.5, 0.1

#: All positions are compared, and their errors count as white.
OPTIONS = FitOptions(channels=(POSITIONS,), noise=None, bandwidth=0.0)


def searched(
    stretches: Sequence[Stretch], sought: Sequence[JointQuantity], say: Callable[[str], None]
) -> tuple[SimulationFit, np.ndarray]:
    """The fit of one branch, and what its values count from, shape (unknowns,).

    A fit that does not settle, or loses the motion, is begun anew from the next start; of several
    the one with the smallest errors is kept.

    Raises:
        SimulationDiverged: the loop is unstable from wherever the search starts; names the joint.
        RankDeficientRegressor: the record does not determine some quantities; names them.
    """
    unknowns = [own.unknown for own in sought]
    best: tuple[SimulationFit, np.ndarray] | None = None
    failure: IdentificationError | None = None
    tried = 0
    for begin in _starts(stretches, sought):
        try:
            near = approached(begin, unknowns, say)
            found = fit_simulation(near, unknowns, OPTIONS, say)
        except IdentificationError as error:
            failure = failure or error
            if isinstance(error, (SimulationDiverged, MassMatrixNotPositiveDefinite)):
                continue
        else:
            if is_lost(found):
                found = replace(found, converged=False)
            if found.converged:
                return found, _offsets(near[0], unknowns)
            if best is None or _size(found) < _size(best[0]):
                best = found, _offsets(near[0], unknowns)
        tried += 1
        if tried == MAX_TRIED:
            break
        say("did not settle; begun anew from another start")
    if best is None:
        assert failure is not None
        raise failure
    return best


def is_lost(fit: SimulationFit) -> bool:
    """Whether the simulation tells little of what the measured motion is beside its reference.

    Such a loop swings by itself, and the minimum that was found is one of many. Joints that were
    to stand still are left out.
    """
    squares, tracking, motion = [], [], []
    for own, errors in zip(fit.stretches, fit.errors, strict=True):
        compared = slice(own.first, own.samples)
        reference = own.loop.signals.q_ref[:: own.step][compared]
        squares.append(errors[POSITIONS][:, compared].T ** 2)
        tracking.append((own.q[compared] - reference) ** 2)
        motion.append((reference - reference.mean(axis=0)) ** 2)
    error, lag, size = (
        np.sqrt(np.concatenate(own).mean(axis=0)) for own in (squares, tracking, motion)
    )
    large = error > np.maximum(MAX_OF_TRACKING * lag, MAX_OF_MOTION * size)
    return bool((large & (size > 0.0)).any())


def _size(fit: SimulationFit) -> float:
    """Mean squares of the errors of all positions."""
    return float(np.sum(fit.rms[POSITIONS] ** 2))


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
