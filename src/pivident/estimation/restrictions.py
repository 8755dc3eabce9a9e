"""What is known of the parameters beforehand, as restrictions of one solve.

Fixed values and equalities, A θ = c, leave directions in which an estimate is free,

    θ = θ₀ + N z,   A θ₀ = c,   A N = 0

with z some of the parameters themselves. With the instruments Z N of the free directions, and a
prior of mean m and information Λ, the estimate solves

    Nᵀ (G + Λ) N z = Nᵀ (g - G θ₀ + Λ (m - θ₀)),   G = Σ Zᵀ Φ/λ,   g = Σ Zᵀ τ/λ            (1)

For a fixed value this is the estimate from τ - Φ_f θ_f with the other columns.

Bounds are met as in a quadratic program: the estimate is that of (1) with some parameters at their
bounds, each pressed against it, (G θ - g)_i ≥ 0 at the lower and ≤ 0 at the upper one, and the
others within theirs. With Z = Φ it minimises the squares. Otherwise it is the solution of the
linear complementarity problem of the same form, which is unique as long as zᵀNᵀGNz > 0. It is found
by principal pivoting with the least index (Murty 1974), which comes to an end for such matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.foundation.text.sentences import listed

#: Largest coefficient that elimination leaves of a row of A, over that of the row, which then says
#: what others say already.
REDUNDANT = 1e-10

#: How far beyond a bound rounding may leave an estimate, over its own size and that of the bound.
ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class Freedom:
    """Directions in which an estimate is free, and what a prior says along them."""

    offset: np.ndarray  # θ₀, shape (parameters,)
    basis: np.ndarray  # N, shape (parameters, free)
    information: np.ndarray  # Λ, shape (parameters, parameters)
    free: np.ndarray  # indices of z among the parameters, shape (free,)

    @classmethod
    def whole(cls, size: int) -> Freedom:
        """Nothing is known."""
        return cls(np.zeros(size), np.eye(size), np.zeros((size, size)), np.arange(size))

    def reduced(self, gram: np.ndarray) -> np.ndarray:
        """Nᵀ G N, of matrices one after the other too, shape (…, free, free)."""
        return self.basis.T @ gram @ self.basis

    def solve(self, gram: np.ndarray, moment: np.ndarray) -> np.ndarray:
        """θ of (1), with Λ and Λ m in G and g already, shape (parameters,).

        Args:
            gram: G, shape (parameters, parameters).
            moment: g, shape (parameters,).
        """
        own, right = self.reduced(gram), self.basis.T @ (moment - gram @ self.offset)
        size = np.sqrt(np.abs(np.diag(own)))
        scale = np.where(size > 0.0, size, 1.0)
        z = np.linalg.solve(own / np.outer(scale, scale), right / scale) / scale
        return self.offset + self.basis @ z

    def bread(self, gram: np.ndarray) -> np.ndarray:
        """N (Nᵀ (G + Λ) N)⁻¹ Nᵀ: what scores of all parameters do to the estimate."""
        own = self.reduced(gram + self.information)
        size = np.sqrt(np.maximum(np.abs(np.diag(own)), 1e-300))
        outer = np.outer(size, size)
        return self.basis @ (np.linalg.inv(own / outer) / outer) @ self.basis.T


@dataclass(frozen=True, eq=False)
class Restrictions:
    """Equalities, bounds and a prior of the parameters of a problem, in their order.

    Attributes:
        names: names of the parameters.
        matrix: A, shape (equalities, parameters).
        right: c, shape (equalities,).
        low: least values, -∞ for none, shape (parameters,).
        high: largest values, likewise.
        mean: m, shape (parameters,); zero where the prior says nothing.
        information: Λ, shape (parameters, parameters).
    """

    names: tuple[str, ...]
    matrix: np.ndarray
    right: np.ndarray
    low: np.ndarray
    high: np.ndarray
    mean: np.ndarray
    information: np.ndarray

    @classmethod
    def none(cls, names: Sequence[str]) -> Restrictions:
        """Nothing is known."""
        size = len(names)
        low, high = np.full(size, -np.inf), np.full(size, np.inf)
        zero = np.zeros(size)
        return cls(
            tuple(names), np.zeros((0, size)), np.zeros(0), low, high, zero, np.zeros((size, size))
        )

    @cached_property
    def freedom(self) -> Freedom:
        """The directions that the equalities leave.

        Raises:
            ExperimentError: they contradict one another, repeat one another, or leave nothing.
        """
        return self._freedom(self.matrix, self.right)

    @property
    def without_prior(self) -> Restrictions:
        """The same without the prior."""
        return replace(self, information=np.zeros_like(self.information))

    @property
    def is_bounded(self) -> bool:
        """Whether any parameter has a bound."""
        return bool(np.isfinite(self.low).any() or np.isfinite(self.high).any())

    @cached_property
    def is_fixed(self) -> np.ndarray:
        """Parameters that the equalities leave no choice, shape (parameters,)."""
        return np.asarray(~self.freedom.basis.any(axis=1))

    def solve(self, gram: np.ndarray, moment: np.ndarray) -> np.ndarray:
        """The estimate of normal equations G θ = g, shape (parameters,).

        Args:
            gram: G, without the prior, shape (parameters, parameters).
            moment: g, shape (parameters,).

        Raises:
            IdentificationError: no estimate within the bounds was found.
        """
        gram, moment = gram + self.information, moment + self.information @ self.mean
        theta = self.freedom.solve(gram, moment)
        return self._within_bounds(gram, moment, theta) if self.is_bounded else theta

    def sides(self, theta: np.ndarray) -> tuple[str, ...]:
        """Bound that holds each parameter of an estimate, ``low`` or ``high``, else empty.

        Args:
            theta: the estimate, shape (parameters,).
        """
        at_low, at_high = theta == self.low, theta == self.high
        free = ~self.is_fixed
        return tuple(
            "low" if low else "high" if high else ""
            for low, high in zip(at_low & free, at_high & free, strict=True)
        )

    def on(self, chosen: Sequence[int] | np.ndarray) -> Restrictions:
        """What they say of some of the parameters alone.

        Args:
            chosen: their indices; equalities that others stand in are left out.
        """
        k = np.asarray(chosen, dtype=int)
        rows = ~np.delete(self.matrix, k, axis=1).any(axis=1)
        return Restrictions(
            tuple(self.names[i] for i in k), self.matrix[rows][:, k], self.right[rows],
            self.low[k], self.high[k], self.mean[k], self.information[np.ix_(k, k)],
        )  # fmt: skip

    def _freedom(self, matrix: np.ndarray, right: np.ndarray) -> Freedom:
        """θ₀ and N by elimination: each equality gives one parameter by the others."""
        a, c = np.array(matrix, float), np.array(right, float)
        length = np.abs(a).max(axis=1, initial=0.0)
        pivots: list[int] = []
        for k in range(len(a)):
            pivot = int(np.argmax(np.abs(a[k])))
            if np.abs(a[k, pivot]) <= REDUNDANT * length[k]:
                self._refuse(matrix[k], c[k], right[k])
            a[k], c[k] = a[k] / a[k, pivot], c[k] / a[k, pivot]
            for other in range(len(a)):
                if other != k:
                    c[other] -= a[other, pivot] * c[k]
                    a[other] -= a[other, pivot] * a[k]
                    a[other, pivot] = 0.0
            pivots.append(pivot)
        size = len(self.names)
        free = np.setdiff1d(np.arange(size), pivots)
        offset, basis = np.zeros(size), np.zeros((size, free.size))
        offset[pivots] = c
        basis[free, np.arange(free.size)] = 1.0
        basis[pivots] = -a[:, free]
        return Freedom(offset, basis, self.information, free)

    def _refuse(self, row: np.ndarray, left: float, right: float) -> None:
        """Refuse an equality that elimination has left nothing of."""
        names = listed([n for n, x in zip(self.names, row, strict=True) if x])
        if abs(left) <= REDUNDANT * max(abs(right), 1.0):
            raise ExperimentError(
                f"what is fixed of {names} follows from the other constraints already",
                advice="leave one of them out",
            )
        raise ExperimentError(
            f"what is fixed of {names} contradicts the other constraints",
            advice="correct or leave out one of them",
        )

    def _within_bounds(self, gram: np.ndarray, moment: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Principal pivoting: one bound at a time is taken up or let go."""
        held: dict[int, float] = {}
        size = len(self.names)
        best, patience = size + 1, size
        for _ in range(50 * size + 50):
            far = ROUNDING * np.maximum(np.abs(theta), 1e-300)
            low, high = theta < self.low - far, theta > self.high + far
            wrong = [int(k) for k in np.flatnonzero(low | high) if k not in held]
            wrong += self._let_go(gram, moment, theta, held)
            if not wrong:
                return np.clip(theta, self.low, self.high)
            # all that is wrong at once as long as it becomes less, then the least index alone
            if len(wrong) < best:
                best, patience = len(wrong), size
            patience -= 1
            for k in sorted(wrong) if patience > 0 else [min(wrong)]:
                if k in held:
                    del held[k]
                elif self._held(held)[0].basis[k].any():  # still free to be brought there
                    held[k] = float(self.low[k] if low[k] else self.high[k])
            theta = self._held(held)[0].solve(gram, moment)
        raise IdentificationError(
            "no estimate within the bounds was found",
            advice="the motion hardly separates the bounded parameters: fix some, or widen bounds",
        )

    def _held(self, held: dict[int, float]) -> tuple[Freedom, np.ndarray]:
        """Freedom with some parameters at bounds, and all rows of A then."""
        rows = np.vstack([self.matrix, np.eye(len(self.names))[list(held)]])
        return self._freedom(rows, np.append(self.right, list(held.values()))), rows

    def _let_go(
        self, gram: np.ndarray, moment: np.ndarray, theta: np.ndarray, held: dict[int, float]
    ) -> list[int]:
        """Parameters at a bound that the equations would pull off it."""
        if not held:
            return []
        _, rows = self._held(held)
        pressed = gram @ theta - moment
        scale = np.sqrt(np.maximum(np.abs(np.diag(gram)), 1e-300))
        forces = np.linalg.lstsq((rows / scale).T, pressed / scale, rcond=None)[0]
        signs = np.array([1.0 if held[k] == self.low[k] else -1.0 for k in held])
        wrong = forces[len(self.matrix) :] * signs < 0.0
        return [k for k, off in zip(held, wrong, strict=True) if off]
