"""What comes with a fit: covariances, the least determined direction, errors of unit variance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.dynamics.separation import WEAKEST_SHARE
from pivident.estimation.covariance.sandwich import Jackknife
from pivident.estimation.covariance.stationary_noise import covariance_by_test
from pivident.estimation.output_error.bounded_step import condition_of
from pivident.estimation.output_error.noise_weights import whitened_errors
from pivident.estimation.output_error.simulation_fit import (
    FitOptions,
    FitPass,
    SimulationFit,
)
from pivident.estimation.output_error.stationary_errors import stationary_covariance
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
    robust, formula, windows = _covariances(point, solved, kept, steps.options)
    condition, share = condition_of(solved.equations.gram[np.ix_(kept, kept)])
    weakest = [int(kept[i]) for i in np.argsort(-share) if share[i] > WEAKEST_SHARE]
    samples = np.array([float(s.samples) for s in stretches])
    squares = np.stack([own.mean_square for own in point.made])
    return SimulationFit(
        unknowns=steps.unknowns,
        values=point.values,
        covariance=formula if steps.options.covariance == "formula" else robust,
        robust_covariance=robust,
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
    point: Point, solved: WeightedStep, kept: np.ndarray, options: FitOptions
) -> tuple[np.ndarray, np.ndarray, Jackknife]:
    """The covariance that holds for errors that are not white, H⁻¹, and the windows.

    That of an unknown at a bound is what it would be if it were free.
    """
    formula = inverse_of_free(solved.equations.gram, ~solved.held & ~solved.bound)
    windows = solved.equations.scores_without(solved.step, kept)
    grid, robust = np.ix_(kept, kept), np.zeros_like(formula)
    if options.covariance == "sandwich":
        robust[grid] = windows.covariance
    else:
        own = stationary_covariance(point, solved, kept, formula[grid], options.robust)
        by_test = options.covariance != "stationary"
        robust[grid] = covariance_by_test(own, windows) if by_test else own
    free = inverse_of_free(solved.equations.gram, ~solved.held)
    for i in np.flatnonzero(solved.bound):
        formula[i, i] = robust[i, i] = free[i, i]
    return robust, formula, windows


def _white(point: Point, solved: WeightedStep) -> tuple[np.ndarray, ...]:
    """A e/√λ of each stretch, NaN where not used."""
    out = []
    for made in point.made:
        white = whitened_errors(made, solved.noise)
        white /= np.sqrt(solved.noise.variance)[:, :, None]
        white[~made.used] = np.nan
        out.append(white)
    return tuple(out)
