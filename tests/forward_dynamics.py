"""Accelerations that robots have under torques, from the compiled parts of the simulation.

M(q) ddq + h(q, dq) + friction(dq, q, z, load) = tau
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from pivident.dynamics.closed_chains.closed_dynamics import (
    ClosedModel,
)
from pivident.dynamics.forward import Model, checked_states, closed_states, make_model
from pivident.dynamics.friction_kernels import level_and_slope
from pivident.dynamics.friction_table import (
    AHEAD,
    OF_POSITION,
    PATH_ROWS,
    SPRINGS,
    STATE,
    FrictionTable,
    friction_torque,
    make_friction_table,
    path_entries,
    path_torque,
    position_torque,
    slopes_width,
)
from pivident.dynamics.kernels import (
    invert_mass_matrix,
    mass_matrix_and_bias,
    rigid_body_work,
)
from pivident.dynamics.parameters import Parameter
from pivident.foundation.compiled import allocating
from pivident.foundation.errors import MassMatrixNotPositiveDefinite
from pivident.robot.description import Robot


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
    q, dq, tau = checked_states(robot, q, dq, tau)
    model = make_model(robot, parameters, theta)
    if model.closed is not None:
        return _closed_acceleration(robot, model, model.closed, q, dq, tau)
    states = _memory(model.friction, dq, state)
    out, failure = np.zeros(q.shape), np.zeros(1)
    joint, sample = _accelerations(model, q, dq, tau, states, out, failure)
    if joint >= 0:
        raise MassMatrixNotPositiveDefinite(robot.joint_names[joint], float(sample), failure[0])
    return out


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
        position_torque(f.path_index, f.path_value, vectors, position, spring, SPRINGS)
        for i in range(n):
            out[s, i] = 0.0
            for j in range(n):
                net = tau[s, j] - bias[j] - vectors[spring, j] - vectors[friction, j]
                out[s, i] += inverse[i, j] * net
    return -1, -1


def _closed_acceleration(
    robot: Robot, model: Model, closed: ClosedModel, q: np.ndarray, dq: np.ndarray, tau: np.ndarray
) -> np.ndarray:
    """M_a⁻¹ (τ - h_a - friction) of a closed mechanism."""
    mass, bias = closed_states(robot, model, closed, q, dq)
    f, n = model.friction, robot.size
    vectors, slopes = np.zeros((3, n)), np.zeros((1, slopes_width(n, len(f.pair_index))))
    net = tau - bias
    for s in range(len(q)):
        vectors[0], vectors[2] = dq[s], q[s]
        friction_torque(
            f.linear, f.term_index, f.term_value, f.pair_index, f.pair_value, vectors, 0, 1, slopes,
            0,
        )  # fmt: skip
        position_torque(f.path_index, f.path_value, vectors, 2, 1, OF_POSITION)
        net[s] -= vectors[1]
        try:
            np.linalg.cholesky(mass[s])
        except np.linalg.LinAlgError:
            lowest = float(np.linalg.eigvalsh(mass[s])[0])
            raise MassMatrixNotPositiveDefinite(robot.joint_names[0], float(s), lowest) from None
    return np.linalg.solve(mass, net[..., None])[..., 0]


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


def friction_states(robot: Robot, parameters: tuple[Parameter, ...]) -> tuple[str, ...]:
    """Names of the parameters whose friction has a state z, in the order of the states.

    Terms that share a state, fc and fd of LuGre friction, have one name, that of the first.
    """
    entries = path_entries(parameters, np.zeros(len(parameters)))
    table = make_friction_table(robot, parameters, np.zeros(len(parameters)))
    return tuple(entries[e].name for e in table.memories)
