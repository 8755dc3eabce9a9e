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

Rows of a recursion, one sample at a time: of a robot, or given; their sums, compiled.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from pivident.dynamics.closed_chains.closed_motion import JUMP
from pivident.dynamics.closed_chains.closure_kernels import OPEN
from pivident.dynamics.kernels import link_poses
from pivident.dynamics.parameters import Parameter
from pivident.dynamics.rigid_body_slopes import inertial_columns, move_links, place_links
from pivident.estimation.literature.filters.closed_step import (
    closed_columns,
    move_closed_links,
    place_closed,
)
from pivident.estimation.literature.filters.midpoint_step import StepWork, step_work
from pivident.estimation.literature.filters.robot_equations import (
    RobotEquations,
    add_local_columns,
    robot_equations,
)
from pivident.foundation.compiled import kernel
from pivident.foundation.errors import IdentificationError, LoopNotClosed
from pivident.robot.description import Robot


@kernel
def _columns(equations, work, closed, motion, phi):
    """Φ of one instant, (joints, parameters); ``motion``: q, dq and ddq, (3, joints).

    ``closed``: that of ``work``. False: its loops do not close.
    """
    tree = equations.tree
    for i in range(phi.shape[0]):
        for k in range(phi.shape[1]):
            phi[i, k] = 0.0
    if closed is None:  # decided by its type
        link_poses(tree.prismatic, tree.rotation, tree.translation, motion[0], work.pose)
        place_links(tree.parent, tree.prismatic, work.pose, work.inertia, work.links, work.body)
        move_links(tree.parent, tree.gravity, motion[1], motion[2], work.links, work.body)
        inertial_columns(tree.parent, equations.inertial, work.links, phi)
        add_local_columns(
            equations.local_index, equations.local_value, motion[0], motion[1], motion[2], phi
        )
    else:
        if not place_closed(closed, motion[0], motion[1]):
            return False
        move_closed_links(closed, motion[2], work.links, work.body)
        closed_columns(
            closed, equations.inertial, equations.local_index, equations.local_value, work.links,
            phi,
        )  # fmt: skip
    return True


@kernel
def turn_in(triangle, row, phi, tau, weight, forgetting):
    """Rows of one sample into the triangle [R d], (parameters, parameters + 1)."""
    size, root = row.size - 1, math.sqrt(forgetting)
    for a in range(size):
        for b in range(a, size + 1):
            triangle[a, b] *= root
    for j in range(tau.size):
        for b in range(size):
            row[b] = phi[j, b] * weight[j]
        row[size] = tau[j] * weight[j]
        for a in range(size):
            if row[a] == 0.0:
                continue
            length = math.hypot(triangle[a, a], row[a])
            c, s = triangle[a, a] / length, row[a] / length
            triangle[a, a] = length
            for b in range(a + 1, size + 1):
                old = triangle[a, b]
                triangle[a, b] = c * old + s * row[b]
                row[b] = c * row[b] - s * old


@kernel
def add_up(gram, moment, squares, phi, tau, z, weight, forgetting):
    """Sums of the equations of instruments."""
    size = moment.size
    for a in range(size):
        moment[a] *= forgetting
        for b in range(size):
            gram[a, b] *= forgetting
            squares[a, b] *= forgetting * forgetting
    for j in range(tau.size):
        square = weight[j] * weight[j]
        for a in range(size):
            share = square * z[j, a]
            if share == 0.0:
                continue
            moment[a] += share * tau[j]
            for b in range(size):
                gram[a, b] += share * phi[j, b]
                squares[a, b] += share * z[j, b]


class Recursion:
    """Rows of a robot, or of anything else, and what they weigh."""

    def __init__(
        self, joints: int, size: int, *, torque_std: ArrayLike = 1.0, forgetting: float = 1.0
    ) -> None:
        std = np.asarray(torque_std, dtype=float)
        if std.shape not in ((), (joints,)) or not (np.isfinite(std) & (std > 0.0)).all():
            raise IdentificationError(
                f"torque_std is {torque_std!r}",
                advice=f"one positive number, or one for each of {joints} rows",
            )
        if not 0.0 < forgetting <= 1.0:
            raise IdentificationError(f"forgetting is {forgetting}", advice="above 0 and at most 1")
        self.forgetting, self.samples = float(forgetting), 0
        self._weight = np.broadcast_to(1.0 / std, joints).copy()
        self._phi, self._z = np.zeros((joints, size)), np.zeros((joints, size))
        self._tau, self._motion = np.zeros(joints), np.zeros((3, joints))
        self._equations: RobotEquations | None = None
        self._work: StepWork | None = None
        self._names: Sequence[str] = ()

    @classmethod
    def of_robot(
        cls,
        robot: Robot,
        parameters: tuple[Parameter, ...],
        *,
        torque_std: ArrayLike = 1.0,
        forgetting: float = 1.0,
    ) -> Self:
        """With the rows of a robot, for ``update_motion``.

        Args:
            robot: the robot.
            parameters: what is estimated.
            torque_std: see the class.
            forgetting: see the class.

        Returns:
            The recursion, without any sample.
        """
        made = cls(robot.size, len(parameters), torque_std=torque_std, forgetting=forgetting)
        made._equations = robot_equations(robot, tuple(parameters), simulated=False)
        made._names = robot.joint_names
        return made

    def _take(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, out: np.ndarray) -> None:
        """Φ of one instant into ``out``.

        Raises:
            IdentificationError: no robot is known, or its loops do not close.
        """
        if self._equations is None:
            raise IdentificationError(
                "this recursion knows no robot",
                advice="make it with of_robot, or give update(phi, tau)",
            )
        at = self._motion[0]
        far = self._equations.loops is not None and (
            self.samples == 0 or np.abs(np.subtract(q, at)).max() > JUMP
        )
        self._motion[0], self._motion[1], self._motion[2] = q, dq, ddq
        if self._work is None or far:
            self._work = step_work(self._equations, at, self._names)
        if not _columns(self._equations, self._work, self._work.closed, self._motion, out):
            raise LoopNotClosed(OPEN, at, self._names, self.samples + 1)

    def _check(self) -> None:
        """Refuse what would stay in the estimate for ever."""
        self.samples += 1
        if not (math.isfinite(self._tau.sum()) and math.isfinite(self._phi.sum())):
            raise IdentificationError(
                f"sample {self.samples}: rows or torques hold numbers that are not finite"
            )


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
