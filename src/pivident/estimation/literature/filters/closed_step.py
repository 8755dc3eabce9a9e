"""A mechanism with closed loops in the step of a filter: torques and slopes of its tree, projected.

With q, dq and ddq of all joints where the loops are closed, dq = N v and ddq = N a + γ,

    ID_a(q_a, v, a) = Nᵀ ID(q, dq, ddq),     M_a = Nᵀ M N,     Φ_a = Nᵀ Φ

The local terms of all joints, passive ones too, are those of the tree. Rotors turn with independent
joints and are counted there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pivident.dynamics.closed_chains.closed_dynamics import (
    BIAS,
    FRICTION,
    ClosedModel,
    ClosedRun,
    closed_mass,
    closed_run,
)
from pivident.dynamics.closed_chains.closed_motion import closed_place
from pivident.dynamics.closed_chains.closed_slopes import (
    ClosedSlopes,
    closed_slopes,
    project_columns,
    project_slopes,
    tree_slopes,
)
from pivident.dynamics.closed_chains.closure_kernels import (
    CLOSED,
    close_loops,
    lead_on,
    move_closed,
)
from pivident.dynamics.closed_chains.closure_table import closure_work
from pivident.dynamics.kernels import bias_torque
from pivident.dynamics.rigid_body_slopes import inertial_columns, move_links, place_links
from pivident.estimation.literature.filters.robot_equations import (
    add_local_columns,
    add_local_slopes,
    local_torques,
)
from pivident.foundation.compiled import inlined, inner

# Rows of ``ClosedStep.vectors``: ddq, zeros, positions before an attempt to close the loops.
_ACCELERATION, _STILL, _BEFORE, _ROWS = 0, 1, 2, 3


class ClosedStep(NamedTuple):
    """Where a mechanism is in a step, and scratch."""

    run: ClosedRun  # its friction table is empty: local terms are those of ``RobotEquations``
    slopes: ClosedSlopes
    vectors: np.ndarray  # see above, (3, tree joints)
    rotor: np.ndarray  # of the independent joints, (joints, joints)
    columns: np.ndarray  # Φ of the tree, (tree joints, parameters)


def closed_step(
    model: ClosedModel, parameters: int, q: np.ndarray | None, joint_names: Sequence[str]
) -> ClosedStep:
    """A mechanism near independent positions, (joints,), or at the posture of its description.

    Raises:
        LoopNotClosed: on the way there the loops do not close.
    """
    table = model.table
    n, m = table.posture.size, table.places.size
    place = closure_work(table) if q is None else closed_place(table, q, joint_names)
    return ClosedStep(
        closed_run(model, place), closed_slopes(model), np.zeros((_ROWS, n)), np.zeros((m, m)),
        np.zeros((n, parameters)),
    )  # fmt: skip


@inner
def place_closed(closed, q, v):
    """Close the loops at independent positions and speeds, (joints,); whether they close.

    If not the mechanism stays where it was, so that others may be found from there.
    """
    table, place, before = closed.run.model.table, closed.run.place, closed.vectors[_BEFORE]
    for i in range(before.size):
        before[i] = place.q[i]
    lead_on(table, place, q)
    for a in range(v.size):
        place.dq[table.places[a]] = v[a]
    if close_loops(table, place) == CLOSED:
        return True
    for i in range(before.size):
        place.q[i], place.dq[i], place.drift[i] = before[i], 0.0, 0.0
    place.held[0], place.time[0] = 0, 0.0
    return False


@inlined
def take_rotors(closed, rotor):
    """Rotors of the independent joints from those of all, (tree joints, tree joints)."""
    places = closed.run.model.table.places
    for a in range(places.size):
        for b in range(places.size):
            closed.rotor[a, b] = rotor[places[a], places[b]]


@inner
def closed_masses(closed, rotor, mass):
    """M_a with rotors, (joints, joints), where the loops are closed; ``rotor``: of all joints."""
    take_rotors(closed, rotor)
    closed_mass(closed.run, closed.rotor, mass)


@inlined
def _accelerate(closed, a):
    """Accelerations of all joints, N a + γ; None, decided by its type: γ."""
    place, ddq = closed.run.place, closed.vectors[_ACCELERATION]
    for i in range(ddq.size):
        ddq[i] = place.drift[i]
        if a is not None:
            for b in range(a.size):
                ddq[i] += place.gain[i, b] * a[b]


@inner
def closed_torques(closed, local_index, local_value, used, v, a, rigid, local, by_speed):
    """Nᵀ ID without rotors at speeds v, where ``place_closed`` has been, in two parts.

    ``a``: independent accelerations, (joints,), or None: zero; ``rigid local``: receive torques of
    the rigid bodies and of local terms, (joints,); ``by_speed``: the slopes of the latter by v.
    """
    run, slopes, ddq = closed.run, closed.slopes, closed.vectors[_ACCELERATION]
    place, tree, vectors, gain = run.place, run.model.table.tree, run.vectors, run.place.gain
    n, m = gain.shape
    move_closed(run.model.table, place, v)
    _accelerate(closed, a)
    bias_torque(
        tree.parent, tree.prismatic, tree.gravity, place.pose, run.model.inertia, place.dq, ddq,
        run.motion, run.force, vectors[BIAS],
    )  # fmt: skip
    local_torques(
        local_index, local_value, used, place.q, place.dq, closed.vectors[_STILL],
        vectors[FRICTION], slopes.by_position, slopes.by_speed,
    )  # fmt: skip
    for b in range(m):
        rigid[b], local[b] = 0.0, 0.0
        for i in range(n):
            rigid[b] += gain[i, b] * vectors[BIAS, i]
            local[b] += gain[i, b] * vectors[FRICTION, i]
    _project_matrix(gain, slopes.by_speed, by_speed)


@inlined
def _project_matrix(gain, matrix, out):
    """Nᵀ times a matrix of all joints times N; most of its elements are zero."""
    for b in range(out.shape[0]):
        for c in range(out.shape[1]):
            out[b, c] = 0.0
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            if matrix[i, j] != 0.0:
                for b in range(out.shape[0]):
                    share = gain[i, b] * matrix[i, j]
                    for c in range(out.shape[1]):
                        out[b, c] += share * gain[j, c]


@inner
def closed_torque_slopes(
    closed, local_index, local_value, used, a, links, body, by_position, by_speed
):
    """∂ID_a/∂q_a and ∂ID_a/∂v, (joints, joints); after ``closed_torques`` at accelerations ``a``.

    ``links body``: scratch of ``rigid_body_slopes`` for the tree, which receives its motion.
    """
    run, slopes, closure = closed.run, closed.slopes, closed.slopes.closure
    place, ddq, still = run.place, closed.vectors[_ACCELERATION], closed.vectors[_STILL]
    n, m = place.gain.shape
    tree_slopes(run, slopes, ddq, links, body)
    for i in range(n):
        for c in range(m):
            for b in range(m):  # of ddq not only γ depends on the posture
                closure.drift[i, c] += closure.gain[i, b, c] * a[b]
    # torques are there already: here they go to scratch
    add_local_slopes(
        local_index, local_value, used, place.q, place.dq, still, slopes.turned[0],
        slopes.by_position, slopes.by_speed,
    )  # fmt: skip
    project_slopes(run, slopes, by_position, by_speed)


@inner
def closed_columns(closed, inertial, local_index, local_value, links, out):
    """Φ_a, added to ``out``, (joints, parameters); after ``closed_torque_slopes``."""
    place, columns, ddq = closed.run.place, closed.columns, closed.vectors[_ACCELERATION]
    for i in range(columns.shape[0]):
        for k in range(columns.shape[1]):
            columns[i, k] = 0.0
    inertial_columns(closed.run.model.table.tree.parent, inertial, links, columns)
    add_local_columns(local_index, local_value, place.q, place.dq, ddq, columns)
    project_columns(place.gain, columns, out)


@inner
def move_closed_links(closed, a, links, body):
    """Motion of all links where ``place_closed`` has been, for ``closed_columns`` alone."""
    run, tree = closed.run, closed.run.model.table.tree
    _accelerate(closed, a)
    place_links(tree.parent, tree.prismatic, run.place.pose, run.model.inertia, links, body)
    ddq = closed.vectors[_ACCELERATION]
    move_links(tree.parent, tree.gravity, run.place.dq, ddq, links, body)
