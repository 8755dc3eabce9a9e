"""Rows of τ_j = Φ_j θ of all joints, each weighted by 1/√λ_j, and the regressions on them.

What sums over the record do not tell, rows do: how large each single error is, how those of two
joints go together, in which order they came.

Regressions: the equations of weighted least squares, solved otherwise.

Filters, mask, weights 1/λ_j and the load of friction are those of least squares, whose estimate is
where the methods begin. They share its bias: measured positions in the observation matrix, inside a
feedback loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from pivident.estimation.answer import Covariances, answer
from pivident.estimation.covariance import inverse_gram
from pivident.estimation.covariance.sandwich import jackknife
from pivident.estimation.covariance.windows import Share, windows_of
from pivident.estimation.identification import Identification
from pivident.estimation.iteration import Run, solved_otherwise
from pivident.estimation.least_squares import least_squares_start
from pivident.estimation.method import Handles, Method, Refit, Say
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import BIASED, NOTHING_KNOWN, Problem
from pivident.estimation.restrictions import Freedom
from pivident.estimation.solved_equations import Equations
from pivident.foundation.options import option
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.finding import Finding


@dataclass(frozen=True, eq=False)
class JointRows:
    """Rows of one joint, those of all recordings one after the other, zero where not used."""

    name: str  # name of the joint
    columns: np.ndarray  # parameters that act on the joint, shape (k,)
    phi: np.ndarray  # Φ_j/√λ_j, shape (k, rows), time last
    tau: np.ndarray  # τ_j/√λ_j, shape (rows,)
    used: np.ndarray  # rows that count, shape (rows,)

    def residual(self, theta: np.ndarray) -> np.ndarray:
        """(τ_j - Φ_j θ)/√λ_j, shape (rows,)."""
        return self.tau - theta[self.columns] @ self.phi


@dataclass(frozen=True, eq=False)
class Rows(Displayed):
    """Rows of all joints.

    Attributes:
        joints: rows of each.
        size: how many parameters there are.
        root: √λ_j, what a row was divided by, shape (joints,) [N m or N].
        lengths: rows of each recording.
    """

    joints: tuple[JointRows, ...]
    size: int
    root: np.ndarray
    lengths: tuple[int, ...]

    @classmethod
    def of(cls, equations: Equations, left_out: np.ndarray | None = None) -> Rows:
        """The rows of equations.

        Args:
            equations: of all recordings.
            left_out: rows that are not to count, shape (rows,); None: all do.

        Returns:
            Rows of all joints, zero where they do not count.
        """
        blocks = list(equations.blocks())
        joints = []
        for j, name in enumerate(equations.regressor.robot.joint_names):
            own = [block.joints[j] for block in blocks]
            phi = np.concatenate([rows.phi for rows in own], axis=1)
            tau = np.concatenate([rows.tau for rows in own])
            used = np.concatenate([rows.used for rows in own])
            if left_out is not None:
                used = used & ~left_out
                phi, tau = phi * used, tau * used
            joints.append(JointRows(name, own[0].columns, phi, tau, used))
        root = np.sqrt(equations.variance)
        return cls(tuple(joints), equations.size, root, tuple(equations.lengths))

    def without(self, freedom: Freedom) -> Rows:
        """Rows of the free columns alone, τ without what the others make of it.

        Args:
            freedom: of parameters that are free or fixed.
        """
        place = np.full(self.size, -1)
        place[freedom.free] = np.arange(freedom.free.size)
        joints = []
        for own in self.joints:
            free = place[own.columns] >= 0
            tau = own.tau - freedom.offset[own.columns] @ own.phi
            columns = place[own.columns[free]]
            joints.append(replace(own, columns=columns, phi=own.phi[free], tau=tau))
        return replace(self, joints=tuple(joints), size=freedom.free.size)

    @property
    def count(self) -> int:
        """Rows that count, of all joints together."""
        return sum(int(np.count_nonzero(own.used)) for own in self.joints)

    def residuals(self, theta: np.ndarray) -> np.ndarray:
        """(τ - Φθ)/√λ, shape (joints, rows); zero where a row is not used.

        Args:
            theta: parameters, shape (parameters,).
        """
        return np.stack([own.residual(theta) for own in self.joints])

    def sums(self, weights: np.ndarray | None = None) -> list[JointSums]:
        """Normal equations with their windows of time; ``weights``: of rows, (joints, rows)."""
        windows = windows_of(self.lengths)
        count = sum(own.count for own in windows)
        made = []
        for j, own in enumerate(self.joints):
            stack = np.vstack([own.phi, own.tau])
            if weights is not None:
                stack *= np.sqrt(weights[j])
            sums = JointSums.empty(own.name, own.columns, count)
            start = 0
            for window, length in zip(windows, self.lengths, strict=True):
                part = slice(start, start + length)
                shares: list[Share] = list(window.shares(slice(0, length)))
                sums.add_stack(np.ascontiguousarray(stack[:, part]), own.used[part], shares)
                start += length
            made.append(sums)
        return made

    def triangle(self) -> np.ndarray:
        """R of the factors Q R = [Φ τ]/√λ of all rows, shape (size + 1, size + 1)."""
        made = np.zeros((0, self.size + 1))
        for own in self.joints:
            rows = np.vstack([own.phi, own.tau])[:, own.used].T
            reduced = np.asarray(np.linalg.qr(rows, mode="r"))
            block = np.zeros((len(reduced), self.size + 1))
            block[:, np.append(own.columns, self.size)] = reduced
            made = np.asarray(np.linalg.qr(np.vstack([made, block]), mode="r"))
        return made


@dataclass(frozen=True, eq=False)
class Solved(Displayed):
    """What a method made of the rows.

    Attributes:
        theta: parameters, shape (parameters,).
        covariance: theirs, for errors that are white, shape (parameters, parameters).
        robust: one that holds for correlated errors, likewise.
        condition: condition number of what was solved, columns of unit length.
        iterations: estimates after each pass, shape (passes, parameters).
        converged: whether the passes settled.
    """

    theta: np.ndarray
    covariance: np.ndarray
    robust: np.ndarray
    condition: float
    iterations: np.ndarray
    converged: bool = True


@dataclass(frozen=True, eq=False)
class NormalEquations(Displayed):
    """H θ = g of all joints, in columns of unit length.

    Attributes:
        gram: H, shape (size, size).
        moment: g, shape (size,).
        scale: lengths of the columns, shape (size,).
    """

    gram: np.ndarray
    moment: np.ndarray
    scale: np.ndarray

    @classmethod
    def of(cls, sums: Sequence[JointSums], size: int) -> NormalEquations:
        """Those of weighted rows.

        Args:
            sums: sums of the rows of each joint, as `Rows.sums` gives them.
            size: how many parameters there are.

        Returns:
            The equations of all joints together.
        """
        gram, moment = np.zeros((size, size)), np.zeros(size)
        for own in sums:
            gram[np.ix_(own.columns, own.columns)] += own.zf
            moment[own.columns] += own.zt
        length = np.sqrt(np.diag(gram))
        scale = np.where(length > 0.0, length, 1.0)
        return cls(gram / np.outer(scale, scale), moment / scale, scale)

    @property
    def inverse(self) -> np.ndarray:
        """H⁻¹, in the parameters' own units."""
        return inverse_gram(self.gram) / np.outer(self.scale, self.scale)

    @property
    def solution(self) -> np.ndarray:
        """H⁻¹ g."""
        return np.linalg.solve(self.gram, self.moment) / self.scale

    @property
    def condition(self) -> float:
        """Condition number of the observation matrix."""
        return float(np.sqrt(np.linalg.cond(self.gram)))


def windows_covariance(sums: Sequence[JointSums], theta: np.ndarray) -> np.ndarray:
    """Covariance that holds for correlated errors, from windows of time (jackknife).

    Args:
        sums: sums of the weighted rows of each joint, as `Rows.sums` gives them.
        theta: the estimate, shape (parameters,).

    Returns:
        Covariance, shape (parameters, parameters).
    """
    return jackknife(sums, theta, np.ones(len(sums))).covariance


@dataclass(frozen=True, eq=False)
class Noticed(Displayed):
    """A solution with what there is to say of it.

    Attributes:
        solved: the solution.
        findings: what the result says of it.
    """

    solved: Solved
    findings: tuple[Finding, ...] = ()

    def along(self, freedom: Freedom) -> Noticed:
        """The same of all parameters, of which those in the solution are free.

        Args:
            freedom: of all parameters.
        """
        basis, own = freedom.basis, self.solved
        made = replace(
            own,
            theta=freedom.offset + basis @ own.theta,
            covariance=basis @ own.covariance @ basis.T,
            robust=basis @ own.robust @ basis.T,
            iterations=freedom.offset + own.iterations @ basis.T,
        )
        return replace(self, solved=made)


@dataclass(frozen=True, kw_only=True)
class Regression(Method):
    """A method of the rows of the equations alone."""

    handles: ClassVar[Handles] = Handles(known=("fixed",))
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

    def solve_free(self, problem: Problem, rows: Rows, start: np.ndarray) -> Noticed:
        """The same where some values are known: of the others, with what is left of τ.

        Args:
            problem: what is estimated.
            rows: the equations, weighted by 1/√λ_j.
            start: least squares, shape (parameters,).
        """
        if not problem.fixed:
            return self.solve(problem, rows, start)
        freedom = problem.restrictions.freedom
        names = tuple(problem.names[k] for k in freedom.free)
        free = replace(problem, parameters=names, **NOTHING_KNOWN)
        return self.solve(free, rows.without(freedom), start[freedom.free]).along(freedom)

    def estimate(self, problem: Problem, say: Say, *, test_gains: bool = True) -> Identification:
        """Least squares, whose equations are solved once more by the method."""
        _, start = least_squares_start(problem, self, say)
        filters = start.prefilters.filters
        equations = Equations(
            problem.regressor, tuple(start.records), tuple(filters), start.variance
        )
        say(f"{self.label}: solving")
        noticed = self.solve_free(problem, Rows.of(equations), start.theta)
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
