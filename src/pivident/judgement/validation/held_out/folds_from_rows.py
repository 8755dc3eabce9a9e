"""Estimates and fitted simulations without a block of the motion, from rows of the record.

Regressions and filters are solved from the rows that are left.

Estimates of a fitted simulation without a block of the motion.

The last pass of the fit solves H δ = g, sums over the rows of the simulation errors. Without the
rows of a block the same equations give

    p₍ₖ₎ = p + H₍ₖ₎⁻¹ g₍ₖ₎

one Gauss–Newton step from the estimate of the whole record, at which derivatives, noise models and
initial states are shared, as instruments are above. The simulation runs through the held-out block:
its positions and torques are not compared there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification
from pivident.estimation.literature.rows import NormalEquations, Rows
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
from pivident.estimation.problem import Problem
from pivident.estimation.simulation_result import SimulationResult
from pivident.foundation.errors import IdentificationError
from pivident.judgement.validation.held_out.fold_estimates import (
    POORER,
    of_each,
    widened,
    without_fold,
)
from pivident.judgement.validation.held_out.folds import Fold


def refitted_without(
    refit: str, problem: Problem, found: Identification, folds: Sequence[Fold]
) -> list[Identification | IdentificationError]:
    """For each fold the estimate without it, as the method refits: simulation, samples or rows."""
    if refit == "simulation":
        return simulated_estimates_without(found, folds)
    return (filters_without if refit == "samples" else regressions_without)(problem, found, folds)


def regressions_without(
    problem: Problem, found: Identification, folds: Sequence[Fold]
) -> list[Identification | IdentificationError]:
    """For each fold the estimate without it, or why there is none.

    Args:
        problem: what was estimated.
        found: estimate of the whole record, with its equations, whose weights are kept.
        folds: what is left out in turn.
    """
    equations, method = found.equations, found.method_used
    assert equations is not None and method is not None
    samples = [record.sample_numbers for record in equations.records]

    def without(fold: Fold) -> Identification:
        rows = Rows.of(equations, rows_left_out(samples, fold))
        return _solved_rows(problem, found, method, rows)

    return of_each(folds, without)


def rows_left_out(samples: Sequence[np.ndarray], fold: Fold) -> np.ndarray:
    """Rows that a fold leaves out, those of all recordings one after the other."""
    out = [np.zeros(len(own), bool) for own in samples]
    for piece in fold.left_out:
        own = samples[piece.recording]
        out[piece.recording] |= (own >= piece.start - 0.5) & (own < piece.stop - 0.5)
    return np.concatenate(out)


def _solved_rows(
    problem: Problem, found: Identification, method: Any, rows: Rows
) -> Identification:
    """The estimate from the rows that are left."""
    solved = method.solve_free(problem, rows, found.theta).solved
    if solved.condition > POORER * found.condition:
        raise IdentificationError(
            "without it the motion hardly separates the parameters (condition number "
            f"{solved.condition:.3g}, with it {found.condition:.3g})",
            advice="take more folds, or a longer motion",
        )
    return without_fold(
        found,
        solved.theta,
        covariance=solved.covariance,
        robust_covariance=solved.robust,
        formula_covariance=solved.covariance,
    )


#: Steps of a filter up to which folds are filtered anew: a minute or two each.
MAX_STEPS = 20_000_000


def filters_without(
    problem: Problem, found: Identification, folds: Sequence[Fold]
) -> list[Identification | IdentificationError]:
    """For each fold the estimate without it, or why there is none.

    The noises are those of the whole record; start and estimate know nothing of the fold.

    Args:
        problem: what was estimated.
        found: estimate of the whole record, with its equations.
        folds: what is left out in turn.
    """
    method: Any = found.method_used
    assert found.equations is not None and method is not None
    samples = sum(recording.samples for recording in problem.recordings)
    if method.steps(samples) > MAX_STEPS:
        reason = IdentificationError(
            f"{method.label}: {samples} samples would take too long to be run anew for each fold",
            advice="give a second recording to judge by, or fewer particles",
        )
        return [reason] * len(folds)
    prepared = method.prepare(problem, lambda line: None)
    return of_each(folds, partial(_filtered, problem, found, method, prepared))


def _filtered(
    problem: Problem, found: Identification, method: Any, prepared: Any, fold: Fold
) -> Identification:
    """The estimate from the samples that are left."""
    assert found.equations is not None
    setup, left = prepared.setup, []
    for stretch in prepared.stretches:
        out = np.zeros(problem.recordings[stretch.recording].samples, bool)
        for piece in fold.left_out:
            if piece.recording == stretch.recording:
                out[piece.span] = True
        left += stretch.without(out)
    if method.start == "least-squares":
        numbers = [record.sample_numbers for record in found.equations.records]
        rows = Rows.of(found.equations, rows_left_out(numbers, fold))
        normal = NormalEquations.of(rows.sums(), rows.size)
        size = method.first_spread * np.sqrt(np.diag(normal.inverse))
        setup = replace(setup, theta=normal.solution, covariance=np.diag(size**2))
    filtered = method.run(problem, setup, left)
    return without_fold(
        found,
        filtered.theta,
        covariance=filtered.covariance,
        robust_covariance=filtered.robust,
        formula_covariance=filtered.covariance,
    )


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


def rows_of(
    fit: SimulationFit, recordings: Sequence[Recording], fold: Fold
) -> Iterator[np.ndarray]:
    """Thinned rows of each stretch that see a sample of what a fold leaves out, shape (rows,).

    ``recordings``: of the fit, in its order; each has one stretch or several one after the other.
    """
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
        yield seen


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
