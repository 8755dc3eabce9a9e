"""The bilinear model of gains and parameters, and its estimators: ours and the literature's.

With ℓ_m = log |κ_m| and signs s_m, the command of motor m under load g is

    c_m = ν_m Φ_m θ_g + e_m,     ν_m = s_m exp(-ℓ_m),     θ_g = M_g x + b_g,

x all linear unknowns (base parameters, friction under load, unknown parts of the payload), b_g the
known part (payload, trusted parameters). The error e_m belongs to the command and stays on its side
of the equation. In the form κ_m c_m = Φ_m θ_g commands become regressors, and least squares makes
every gain too small.

Given ℓ the model is linear in x, so that least squares searches in as many dimensions as there are
motors (variable projection; Golub and Pereyra 1973, Kaufman 1975). Instrumental variables solve

    Σ_m Pᵀ Z_mᵀ (c_m - ν_m Φ_m θ_g) / σ²_m = 0,     P = ∂(ν_m θ_g)/∂(ℓ, x),

which with Z = Φ is the same point. A prior on ℓ, five units wide, keeps undetermined scales finite;
it is negligible against the information of any row.

The literature's estimators of drive gains: weighted and total least squares.

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

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import eigh

from pivident.estimation.covariance.sandwich import sandwich
from pivident.estimation.normal_equations import JointSums
from pivident.foundation.errors import IdentificationError

#: Standard deviation of the prior on log gains: a factor of 150 either way.
PRIOR_STD = 5.0
#: Longest step in log gains.
MAX_STEP = 1.0
#: Iterations of the search, and the largest last step at convergence, in standard errors.
MAX_STEPS, SETTLED = 100, 1e-4
Estimator = Literal["wls", "tls", "mixed-tls"]


@dataclass(frozen=True, eq=False)
class GainEquations:
    """Sums, known and unknown parts of the bilinear model."""

    sums: Sequence[Sequence[JointSums]]  # sums[load][motor], see drive_sums
    maps: Sequence[np.ndarray]  # M_g of each load, (parameters, unknowns)
    offsets: Sequence[np.ndarray]  # b_g of each load, (parameters,)
    signs: np.ndarray  # s_m, (motors,)
    variances: np.ndarray  # σ² of each row, (loads, motors) [squared unit of the log]
    centre: np.ndarray  # mean of the prior on ℓ, (motors,)
    trusted: np.ndarray  # standard deviation of ℓ of trusted gains, inf elsewhere, (motors,)

    @property
    def motors(self) -> int:
        """Number of motors."""
        return len(self.signs)

    @property
    def unknowns(self) -> int:
        """Number of linear unknowns."""
        return self.maps[0].shape[1]

    @property
    def prior(self) -> np.ndarray:
        """Precision of ℓ before any row, shape (motors,)."""
        return np.minimum(PRIOR_STD, self.trusted) ** -2.0

    def rows(self) -> Iterator[tuple[int, int, JointSums, np.ndarray, np.ndarray]]:
        """Load, motor, sums, map on its columns and known part of every row."""
        for g, loaded in enumerate(self.sums):
            for m, own in enumerate(loaded):
                if own.rows:
                    yield g, m, own, self.maps[g][own.columns], self.offsets[g][own.columns]

    def rate(self, ell: np.ndarray) -> np.ndarray:
        """ν = s exp(-ℓ), shape (motors,)."""
        return self.signs * np.exp(-ell)


def linear_part(equations: GainEquations, ell: np.ndarray) -> tuple[np.ndarray, float]:
    """Least-squares x for given gains, and the cost that remains, prior included."""
    nu = equations.rate(ell)
    gram = np.zeros((equations.unknowns, equations.unknowns))
    right = np.zeros(equations.unknowns)
    for g, m, own, M, b in equations.rows():
        weight = 1.0 / equations.variances[g, m]
        gram += weight * nu[m] ** 2 * M.T @ own.ff @ M
        right += weight * nu[m] * M.T @ (own.ft - nu[m] * own.ff @ b)
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    x = np.linalg.lstsq(gram / np.outer(scale, scale), right / scale, rcond=1e-13)[0] / scale
    return x, cost(equations, ell, x)


def cost(equations: GainEquations, ell: np.ndarray, x: np.ndarray) -> float:
    """Σ ‖c - νΦθ‖²/σ² and the prior's part."""
    nu = equations.rate(ell)
    total = float(np.sum(equations.prior * (ell - equations.centre) ** 2))
    for g, m, own, M, b in equations.rows():
        total += residual_sum(own, nu[m] * (M @ x + b)) / equations.variances[g, m]
    return total


def residual_sum(own: JointSums, coefficients: np.ndarray) -> float:
    """‖c - Φ_m a‖² of one row for coefficients a on its columns."""
    left = own.tt - 2.0 * coefficients @ own.ft + coefficients @ own.ff @ coefficients
    return max(float(left), 0.0)


def instrumented(
    equations: GainEquations, ell: np.ndarray, x: np.ndarray, by_window: bool = False
) -> list[JointSums]:
    """Linearised equations in the steps of (ℓ, x), as sums.

    With P = ∂(νθ)/∂(ℓ, x) on a row's columns, the step Δ obeys PᵀZᵀΦP Δ = PᵀZᵀ(c - νΦθ). The prior
    comes last, as an additional row. ``by_window``: with the sums of each window of time.
    """
    n, size = equations.motors, equations.motors + equations.unknowns
    windows = len(equations.sums[0][0].window_zf) if by_window else 0
    nu, everything = equations.rate(ell), np.arange(size)
    made = []
    for g, m, own, M, b in equations.rows():
        theta = M @ x + b
        P = np.zeros((own.columns.size, size))
        P[:, m] = -nu[m] * theta
        P[:, n:] = nu[m] * M
        P /= np.sqrt(equations.variances[g, m])
        error = (own.zt - nu[m] * own.zf @ theta) / np.sqrt(equations.variances[g, m])
        window_zf = own.window_zf[:windows]
        window_error = own.window_zt[:windows] - nu[m] * window_zf @ theta
        window_error /= np.sqrt(equations.variances[g, m])
        zf = P.T @ own.zf @ P
        made.append(
            JointSums(
                own.name, everything, zf, P.T @ own.zz @ P, P.T @ own.ff @ P,
                P.T @ error, P.T @ error, P.T @ window_zf @ P, window_error @ P,
                residual_sum(own, nu[m] * theta) / equations.variances[g, m], own.rows,
            )
        )  # fmt: skip
    prior, no_scores = np.zeros((size, size)), np.zeros((windows, size))
    prior[:n, :n] = np.diag(equations.prior)
    pull = prior[:, :n] @ (equations.centre - ell)
    made.append(
        JointSums(
            "prior", everything, prior, prior, prior, pull, pull,
            np.broadcast_to(prior / max(windows, 1), (windows, size, size)), no_scores,
        )
    )  # fmt: skip
    return made


def least_squares(equations: GainEquations, ell: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Variable projection by Levenberg–Marquardt steps in the log gains."""
    n, damping = equations.motors, 1e-3
    x, least = linear_part(equations, ell)
    for _ in range(MAX_STEPS):
        steps = instrumented(equations, ell, x)
        hessian = _added([s.ff for s in steps])
        reduced = hessian[:n, :n] - hessian[:n, n:] @ _solve(hessian[n:, n:], hessian[n:, :n])
        gradient = _added([s.ft for s in steps])[:n]
        while damping < 1e12:
            step = np.linalg.solve(reduced + damping * np.diag(np.diag(reduced)), gradient)
            step *= min(1.0, MAX_STEP / max(np.abs(step).max(), 1e-300))
            tried, value = linear_part(equations, ell + step)
            if value <= least:
                break
            damping *= 10.0
        else:
            break
        ell, x, gained, least = ell + step, tried, least - value, value
        damping = max(damping / 10.0, 1e-12)
        if gained < SETTLED**2:
            break
    return ell, x


def instrumental_variables(
    equations: GainEquations, ell: np.ndarray, x: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Newton's iteration on the equations with instruments, from a nearby point."""
    n = equations.motors
    for _ in range(MAX_STEPS):
        steps = instrumented(equations, ell, x)
        jacobian = _added([s.zf for s in steps])
        error = _added([s.zt for s in steps])
        step = _solve(jacobian, error)
        step *= min(1.0, MAX_STEP / max(np.abs(step[:n]).max(), 1e-300))
        ell, x = ell + step[:n], x + step[n:]
        if abs(step @ error) < SETTLED**2:
            return ell, x
    raise IdentificationError(
        "the gains do not converge with these instruments",
        advice="check the controller's gains and units, or leave [controller] out to estimate "
        "without simulated instruments",
    )


def covariance(equations: GainEquations, ell: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Covariance of (ℓ, x): the sandwich over windows of time, and the prior where it is alone.

    The sandwich is valid for residuals that are correlated in time and heteroscedastic.
    """
    steps = instrumented(equations, ell, x, by_window=True)
    robust = sandwich(steps, np.zeros(ell.size + x.size), np.ones(len(steps)))
    total, prior = _added([s.zf for s in steps]), steps[-1].zf
    return robust + _solve(total, _solve(total, prior).T)


def sensitivity(
    equations: GainEquations,
    ell: np.ndarray,
    x: np.ndarray,
    directions: Sequence[np.ndarray],
) -> np.ndarray:
    """Derivative of (ℓ, x) with respect to a known number η, from ∂b_g/∂η of each load."""
    n, nu = equations.motors, equations.rate(ell)
    right = np.zeros(n + equations.unknowns)
    for g, m, own, M, b in equations.rows():
        P = np.zeros((own.columns.size, right.size))
        P[:, m] = -nu[m] * (M @ x + b)
        P[:, n:] = nu[m] * M
        change = nu[m] * own.zf @ directions[g][own.columns]
        right -= P.T @ change / equations.variances[g, m]
    return _solve(_added([s.zf for s in instrumented(equations, ell, x)]), right)


def _added(parts: Sequence[np.ndarray]) -> np.ndarray:
    """Sum over rows and prior."""
    return np.sum(np.stack(parts), axis=0)


def _solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solution with columns of unit length, least squares where directions are missing."""
    scale = np.sqrt(np.maximum(np.abs(np.diag(matrix)), 1e-300))
    scaled = matrix / np.outer(scale, scale)
    if right.ndim == 1:
        return np.linalg.lstsq(scaled, right / scale, rcond=1e-14)[0] / scale
    return np.linalg.lstsq(scaled, right / scale[:, None], rcond=1e-14)[0] / scale[:, None]


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
