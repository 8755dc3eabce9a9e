"""Recursive least squares and recursive instruments, with exponential forgetting.

Rows φ of τ = φθ come one sample at a time; older samples count less by μ each. Least squares
carries the triangle of its information (Bierman 1977), into which Givens' rotations turn each row,

    [R d] ← Q [√μ R  √μ d; φ/σ  τ/σ],      R θ = d,      P = (RᵀR)⁻¹

so that nothing has to be known at the start, and what comes out is least squares of the same rows
to the last digits. Instruments z carry the sums

    G ← μ G + zᵀφ/σ²,   g ← μ g + zᵀτ/σ²,   C ← μ² C + zᵀz/σ²,    θ = G⁻¹g,   P = G⁻¹ C G⁻ᵀ

(Söderström and Stoica 1983). With μ < 1 the estimate follows parameters that change, with a memory
of 1/(1-μ) samples; directions that are not excited meanwhile lose theirs. Covariances are those of
white errors with the variance σ² of each joint; with μ < 1 that of least squares is about twice
that of its noise, and stands for what may have changed, too.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pivident.estimation.literature.filters.recursion import Recursion, add_up, turn_in

#: Smallest diagonal of the information's triangle, relative to its column, that determines θ.
DETERMINED = 1e-12


class RecursiveLeastSquares(Recursion):
    """Least squares, one sample at a time.

    Args:
        joints: rows of a sample.
        size: number of parameters.
        torque_std: standard deviation of each row's error, shape (joints,) or one for all
            [N m or N].
        forgetting: what a sample counts when the next one comes, 1: all count alike.

    Raises:
        IdentificationError: numbers that cannot be.
    """

    def __init__(
        self, joints: int, size: int, *, torque_std: ArrayLike = 1.0, forgetting: float = 1.0
    ) -> None:
        super().__init__(joints, size, torque_std=torque_std, forgetting=forgetting)
        self._triangle, self._row = np.zeros((size, size + 1)), np.zeros(size + 1)

    def update(self, phi: ArrayLike, tau: ArrayLike) -> None:
        """Take the rows of one sample.

        Args:
            phi: rows, shape (joints, parameters).
            tau: torques, shape (joints,) [N m or N].
        """
        self._phi[:], self._tau[:] = phi, tau
        self._turn()

    def update_motion(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, tau: ArrayLike) -> None:
        """Take one sample of a robot.

        Args:
            q: positions, shape (joints,) [rad or m].
            dq: speeds, likewise [rad/s or m/s].
            ddq: accelerations, likewise [rad/s² or m/s²].
            tau: torques, likewise [N m or N].
        """
        self._take(q, dq, ddq, self._phi)
        self._tau[:] = tau
        self._turn()

    def _turn(self) -> None:
        self._check()
        turn_in(self._triangle, self._row, self._phi, self._tau, self._weight, self.forgetting)

    @property
    def theta(self) -> np.ndarray:
        """Parameters, shape (parameters,); those that no row has told yet are NaN, all of them."""
        return self._solved(self._triangle[:, -1])

    @property
    def covariance(self) -> np.ndarray:
        """Covariance for white errors of the assumed size, (parameters, parameters)."""
        inverse = self._solved(np.eye(len(self._triangle)))
        return inverse @ inverse.T

    def _solved(self, right: np.ndarray) -> np.ndarray:
        """R⁻¹ times something."""
        triangle = self._triangle[:, :-1]
        length = np.linalg.norm(triangle, axis=0)
        if not (np.abs(np.diag(triangle)) > DETERMINED * length).all():
            return np.full(right.shape, np.nan)
        from scipy.linalg import solve_triangular

        return solve_triangular(triangle, right)


class RecursiveInstruments(Recursion):
    """Instrumental variables, one sample at a time.

    Args:
        joints: rows of a sample.
        size: number of parameters.
        torque_std: standard deviation of each row's error, shape (joints,) or one for all
            [N m or N].
        forgetting: what a sample counts when the next one comes, 1: all count alike.

    Raises:
        IdentificationError: numbers that cannot be.
    """

    def __init__(
        self, joints: int, size: int, *, torque_std: ArrayLike = 1.0, forgetting: float = 1.0
    ) -> None:
        super().__init__(joints, size, torque_std=torque_std, forgetting=forgetting)
        self._gram, self._squares = np.zeros((size, size)), np.zeros((size, size))
        self._moment = np.zeros(size)

    def update(self, phi: ArrayLike, tau: ArrayLike, z: ArrayLike) -> None:
        """Take the rows of one sample.

        Args:
            phi: rows, shape (joints, parameters).
            tau: torques, shape (joints,) [N m or N].
            z: instruments, likewise (joints, parameters).
        """
        self._phi[:], self._tau[:], self._z[:] = phi, tau, z
        self._add()

    def update_motion(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        tau: ArrayLike,
        instruments: tuple[ArrayLike, ArrayLike, ArrayLike],
    ) -> None:
        """Take one sample of a robot.

        Args:
            q: positions, shape (joints,) [rad or m].
            dq: speeds, likewise [rad/s or m/s].
            ddq: accelerations, likewise [rad/s² or m/s²].
            tau: torques, likewise [N m or N].
            instruments: positions, speeds and accelerations without the noise of q, such as those
                of a simulated loop.
        """
        self._take(*instruments, self._z)
        self._take(q, dq, ddq, self._phi)
        self._tau[:] = tau
        self._add()

    def _add(self) -> None:
        self._check()
        add_up(
            self._gram, self._moment, self._squares, self._phi, self._tau, self._z, self._weight,
            self.forgetting,
        )  # fmt: skip

    @property
    def theta(self) -> np.ndarray:
        """Parameters, shape (parameters,); NaN while the rows do not determine them."""
        scale = self._scale()
        if scale is None:
            return np.full(self._moment.shape, np.nan)
        return np.linalg.solve(self._gram / np.outer(*scale), self._moment / scale[0]) / scale[1]

    @property
    def covariance(self) -> np.ndarray:
        """Covariance for white errors of the assumed size, (parameters, parameters)."""
        scale = self._scale()
        if scale is None:
            return np.full(self._gram.shape, np.nan)
        inverse = np.linalg.inv(self._gram / np.outer(*scale)) / np.outer(*scale[::-1])
        return inverse @ self._squares @ inverse.T

    def _scale(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Sizes of the rows and columns of G; None: it cannot be inverted."""
        rows = np.sqrt(np.diag(self._squares))
        if not (rows > 0.0).all():
            return None
        columns = np.abs(np.diag(self._gram)) / rows
        if not (columns > 0.0).all():
            return None
        scaled = self._gram / np.outer(rows, columns)
        return (rows, columns) if np.linalg.cond(scaled) < 1.0 / DETERMINED else None
