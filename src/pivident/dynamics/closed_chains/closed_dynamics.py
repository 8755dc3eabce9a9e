"""Mass matrix and bias torques of a closed mechanism in its independent joints.

    M_a = Nᵀ M N + J,    h_a = Nᵀ (h + M γ + f_p),    M_a ddq_a + h_a + friction = τ_a

M, h and the friction f_p of passive joints, springs and ripple included, are those of the tree at
the posture that closes the loops, J the rotors.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pivident.dynamics.closed_chains.closure_kernels import CLOSED, close_loops, lead_on
from pivident.dynamics.closed_chains.closure_table import ClosureTable, ClosureWork, closure_table
from pivident.dynamics.friction_table import (
    OF_POSITION,
    FrictionTable,
    friction_torque,
    make_friction_table,
    position_torque,
    slopes_width,
)
from pivident.dynamics.kernels import bias_torque, composite_mass_matrix
from pivident.dynamics.parameters import Parameter
from pivident.foundation.compiled import inlined, inner, kernel, rows
from pivident.robot.description import Robot

# Rows of ``ClosedRun.vectors``: of all joints speeds, friction, h + M γ, a row of M N, positions.
_SPEED, FRICTION, BIAS, _CARRIED, POSITION, _ROWS = rows(0, 1, 2, 3, 4, 5)

#: The only row of ``ClosedRun.slopes``.
(_SLOPES,) = rows(0)


class ClosedModel(NamedTuple):
    """What a simulation needs of a closed mechanism beside its independent joints."""

    table: ClosureTable
    inertia: np.ndarray  # ten inertial parameters of every link of the tree, (tree joints, 10)
    friction: FrictionTable  # of the passive joints, counted in the tree


class ClosedRun(NamedTuple):
    """State and scratch of a simulation of it."""

    model: ClosedModel
    place: ClosureWork
    motion: np.ndarray  # scratch of the rigid bodies, (tree joints, 9)
    force: np.ndarray  # (tree joints, 6)
    composite: np.ndarray  # (tree joints, 10)
    no_rotor: np.ndarray  # zeros, (tree joints, tree joints)
    mass: np.ndarray  # M, (tree joints, tree joints)
    vectors: np.ndarray  # (rows, tree joints)
    slopes: np.ndarray  # scratch of friction


def closed_model(
    robot: Robot, parameters: tuple[Parameter, ...], values: np.ndarray, inertia: np.ndarray
) -> ClosedModel:
    """The part of a model that only closed mechanisms have."""
    passive = [k for k, p in enumerate(parameters) if p.friction and p.joint not in robot.places]
    own = tuple(parameters[k] for k in passive)
    return ClosedModel(
        closure_table(robot), inertia, make_friction_table(robot.tree, own, values[passive])
    )


def on_own_joints(robot: Robot, parameters: tuple[Parameter, ...]) -> tuple[Parameter, ...]:
    """Parameters that belong to independent joints, which are counted among themselves."""
    place = {i: j for j, i in enumerate(robot.places)}
    pairs = dict(zip(robot.tree.couplings, robot.couplings, strict=True))
    return tuple(
        replace(p, joint=place[p.joint], coupling=pairs[p.coupling] if p.coupling else None)
        for p in parameters
        if p.joint in place
    )


def closed_run(model: ClosedModel, place: ClosureWork) -> ClosedRun:
    """A simulation at a place."""
    n = len(place.gain)
    return ClosedRun(
        model, place, np.zeros((n, 9)), np.zeros((n, 6)), np.zeros((n, 10)), np.zeros((n, n)),
        np.zeros((n, n)), np.zeros((_ROWS, n)),
        np.zeros((1, slopes_width(n, len(model.friction.pair_index)))),
    )  # fmt: skip


@inlined
def tree_torque(run, i):
    """H + M γ + f_p in a joint of the tree, where ``closed_bias`` has been."""
    return run.vectors[BIAS, i] + run.vectors[FRICTION, i]


@inner
def closed_bias(run, q, dq, bias):
    """Close the loops at independent positions and speeds, and h_a; status, see above."""
    table, place, friction = run.model.table, run.place, run.model.friction
    tree, inertia, vectors = table.tree, run.model.inertia, run.vectors
    n, m = place.gain.shape
    lead_on(table, place, q)
    for a in range(m):
        place.dq[table.places[a]] = dq[a]
    status = close_loops(table, place)
    if status != CLOSED:
        return status
    for i in range(n):
        vectors[_SPEED, i], vectors[POSITION, i] = place.dq[i], place.q[i]
    bias_torque(
        tree.parent, tree.prismatic, tree.gravity, place.pose, inertia, place.dq, place.drift,
        run.motion, run.force, vectors[BIAS],
    )  # fmt: skip
    friction_torque(
        friction.linear, friction.term_index, friction.term_value, friction.pair_index,
        friction.pair_value, vectors, _SPEED, FRICTION, run.slopes, _SLOPES,
    )  # fmt: skip
    position_torque(
        friction.path_index, friction.path_value, vectors, POSITION, FRICTION, OF_POSITION
    )
    for a in range(m):
        bias[a] = 0.0
    for i in range(n):
        torque = tree_torque(run, i)
        for a in range(m):
            bias[a] += place.gain[i, a] * torque
    return CLOSED


@inner
def closed_mass(run, rotor, mass):
    """M_a at the place of ``closed_bias``, both triangles.

    M_ij of the tree is zero unless one of both joints is beyond the other.
    """
    gain, tree = run.place.gain, run.model.table.tree
    parent = tree.parent
    n, m = gain.shape
    composite_mass_matrix(
        parent, tree.prismatic, run.place.pose, run.model.inertia, run.no_rotor, run.composite,
        run.mass,
    )  # fmt: skip
    for a in range(m):
        for b in range(a + 1):
            mass[a, b] = rotor[a, b]
    carried = run.vectors[_CARRIED]
    for i in range(n):
        for a in range(m):
            carried[a] = 0.5 * run.mass[i, i] * gain[i, a]
        j = parent[i]
        while j >= 0:
            for a in range(m):
                carried[a] += run.mass[i, j] * gain[j, a]
            j = parent[j]
        for a in range(m):
            for b in range(a + 1):
                mass[a, b] += gain[i, a] * carried[b] + gain[i, b] * carried[a]
    for a in range(m):
        for b in range(a):
            mass[b, a] = mass[a, b]


@kernel
def closed_mass_and_bias(run, rotor, q, dq, mass, bias):
    """Both at one state; status."""
    status = closed_bias(run, q, dq, bias)
    if status == CLOSED:
        closed_mass(run, rotor, mass)
    return status
