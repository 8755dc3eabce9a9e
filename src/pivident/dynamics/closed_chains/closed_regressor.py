"""Observation matrix of a closed mechanism: Nᵀ Y of its tree, in the rows of independent joints.

    Nᵀ Y(q, dq, ddq) θ = τ_a

by virtual work; Y is the tree's, at the motion of all joints that closes the loops. Friction of
passive joints stays in Y.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pivident.dynamics.closed_chains.closed_motion import ClosedChains, moved_joints
from pivident.dynamics.parameters import Parameter
from pivident.dynamics.regressor import Regressor
from pivident.foundation.compiled import kernel
from pivident.foundation.errors import RobotDescriptionError
from pivident.foundation.scratch import working_array
from pivident.foundation.threads import run_in_threads
from pivident.robot.description import Robot

#: Samples that are followed at a time by a thread: as many as a block of the normal equations has.
BLOCK = 4096


@kernel
def _project(term, place, gain, packed, out, start):
    """Rows ``place`` of out, from sample ``start`` on, = Σ N_ia Y_i.

    Rows of ``term`` are row of the entry, entry of the tree, joint of the tree i, independent a.
    """
    samples = packed.shape[1]
    for k in range(place.size):
        for t in range(samples):
            out[place[k], start + t] = 0.0
    for k in range(term.shape[0]):
        row, entry, i, a = place[term[k, 0]], term[k, 1], term[k, 2], term[k, 3]
        for t in range(samples):
            out[row, start + t] += gain[i, a, t] * packed[entry, t]


@kernel
def _project_torque(gain, torque, out, start):
    """Row t + ``start`` of out (samples, joints) = Nᵀ τ, τ of all joints (samples, joints)."""
    for t in range(torque.shape[0]):
        for a in range(out.shape[1]):
            total = 0.0
            for i in range(torque.shape[1]):
                total += gain[i, a, t] * torque[t, i]
            out[start + t, a] = total


@dataclass(frozen=True, eq=False)
class ClosedRegressor(Regressor):
    """The observation matrix of a closed mechanism; rows are its independent joints.

    Attributes:
        chains: its constraints.
        tree: the observation matrix of all joints.
        term: what entries are sums of: row of the entry, entry of the tree, joint of the tree,
            independent joint, shape (terms, 4).
    """

    chains: ClosedChains = field(repr=False, kw_only=True)
    tree: Regressor = field(repr=False, kw_only=True)
    term: np.ndarray = field(repr=False, kw_only=True)

    @classmethod
    def of(cls, robot: Robot, parameters: Sequence[Parameter]) -> ClosedRegressor:
        """Find the entries that are not always zero, by postures at random.

        Raises:
            RobotDescriptionError: friction whose column needs more than one sample.
        """
        tree = Regressor.build(robot.tree, parameters)
        if tree.inner_entries.size:
            p = parameters[tree.column[tree.inner_entries[0]]]
            raise RobotDescriptionError(
                f"{p.name}: friction with a memory, and friction that grows with the load, are "
                "not handled in mechanisms with closed loops",
                advice="choose viscous, Coulomb, Stribeck …",
            )
        for p in parameters:
            if p.friction is not None and p.friction.column.of_motion:
                raise RobotDescriptionError(
                    f"{p.name}: friction of more than one quantity is not handled in mechanisms "
                    "with closed loops",
                    advice="give a function of the speed or of the position alone",
                )
        chains = ClosedChains(robot)
        moved = moved_joints(robot)
        candidates = {
            (a, int(c))
            for i, c in zip(tree.row, tree.column, strict=True)
            for a in np.flatnonzero(moved[i])
        }
        entries = sorted((int(a), c) for a, c in candidates)
        place = {entry: k for k, entry in enumerate(entries)}
        term = [
            (place[int(a), int(c)], e, int(i), int(a))
            for e, (i, c) in enumerate(zip(tree.row, tree.column, strict=True))
            for a in np.flatnonzero(moved[i])
        ]
        row = np.array([a for a, _ in entries], dtype=np.int64)
        return cls(
            robot,
            tuple(parameters),
            row,
            np.array([c for _, c in entries], dtype=np.int64),
            np.searchsorted(row, np.arange(robot.size + 1)),
            np.zeros(0, dtype=np.int64),
            tree._plan,
            chains=chains,
            tree=tree,
            term=np.array(term, dtype=np.int64).reshape(-1, 4),
        )

    def __reduce__(self) -> tuple:
        return type(self).of, (self.robot, self.parameters)

    def packed(
        self,
        q: np.ndarray,
        dq: np.ndarray,
        ddq: np.ndarray,
        out: np.ndarray | None = None,
        inner: np.ndarray | None = None,
        place: np.ndarray | None = None,
    ) -> np.ndarray:
        """As `Regressor.packed`; samples follow one another."""
        self._check_motion(np.transpose(q), np.transpose(dq), np.transpose(ddq))
        made, place = self._packed_out(out, place, np.shape(q)[1])

        def block(part: slice) -> None:
            motion = self.chains.motion(q[:, part], dq[:, part], ddq[:, part], part.start)
            packed = self.tree.packed(motion.q, motion.dq, motion.ddq)
            _project(self.term, place, motion.gain, packed, made, part.start)

        run_in_threads(block, _blocks(made.shape[1]))
        return made

    def matrix(
        self,
        q: np.ndarray,
        dq: np.ndarray,
        ddq: np.ndarray,
        out: np.ndarray | None = None,
        inner: np.ndarray | None = None,
    ) -> np.ndarray:
        """As `Regressor.matrix`; samples follow one another."""
        self._check_motion(q, dq, ddq)
        out = self._dense_out(out, q.shape[0])
        out[:, self.row, self.column] = self.packed(q.T, dq.T, ddq.T).T
        return out

    def _weighted_sum(
        self, weights: np.ndarray, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, inner: np.ndarray
    ) -> np.ndarray:
        """Sum of each joint's entries with given weights, shape (samples, joints).

        Nᵀ (Y θ), θ from the entries' weights: one product for each joint in place of each entry.
        """
        tau, theta = working_array(q.shape), np.zeros(len(self.parameters))
        theta[self.column] = weights

        def block(part: slice) -> None:
            motion = self.chains.motion(q[part].T, dq[part].T, ddq[part].T, part.start)
            torque = self.tree.torque(motion.q.T, motion.dq.T, motion.ddq.T, theta)
            _project_torque(motion.gain, torque, tau, part.start)

        run_in_threads(block, _blocks(len(q)))
        return tau


def _blocks(samples: int) -> list[slice]:
    return [slice(k, min(k + BLOCK, samples)) for k in range(0, samples, BLOCK)]
