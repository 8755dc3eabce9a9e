"""Torques of one model, prepared once: tau = Φ(q, dq, ddq) θ with θ folded in.

A controller asks for one state at a time. For that the compiled recursion of Newton and Euler runs
over the links, with the values of friction, rotors and couplings beside it; the observation matrix,
which is computed for whole tiles of samples, would take many times as long. Many samples are left
to the observation matrix, whose tiles then pay.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pivident.dynamics.entry_plan import ACCELERATION, joint_entry
from pivident.dynamics.friction_kernels import (
    VALUE,
    friction_value_and_slope,
    motion_value,
    position_value_and_slope,
    smooth_sign_and_slope,
)
from pivident.dynamics.friction_table import OF_POSITION
from pivident.dynamics.kernels import Tree, bias_torque, link_poses, rigid_body_work, tree_of
from pivident.dynamics.parameters import Parameter
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.foundation.compiled import allocating
from pivident.foundation.errors import UnusableValue
from pivident.robot.description import INERTIAL, Robot
from pivident.robot.friction_term import MAX_SHAPES
from pivident.robot.friction_terms.coulomb import LOAD

_LOAD = int(LOAD)


class StatePlan(NamedTuple):
    """A tree with values of its parameters, as arrays for the loop over one state."""

    tree: Tree
    inertia: np.ndarray  # ten inertial parameters of every link, (joints, 10)
    row: np.ndarray  # joint on which each other entry acts, those that carry load first, (entries,)
    joint_index: np.ndarray  # as in ``EntryPlan``, (entries, 4)
    joint_value: np.ndarray  # likewise, the parameter in the factor, (entries, 3 + MAX_SHAPES)
    carrying: int  # number of entries whose torque the joint carries


@dataclass(frozen=True, eq=False)
class InverseDynamics:
    """The torque that a model needs for a motion, as a function of q, dq and ddq.

    What does not depend on the motion is prepared when it is made. It holds no state, so that
    threads may share it.

    Attributes:
        robot: the robot.
        parameters: parameters of the model; all others are zero.
        theta: their values, shape (parameters,).
    """

    robot: Robot
    parameters: tuple[Parameter, ...]
    theta: np.ndarray
    _regressor: Regressor = field(init=False, repr=False)
    _plan: StatePlan | None = field(init=False, repr=False)

    def __post_init__(self) -> None:
        values = np.array(self.theta, dtype=float)
        regressor = regressor_of(self.robot, self.parameters)
        one_sample = self.robot.constraints is None and not self._remembers
        plan = _state_plan(regressor, values) if one_sample else None
        for name, made in (("theta", values), ("_regressor", regressor), ("_plan", plan)):
            object.__setattr__(self, name, made)

    def __reduce__(self) -> tuple:
        return InverseDynamics, (self.robot, self.parameters, self.theta)

    @property
    def _remembers(self) -> bool:
        """Whether there is friction that depends on the path so far."""
        return any(p.friction is not None and p.friction.has_memory for p in self.parameters)

    def __call__(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> np.ndarray:
        """Torque of one state or of many samples [N m or N], of the shape of ``q``.

        Args:
            q: joint positions [rad or m], shape (joints,) or (samples, joints).
            dq: joint speeds [rad/s or m/s], of the same shape.
            ddq: joint accelerations [rad/s² or m/s²], of the same shape.

        Raises:
            ValueError: other shapes; one state of friction with a memory, which needs the path.
        """
        q, dq, ddq = (np.ascontiguousarray(x, dtype=float) for x in (q, dq, ddq))
        if q.ndim != 1:
            return self._regressor.torque(q, dq, ddq, self.theta)
        if not q.shape == dq.shape == ddq.shape == (self.robot.size,):
            raise UnusableValue(
                f"q, dq, ddq have shapes {q.shape}, {dq.shape}, {ddq.shape}",
                advice=f"one state has ({self.robot.size},) each, many have one row for each",
            )
        if self._plan is not None:
            out = np.empty(q.shape)
            _torque_of_state(*self._plan, q, dq, ddq, out)
            return out
        if self._remembers:
            raise UnusableValue(
                "friction with a memory has no torque at a single state",
                advice="give the samples since standstill, shape (samples, joints)",
            )
        return self._regressor.torque(q[None], dq[None], ddq[None], self.theta)[0]


def _state_plan(regressor: Regressor, theta: np.ndarray) -> StatePlan:
    """Values of a tree's parameters for the loop over one state."""
    robot, parameters = regressor.robot, regressor.parameters
    inertia = np.zeros((robot.size, 10))
    for p, number in zip(parameters, theta, strict=True):
        if p.is_inertial:
            inertia[p.joint, INERTIAL.index(p.stem)] += number
    pairs = zip(regressor.row.tolist(), regressor.column.tolist(), strict=True)
    entries = [(joint, c) for joint, c in pairs if not parameters[c].is_inertial]
    entries.sort(key=lambda entry: not parameters[entry[1]].carries_load)
    rows = [joint_entry(robot, parameters[c], joint) for joint, c in entries]
    value = np.array([factors for _, factors in rows], dtype=float).reshape(-1, 3 + MAX_SHAPES)
    value[:, 0] *= theta[[c for _, c in entries]]
    return StatePlan(
        tree_of(robot),
        inertia,
        np.array([joint for joint, _ in entries], dtype=np.int64),
        np.array([places for places, _ in rows], dtype=np.int64).reshape(-1, 4),
        value,
        sum(parameters[c].carries_load for _, c in entries),
    )


@allocating
def _torque_of_state(tree, inertia, row, index, value, carrying, q, dq, ddq, out):
    """Torques of one state into ``out``, shape (joints,)."""
    work = rigid_body_work(q.size)
    link_poses(tree.prismatic, tree.rotation, tree.translation, q, work.pose)
    bias_torque(
        tree.parent, tree.prismatic, tree.gravity, work.pose, inertia, dq, ddq,
        work.motion, work.force, out,
    )  # fmt: skip
    load = out
    for e in range(row.size):
        if e == carrying:
            load = out.copy()
        function, sign, a, b = index[e, 0], index[e, 1], index[e, 2], index[e, 3]
        factor, gamma = value[e, 0], value[e, 2]
        first, second = value[e, 3], value[e, 4]
        if function == ACCELERATION:
            torque = ddq[a]
        elif sign <= OF_POSITION:
            torque = position_value_and_slope(function, first, second, q[a])[0]
        elif function == _LOAD:
            s, _ = smooth_sign_and_slope(sign, gamma, dq[a])
            torque = abs(load[row[e]]) * s
        elif function < 0:
            torque = motion_value(function, VALUE, sign, gamma, dq[a], load[row[e]], q[a])
        else:
            v = dq[a] + value[e, 1] * dq[b]
            torque = friction_value_and_slope(function, sign, gamma, first, second, v)[0]
        out[row[e]] += factor * torque
