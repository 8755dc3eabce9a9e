"""Smallest possible standard errors: the bound (P-23) at the true model and noise.

The equation of joint j is τ_j = φ_j θ + ε_j. The torque contains the noise v of its sensor and the
encoder noise n that the control law feeds back (P-26),

    ε_j = v_j - g_j C_j(z) n_j,      S_j(ω) = σ_v² + g_j² |C_j|² (σ_n² + σ_c² |1/D|² / Σ|1/D|²)

with C the law without its integrator and 1/D the AR(2) filter of coloured noise. With L_j the
filter that whitens S_j, the covariance of any unbiased estimator that knows the noise-free motion
and S is at least

    P = (Σ_j (L_j φ_j)ᵀ (L_j φ_j))⁻¹                                                        (P-23)

(P-26) neglects that the loop suppresses encoder noise inside its bandwidth. Without noise of a
torque sensor, as in the scenario *loop*, an estimator may do better than this bound. It does not
include rounding to counts, nor encoder noise on the record only, which does not affect the torque.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_toeplitz, solve_triangular, toeplitz

from pivident.loop.motion.motion import central_differences
from pivident.loop.simulation.controllers import inverse_controller
from pivident.studies.many.study.bench import Bench

#: Order of the autoregression that whitens the noise, and points of its spectrum.
ORDER, POINTS = 400, 2**15

#: Samples at both ends whose central differences are not used.
ENDS = 2


@dataclass(frozen=True, eq=False)
class Bounds:
    """Smallest standard errors of the estimated parameters, shape (parameters,)."""

    # by (P-23), from torque sensor and encoder noise; None without either
    equation: np.ndarray | None
    # from the noise of the torque sensor alone; None without it
    torque_sensor: np.ndarray | None


def efficiency_bounds(bench: Bench) -> Bounds:
    """Bounds of a scenario's estimates; none where the records move in several ways."""
    if len(bench.scenario.content.trajectory.seeds) > 1:
        return Bounds(None, None)
    noise, entry, n = bench.noise, bench.scenario.content.record, bench.scenario.robot.size
    q = bench.noise_free.q[:: entry.step]
    dq, ddq = central_differences(q, entry.rate)
    inside = slice(ENDS, len(q) - ENDS)
    motion = (q[inside].T, dq[inside].T, ddq[inside].T)
    inner = bench.regressor.inner(*motion, bench.expected)
    packed = bench.regressor.packed(*motion, inner=inner)
    sensor = np.broadcast_to(np.asarray(noise.torque, float), (n,)) ** 2
    equation = sensor[:, None] * (np.arange(ORDER + 1) == 0) + loop_noise(bench)
    return Bounds(
        _standard_errors(bench, packed, equation) if (equation[:, 0] > 0).all() else None,
        _standard_errors(bench, packed, sensor[:, None]) if (sensor > 0).all() else None,
    )


def loop_noise(bench: Bench) -> np.ndarray:
    """Autocovariance of the encoder noise in the recorded torque, shape (joints, ORDER + 1).

    It is computed at the control rate of the law, and taken at the samples of the record.
    """
    noise, entry, n = bench.noise, bench.scenario.content.record, bench.scenario.robot.size
    if noise.where == "record":
        return np.zeros((n, ORDER + 1))
    pole, feedback = inverse_controller(bench.controller, entry.law_rate, n)
    gain = np.broadcast_to(np.asarray(bench.loop.drive_gain, float), (n,))
    white = np.broadcast_to(np.asarray(noise.encoder, float), (n,)) ** 2
    coloured = np.broadcast_to(np.asarray(noise.coloured, float), (n,)) ** 2
    points = POINTS * entry.step
    peak = 1.0 / np.abs(np.fft.rfft(noise.denominator, points)) ** 2 / noise.gain**2
    law = np.fft.rfft(feedback, points, axis=1) / np.fft.rfft(pole, points, axis=1)
    spectrum = (gain[:, None] * np.abs(law)) ** 2 * (white[:, None] + coloured[:, None] * peak)
    covariance = np.fft.irfft(spectrum, points, axis=1)
    return covariance[:, : (ORDER + 1) * entry.step : entry.step]


def whitened(columns: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Columns through the filter that makes noise of a given autocovariance white.

    Exact for the first samples, by the inverse of a Cholesky factor; an autoregression for the
    others.
    """
    from scipy.signal import oaconvolve

    order = covariance.size - 1
    if order == 0:
        return columns / np.sqrt(covariance[0])
    ar = np.concatenate([[1.0], -solve_toeplitz(covariance[:-1], covariance[1:])])
    variance = float(ar @ covariance)
    out = oaconvolve(columns, ar[None, :], axes=1)[:, : columns.shape[1]] / np.sqrt(variance)
    start = min(order, columns.shape[1])
    lower = cholesky(toeplitz(covariance[:start]), lower=True)
    out[:, :start] = solve_triangular(lower, columns[:, :start].T, lower=True).T
    return out


def _standard_errors(bench: Bench, packed: np.ndarray, covariance: np.ndarray) -> np.ndarray | None:
    """Standard errors from Σ (Lφ)ᵀ(Lφ); None where the motion does not excite all parameters.

    ``packed`` are the non-zero entries of the regressor, (entries, samples).
    """
    regressor = bench.regressor
    information = np.zeros((len(regressor.parameters),) * 2)
    for j in range(bench.scenario.robot.size):
        own = slice(regressor.offsets[j], regressor.offsets[j + 1])
        columns = whitened(packed[own], covariance[j])
        grid = np.ix_(regressor.columns_of(j), regressor.columns_of(j))
        information[grid] += columns @ columns.T
    scale = np.sqrt(np.diag(information))
    if not (scale > 0).all():
        return None
    try:
        inverse = np.linalg.inv(information / np.outer(scale, scale))
    except np.linalg.LinAlgError:
        return None
    return np.sqrt(np.diag(inverse)) / scale
