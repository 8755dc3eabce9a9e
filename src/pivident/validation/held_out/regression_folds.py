"""Estimates without a block of the motion, of regressions and filters: from what is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from pivident.errors import IdentificationError
from pivident.estimation.filter_methods import Particles, StateFilter
from pivident.estimation.filters.identify_filter import Prepared, prepared, run_filter
from pivident.estimation.identification import Identification
from pivident.estimation.methods import FrequencyDomain, LeastSquares, Method, Regression
from pivident.estimation.problem import Problem
from pivident.estimation.regression.identify_regression import solved_rows
from pivident.estimation.regression.rows import NormalEquations, Rows
from pivident.validation.held_out.fold_estimates import POORER, of_each, without_fold
from pivident.validation.held_out.folds import Fold


def needs_rows(method: Method | None) -> bool:
    """Whether a method is solved from rows, not from sums of them."""
    summed = (LeastSquares, FrequencyDomain)
    return isinstance(method, Regression) and not isinstance(method, summed)


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
    assert equations is not None and isinstance(method, Regression)
    samples = [record.sample_numbers for record in equations.records]

    def without(fold: Fold) -> Identification:
        rows = Rows.of(equations, rows_left_out(samples, fold))
        return _solved(problem, found, method, rows)

    return of_each(folds, without)


def rows_left_out(samples: Sequence[np.ndarray], fold: Fold) -> np.ndarray:
    """Rows that a fold leaves out, those of all recordings one after the other."""
    out = [np.zeros(len(own), bool) for own in samples]
    for piece in fold.left_out:
        own = samples[piece.recording]
        out[piece.recording] |= (own >= piece.start - 0.5) & (own < piece.stop - 0.5)
    return np.concatenate(out)


def _solved(
    problem: Problem, found: Identification, method: Regression, rows: Rows
) -> Identification:
    """The estimate from the rows that are left."""
    solved = solved_rows(problem, method, rows, found.theta).solved
    if solved.condition > POORER * found.condition:
        raise IdentificationError(
            f"without it the motion hardly separates the parameters (condition number "
            f"{solved.condition:.3g}, with it {found.condition:.3g}); take more folds, or a longer "
            "motion"
        )
    return without_fold(
        found,
        solved.theta,
        covariance=solved.covariance,
        robust_covariance=solved.robust,
        formula_covariance=solved.covariance,
    )


#: Particles times samples up to which folds are filtered anew: a minute or two each.
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
    method = found.method_used
    assert found.equations is not None and isinstance(method, StateFilter)
    samples = sum(recording.samples for recording in problem.recordings)
    if isinstance(method, Particles) and method.particles * samples > MAX_STEPS:
        reason = IdentificationError(
            f"{method.particles} particles on {samples} samples take too long to be filtered anew "
            "for each fold; give a second recording to judge by, or fewer particles"
        )
        return [reason] * len(folds)
    known = prepared(problem, method, lambda line: None)
    return of_each(folds, partial(_filtered, problem, found, method, known))


def _filtered(
    problem: Problem, found: Identification, method: StateFilter, known: Prepared, fold: Fold
) -> Identification:
    """The estimate from the samples that are left."""
    assert found.equations is not None
    setup, left = known.setup, []
    for stretch in known.stretches:
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
    filtered = run_filter(problem, method, setup, left)
    return without_fold(
        found,
        filtered.theta,
        covariance=filtered.covariance,
        robust_covariance=filtered.robust,
        formula_covariance=filtered.covariance,
    )
