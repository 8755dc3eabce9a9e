"""Covariance of a fit whose errors are stationary noise of any colour.

    P = H⁻¹ V H⁻¹,   V the variance of the scores Σ_j Σ_t z_j(t) w_j(t)   (`score_spectra`)

w are the whitened errors over √λ that the fit leaves, z their derivatives, less what the initial
states of a stretch take over (`reduced_equations`). Positions and torques of a joint are
correlated: both have the noise of one encoder.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pivident.estimation.covariance.score_spectra import ScoreSpectra
from pivident.estimation.covariance.stationary_noise import MAX_STRETCH, longest_lag
from pivident.estimation.output_error.noise_weights import whitened_rows
from pivident.estimation.output_error.weighted_step import Point, WeightedStep
from pivident.threads import run_in_threads

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
