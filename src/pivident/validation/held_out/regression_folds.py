"""Estimates of regressions without a block of the motion: from the rows that are left."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.errors import IdentificationError
from pivident.estimation.identification import Identification
from pivident.estimation.methods import FrequencyDomain, LeastSquares, Method, Regression
from pivident.estimation.problem import Problem
from pivident.estimation.regression.identify_regression import solved_rows
from pivident.estimation.regression.rows import Rows
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
