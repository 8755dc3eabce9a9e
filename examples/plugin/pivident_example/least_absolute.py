"""Least absolute deviations, θ = argmin Σ |τ - Φθ|, by least squares weighted anew."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pivident import Problem
from pivident.estimation import (
    NormalEquations,
    Noticed,
    Regression,
    Rows,
    Solved,
    windows_covariance,
)
from pivident.foundation.options import option

#: Errors below this count as large as this, in standard deviations.
SMALLEST = 1e-3


@dataclass(frozen=True, kw_only=True)
class LeastAbsolute(Regression):
    """Outliers of the torque count by their size, not by its square."""

    passes: int = option(30, "how often the rows are weighted anew", at_least=1)

    label: ClassVar[str] = "IDIM-LAD"
    summary: ClassVar[str] = "least absolute deviations"

    def solve(self, problem: Problem, rows: Rows, start: np.ndarray) -> Noticed:
        """The estimate after the last pass; ``start``: least squares."""
        estimates = [start]
        for _ in range(self.passes):
            weights = 1.0 / np.maximum(np.abs(rows.residuals(estimates[-1])), SMALLEST)
            sums = rows.sums(weights)
            equations = NormalEquations.of(sums, rows.size)
            estimates.append(equations.solution)
        covariance = windows_covariance(sums, estimates[-1])
        condition = equations.condition
        return Noticed(
            Solved(estimates[-1], covariance, covariance, condition, np.array(estimates[1:]))
        )
