"""The literature's estimators of drive gains: weighted and total least squares.

Gautier and Briot ("Global identification of joint drive gains and dynamic parameters of robots",
ASME J. Dyn. Sys. Meas. Control 136, 2014, and IROS 2011) write the model with the commands as
regressors, one column for each motor's gain, and the known payload as the last column:

    [ diag(c)  -Φ  -Φ_unknown ] (κ, x) = Φ_known π_known,       rows weighted by 1/σ_m.

Weighted least squares treats the noise of the commands as signal: gains are too small, by the
fraction of noise in what the known load alone explains. Total least squares (the last right
singular vector of [ columns, right-hand side ]) assumes equal noise in all columns; with noise in
the commands only (mixed total least squares) it is consistent. All follow from the same sums.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.linalg import eigh

from pivident.drives.gain_equations import GainEquations
from pivident.errors import IdentificationError

Estimator = Literal["wls", "tls", "mixed-tls"]


def gains_by(
    estimator: Estimator, equations: GainEquations, kappa: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """κ and its standard errors by the formulas for white residuals, each (motors,).

    ``tls``: all columns are noisy, ``mixed-tls``: the commands are. ``kappa`` weights the rows.
    """
    gram, noise, rows = _gram(equations, kappa)
    n = equations.motors
    if not gram[-1, -1] > 0:
        raise IdentificationError(
            "weighted and total least squares need a known load on the right-hand side",
            advice="give a payload or a trusted parameter",
        )
    if estimator == "wls":
        solution = _least_squares(gram)
        information = gram[:-1, :-1]
    elif estimator == "tls":
        values, vectors = np.linalg.eigh(gram)
        solution = vectors[:-1, 0] / -vectors[-1, 0]
        information = gram[:-1, :-1] - values[0] * np.eye(len(gram) - 1)
    else:
        # min yᵀGy / yᵀCy: 1/µ is the largest eigenvalue of C y = (1/µ) G y
        values, vectors = eigh(noise, gram)
        solution = vectors[:-1, -1] / -vectors[-1, -1]
        information = gram[:-1, :-1] - noise[:-1, :-1] / values[-1]
    error = np.append(solution, -1.0)
    variance = max(float(error @ gram @ error), 0.0) / max(rows - solution.size, 1)
    scale = np.sqrt(np.maximum(np.abs(np.diag(information)), 1e-300))
    inverse = np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-15, hermitian=True)
    spread = np.abs(np.diag(inverse)) / scale**2
    return solution[:n], np.sqrt(variance * spread[:n])


def homogeneous_start(equations: GainEquations) -> np.ndarray:
    """Gains log |κ| up to a scale, without a known load: mixed TLS on [diag(c), -Φ].

    The command of each motor has unit power, so that no motor is favoured.
    """
    n = equations.motors
    gram, _, _ = _gram(equations, np.ones(n), equally=True)
    left = gram[:-1, :-1]
    schur = (
        left[:n, :n] - left[:n, n:] @ np.linalg.pinv(left[n:, n:], hermitian=True) @ left[n:, :n]
    )
    power = np.diag(left)[:n]
    _, vectors = eigh(schur, np.diag(power))
    # in units of each command's own power no gain is far from the others
    relative = np.abs(vectors[:, 0]) * np.sqrt(power)
    relative = np.maximum(relative, 0.05 * relative.max())
    return np.log(relative / np.sqrt(power))


def _gram(
    equations: GainEquations, kappa: np.ndarray, equally: bool = False
) -> tuple[np.ndarray, np.ndarray, int]:
    """Gram matrix of [diag(c), -ΦM, Φb], that of the commands' noise, and the number of rows."""
    n = equations.motors
    size = n + equations.unknowns + 1
    gram, noise, rows = np.zeros((size, size)), np.zeros((size, size)), 0
    for g, m, own, M, b in equations.rows():
        weight = 1.0 / (1.0 if equally else kappa[m] ** 2 * equations.variances[g, m])
        right = np.column_stack([-M, b])
        gram[m, m] += weight * own.tt
        gram[m, n:] += weight * own.ft @ right
        gram[n:, n:] += weight * right.T @ own.ff @ right
        noise[m, m] += own.rows / kappa[m] ** 2
        rows += own.rows
    gram[n:, :n] = gram[:n, n:].T
    return gram, noise, rows


def _least_squares(gram: np.ndarray) -> np.ndarray:
    """Solution of the normal equations inside a Gram matrix with the right-hand side last."""
    scale = np.sqrt(np.maximum(np.diag(gram)[:-1], 1e-300))
    scaled = gram[:-1, :-1] / np.outer(scale, scale)
    return np.linalg.lstsq(scaled, gram[:-1, -1] / scale, rcond=1e-14)[0] / scale
