"""Estimates of a fitted simulation without a block of the motion.

The last pass of the fit solves H δ = g, sums over the rows of the simulation errors. Without the
rows of a block the same equations give

    p₍ₖ₎ = p + H₍ₖ₎⁻¹ g₍ₖ₎

one Gauss–Newton step from the estimate of the whole record, at which derivatives, noise models and
initial states are shared, as `pivident.validation.held_out.fold_estimates` shares instruments. The
simulation runs through the held-out block: its positions and torques are not compared there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from pivident.errors import IdentificationError
from pivident.estimation.identification import Identification
from pivident.estimation.output_error.noise_weights import whitened_sums
from pivident.estimation.output_error.reduced_equations import (
    ReducedEquations,
    bounded_step,
    condition_of,
    stretch_equations,
)
from pivident.estimation.output_error.simulated_errors import SimulatedErrors
from pivident.estimation.output_error.simulation_fit import SimulationFit
from pivident.estimation.output_error.thinning import Thinning
from pivident.estimation.simulation_result import SimulationResult
from pivident.recording.recording import Recording
from pivident.validation.held_out.fold_estimates import POORER, of_each, widened, without_fold
from pivident.validation.held_out.folds import Fold


def simulated_estimates_without(
    found: Identification, folds: Sequence[Fold]
) -> list[Identification | IdentificationError]:
    """For each fold the estimate without it, or why there is none.

    Args:
        found: estimate of the whole record, with its fit and its equations.
        folds: what is left out in turn.
    """
    assert found.equations is not None and found.simulation is not None
    fit = found.simulation.fit
    assert fit is not None
    recordings = [record.kinematics.recording for record in found.equations.records]
    return of_each(folds, partial(_without, found, found.simulation, fit, recordings))


def _without(
    found: Identification,
    simulation: SimulationResult,
    fit: SimulationFit,
    recordings: Sequence[Recording],
    fold: Fold,
) -> Identification:
    """The estimate without one fold."""
    kept = [
        replace(made, errors=errors, used=made.used & ~out)
        for made, errors, out in zip(
            fit.made, fit.errors, rows_of(fit, recordings, fold), strict=True
        )
    ]
    equations = _equations(fit, kept, found.options.get("loss") == "huber")
    low = np.array([u.low for u in fit.unknowns]) - fit.values
    high = np.array([u.high for u in fit.unknowns]) - fit.values
    step = bounded_step(equations.gram, equations.moment, low, high, fit.held).step
    free = np.flatnonzero(~fit.held & ~fit.bound)
    condition, share = condition_of(equations.gram[np.ix_(free, free)])
    if condition > POORER * fit.condition:
        weakest = ", ".join(fit.unknowns[free[i]].name for i in np.flatnonzero(share > 0.3))
        raise IdentificationError(
            f"without it the simulated motion does not separate {weakest} (condition number "
            f"{condition:.3g}, with it {fit.condition:.3g})",
            advice="take more folds, or a longer motion",
        )
    values = fit.values + step
    more = _used(fit.made) / max(_used(kept), 1)
    count = len(found.theta)
    return without_fold(
        found,
        values[:count],
        **widened(found, more),
        simulation=replace(
            simulation,
            loop_parameters=tuple(
                replace(p, value=float(value), std=float(np.sqrt(more)) * p.std)
                for p, value in zip(simulation.loop_parameters, values[count:], strict=True)
            ),
            fit=None,
        ),
    )


def _equations(
    fit: SimulationFit, made: Sequence[SimulatedErrors], robust: bool
) -> ReducedEquations:
    """Normal equations of the rows that are used."""
    sums = whitened_sums(made, fit.noise, robust)
    own = []
    for each, stretch in zip(sums, fit.stretches, strict=True):
        starts = 0 if stretch.start_std is None else stretch.start_std.size
        own.append(
            stretch_equations(
                each, fit.noise.variance, len(fit.unknowns), stretch.start_std, np.zeros(starts)
            )
        )
    return ReducedEquations.of(own)


def rows_of(fit: SimulationFit, recordings: Sequence[Recording], fold: Fold) -> list[np.ndarray]:
    """Thinned rows of each stretch that see a sample of what a fold leaves out, shape (rows,).

    ``recordings``: of the fit, in its order; each has one stretch or several one after the other.
    """
    out = []
    owners = _owners(fit, recordings)
    for owner, stretch, made, factor in zip(
        owners, fit.stretches, fit.made, fit.factors, strict=True
    ):
        recording = recordings[owner]
        begin = stretch.start_time + np.arange(made.errors.shape[2]) / made.rate
        end = begin + Thinning(factor).width * factor / stretch.rate
        seen = np.zeros(len(begin), bool)
        for piece in fold.left_out:
            if piece.recording == owner:
                first = recording.start_time + piece.start / recording.rate
                last = recording.start_time + piece.stop / recording.rate
                seen |= (begin < last) & (end > first)
        out.append(seen)
    return out


def _owners(fit: SimulationFit, recordings: Sequence[Recording]) -> list[int]:
    """Number of the recording that each stretch belongs to."""
    owners, k, left = [], 0, recordings[0].samples / recordings[0].rate
    for stretch in fit.stretches:
        owners.append(k)
        left -= stretch.samples / stretch.rate
        # at another rate of the loop a stretch may end within the last period of its recording
        if left < 1.5 / recordings[k].rate and k + 1 < len(recordings):
            k += 1
            left = recordings[k].samples / recordings[k].rate
    return owners


def _used(made: Sequence[SimulatedErrors]) -> int:
    """How many rows count."""
    return sum(int(own.used.sum()) for own in made)
