"""Regressions: the equations of weighted least squares, solved otherwise.

Filters, mask, weights 1/λ_j and the load of friction are those of least squares, whose estimate is
where the methods begin. They share its bias: measured positions in the observation matrix, inside a
feedback loop.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pivident.estimation.answer import Covariances, answer
from pivident.estimation.identification import Identification
from pivident.estimation.iteration import Run, solved_otherwise
from pivident.estimation.least_squares import least_squares_start
from pivident.estimation.literature.rows import Rows, Solved
from pivident.estimation.method import Method, Refit, Say
from pivident.estimation.problem import Problem
from pivident.estimation.solved_equations import Equations
from pivident.estimation.without_torque import BIASED
from pivident.options import option
from pivident.text.finding import Finding


@dataclass(frozen=True, eq=False)
class Noticed:
    """A solution with what there is to say of it.

    Attributes:
        solved: the solution.
        findings: what the result says of it.
    """

    solved: Solved
    findings: tuple[Finding, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Regression(Method):
    """A method of the rows of the equations alone."""

    refit: ClassVar[Refit] = "rows"
    of_computed_torque: ClassVar[tuple[Finding, ...]] = (BIASED,)

    def solve(self, problem: Problem, rows: Rows, start: np.ndarray) -> Noticed:
        """What the method makes of rows.

        Args:
            problem: what is estimated.
            rows: the equations, weighted by 1/√λ_j.
            start: least squares, shape (parameters,).

        Raises:
            IdentificationError: the method finds nothing; says why.
            ExperimentError: an option names what is not there.
        """
        raise NotImplementedError(f"{type(self).__name__} has no solve()")

    def estimate(self, problem: Problem, say: Say, *, test_gains: bool = True) -> Identification:
        """Least squares, whose equations are solved once more by the method."""
        _, start = least_squares_start(problem, self, say)
        filters = start.prefilters.filters
        equations = Equations(
            problem.regressor, tuple(start.records), tuple(filters), start.variance
        )
        say(f"{self.label}: solving")
        noticed = self.solve(problem, Rows.of(equations), start.theta)
        solved = noticed.solved
        estimate, history = solved_otherwise(
            start, solved.theta, solved.covariance, solved.condition, solved.iterations
        )
        run = Run(history, solved.converged)
        covariances = Covariances(solved.robust, solved.covariance)
        return answer(problem, self, estimate, run, noticed.findings, covariances=covariances)


@dataclass(frozen=True, kw_only=True)
class IteratedRegression(Regression):
    """A regression in passes.

    Attributes:
        tolerance: change of all parameters, in standard errors, at which the passes end.
        max_iterations: give up after so many.
    """

    tolerance: float = option(
        1e-2, "step in standard errors at which the passes end", unit="σ", above=0.0, below=1.0,
        shared=True,
    )  # fmt: skip
    max_iterations: int = option(50, "largest number of passes", at_least=1, shared=True)
