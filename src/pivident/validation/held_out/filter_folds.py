"""Estimates of filters without a block of the motion: the filter goes through what is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from pivident.errors import IdentificationError
from pivident.estimation.filter_methods import Particles, StateFilter
from pivident.estimation.filters.filter_run import run_filter
from pivident.estimation.filters.identify_filter import Prepared, prepared
from pivident.estimation.identification import Identification
from pivident.estimation.problem import Problem
from pivident.estimation.regression.rows import NormalEquations, Rows
from pivident.validation.held_out.fold_estimates import of_each, without_fold
from pivident.validation.held_out.folds import Fold
from pivident.validation.held_out.regression_folds import rows_left_out

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
