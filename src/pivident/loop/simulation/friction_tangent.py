"""Tangents of friction of speed alone: of its torque, and of its slopes."""

from __future__ import annotations

from pivident.dynamics.column_slopes import (
    speed_curvature,
    speed_partials,
)
from pivident.dynamics.friction_kernels import friction_value_and_slope, sign_partials
from pivident.dynamics.lanes import LANES, load, store
from pivident.foundation.compiled import inlined, inner

#: Tables of ``FrictionTable`` that a constant of friction is in.
LINEAR, TERM, PAIR, PATH = 0, 1, 2, 3


@inner
def friction_tangent(
    term_index, term_value, pair_index, pair_value, index, slope, vectors, speed, slopes, row,
    tangents, of_speed, out, of_slopes, target, columns, bends,
):  # fmt: skip
    """Tangents δf = D δv + ∂f/∂p δp and δD = ∂²f/∂v² δv + ∂²f/∂v∂p δp at the speeds of a row.

    ``index slope``: constants of friction along the directions, see ``LoopTangent``; ``row``: of
    ``slopes``, which hold D at that speed; ``of_speed``: row of δv in ``tangents``; ``out``: row
    that receives δf; ``target``: row of ``of_slopes`` that receives δD; ``columns bends``: scratch,
    see ``friction_columns``.
    """
    friction_columns(
        term_index, term_value, pair_index, pair_value, index, slope, vectors, speed, columns, bends
    )
    for at in range(0, tangents.shape[2], LANES):
        friction_block(
            pair_index, pair_value, slopes, row, columns, bends, tangents, of_speed, at,
            tangents, out, of_slopes, target, at,
        )  # fmt: skip


@inner
def friction_columns(
    term_index, term_value, pair_index, pair_value, index, slope, vectors, speed, columns, bends
):
    """∂²f/∂v² of joints and couplings, and the columns ∂f/∂p and ∂²f/∂v∂p of the constants.

    ``columns``: receives ∂f/∂p of the joints, then ∂²f/∂v∂p of joints and couplings, shape
    (2 joints + couplings, directions); zero wherever there is no constant; ``bends``: receives
    ∂²f/∂v², shape (joints + couplings,).
    """
    couplings = pair_index.shape[0]
    n = bends.size - couplings
    for j in range(n):
        bends[j] = 0.0
    for k in range(term_index.shape[0]):
        bend = speed_curvature(
            term_index[k, 1], term_index[k, 2], term_value[k, 1], term_value[k, 2],
            term_value[k, 3], vectors[speed, term_index[k, 0]],
        )  # fmt: skip
        bends[term_index[k, 0]] += term_value[k, 0] * bend
    for k in range(couplings):
        at = vectors[speed, pair_index[k, 0]] + pair_value[k, 0] * vectors[speed, pair_index[k, 1]]
        bend = sign_partials(pair_index[k, 2], pair_value[k, 3], at)[2]
        bends[n + k] = pair_value[k, 2] * bend
    for e in range(index.shape[0]):  # several constants may meet in one place
        k, d = index[e, 2], index[e, 4]
        i = term_index[k, 0] if index[e, 1] == TERM else k
        if index[e, 1] == PAIR:
            columns[2 * n + k, d] = 0.0
            columns[pair_index[k, 1], d] = 0.0
            i = pair_index[k, 0]
        if index[e, 1] != PATH:
            columns[i, d], columns[n + i, d] = 0.0, 0.0
    for e in range(index.shape[0]):
        table, k, column, d, weight = index[e, 1], index[e, 2], index[e, 3], index[e, 4], slope[e]
        if table == LINEAR:
            if column == 0:
                columns[k, d] += weight * vectors[speed, k]
                columns[n + k, d] += weight
            else:
                columns[k, d] += weight
        elif table == TERM:
            j = term_index[k, 0]
            f, rise = _by_constant(term_index, term_value, k, column, vectors[speed, j])
            columns[j, d] += weight * f
            columns[n + j, d] += weight * rise
        elif table == PAIR:
            i, j, ratio = pair_index[k, 0], pair_index[k, 1], pair_value[k, 0]
            motor, joint = vectors[speed, i], vectors[speed, j]
            if column == 1:
                columns[i, d] += weight * ratio * joint
                columns[j, d] += weight * ratio * motor
                continue
            at = motor + ratio * joint
            s, rise, _, by_gamma, rise_by_gamma = sign_partials(
                pair_index[k, 2], pair_value[k, 3], at
            )
            if column == 3:
                s, rise = pair_value[k, 2] * by_gamma, pair_value[k, 2] * rise_by_gamma
            columns[i, d] += weight * s
            columns[j, d] += weight * ratio * s
            columns[2 * n + k, d] += weight * rise


@inlined
def friction_block(
    pair_index, pair_value, slopes, row, columns, bends, tangents, of_speed, at,
    out_of, out, of_slopes, target, there,
):  # fmt: skip
    """δf and δD of the directions from number ``there`` on, whose δv lie at ``at``.

    ``out_of``: array whose row ``out`` receives δf, where δv lie in theirs.
    """
    couplings = pair_index.shape[0]
    n = bends.size - couplings
    for j in range(n):
        v = load(tangents, (of_speed, j), at)
        store(out_of, (out, j), at, load(columns, (j,), there) + slopes[row, j] * v)
        store(of_slopes, (target, j), there, load(columns, (n + j,), there) + bends[j] * v)
    for k in range(couplings):
        i, j, ratio = pair_index[k, 0], pair_index[k, 1], pair_value[k, 0]
        motor, joint = load(tangents, (of_speed, i), at), load(tangents, (of_speed, j), at)
        turning, damping = motor + ratio * joint, slopes[row, n + k]
        dry, viscous = damping * turning, ratio * pair_value[k, 1]
        more = load(columns, (2 * n + k,), there)
        store(of_slopes, (target, n + k), there, more + bends[n + k] * turning)
        store(out_of, (out, i), at, load(out_of, (out, i), at) + dry + viscous * joint)
        store(out_of, (out, j), at, load(out_of, (out, j), at) + ratio * dry + viscous * motor)


@inner
def constant_torque(term_index, term_value, table, k, column, dq):
    """Joint whose friction a constant of ``linear`` or ``term_value`` changes, and ∂f/∂p there."""
    if table == LINEAR:
        return k, dq[k] if column == 0 else 1.0
    joint = term_index[k, 0]
    torque, _ = _by_constant(term_index, term_value, k, column, dq[joint])
    return joint, torque


@inlined
def _by_constant(term_index, term_value, k, column, v):
    """∂f/∂p and ∂²f/∂v∂p of a term for a column of ``term_value``."""
    code, sign, value = term_index[k, 1], term_index[k, 2], term_value[k, 0]
    gamma, first, second = term_value[k, 1], term_value[k, 2], term_value[k, 3]
    if column == 0:
        return friction_value_and_slope(code, sign, gamma, first, second, v)
    _, f, rise = speed_partials(code, sign, gamma, first, second, v, column)
    return value * f, value * rise


@inner
def slope_times_tangent(
    pair_index, pair_value, slopes, row, of_slopes, source, vectors, y, tangents, of_y, out
):
    """Tangent of D y: D δy + δD y, y a row of ``vectors`` and δy one of ``tangents``."""
    for at in range(0, tangents.shape[2], LANES):
        slope_times_block(
            pair_index, pair_value, slopes, row, of_slopes, source, vectors, y, tangents, of_y, out,
            at, at,
        )  # fmt: skip


@inlined
def slope_times_block(
    pair_index, pair_value, slopes, row, of_slopes, source, vectors, y, tangents, of_y, out, at,
    there,
):  # fmt: skip
    """D δy + δD y of the directions from number ``there`` on, whose δy lie at ``at``."""
    n, couplings = tangents.shape[1], pair_index.shape[0]
    for i in range(n):
        damped = slopes[row, i] * load(tangents, (of_y, i), at)
        store(tangents, (out, i), at, damped + vectors[y, i] * load(of_slopes, (source, i), there))
    for k in range(couplings):
        i, j = pair_index[k, 0], pair_index[k, 1]
        ratio, viscous = pair_value[k, 0], pair_value[k, 1]
        motor, joint = load(tangents, (of_y, i), at), load(tangents, (of_y, j), at)
        dry = slopes[row, n + k] * (motor + ratio * joint)
        turning = vectors[y, i] + ratio * vectors[y, j]
        dry += turning * load(of_slopes, (source, n + k), there)
        of_viscous = load(of_slopes, (source, n + couplings + k), there)
        on_motor = viscous * joint + vectors[y, j] * of_viscous
        on_joint = viscous * motor + vectors[y, i] * of_viscous
        store(tangents, (out, i), at, load(tangents, (out, i), at) + dry + ratio * on_motor)
        store(tangents, (out, j), at, load(tangents, (out, j), at) + ratio * (dry + on_joint))
