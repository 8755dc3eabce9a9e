"""Rows of τ_j = Φ_j θ of all joints, in memory, each joint weighted by 1/√λ_j.

What sums over the record do not tell, rows do: how large each single error is, how those of two
joints go together, in which order they came.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.estimation.covariance import inverse_gram
from pivident.estimation.covariance.sandwich import jackknife
from pivident.estimation.covariance.windows import Share, windows_of
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.solved_equations import Equations


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
class Rows:
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
        names = equations.regressor.robot.joint_names
        blocks = list(equations.blocks())
        joints = []
        for j, name in enumerate(names):
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
class Solved:
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
class NormalEquations:
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
