"""The networks of the literature that solve least squares by steps.

Adaptive linear neuron (ADALINE; Widrow and Hoff 1960): row by row,

    θ ← θ + μ φ (τ - φᵀθ)

for columns of unit mean square. It stays in motion: for rows that are independent of each other its
estimate scatters around the solution with (μ/2) σ² in each direction (Widrow et al. 1976), far more
than least squares, and directions of small eigenvalue ν of the mean φφᵀ need 1/(μ ν) rows.

Hopfield and Tank's network (1985): with neurons θ = β tanh(u/β) it follows

    du/dt = -∂/∂θ ½ ‖τ - Φθ‖² = Φᵀτ - ΦᵀΦ θ

to the least squares solution θ*, if β is beyond it and time suffices. It is solved in θ/β and as
ΦᵀΦ (θ* - θ), whose rounding errors vanish with the distance: those of the difference above would
keep the steps of the solver short for ever.

They know nothing that least squares does not, and are here to be compared with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pivident.estimation.literature.rows import (
    NormalEquations,
    Noticed,
    Regression,
    Rows,
    Solved,
    windows_covariance,
)
from pivident.estimation.problem import Problem
from pivident.foundation.compiled import compiled
from pivident.foundation.options import option
from pivident.foundation.text.finding import Finding

#: Time constants of the slowest direction after which a network has arrived.
ARRIVED = 4.0


#: What is said of a network's estimate.
NETWORK = Finding(
    "note", "regression", "network",
    "The network solves least squares by steps; it cannot be nearer to the truth than that, and "
    "shares its bias.",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Adaline(Regression):
    """Adaptive linear neuron: least squares, step by step along the rows.

    Attributes:
        rate: step over the largest that converges in the mean.
        epochs: how often all rows are gone through.
    """

    rate: float = option(
        0.1, "step over the largest that converges in the mean", above=0.0, below=2.0
    )
    epochs: int = option(20, "how often all rows are gone through", at_least=1)

    label: ClassVar[str] = "ADALINE"
    summary: ClassVar[str] = "step by step, for comparison"

    def solve(self, problem: Problem, rows: Rows, start: np.ndarray) -> Noticed:
        """The weights after the last row."""
        return Noticed(
            solve_adaline(rows, problem.initial_values(), self.rate, self.epochs), (NETWORK,)
        )


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
    scatter = 0.5 * step * error_variance(rows, found) * np.diag(1.0 / scale**2)
    least = equations.inverse * error_variance(rows, found)
    robust = windows_covariance(sums, found) + scatter
    arrived = step * values[0] * rows.count * epochs >= ARRIVED
    return Solved(
        found, scatter + least, robust, equations.condition, np.array(passes), bool(arrived)
    )


def error_variance(rows: Rows, theta: np.ndarray) -> float:
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


@compiled()
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


#: Most steps of the differential equation; some hundreds are usual.
MAX_STEPS = 20_000


@dataclass(frozen=True, kw_only=True)
class Hopfield(Regression):
    """Hopfield and Tank's network: least squares as the end of a differential equation.

    Attributes:
        reach: largest parameter that the neurons can take, over that of least squares.
        time: how long the network runs, in time constants of its fastest direction.
    """

    reach: float = option(10.0, "largest value of a neuron, over the largest parameter", above=1.0)
    time: float = option(
        1e6, "how long the network runs, in time constants of its fastest direction", above=0.0
    )

    label: ClassVar[str] = "Hopfield"
    summary: ClassVar[str] = "step by step, for comparison"

    def solve(self, problem: Problem, rows: Rows, start: np.ndarray) -> Noticed:
        """Where the network has come to rest."""
        return Noticed(
            solve_hopfield(rows, problem.initial_values(), self.reach, self.time), (NETWORK,)
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
    covariance = equations.inverse * error_variance(rows, theta)
    robust = windows_covariance(sums, theta)
    left = size * np.abs(goal - outputs[-1])
    arrived = (left <= 0.1 * np.sqrt(np.diag(np.linalg.inv(equations.gram)))).all()
    return Solved(theta, covariance, robust, equations.condition, thetas, bool(arrived))
