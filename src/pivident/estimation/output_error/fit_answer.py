"""What comes with a fit: covariances, the least determined direction, errors of unit variance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.estimation.covariance.sandwich import Jackknife
from pivident.estimation.covariance.stationary_noise import covariance_by_test
from pivident.estimation.normal_equations import WEAKEST_SHARE
from pivident.estimation.output_error.bounded_step import condition_of
from pivident.estimation.output_error.noise_weights import whitened_errors
from pivident.estimation.output_error.simulation_fit import FitPass, SimulationFit
from pivident.estimation.output_error.stretch import Stretch
from pivident.estimation.output_error.weighted_step import (
    Point,
    WeightedStep,
    WeightedSteps,
    inverse_of_free,
)


def fit_answer(
    steps: WeightedSteps,
    stretches: Sequence[Stretch],
    factors: Sequence[int],
    point: Point,
    solved: WeightedStep,
    history: Sequence[FitPass],
    converged: bool,
) -> SimulationFit:
    """Everything that comes with the estimate.

    ``stretches``: with the loops of ``point``, the last one that was simulated; where the fit has
    settled the step from there, ``solved``, is next to nothing.
    """
    kept = np.flatnonzero(~solved.held & ~solved.bound)
    covariance, by_windows, formula, windows = _covariances(solved, kept)
    condition, share = condition_of(solved.equations.gram[np.ix_(kept, kept)])
    weakest = [int(kept[i]) for i in np.argsort(-share) if share[i] > WEAKEST_SHARE]
    samples = np.array([float(s.samples) for s in stretches])
    squares = np.stack([own.mean_square for own in point.made])
    return SimulationFit(
        unknowns=steps.unknowns,
        values=point.values,
        covariance=covariance,
        window_covariance=by_windows,
        formula_covariance=formula,
        held=solved.held,
        bound=solved.bound,
        converged=converged,
        history=tuple(history),
        condition=condition,
        weakest=tuple(steps.unknowns[i].name for i in weakest),
        noise=solved.noise,
        errors=tuple(own.errors for own in point.made),
        white=_white(point, solved),
        rates=tuple(own.rate for own in point.made),
        rms=np.sqrt(np.tensordot(samples, squares, 1) / samples.sum()),
        stretches=tuple(stretches),
        windows=windows,
        channels=steps.options.channels,
        factors=tuple(factors),
        made=point.made,
    )


def _covariances(
    solved: WeightedStep, kept: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, Jackknife]:
    """The covariance to report, that of the windows, H⁻¹, and the windows.

    That of an unknown at a bound is what it would be if it were free.
    """
    formula = inverse_of_free(solved.equations.gram, ~solved.held & ~solved.bound)
    windows = solved.equations.scores_without(solved.step, kept)
    covariance, by_windows = np.zeros_like(formula), np.zeros_like(formula)
    grid = np.ix_(kept, kept)
    by_windows[grid] = windows.covariance
    covariance[grid] = covariance_by_test(formula[grid], windows)
    free = inverse_of_free(solved.equations.gram, ~solved.held)
    for i in np.flatnonzero(solved.bound):
        formula[i, i] = covariance[i, i] = by_windows[i, i] = free[i, i]
    return covariance, by_windows, formula, windows


def _white(point: Point, solved: WeightedStep) -> tuple[np.ndarray, ...]:
    """A e/√λ of each stretch, NaN where not used."""
    out = []
    for made in point.made:
        white = whitened_errors(made, solved.noise)
        white /= np.sqrt(solved.noise.variance)[:, :, None]
        white[~made.used] = np.nan
        out.append(white)
    return tuple(out)
