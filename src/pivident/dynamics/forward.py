"""Forward dynamics: mass matrix, bias torques and acceleration from linear parameters; (P-5).

    M(q) ddq + h(q, dq) + friction(dq, q, z, load) = tau

Base parameters suffice: assigned to the heads of their groups they leave some links without mass,
which the linear ten-parameter form of the kernels allows.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from pivident.compiled import allocating
from pivident.dynamics.closed_chains.closed_dynamics import (
    ClosedModel,
    closed_mass_and_bias,
    closed_model,
    closed_run,
    on_own_joints,
)
from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.dynamics.closed_chains.passive_springs import position_torque
from pivident.dynamics.friction_kernels import level_and_slope
from pivident.dynamics.friction_table import (
    AHEAD,
    PATH_ROWS,
    STATE,
    FrictionTable,
    clipped_friction,
    friction_torque,
    make_friction_table,
    path_entries,
    path_torque,
    slopes_width,
    spring_torque,
)
from pivident.dynamics.kernels import (
    Tree,
    invert_mass_matrix,
    mass_matrix_and_bias,
    rigid_body_work,
    tree_of,
)
from pivident.dynamics.parameters import Parameter
from pivident.errors import LoopNotClosed, MassMatrixNotPositiveDefinite
from pivident.robot.description import INERTIAL, Robot


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
def _accelerations(model, q, dq, tau, states, out, failure):
    """Accelerations at many states; the first indefinite mass matrix is reported."""
    n = q.shape[1]
    f = model.friction
    work = rigid_body_work(n)
    mass, factor, inverse, bias = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    couplings = f.pair_index.shape[0]
    vectors = np.zeros((5, n))
    slopes = np.zeros((1, slopes_width(n, couplings)))
    path = np.zeros((PATH_ROWS, f.path_index.shape[0]))
    position, speed, friction, still, spring = 0, 1, 2, 3, 4
    for s in range(q.shape[0]):
        mass_matrix_and_bias(model.tree, model.inertia, model.rotor, q[s], dq[s], work, mass, bias)
        joint = invert_mass_matrix(mass, factor, inverse)
        if joint >= 0:
            failure[0] = factor[joint, joint]
            return joint, s
        vectors[position], vectors[speed], vectors[spring] = q[s], dq[s], 0.0
        path[STATE] = states[s]
        friction_torque(
            f.linear, f.term_index, f.term_value, f.pair_index, f.pair_value,
            vectors, speed, friction, slopes, 0,
        )  # fmt: skip
        path_torque(
            f.path_index, f.path_value, path, AHEAD, couplings, tau[s],
            vectors, position, speed, 0.0, still, speed, friction, slopes, 0,
        )  # fmt: skip
        spring_torque(f.path_index, f.path_value, vectors, position, spring)
        for i in range(n):
            out[s, i] = 0.0
            for j in range(n):
                net = tau[s, j] - bias[j] - vectors[spring, j] - vectors[friction, j]
                out[s, i] += inverse[i, j] * net
    return -1, -1


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
    (q,) = _states(robot, q)
    out = np.zeros((len(q), robot.size, robot.size))
    model = make_model(robot, parameters, theta)
    if model.closed is not None:
        return _closed_states(robot, model, model.closed, q, np.zeros(q.shape))[0]
    _mass_matrices(model, q, out)
    return out


def _closed_states(
    robot: Robot, model: Model, closed: ClosedModel, q: np.ndarray, dq: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """M_a and h_a at many states that need not follow one another."""
    chains = ClosedChains(robot)
    mass, bias = np.zeros((*q.shape, robot.size)), np.zeros(q.shape)
    for s in range(len(q)):
        run = closed_run(closed, chains.start(q[s]))
        status = closed_mass_and_bias(run, model.rotor, q[s], dq[s], mass[s], bias[s])
        if status:
            raise LoopNotClosed(status, q[s], robot.joint_names, s)
    return mass, bias


def _closed_acceleration(
    robot: Robot, model: Model, closed: ClosedModel, q: np.ndarray, dq: np.ndarray, tau: np.ndarray
) -> np.ndarray:
    """M_a⁻¹ (τ - h_a - friction) of a closed mechanism."""
    mass, bias = _closed_states(robot, model, closed, q, dq)
    f, n = model.friction, robot.size
    vectors, slopes = np.zeros((3, n)), np.zeros((1, slopes_width(n, len(f.pair_index))))
    net = tau - bias
    for s in range(len(q)):
        vectors[0], vectors[2] = dq[s], q[s]
        friction_torque(
            f.linear, f.term_index, f.term_value, f.pair_index, f.pair_value, vectors, 0, 1, slopes,
            0,
        )  # fmt: skip
        position_torque(f.path_index, f.path_value, vectors, 2, 1)
        net[s] -= vectors[1]
        try:
            np.linalg.cholesky(mass[s])
        except np.linalg.LinAlgError:
            lowest = float(np.linalg.eigvalsh(mass[s])[0])
            raise MassMatrixNotPositiveDefinite(robot.joint_names[0], float(s), lowest) from None
    return np.linalg.solve(mass, net[..., None])[..., 0]


def friction_states(robot: Robot, parameters: tuple[Parameter, ...]) -> tuple[str, ...]:
    """Names of the parameters whose friction has a state z, in the order of the states.

    Terms that share a state, fc and fd of LuGre friction, have one name, that of the first.
    """
    entries = path_entries(parameters, np.zeros(len(parameters)))
    table = make_friction_table(robot, parameters, np.zeros(len(parameters)))
    return tuple(entries[e].name for e in table.memories)


def acceleration(
    robot: Robot,
    parameters: tuple[Parameter, ...],
    theta: np.ndarray,
    q: np.ndarray,
    dq: np.ndarray,
    tau: np.ndarray,
    state: Literal["relaxed", "sliding"] | np.ndarray | None = None,
) -> np.ndarray:
    """M(q)⁻¹ (tau - h(q, dq) - friction) [rad/s² or m/s²], all of shape (samples, joints).

    Hard signs are smoothed. Friction with memory needs its ``state``: "relaxed" (z = 0, as a record
    starts), "sliding" (z = ±g(dq), after a long way in the direction of the speed), or the states z
    in the order of ``friction_states``, shape (samples, states).
    """
    q, dq, tau = _states(robot, q, dq, tau)
    model = make_model(robot, parameters, theta)
    if model.closed is not None:
        return _closed_acceleration(robot, model, model.closed, q, dq, tau)
    states = _memory(model.friction, dq, state)
    out, failure = np.zeros(q.shape), np.zeros(1)
    joint, sample = _accelerations(model, q, dq, tau, states, out, failure)
    if joint >= 0:
        raise MassMatrixNotPositiveDefinite(robot.joint_names[joint], float(sample), failure[0])
    return out


def _memory(friction: FrictionTable, dq: np.ndarray, state: str | np.ndarray | None) -> np.ndarray:
    """States of all entries of the path table, shape (samples, entries)."""
    entries = friction.memories
    states = np.zeros((len(dq), len(friction.path_index)))
    if not entries.size:
        return states
    if state is None:
        raise ValueError(
            "this friction has a memory, so its state must be given: state='sliding' for a joint "
            "that has moved some way, state='relaxed', or the states z"
        )
    if isinstance(state, str):
        if state not in ("relaxed", "sliding"):
            raise ValueError(f"state {state!r} is not known; 'relaxed' and 'sliding' are")
        for e in entries if state == "sliding" else ():
            excess, inverse_speed, exponent = friction.path_value[e, 3:]
            v = dq[:, friction.path_index[e, 0]]
            level = np.array([level_and_slope(excess, inverse_speed, exponent, x)[0] for x in v])
            states[:, e] = np.sign(v) * level
        return states
    wanted = (len(dq), entries.size)
    if np.shape(state) != wanted:
        raise ValueError(f"state has shape {np.shape(state)}; (samples, states) = {wanted}")
    states[:, entries] = state
    return states


def _states(robot: Robot, *signals: np.ndarray) -> list[np.ndarray]:
    """Signals (samples, joints) as C arrays, shapes checked: the compiled loops do not."""
    wanted = (len(signals[0]), robot.size)
    if any(np.shape(x) != wanted for x in signals):
        shapes = ", ".join(str(np.shape(x)) for x in signals)
        raise ValueError(f"arrays have shapes {shapes}, (samples, joints) = {wanted} is needed")
    return [np.ascontiguousarray(x, dtype=float) for x in signals]
