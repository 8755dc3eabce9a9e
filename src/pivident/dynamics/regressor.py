"""Observation matrix Φ(q, dq, ddq), with tau = Φ θ, linear in the parameters.

Inside, the matrix is *packed*: only the structurally non-zero entries are computed, one row per
entry, time last, sorted by joint. On the TX40 that is about a third of the dense matrix. The
dense form (samples, joints, parameters) is made from it for people who want it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numba import njit

from pivident.dynamics.friction import friction_column, smoothed_sign
from pivident.dynamics.kernels import Tree, inertial_entries
from pivident.dynamics.parameters import Parameter
from pivident.robot.description import INERTIAL, Robot
from pivident.robot.friction import SignFunction
from pivident.threads import run_in_threads

BLOCK = 1024  # samples per block of the dense matrix: its packed form stays in the cache


@dataclass(frozen=True, eq=False)
class Regressor:
    """The observation matrix of a robot for chosen parameters.

    Attributes:
        robot: the robot.
        parameters: the columns, in order.
        row: joint of each packed entry, ascending, shape (entries,).
        column: parameter of each packed entry, shape (entries,).
        offsets: entries of joint j are ``offsets[j]:offsets[j+1]``, shape (joints + 1,).
    """

    robot: Robot
    parameters: tuple[Parameter, ...]
    row: np.ndarray
    column: np.ndarray
    offsets: np.ndarray
    _tree: Tree = field(repr=False)
    _joint_of: np.ndarray = field(repr=False)
    _rows_of: np.ndarray = field(repr=False)

    @classmethod
    def build(cls, robot: Robot, parameters: Sequence[Parameter]) -> Regressor:
        """Find the non-zero entries: by the tree's structure, then by probing random states.

        A probe decides because geometry hides zeros that the tree does not show (a vertical
        first axis does not feel gravity).
        """
        candidates = _possible_entries(robot, parameters)
        everything = cls._from_entries(robot, tuple(parameters), candidates)
        rng = np.random.default_rng(20180501)
        q, dq, ddq = rng.uniform(-2.0, 2.0, (3, robot.size, 64))
        packed = everything.packed(q, dq, ddq)
        scale = max(1.0, float(np.abs(packed).max(initial=0.0)))
        alive = np.abs(packed).max(axis=1) > 1e-12 * scale
        return cls._from_entries(
            robot,
            tuple(parameters),
            [
                (int(j), int(c))
                for j, c in zip(everything.row[alive], everything.column[alive], strict=True)
            ],
        )

    @classmethod
    def _from_entries(
        cls, robot: Robot, parameters: tuple[Parameter, ...], entries: list[tuple[int, int]]
    ) -> Regressor:
        entries = sorted(entries)
        row = np.array([j for j, _ in entries], dtype=np.int64)
        column = np.array([c for _, c in entries], dtype=np.int64)
        depth = max(len(robot.ancestors(i)) for i in range(robot.size))
        joint_of = np.full((robot.size, depth), -1, dtype=np.int64)
        rows_of = np.full((robot.size, depth, len(INERTIAL)), -1, dtype=np.int64)
        for i in range(robot.size):
            joint_of[i, : len(robot.ancestors(i))] = robot.ancestors(i)
        for e, (j, c) in enumerate(entries):
            p = parameters[c]
            if p.is_inertial:
                k = robot.ancestors(p.joint).index(j)
                rows_of[p.joint, k, INERTIAL.index(p.stem)] = e
        offsets = np.searchsorted(row, np.arange(robot.size + 1))
        return cls(robot, parameters, row, column, offsets, tree_of(robot), joint_of, rows_of)

    @property
    def entries(self) -> int:
        """Number of structurally non-zero entries."""
        return self.row.size

    @cached_property
    def _joint_entries(self) -> list[tuple[int, Parameter]]:
        """Entries of rotor inertias, friction and couplings, with their parameters."""
        parameters = [self.parameters[c] for c in self.column]
        return [(e, p) for e, p in enumerate(parameters) if not p.is_inertial]

    def columns_of(self, joint: int) -> np.ndarray:
        """Parameters that act on a joint: indices into ``parameters``."""
        return self.column[self.offsets[joint] : self.offsets[joint + 1]]

    def packed(
        self,
        q: np.ndarray,
        dq: np.ndarray,
        ddq: np.ndarray,
        out: np.ndarray | None = None,
    ) -> np.ndarray:
        """Non-zero entries of the observation matrix, time **last**.

        Args:
            q: joint positions [rad or m], shape (joints, samples); ``dq ddq`` likewise.
            dq: joint speeds [rad/s or m/s].
            ddq: joint accelerations [rad/s² or m/s²].
            out: array (entries, samples) to write into.

        Returns:
            Entries, shape (entries, samples).
        """
        q, dq, ddq = (np.ascontiguousarray(x, dtype=float) for x in (q, dq, ddq))
        if out is None:
            out = np.empty((self.entries, q.shape[1]))
        inertial_entries(
            self._tree, self._joint_of, self._rows_of, q, dq, ddq, np.sin(q), np.cos(q), out
        )
        shared: dict[str, np.ndarray] = {}
        for e, p in self._joint_entries:
            if p.stem == "ia":
                out[e] = ddq[self.row[e]]
            elif p.friction is not None:
                out[e] = friction_column(*p.friction.encoded(), dq[self.row[e]])
            elif p.coupling is not None:
                out[e] = self._coupling_entry(p, int(self.row[e]), dq, ddq, shared)
        return out

    def _coupling_entry(
        self,
        p: Parameter,
        row: int,
        dq: np.ndarray,
        ddq: np.ndarray,
        shared: dict[str, np.ndarray],
    ) -> np.ndarray:
        c = p.coupling
        assert c is not None
        other = c.motor if row == c.joint else c.joint
        if p.stem == "iam":
            return c.ratio * ddq[other]
        if p.stem == "fvm":
            return c.ratio * dq[other]
        if p.name not in shared:  # the same sign function acts on both rows
            sign, gamma = coupling_sign(self.robot, c.motor)
            shared[p.name] = smoothed_sign(sign, gamma, dq[c.motor] + c.ratio * dq[c.joint])
        return c.ratio * shared[p.name] if row == c.joint else shared[p.name]

    def matrix(
        self,
        q: np.ndarray,
        dq: np.ndarray,
        ddq: np.ndarray,
        out: np.ndarray | None = None,
    ) -> np.ndarray:
        """Dense observation matrix Φ, tau = Φ θ.

        Args:
            q: joint positions [rad or m], shape (samples, joints); ``dq ddq`` likewise.
            dq: joint speeds [rad/s or m/s].
            ddq: joint accelerations [rad/s² or m/s²].
            out: array (samples, joints, parameters) of an earlier call to write into. Its
                structural zeros are taken to be zero already and are not written again.

        Returns:
            Φ, shape (samples, joints, parameters).
        """
        samples = q.shape[0]
        if out is None:
            out = np.zeros((samples, self.robot.size, len(self.parameters)))

        def block(start: int) -> None:
            part = slice(start, min(start + BLOCK, samples))
            packed = self.packed(q[part].T, dq[part].T, ddq[part].T)
            _scatter(packed, self.row, self.column, out[part])

        run_in_threads(block, range(0, samples, BLOCK))
        return out

    def torque(
        self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, theta: np.ndarray
    ) -> np.ndarray:
        """Tau = Φ(q, dq, ddq) θ, shape (samples, joints) [N m or N].

        Args:
            q: joint positions [rad or m], shape (samples, joints); ``dq ddq`` likewise.
            dq: joint speeds.
            ddq: joint accelerations.
            theta: parameters, shape (parameters,).
        """
        tau = np.zeros(q.shape)
        weights = np.asarray(theta, dtype=float)[self.column]

        def block(start: int) -> None:
            part = slice(start, min(start + 4 * BLOCK, len(q)))
            packed = self.packed(q[part].T, dq[part].T, ddq[part].T)
            for j in range(self.robot.size):
                own = slice(self.offsets[j], self.offsets[j + 1])
                tau[part, j] = weights[own] @ packed[own]

        run_in_threads(block, range(0, len(q), 4 * BLOCK))
        return tau


def tree_of(robot: Robot) -> Tree:
    """Geometry of a robot as the kernels want it."""
    return Tree(
        np.array([j.parent for j in robot.joints], dtype=np.int64),
        np.array([j.kind == "prismatic" for j in robot.joints], dtype=np.int64),
        np.array([j.rotation for j in robot.joints], dtype=float),
        np.array([j.translation for j in robot.joints], dtype=float),
        np.asarray(robot.gravity, dtype=float),
    )


def coupling_sign(robot: Robot, motor: int, simulated: bool = False) -> tuple[int, float]:
    """Sign function of a coupling's Coulomb term: that of the motor's own joint.

    Args:
        robot: the robot.
        motor: index of the coupled motor's joint.
        simulated: replace the hard sign by the arctangent, as the simulator needs.
    """
    for term in robot.joints[motor].friction.terms:
        _, sign, shape = term.encoded(simulated)
        if term.stem.startswith("fc"):
            return sign, shape[0]
    return int(SignFunction.ATAN), robot.joints[motor].default_gamma


def _possible_entries(robot: Robot, parameters: Sequence[Parameter]) -> list[tuple[int, int]]:
    """(joint, parameter) pairs that the tree allows to be non-zero."""
    entries = []
    for c, p in enumerate(parameters):
        if p.is_inertial:
            entries.extend((j, c) for j in robot.ancestors(p.joint))
        elif p.coupling is not None:
            entries.extend(((p.coupling.joint, c), (p.coupling.motor, c)))
        else:
            entries.append((p.joint, c))
    return entries


@njit(cache=True, nogil=True, error_model="numpy")
def _scatter(packed, row, column, out):
    """Write packed entries (time last) into the dense matrix (time first)."""
    for s in range(packed.shape[1]):
        for e in range(packed.shape[0]):
            out[s, row[e], column[e]] = packed[e, s]
