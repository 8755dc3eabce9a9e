"""Forward dynamics: mass matrix and bias torques from linear parameters; (P-5).

    M(q) ddq + h(q, dq) + friction(dq, q, z, load) = tau

Base parameters suffice: assigned to the heads of their groups they leave some links without mass,
which the linear ten-parameter form of the kernels allows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pivident.dynamics.friction_table import (
    FrictionTable,
    clipped_friction,
    make_friction_table,
)
from pivident.dynamics.kernels import (
    Tree,
    mass_matrix_and_bias,
    rigid_body_work,
    tree_of,
)
from pivident.dynamics.parameters import Parameter
from pivident.foundation.compiled import allocating
from pivident.foundation.errors import LoopNotClosed, UnusableValue
from pivident.robot.description import INERTIAL, Robot

if TYPE_CHECKING:
    from pivident.dynamics.closed_chains.closed_dynamics import ClosedModel


class Model(NamedTuple):
    """A robot with parameter values, as arrays for the compiled loops.

    Tree and inertias are those of all links, rotors and friction of the joints that are driven.
    """

    tree: Tree
    inertia: np.ndarray  # ten inertial parameters of every link, (tree joints, 10)
    rotor: np.ndarray  # rotor inertias with couplings, (joints, joints)
    friction: FrictionTable
    closed: ClosedModel | None  # what closes the loops; None: a tree


def make_model(
    robot: Robot, parameters: tuple[Parameter, ...], theta: np.ndarray, clip: bool = False
) -> Model:
    """Values of standard parameters or heads of base groups for the loops; others are zero.

    ``clip`` replaces negative friction levels by zero, and |fl| by at most MAX_LOAD_SHARE: friction
    that feeds energy in makes the simulated loop diverge, and an iteration may pass through such
    values. Unclipped, load-dependent friction fl >= 1 is a ValueError.
    """
    tree = robot.tree
    inertia = np.zeros((tree.size, 10))
    values = np.array(theta, dtype=float)
    for k, p in enumerate(parameters):
        if clip and p.friction is not None:
            values[k] = clipped_friction(p.friction, values[k])
        elif clip and p.is_dissipative and p.stem not in ("ia", "iam"):
            values[k] = max(values[k], 0.0)
        if p.is_inertial:
            inertia[p.joint, INERTIAL.index(p.stem)] = values[k]
    if robot.constraints is None:
        friction = make_friction_table(robot, parameters, values)
        return Model(tree_of(robot), inertia, _rotors(robot, parameters, values), friction, None)
    from pivident.dynamics.closed_chains.closed_dynamics import closed_model, on_own_joints

    own = np.array([p.joint in robot.places for p in parameters], bool)
    driven, given = on_own_joints(robot, parameters), values[own]
    return Model(
        tree_of(tree),
        inertia,
        _rotors(robot, driven, given),
        make_friction_table(robot, driven, given),
        closed_model(robot, parameters, values, inertia),
    )


def _rotors(robot: Robot, parameters: tuple[Parameter, ...], values: np.ndarray) -> np.ndarray:
    """Rotor inertias with couplings, shape (joints, joints)."""
    rotor = np.zeros((robot.size, robot.size))
    for p, value in zip(parameters, values.tolist(), strict=True):
        if p.stem == "ia":
            rotor[p.joint, p.joint] = value
        elif p.coupling is not None and p.stem == "iam":
            i, j = p.coupling.motor, p.coupling.joint
            rotor[i, j] = rotor[j, i] = p.coupling.ratio * value
    return rotor


@allocating
def _mass_matrices(model, q, out):
    """M(q) at many positions, both triangles."""
    n = q.shape[1]
    work = rigid_body_work(n)
    bias, still = np.zeros(n), np.zeros(n)
    for s in range(q.shape[0]):
        mass_matrix_and_bias(
            model.tree, model.inertia, model.rotor, q[s], still, work, out[s], bias
        )
        for i in range(n):
            for j in range(i):
                out[s, j, i] = out[s, i, j]


def mass_matrix(
    robot: Robot, parameters: tuple[Parameter, ...], theta: np.ndarray, q: np.ndarray
) -> np.ndarray:
    """M(q) [kg m², kg m or kg], shape (samples, joints, joints), at positions (samples, joints)."""
    (q,) = checked_states(robot, q)
    out = np.zeros((len(q), robot.size, robot.size))
    model = make_model(robot, parameters, theta)
    if model.closed is not None:
        return closed_states(robot, model, model.closed, q, np.zeros(q.shape))[0]
    _mass_matrices(model, q, out)
    return out


def closed_states(
    robot: Robot, model: Model, closed: ClosedModel, q: np.ndarray, dq: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """M_a and h_a at many states that need not follow one another."""
    from pivident.dynamics.closed_chains.closed_dynamics import closed_mass_and_bias, closed_run
    from pivident.dynamics.closed_chains.closed_motion import ClosedChains

    chains = ClosedChains(robot)
    mass, bias = np.zeros((*q.shape, robot.size)), np.zeros(q.shape)
    for s in range(len(q)):
        run = closed_run(closed, chains.start(q[s]))
        status = closed_mass_and_bias(run, model.rotor, q[s], dq[s], mass[s], bias[s])
        if status:
            raise LoopNotClosed(status, q[s], robot.joint_names, s)
    return mass, bias


def checked_states(robot: Robot, *signals: np.ndarray) -> list[np.ndarray]:
    """Signals (samples, joints) as C arrays of their own, shapes checked: compiled loops do not."""
    wanted = (len(signals[0]), robot.size)
    if any(np.shape(x) != wanted for x in signals):
        shapes = ", ".join(str(np.shape(x)) for x in signals)
        raise UnusableValue(f"arrays have shapes {shapes}, (samples, joints) = {wanted} is needed")
    return [np.array(x, dtype=float, order="C") for x in signals]
