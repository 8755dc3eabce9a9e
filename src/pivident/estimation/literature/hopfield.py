"""Hopfield and Tank's network (1985), as the literature tried it.

With neurons θ = β tanh(u/β) it follows

    du/dt = -∂/∂θ ½ ‖τ - Φθ‖² = Φᵀτ - ΦᵀΦ θ

to the least squares solution θ*, if β is beyond it and time suffices. It is solved in θ/β and as
ΦᵀΦ (θ* - θ), whose rounding errors vanish with the distance: those of the difference above would
keep the steps of the solver short for ever. It knows nothing that least squares does not, and is
here to be compared with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pivident.estimation.literature.adaline import NETWORK, error_variance
from pivident.estimation.literature.rows import (
    NormalEquations,
    Noticed,
    Regression,
    Rows,
    Solved,
    windows_covariance,
)
from pivident.estimation.problem import Problem
from pivident.foundation.options import option

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
