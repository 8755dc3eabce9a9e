"""Two networks that solve least squares by a differential equation, as the literature tried them.

Adaptive linear neuron (ADALINE; Widrow and Hoff 1960), row by row,

    θ ← θ + μ φ (τ - φᵀθ)

for columns of unit mean square. It stays in motion: for rows that are independent of each other its
estimate scatters around the solution with (μ/2) σ² in each direction (Widrow et al. 1976), far more
than least squares, and directions of small eigenvalue ν of the mean φφᵀ need 1/(μ ν) rows.

Hopfield and Tank's network (1985), with neurons θ = β tanh(u/β), follows

    du/dt = -∂/∂θ ½ ‖τ - Φθ‖² = Φᵀτ - ΦᵀΦ θ

to the least squares solution θ*, if β is beyond it and time suffices. It is solved in θ/β and as
ΦᵀΦ (θ* - θ), whose rounding errors vanish with the distance: those of the difference above would
keep the steps of the solver short for ever. Neither knows anything that least squares does not;
they are here to be compared with it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pivident.estimation.regression.rows import NormalEquations, Rows, Solved, windows_covariance

#: Time constants of the slowest direction after which a network has arrived.
ARRIVED = 4.0

#: Most steps of the differential equation; some hundreds are usual.
MAX_STEPS = 20_000


def solve_adaline(rows: Rows, start: np.ndarray, rate: float, epochs: int) -> Solved:
    """The estimate of an adaptive linear neuron.

    Args:
        rows: the equations.
        start: first weights, shape (parameters,).
        rate: μ, of the largest for which the mean converges.
        epochs: how often all rows are gone through.
    """
    sums = rows.sums()
    equations = NormalEquations.of(sums, rows.size)
    values = np.linalg.eigvalsh(equations.gram)
    scale = equations.scale / np.sqrt(rows.count)
    # of a mean φφᵀ with eigenvalues ν, and rows of squared length p
    step = rate / rows.size
    stacked = _in_order(rows, scale)
    theta, passes = start * scale, []
    for _ in range(epochs):
        _epoch(*stacked, step, theta)
        passes.append(theta / scale)
    found = passes[-1]
    scatter = 0.5 * step * _variance(rows, found) * np.diag(1.0 / scale**2)
    least = equations.inverse * _variance(rows, found)
    robust = windows_covariance(sums, found) + scatter
    arrived = step * values[0] * rows.count * epochs >= ARRIVED
    return Solved(
        found, scatter + least, robust, equations.condition, np.array(passes), bool(arrived)
    )


def solve_hopfield(rows: Rows, start: np.ndarray, reach: float, time: float) -> Solved:
    """The estimate of Hopfield and Tank's network.

    Args:
        rows: the equations.
        start: θ at time zero, shape (parameters,).
        reach: β over the largest parameter of least squares, in columns of unit length.
        time: how long the network runs, in time constants of its fastest direction.
    """
    from scipy.integrate import BDF

    sums = rows.sums()
    equations = NormalEquations.of(sums, rows.size)
    values = np.linalg.eigvalsh(equations.gram)
    size = reach * np.abs(equations.solution * equations.scale).max()
    goal = equations.solution * equations.scale / size
    first = np.clip(start * equations.scale / size, -0.99, 0.99)
    rates = equations.gram / values[-1]

    def slope(_: float, u: np.ndarray) -> np.ndarray:
        return rates @ (goal - np.tanh(u))

    def slopes(_: float, u: np.ndarray) -> np.ndarray:
        return -rates / np.cosh(u) ** 2

    solver = BDF(slope, 0.0, np.arctanh(first), time, jac=slopes, rtol=1e-8, atol=1e-11)
    outputs = [first]
    while solver.status == "running" and len(outputs) <= MAX_STEPS:
        solver.step()
        outputs.append(np.tanh(solver.y))
    thetas = size * np.array(outputs) / equations.scale
    theta = thetas[-1]
    covariance = equations.inverse * _variance(rows, theta)
    robust = windows_covariance(sums, theta)
    left = size * np.abs(goal - outputs[-1])
    arrived = (left <= 0.1 * np.sqrt(np.diag(np.linalg.inv(equations.gram)))).all()
    return Solved(theta, covariance, robust, equations.condition, thetas, bool(arrived))


def _variance(rows: Rows, theta: np.ndarray) -> float:
    """Mean square of the weighted errors: one where θ is as good as least squares."""
    return float((rows.residuals(theta) ** 2).sum() / max(rows.count - rows.size, 1))


def _in_order(rows: Rows, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """φ in scaled columns, τ, and which rows count, row by row as they came."""
    count = rows.joints[0].tau.size
    phi = np.zeros((count, len(rows.joints), rows.size))
    tau = np.stack([own.tau for own in rows.joints], axis=1)
    used = np.stack([own.used for own in rows.joints], axis=1)
    for j, own in enumerate(rows.joints):
        phi[:, j, own.columns] = (own.phi / scale[own.columns, None]).T
    return phi, tau, used


@njit(cache=True, nogil=True)
def _epoch(phi, tau, used, step, theta):
    """θ ← θ + μ φ (τ - φᵀθ), row by row, joint by joint."""
    for t in range(len(phi)):
        for j in range(phi.shape[1]):
            if not used[t, j]:
                continue
            error, length = tau[t, j], 0.0
            for k in range(theta.size):
                error -= phi[t, j, k] * theta[k]
                length += phi[t, j, k] ** 2
            # a row much longer than the mean must not throw the weights beyond the answer
            own = min(step, 1.0 / max(length, 1e-300))
            for k in range(theta.size):
                theta[k] += own * phi[t, j, k] * error
