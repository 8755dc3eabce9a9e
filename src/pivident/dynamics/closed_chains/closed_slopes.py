"""Slopes of M_a and h_a of closed mechanisms along their independent motion and their parameters.

With u = h + M γ + f_p, the torques in all joints of the tree while the independent ones do not
accelerate, of which h_a = Nᵀ u,

    ∂h_a/∂q_c  = (∂N/∂q_c)ᵀ u + Nᵀ (∂u/∂q N_c + ∂u/∂dq ∂N/∂q_c dq_a + M ∂γ/∂q_c)
    ∂h_a/∂dq_c = Nᵀ (∂u/∂dq N_c + 2 M ∂N/∂q_c dq_a)
    ∂M_a/∂q_c  = Nᵀ (Σ_k ∂M/∂q_k N_kc) N + (∂N/∂q_c)ᵀ M N + Nᵀ M ∂N/∂q_c

and along parameters Nᵀ Y, Nᵀ ∂M/∂θ N; ∂N_a/∂q_c = ∂N_c/∂q_a.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pivident.dynamics.closed_chains.closed_dynamics import POSITION, ClosedModel, tree_torque
from pivident.dynamics.closed_chains.closure_slopes import (
    ClosureSlopes,
    closure_slopes,
    find_closure_slopes,
)
from pivident.dynamics.friction_table import OF_POSITION
from pivident.dynamics.kernels import composite_mass_matrix
from pivident.dynamics.path_partials import position_slopes
from pivident.dynamics.rigid_body_slopes import (
    inertial_masses,
    mass_slopes,
    move_links,
    place_links,
    torque_slopes,
)
from pivident.foundation.compiled import inlined, inner


class ClosedSlopes(NamedTuple):
    """Scratch of the slopes of a closed mechanism."""

    closure: ClosureSlopes
    by_position: np.ndarray  # ∂u/∂q at constant γ, (tree joints, tree joints)
    by_speed: np.ndarray  # ∂u/∂dq, likewise
    of_mass: np.ndarray  # ∂M_ij/∂q_k, (tree joints, tree joints, tree joints)
    turned: np.ndarray  # ∂N/∂q_c dq_a and two more columns, (3, tree joints)
    product: np.ndarray  # (tree joints, joints)


def closed_slopes(model: ClosedModel) -> ClosedSlopes:
    """Empty slopes of a mechanism."""
    n, m = model.table.posture.size, model.table.places.size
    return ClosedSlopes(
        closure=closure_slopes(model.table),
        by_position=np.zeros((n, n)),
        by_speed=np.zeros((n, n)),
        of_mass=np.zeros((n, n, n)),
        turned=np.zeros((3, n)),
        product=np.zeros((n, m)),
    )


@inner
def bias_slopes(run, slopes, links, body, by_position, by_speed):
    """∂h_a/∂q_a and ∂h_a/∂dq_a, (joints, joints), where ``closed_bias`` has been.

    ``links body``: scratch of ``rigid_body_slopes`` for the tree, which receives its motion.
    """
    tree_slopes(run, slopes, run.place.drift, links, body)
    for i in range(run.mass.shape[0]):
        slopes.by_speed[i, i] += run.slopes[0, i]
    friction = run.model.friction
    position_slopes(
        friction.path_index,
        friction.path_value,
        run.vectors,
        POSITION,
        slopes.by_position,
        OF_POSITION,
    )
    project_slopes(run, slopes, by_position, by_speed)


@inner
def tree_slopes(run, slopes, ddq, links, body):
    """∂N/∂q_a and ∂γ/∂q_a, and of the tree M, ∂u/∂q and ∂u/∂dq without friction, at ``ddq``.

    ``ddq``: accelerations of all joints; ``links body``: as for ``bias_slopes``.
    """
    table, place = run.model.table, run.place
    tree = table.tree
    find_closure_slopes(table, place, slopes.closure)
    place_links(tree.parent, tree.prismatic, place.pose, run.model.inertia, links, body)
    move_links(tree.parent, tree.gravity, place.dq, ddq, links, body)
    torque_slopes(tree.parent, tree.gravity, links, body, slopes.by_position, slopes.by_speed)
    composite_mass_matrix(
        tree.parent, tree.prismatic, place.pose, run.model.inertia, run.no_rotor, run.composite,
        run.mass,
    )  # fmt: skip
    for i in range(run.mass.shape[0]):
        for j in range(i):
            run.mass[j, i] = run.mass[i, j]


@inner
def project_slopes(run, slopes, by_position, by_speed):
    """∂/∂q_a and ∂/∂dq_a of Nᵀ u, (joints, joints), from those of the tree; see above."""
    table, place, closure = run.model.table, run.place, slopes.closure
    gain = place.gain
    n, m = gain.shape
    turned, of_q, of_dq = slopes.turned[0], slopes.turned[1], slopes.turned[2]
    for c in range(m):
        for i in range(n):
            turned[i] = 0.0
            for a in range(m):
                turned[i] += closure.gain[i, a, c] * place.dq[table.places[a]]
        for i in range(n):
            of_q[i], of_dq[i] = 0.0, 0.0
            for j in range(n):
                of_q[i] += slopes.by_position[i, j] * gain[j, c]
                of_q[i] += slopes.by_speed[i, j] * turned[j]
                of_q[i] += run.mass[i, j] * closure.drift[j, c]
                of_dq[i] += slopes.by_speed[i, j] * gain[j, c]
                of_dq[i] += 2.0 * run.mass[i, j] * turned[j]
        for a in range(m):
            by_position[a, c], by_speed[a, c] = 0.0, 0.0
            for i in range(n):
                by_position[a, c] += gain[i, a] * of_q[i]
                by_position[a, c] += closure.gain[i, a, c] * tree_torque(run, i)
                by_speed[a, c] += gain[i, a] * of_dq[i]


@inlined
def project_columns(gain, columns, out):
    """Nᵀ times columns of all joints, added to ``out``, (joints, columns)."""
    for i in range(gain.shape[0]):
        for a in range(gain.shape[1]):
            if gain[i, a] != 0.0:
                for d in range(columns.shape[1]):
                    out[a, d] += gain[i, a] * columns[i, d]


@inner
def mass_matrix_slopes(run, slopes, links, body, out):
    """∂M_a/∂q_c of the lower triangle, (joints a, joints b ≤ a, joints c).

    Needs ``bias_slopes``.
    """
    tree, gain, product = run.model.table.tree, run.place.gain, slopes.product
    n, m = gain.shape
    mass_slopes(tree.parent, links, body, slopes.of_mass)
    for c in range(m):
        for i in range(n):
            for b in range(m):
                product[i, b] = 0.0
        for i in range(n):
            for j in range(i + 1):
                turned = 0.0
                for k in range(n):
                    turned += slopes.of_mass[i, j, k] * gain[k, c]
                for b in range(m):
                    product[i, b] += turned * gain[j, b]
                    if j != i:
                        product[j, b] += turned * gain[i, b]
            for b in range(m):
                for j in range(n):
                    product[i, b] += run.mass[i, j] * slopes.closure.gain[j, b, c]
        for a in range(m):
            for b in range(a + 1):
                out[a, b, c] = 0.0
                for i in range(n):
                    out[a, b, c] += gain[i, a] * product[i, b]
                    for j in range(n):
                        moved = slopes.closure.gain[i, a, c] * run.mass[i, j]
                        out[a, b, c] += moved * gain[j, b]


@inner
def parameter_masses(run, index, links, whole, out):
    """∂M_a/∂θ of inertial parameters, added to ``out``, (joints a, joints b ≤ a, columns).

    ``index``: as for ``inertial_columns``; ``whole``: scratch, (tree joints, tree joints, columns).
    """
    parent, gain = run.model.table.tree.parent, run.place.gain
    n, m = gain.shape
    for i in range(n):
        j = i
        while j >= 0:
            for d in range(whole.shape[2]):
                whole[i, j, d] = 0.0
            j = parent[j]
    inertial_masses(parent, index, links, whole)
    for i in range(n):
        j = i
        while j >= 0:
            for a in range(m):
                for b in range(a + 1):
                    weight = gain[i, a] * gain[j, b]
                    if i != j:
                        weight += gain[j, a] * gain[i, b]
                    if weight != 0.0:
                        for d in range(whole.shape[2]):
                            out[a, b, d] += weight * whole[i, j, d]
            j = parent[j]
