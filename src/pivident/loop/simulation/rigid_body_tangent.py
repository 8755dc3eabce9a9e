"""Tangents of the rigid body between the steps: of h, and of M⁻¹, held and extrapolated.

Of the symmetric M and M⁻¹ only the lower triangles have tangents.
"""

from __future__ import annotations

from pivident.dynamics.closed_chains.closed_slopes import (
    bias_slopes,
    mass_matrix_slopes,
    parameter_masses,
)
from pivident.dynamics.friction_table import SPRINGS
from pivident.dynamics.lanes import LANES, load, nothing, store
from pivident.dynamics.path_partials import position_partial, position_slopes
from pivident.dynamics.rigid_body_slopes import (
    inertial_columns,
    inertial_masses,
    mass_slopes,
    move_links,
    place_links,
    torque_slopes,
)
from pivident.foundation.compiled import inlined as _inline, inner, rows
from pivident.loop.simulation.friction_tangent import PATH
from pivident.loop.simulation.integration import (
    BIAS,
    CHANGE,
    INVERSE,
    LAST_BIAS,
    LAST_STEP,
    MIDDLE,
    RENEWALS,
    STILL,
    Q,
    V,
)
from pivident.loop.simulation.loop_tangent import (
    CHANGE_TANGENT,
    DELAYED,
    LENGTH,
    MIDDLE_TANGENT,
    RENEWED_TANGENT,
    SINCE_BEFORE,
    SINCE_TANGENT,
    parameter_torques,
)

# Layers of ``matrix_block``: the tangents of M, and those of M⁻¹ δM.
_MASS, _TURNED = rows(0, 1)
BLOCK_LAYERS = 2


@_inline
def bias_tangent(
    parent, prismatic, gravity, inertia, path_index, path_value, vectors, pose,
    own, constants, constant_slope, inertial, columns, by_position, by_speed, links, body,
    closed, loops,
):  # fmt: skip
    """Tangents of h, after ``integration.evaluate``, whose arguments are the first ones.

    ``columns``: receives ∂h/∂θ, shape (joints, directions); the others are those of
    ``LoopTangent``; ``closed``: as there, and None as ``loops`` without closed loops.
    """
    n = own.shape[1]
    for i in range(n):
        for at in range(0, own.shape[2], LANES):
            store(columns, (i,), at, nothing())
    if closed is None:  # decided by its type, here and below
        place_links(parent, prismatic, pose, inertia, links, body)
        move_links(parent, gravity, vectors[V], vectors[STILL], links, body)
        inertial_columns(parent, inertial, links, columns)
        torque_slopes(parent, gravity, links, body, by_position, by_speed)
    else:
        bias_slopes(closed, loops.slopes, links, body, by_position, by_speed)
        parameter_torques(closed, loops, inertial, links, columns)
    if path_index is not None:  # decided by its type, too
        position_slopes(path_index, path_value, vectors, Q, by_position, SPRINGS)
        for e in range(constants.shape[0]):
            if constants[e, 1] == PATH:
                k = constants[e, 2]
                j = path_index[k, 0]
                columns[j, constants[e, 4]] += constant_slope[e] * position_partial(
                    path_index, path_value, k, constants[e, 3], vectors[Q, j], SPRINGS
                )
    for at in range(0, own.shape[2], LANES):
        for i in range(n):
            bias, of_speed = load(columns, (i,), at), nothing()
            for k in range(n):
                bias += by_position[i, k] * load(own, (Q, k), at)
                of_speed += by_speed[i, k] * load(own, (V, k), at)
            store(own, (LAST_BIAS, i), at, load(own, (BIAS, i), at))
            store(own, (BIAS, i), at, bias + of_speed)


@inner
def renew_tangent(
    parent, matrices, clock, own, layers, times, inertial, rotor, rotor_slope, old, columns, block,
    of_mass, links, body, closed, loops,
):  # fmt: skip
    """Tangents of M⁻¹ and of its rate where the simulation has computed M⁻¹ anew.

    ``columns``: receives ∂M/∂θ, shape (joints, joints, directions); ``block``: scratch, shape
    (BLOCK_LAYERS, joints, joints, LANES).
    """
    n = own.shape[1]
    for j in range(n):
        for i in range(j + 1):
            for at in range(0, own.shape[2], LANES):
                store(columns, (j, i), at, nothing())
    if closed is None:
        mass_slopes(parent, links, body, of_mass)
        inertial_masses(parent, inertial, links, columns)
    else:
        mass_matrix_slopes(closed, loops.slopes, links, body, of_mass)
        parameter_masses(closed, inertial, links, loops.masses, columns)
    for e in range(rotor.shape[0]):
        columns[rotor[e, 0], rotor[e, 1], rotor[e, 2]] += rotor_slope[e]
    since = old[SINCE_BEFORE] + clock[LAST_STEP]
    known = clock[RENEWALS] > 1.0 and since > 0.0
    rate = 1.0 / since if known else 0.0
    for at in range(0, own.shape[2], LANES):
        _mass_block(own, columns, of_mass, closed is None, block, at)
        for j in range(n):
            for i in range(n):
                total = nothing()
                for k in range(n):
                    total += matrices[INVERSE, i, k] * load(block, (_MASS, k, j), None)
                store(block, (_TURNED, i, j), None, total)
        for i in range(n):
            for j in range(i + 1):
                fresh = nothing()
                for k in range(n):
                    fresh -= matrices[INVERSE, j, k] * load(block, (_TURNED, i, k), None)
                if known:
                    change = rate * (fresh - load(layers, (RENEWED_TANGENT, i, j), at))
                    if old[DELAYED] != 0.0:
                        since_tangent = load(times, (SINCE_TANGENT,), at)
                        change -= rate * matrices[CHANGE, i, j] * since_tangent
                    store(layers, (CHANGE_TANGENT, i, j), at, change)
                store(layers, (RENEWED_TANGENT, i, j), at, fresh)
        store(times, (SINCE_TANGENT,), at, nothing())


@_inline
def _mass_block(own, columns, of_mass, tree, block, at):
    """Tangents of M, both triangles. In a tree M_ij, j ≤ i, depends on joints beyond j alone."""
    n = own.shape[1]
    for i in range(n):
        for j in range(i + 1):
            mass = load(columns, (i, j), at)
            for k in range(j + 1 if tree else 0, n):
                mass += of_mass[i, j, k] * load(own, (Q, k), at)
            store(block, (_MASS, i, j), None, mass)
            store(block, (_MASS, j, i), None, mass)


@_inline
def middle_block(matrices, layers, times, middle, timed, out_of, out, there, at):
    """δM⁻¹ in the middle of a step, ``middle`` after M⁻¹ was computed, of a block of directions.

    ``timed``: whether a direction changes the lengths of steps; ``out``: layer of ``out_of`` that
    receives the lower triangle, where the block begins at number ``there``.
    """
    for i in range(matrices.shape[1]):
        for j in range(i + 1):
            moved = middle * load(layers, (CHANGE_TANGENT, i, j), at)
            moved += load(layers, (RENEWED_TANGENT, i, j), at)
            if timed:
                longer = load(times, (SINCE_TANGENT,), at) + 0.5 * load(times, (LENGTH,), at)
                moved += matrices[CHANGE, i, j] * longer
            store(out_of, (out, i, j), there, moved)
            store(out_of, (out, j, i), there, moved)


@_inline
def product_row(matrices, vectors, x, tangents, of_x, middle, layer, i, at):
    """Row i of M⁻¹ δx + δM⁻¹ x, both matrices those of the middle, of a block of directions.

    ``x``: row of ``vectors``; ``of_x``: row of ``tangents``; ``layer``: that of δM⁻¹ in ``middle``,
    see ``middle_block``.
    """
    first, second = nothing(), nothing()
    for j in range(matrices.shape[1]):
        first += matrices[MIDDLE, i, j] * load(tangents, (of_x, j), at)
        second += vectors[x, j] * load(middle, (layer, i, j), at)
    return first + second


@inner
def product_tangent(matrices, vectors, x, own, layers, of_x, scale, rate, times, base, out):
    """Tangent of base - scale · M⁻¹ x, M⁻¹ that of the middle: rows of ``own``.

    ``rate``: change of ``scale`` with the length of the step, zero where no direction has one.
    """
    n = own.shape[1]
    for at in range(0, own.shape[2], LANES):
        for i in range(n):
            product = product_row(matrices, vectors, x, own, of_x, layers, MIDDLE_TANGENT, i, at)
            made = load(own, (base, i), at) - scale * product
            if rate != 0.0:
                made -= rate * moved_by(matrices, vectors, x, i) * load(times, (LENGTH,), at)
            store(own, (out, i), at, made)


@_inline
def moved_by(matrices, vectors, x, i):
    """Row i of M⁻¹ x."""
    total = 0.0
    for j in range(matrices.shape[1]):
        total += matrices[MIDDLE, i, j] * vectors[x, j]
    return total
