"""What comes with a fit: covariances, the least determined direction, errors of unit variance.

Where the errors are stationary noise of any colour, the covariance is

    P = H⁻¹ V H⁻¹,   V the variance of the scores Σ_j Σ_t z_j(t) w_j(t)   (`ScoreSpectra`)

w are the whitened errors over √λ that the fit leaves, z their derivatives, less what the initial
states of a stretch take over (`reduced_equations`). Positions and torques of a joint are
correlated: both have the noise of one encoder.

The errors of a long open-loop run are not stationary: they add up what the model lacks, which
repeats with the motion. There the covariance is that of the jackknife over K kinds of moves,

    P = (K - 1)/K Σ_k (p₍ₖ₎ - p̄)(p₍ₖ₎ - p̄)ᵀ

p₍ₖ₎ is one step from the estimate, without the moves of kind k: the record falls into pieces, each
of which begins at its measured state.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pivident.dynamics.separation import WEAKEST_SHARE
from pivident.estimation.covariance.sandwich import Jackknife
from pivident.estimation.covariance.stationary_noise import (
    MAX_STRETCH,
    ScoreSpectra,
    covariance_by_test,
    longest_lag,
)
from pivident.estimation.output_error.noise_weights import whitened_errors, whitened_rows
from pivident.estimation.output_error.record_stretches import (
    Stretch,
    kinds_of_moves,
    without_moves,
)
from pivident.estimation.output_error.reduced_equations import condition_of
from pivident.estimation.output_error.simulated_errors import simulated_errors
from pivident.estimation.output_error.simulation_fit import (
    FitOptions,
    FitPass,
    SimulationFit,
)
from pivident.estimation.output_error.weighted_step import (
    Point,
    WeightedStep,
    WeightedSteps,
    inverse_of_free,
)
from pivident.foundation.threads import run_in_threads

#: Fewest kinds of moves that a covariance is made of, and share of another variance that is
#: rounding.
LEAST_KINDS, ROUNDED = 4, 1e-12

#: Fewest lags of the covariances, for short records: means of four rows overlap.
LEAST_LAGS = 12


def stationary_covariance(
    point: Point, solved: WeightedStep, kept: np.ndarray, metric: np.ndarray, robust: bool
) -> np.ndarray:
    """P of the unknowns ``kept``, shape (kept, kept).

    ``metric``: H⁻¹ of them; ``robust``: Huber's loss.
    """
    joints, channels = point.made[0].errors.shape[1], point.made[0].errors.shape[0]
    longest = min(max(own.errors.shape[2] for own in point.made), MAX_STRETCH)
    lags = longest_lag(point.made[0].rate, longest, LEAST_LAGS)
    scores = [np.zeros_like(metric) for _ in range(joints)]

    def work(j: int) -> None:
        spectra = ScoreSpectra(metric, longest, lags, channels)
        for s in range(len(point.made)):
            for z, noise, used in _series(point, solved, s, j, kept, robust, longest):
                spectra.add(z, noise, used)
        scores[j] = spectra.variance_of_scores()

    run_in_threads(work, range(joints))
    return metric @ sum(scores) @ metric.T


def _series(
    point: Point, solved: WeightedStep, s: int, j: int, kept: np.ndarray, robust: bool, longest: int
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """z, w and the rows in use of stretch s and joint j, channels first; zero where not used.

    ``longest``: rows that come at a time, whole blocks of J.
    """
    made, equations = point.made[s], solved.equations.stretches[s]
    step = np.concatenate([solved.step, equations.start_step(solved.step)])
    p, (channels, _, samples) = equations.unknowns, made.errors.shape
    eliminated = equations.elimination if made.columns.count > p else None
    streams = [whitened_rows(made, solved.noise, c, j, robust) for c in range(channels)]
    for first in range(0, samples, longest):
        length = min(longest, samples - first)
        z, noise = np.empty((channels, len(kept), length)), np.empty((channels, length))
        for c, stream in enumerate(streams):
            done = 0
            while done < length:
                span, rows = next(stream)
                rows = rows * (made.used[c, j, span] / np.sqrt(solved.noise.variance[c, j]))
                columns, error = rows[:-1], rows[-1]
                place = slice(done, done + len(error))
                noise[c, place] = error - step @ columns
                if eliminated is not None:
                    columns = columns[:p] - eliminated.T @ columns[p:]
                z[c, :, place] = columns[kept]
                done = place.stop
        yield z, noise, made.used[:, j, first : first + length].astype(float)


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
    if steps.options.covariance == "auto" and any(own.is_long_run for own in stretches):
        robust = covariance_over_moves(steps, stretches, factors, point.values, robust)
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
        white=tuple(_white(point, solved)),
        rates=tuple(own.rate for own in point.made),
        rms=np.sqrt(np.tensordot(samples, squares, 1) / samples.sum()),
        stretches=tuple(stretches),
        windows=windows,
        channels=steps.options.channels,
        factors=tuple(factors),
        made=point.made,
    )


def covariance_over_moves(
    steps: WeightedSteps,
    stretches: Sequence[Stretch],
    factors: Sequence[int],
    values: np.ndarray,
    other: np.ndarray,
) -> np.ndarray:
    """P of the jackknife over kinds of moves, shape (unknowns, unknowns).

    ``other``: what holds for unknowns that no step moves, and where there are too few kinds. Kinds
    that are no more than the unknowns give variances, and ``other`` the correlations.
    """
    kinds = kinds_of_moves(stretches)
    if len(kinds) < LEAST_KINDS:
        return other
    options = replace(steps.options, undetermined="hold")
    factor_at = {own.rate: factor for own, factor in zip(stretches, factors, strict=True)}
    found = []
    for kind in kinds:
        pieces = without_moves(stretches, kind)
        own = WeightedSteps(tuple(pieces), steps.unknowns, options)
        own.held = steps.held
        thinned = [factor_at[s.rate] for s in pieces]
        made = simulated_errors(pieces, steps.unknowns, options.channels, thinned)
        starts = [np.zeros(0 if s.start_std is None else s.start_std.size) for s in pieces]
        found.append(own.solved(Point(values, tuple(starts), tuple(made)), None, True).step)
    apart = np.array(found) - np.mean(found, axis=0)
    covariance = (1.0 - 1.0 / len(found)) * apart.T @ apart
    still = np.diag(covariance) <= ROUNDED * np.diag(other)
    if len(kinds) > np.count_nonzero(~still):
        covariance[np.ix_(still, still)] = other[np.ix_(still, still)]
        return covariance
    variance = np.where(still, np.diag(other), np.diag(covariance))
    wider = np.sqrt(variance / np.maximum(np.diag(other), 1e-300))
    return other * np.outer(wider, wider)


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


def _white(point: Point, solved: WeightedStep) -> Iterator[np.ndarray]:
    """A e/√λ of each stretch, NaN where not used."""
    for made in point.made:
        white = whitened_errors(made, solved.noise)
        white /= np.sqrt(solved.noise.variance)[:, :, None]
        white[~made.used] = np.nan
        yield white
