"""The equations of a robot as arrays for filters: torques, their slopes and columns at one instant.

    ID(q, dq, ddq; θ) = M(q; θ) ddq + h(q, dq; θ) + f(q, dq; θ) = Φ(q, dq, ddq) θ

f is friction, springs and couplings, *local* terms: each is a parameter times a function of the
speed dq_a + c dq_b of two motors or of one position. Dry friction is smoothed as in the simulator,
and a level below zero, which would feed energy in, counts as zero: only its column stays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pivident.dynamics.closed_chains.closed_dynamics import ClosedModel, closed_model
from pivident.dynamics.entry_plan import ACCELERATION, has_inner_signal, joint_entry
from pivident.dynamics.friction_kernels import (
    friction_value_and_slope,
    motion_values,
    position_value_and_slope,
)
from pivident.dynamics.kernels import Tree, tree_of
from pivident.dynamics.parameters import Parameter
from pivident.foundation.compiled import inlined, inner
from pivident.foundation.errors import ExperimentError
from pivident.robot.description import INERTIAL, Robot
from pivident.robot.friction_column import SignFunction
from pivident.robot.refusals import without_base

_OF_POSITION = int(SignFunction.NONE)
_HARD, _TANH = int(SignFunction.SIGN), int(SignFunction.TANH)

#: γ of a hyperbolic tangent that is a hard sign at any speed but zero.
HARD = 1e300

# Columns of ``local_index`` …
ROW, _FUNCTION, _SIGN, _A, _B, COLUMN = 0, 1, 2, 3, 4, 5
# … and of ``local_value``: factor, c, γ and the constants of a shape.
_FACTOR, _RATIO, _GAMMA, _FIRST, _SECOND = 0, 1, 2, 3, 4


class RobotEquations(NamedTuple):
    """A robot and the parameters that a filter estimates, in their order.

    Tree and entries are those of all joints, couplings those of the independent ones.
    """

    tree: Tree
    inertial: np.ndarray  # link, kind and parameter of each inertial one, links in order, (k, 3)
    local_index: np.ndarray  # joint, function, sign, joints a and b, parameter, (entries, 6)
    local_value: np.ndarray  # factor, c, γ and four constants, (entries, 7)
    floor: np.ndarray  # least value of a parameter that the dynamics take, (parameters,)
    couplings: np.ndarray  # motor, joint and ratio of motors with dry friction, (couplings, 3)
    loops: ClosedModel | None  # what closes loops, without its friction; None: a tree

    @property
    def joints(self) -> int:
        """Number of independent joints, those of a filter's state."""
        return len(self.tree.parent) if self.loops is None else len(self.loops.table.places)


def robot_equations(
    robot: Robot, parameters: tuple[Parameter, ...], simulated: bool = True
) -> RobotEquations:
    """The equations of a robot for some of its parameters; all others count as zero.

    ``simulated``: whether hard signs are smoothed, as the simulator needs.

    Raises:
        ExperimentError: friction with a memory or of the load, which (q, dq, θ) does not hold.
        RobotDescriptionError: a robot on a measured base.
    """
    without_base(robot, "a filter of the robot's state")
    tree, loops = robot.tree, None
    if robot.constraints is not None:
        loops = closed_model(robot, (), np.zeros(0), np.zeros((tree.size, 10)))
    inertial, index, value = [], [], []
    floor = np.full(len(parameters), -np.inf)
    for k, p in enumerate(parameters):
        if has_inner_signal(p):
            raise ExperimentError(
                f"{p.name} is friction with a memory or of the load, and a filter's state holds "
                "positions, speeds and parameters only",
                advice="use oloe or cloe, which simulate it, or another friction law",
            )
        if p.is_inertial:
            inertial.append((p.joint, INERTIAL.index(p.stem), k))
            continue
        dissipates = p.friction.is_dissipative if p.friction else p.is_dissipative
        if dissipates and p.stem not in ("ia", "iam"):
            floor[k] = 0.0
        joints = (p.joint,) if p.coupling is None else (p.coupling.joint, p.coupling.motor)
        for joint in joints:
            (function, sign, a, b), numbers = joint_entry(tree, p, joint, simulated)
            if sign == _HARD and not simulated:
                sign, numbers = _TANH, (*numbers[:2], HARD, *numbers[3:])
            index.append((joint, function, sign, a, b, k))
            value.append(numbers)
    dry = [(c.motor, c.joint, c.ratio) for c in robot.couplings if c.coulomb]
    return RobotEquations(
        tree_of(tree),
        np.array(sorted(inertial), dtype=np.int64).reshape(-1, 3),
        np.array(index, dtype=np.int64).reshape(-1, 6),
        np.array(value, dtype=float).reshape(-1, 7),
        floor,
        np.array(dry, dtype=float).reshape(-1, 3),
        loops,
    )


@inlined
def _local(index, value, e, q, dq, ddq):
    """One local term of a parameter of one, and its slopes by position and by speed."""
    function, a, b = index[e, _FUNCTION], index[e, _A], index[e, _B]
    v = dq[a] + value[e, _RATIO] * dq[b]
    first = value[e, _FIRST]
    f, by_position, by_speed = 0.0, 0.0, 0.0
    if function == ACCELERATION:
        f = ddq[a]
    elif index[e, _SIGN] <= _OF_POSITION:
        f, by_position = position_value_and_slope(function, first, value[e, _SECOND], q[a])
    elif function < 0:
        f, by_position, by_speed = motion_values(
            function, index[e, _SIGN], value[e, _GAMMA], v, q[a]
        )
    else:
        f, by_speed = friction_value_and_slope(
            function, index[e, _SIGN], value[e, _GAMMA], first, value[e, _SECOND], v
        )
    return f, by_position, by_speed


@inner
def take_parameters(inertial, local_index, local_value, floor, theta, inertia, rotor, used):
    """Parameters as the rigid body needs them: ``inertia`` (joints, 10), ``rotor`` and ``used``."""
    for i in range(inertia.shape[0]):
        for c in range(10):
            inertia[i, c] = 0.0
        for j in range(inertia.shape[0]):
            rotor[i, j] = 0.0
    for k in range(used.size):
        used[k] = max(theta[k], floor[k])
    for e in range(inertial.shape[0]):
        inertia[inertial[e, 0], inertial[e, 1]] += theta[inertial[e, 2]]
    for e in range(local_index.shape[0]):
        if local_index[e, _FUNCTION] == ACCELERATION:
            i, j = local_index[e, ROW], local_index[e, _A]
            rotor[i, j] += local_value[e, _FACTOR] * theta[local_index[e, COLUMN]]


@inner
def local_torques(local_index, local_value, used, q, dq, still, torque, by_position, by_speed):
    """Torques of all local terms but rotors, and slopes by positions and speeds, both (n, n)."""
    n = q.size
    for i in range(n):
        torque[i] = 0.0
        for j in range(n):
            by_position[i, j], by_speed[i, j] = 0.0, 0.0
    add_local_slopes(local_index, local_value, used, q, dq, still, torque, by_position, by_speed)


@inner
def add_local_slopes(local_index, local_value, used, q, dq, still, torque, by_position, by_speed):
    """The same, added; ``still``: accelerations of zero, shape (joints,)."""
    for e in range(local_index.shape[0]):
        if local_index[e, _FUNCTION] == ACCELERATION:
            continue
        f, of_position, of_speed = _local(local_index, local_value, e, q, dq, still)
        i, a, b = local_index[e, ROW], local_index[e, _A], local_index[e, _B]
        size = local_value[e, _FACTOR] * used[local_index[e, COLUMN]]
        torque[i] += size * f
        by_position[i, a] += size * of_position
        by_speed[i, a] += size * of_speed
        if local_value[e, _RATIO] != 0.0:
            by_speed[i, b] += size * local_value[e, _RATIO] * of_speed


@inner
def add_local_columns(local_index, local_value, q, dq, ddq, phi):
    """Columns of the local terms, rotors with them, added to ``phi``, (joints, parameters)."""
    for e in range(local_index.shape[0]):
        f, _, _ = _local(local_index, local_value, e, q, dq, ddq)
        phi[local_index[e, ROW], local_index[e, COLUMN]] += local_value[e, _FACTOR] * f
