"""Covariance of a fit whose errors are stationary noise of any colour.

    P = H⁻¹ V H⁻¹,   V the variance of the scores Σ_j Σ_t z_j(t) w_j(t)   (`score_spectra`)

w are the whitened errors over √λ that the fit leaves, z their derivatives, less what the initial
states of a stretch take over (`reduced_equations`). Positions and torques of a joint are
correlated: both have the noise of one encoder.
"""

from __future__ import annotations

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
            z, noise, used = _series(point, solved, s, j, kept, robust)
            for first in range(0, used.shape[1], longest):
                span = slice(first, first + longest)
                spectra.add(z[:, :, span], noise[:, span], used[:, span])
        scores[j] = spectra.variance_of_scores()

    run_in_threads(work, range(joints))
    return metric @ sum(scores) @ metric.T


def _series(
    point: Point, solved: WeightedStep, s: int, j: int, kept: np.ndarray, robust: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """z, w and the rows in use of stretch s and joint j, channels first; zero where not used."""
    made, equations = point.made[s], solved.equations.stretches[s]
    step = np.concatenate([solved.step, equations.start_step(solved.step)])
    p = equations.unknowns
    z, noise = [], []
    for c in range(len(made.errors)):
        rows = whitened_rows(made, solved.noise, c, j, robust)
        rows *= made.used[c, j] / np.sqrt(solved.noise.variance[c, j])
        columns, error = rows[:-1], rows[-1]
        noise.append(error - step @ columns)
        if len(columns) > p:
            columns = columns[:p] - equations.elimination.T @ columns[p:]
        z.append(columns[kept])
    return np.stack(z), np.stack(noise), made.used[:, j].astype(float)
