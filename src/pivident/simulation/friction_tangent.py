"""Tangents of friction of speed alone: of its torque, and of its slopes."""

from __future__ import annotations

from pivident.compiled import inner
from pivident.dynamics.friction_kernels import friction_value_and_slope
from pivident.dynamics.friction_partials import (
    sign_curvature,
    sign_partials,
    speed_curvature,
    speed_partials,
)

#: Tables of ``FrictionTable`` that a constant of friction is in.
LINEAR, TERM, PAIR, PATH = 0, 1, 2, 3


@inner
def friction_tangent(
    term_index, term_value, pair_index, pair_value, index, slope, vectors, speed, slopes, row,
    tangents, of_speed, out, of_slopes, target, curvature,
):  # fmt: skip
    """Tangents δf = D δv + ∂f/∂p δp and δD = ∂²f/∂v² δv + ∂²f/∂v∂p δp at the speeds of a row.

    ``index slope``: constants of friction along the directions, see ``LoopTangent``; ``row``: of
    ``slopes``, which hold D at that speed; ``of_speed``: row of δv in ``tangents``; ``out``: row
    that receives δf; ``target``: row of ``of_slopes`` that receives δD; ``curvature``: scratch.
    """
    n, couplings, directions = tangents.shape[1], pair_index.shape[0], tangents.shape[2]
    for j in range(n):
        curvature[j] = 0.0
    for k in range(term_index.shape[0]):
        bend = speed_curvature(
            term_index[k, 1], term_index[k, 2], term_value[k, 1], term_value[k, 2],
            term_value[k, 3], vectors[speed, term_index[k, 0]],
        )  # fmt: skip
        curvature[term_index[k, 0]] += term_value[k, 0] * bend
    for j in range(n):
        damping, bend = slopes[row, j], curvature[j]
        for d in range(directions):
            v = tangents[of_speed, j, d]
            tangents[out, j, d] = damping * v
            of_slopes[target, j, d] = bend * v
    for k in range(couplings):
        i, j, ratio, viscous = (
            pair_index[k, 0],
            pair_index[k, 1],
            pair_value[k, 0],
            pair_value[k, 1],
        )
        at = vectors[speed, i] + ratio * vectors[speed, j]
        bend = pair_value[k, 2] * sign_curvature(pair_index[k, 2], pair_value[k, 3], at)
        damping = slopes[row, n + k]
        crossed = ratio * (damping + viscous)
        for d in range(directions):  # one loop for each, as vector instructions need it
            turning = tangents[of_speed, i, d] + ratio * tangents[of_speed, j, d]
            of_slopes[target, n + k, d] = bend * turning
        for d in range(directions):
            tangents[out, i, d] += (
                damping * tangents[of_speed, i, d] + crossed * tangents[of_speed, j, d]
            )
        for d in range(directions):
            tangents[out, j, d] += crossed * tangents[of_speed, i, d] + (
                ratio * ratio * damping * tangents[of_speed, j, d]
            )
    for e in range(index.shape[0]):
        table, k, column, d, weight = index[e, 1], index[e, 2], index[e, 3], index[e, 4], slope[e]
        if table == LINEAR:
            if column == 0:
                tangents[out, k, d] += weight * vectors[speed, k]
                of_slopes[target, k, d] += weight
            else:
                tangents[out, k, d] += weight
        elif table == TERM:
            j = term_index[k, 0]
            f, rise = _by_constant(term_index, term_value, k, column, vectors[speed, j])
            tangents[out, j, d] += weight * f
            of_slopes[target, j, d] += weight * rise
        elif table == PAIR:
            i, j, ratio = pair_index[k, 0], pair_index[k, 1], pair_value[k, 0]
            motor, joint = vectors[speed, i], vectors[speed, j]
            if column == 1:
                tangents[out, i, d] += weight * ratio * joint
                tangents[out, j, d] += weight * ratio * motor
                continue
            at = motor + ratio * joint
            s, rise, _, by_gamma, rise_by_gamma = sign_partials(
                pair_index[k, 2], pair_value[k, 3], at
            )
            if column == 3:
                s, rise = pair_value[k, 2] * by_gamma, pair_value[k, 2] * rise_by_gamma
            tangents[out, i, d] += weight * s
            tangents[out, j, d] += weight * ratio * s
            of_slopes[target, n + k, d] += weight * rise


@inner
def constant_torque(term_index, term_value, table, k, column, dq):
    """Joint whose friction a constant of ``linear`` or ``term_value`` changes, and ∂f/∂p there."""
    if table == LINEAR:
        return k, dq[k] if column == 0 else 1.0
    joint = term_index[k, 0]
    torque, _ = _by_constant(term_index, term_value, k, column, dq[joint])
    return joint, torque


@inner
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
    n, couplings, directions = tangents.shape[1], pair_index.shape[0], tangents.shape[2]
    for i in range(n):
        damping, speed = slopes[row, i], vectors[y, i]
        for d in range(directions):
            tangents[out, i, d] = damping * tangents[of_y, i, d] + of_slopes[source, i, d] * speed
    for k in range(couplings):
        i, j, ratio, viscous = (
            pair_index[k, 0],
            pair_index[k, 1],
            pair_value[k, 0],
            pair_value[k, 1],
        )
        yi, yj, dry = vectors[y, i], vectors[y, j], slopes[row, n + k]
        crossed, turning = ratio * (dry + viscous), yi + ratio * yj
        for d in range(directions):
            tangents[out, i, d] += (
                dry * tangents[of_y, i, d]
                + crossed * tangents[of_y, j, d]
                + turning * of_slopes[source, n + k, d]
                + ratio * yj * of_slopes[source, n + couplings + k, d]
            )
        for d in range(directions):
            tangents[out, j, d] += ratio * (
                (dry + viscous) * tangents[of_y, i, d]
                + ratio * dry * tangents[of_y, j, d]
                + turning * of_slopes[source, n + k, d]
                + yi * of_slopes[source, n + couplings + k, d]
            )
