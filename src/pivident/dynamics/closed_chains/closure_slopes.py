"""Compiled slopes of closed mechanisms along their independent joints: ∂N/∂q_a and ∂γ/∂q_a.

The dependent joints are functions of the independent ones. Along a straight line q_a + v t, where
the independent joints do not accelerate, their second and third derivatives

    γ(v) = Σ_ab ∂N_a/∂q_b v_a v_b,      T(v) = Σ_abc ∂²N_a/∂q_b∂q_c v_a v_b v_c

are those that keep the second and third derivatives of the closures zero,

    A γ = -(what the speeds N v make of d²c/dt²),    A T = -(what N v and γ make of d³c/dt³)

Forms of two and three equal vectors give those of different ones (polarisation),

    ∂N_a/∂q_b = (γ(e_a + e_b) - γ(e_a) - γ(e_b))/2
    ∂γ/∂q_c   = (T(v + e_c) - T(v - e_c))/6 - T(e_c)/3,    v = dq_a
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pivident.dynamics.closed_chains.closure_equations import (
    find_drifts,
    move_ends,
    move_links,
    turned_axis,
)
from pivident.dynamics.closed_chains.closure_table import ALPHA, LINEAR, PLACE, ClosureTable, P, W
from pivident.dynamics.elimination import solve
from pivident.dynamics.rigid_body_slopes import cross
from pivident.foundation.compiled import inlined, inner

# Columns of jerks: of turning, β, and of a point, j.
_BETA, _J, _JERKS = 0, 3, 6


class ClosureSlopes(NamedTuple):
    """Slopes of N and γ along the independent joints, and scratch."""

    gain: np.ndarray  # ∂N_a/∂q_b, symmetric in a and b, (tree joints, joints, joints)
    drift: np.ndarray  # ∂γ/∂q_a, (tree joints, joints)
    line: np.ndarray  # v, (joints,)
    dq: np.ndarray  # speeds meanwhile, (tree joints,)
    ddq: np.ndarray  # γ(v), (tree joints,)
    jerk: np.ndarray  # of the links, (tree joints, 6)
    ends: np.ndarray  # of the frames of the closures, (closures, 2, 6)


def closure_slopes(table: ClosureTable) -> ClosureSlopes:
    """Empty slopes of a mechanism."""
    n, m = table.posture.size, table.places.size
    return ClosureSlopes(
        gain=np.zeros((n, m, m)),
        drift=np.zeros((n, m)),
        line=np.zeros(m),
        dq=np.zeros(n),
        ddq=np.zeros(n),
        jerk=np.zeros((n, _JERKS)),
        ends=np.zeros((len(table.link), 2, _JERKS)),
    )


@inlined
def _third(source, jerk, x, y, z):
    """Third derivative of a vector that is fixed in a body, x''' = β×x + 2α×x' + ω×x''."""
    wx, wy, wz = source[W], source[W + 1], source[W + 2]
    ax, ay, az = source[ALPHA], source[ALPHA + 1], source[ALPHA + 2]
    x1, y1, z1 = cross(wx, wy, wz, x, y, z)
    px, py, pz = cross(ax, ay, az, x, y, z)
    qx, qy, qz = cross(wx, wy, wz, x1, y1, z1)
    fx, fy, fz = cross(jerk[_BETA], jerk[_BETA + 1], jerk[_BETA + 2], x, y, z)
    gx, gy, gz = cross(ax, ay, az, x1, y1, z1)
    hx, hy, hz = cross(wx, wy, wz, px + qx, py + qy, pz + qz)
    return fx + 2.0 * gx + hx, fy + 2.0 * gy + hy, fz + 2.0 * gz + hz


@inlined
def _carry(body, carrier, at, own):
    """Third derivatives ``own`` of a frame ``at`` some place on a body."""
    x, y, z = _third(
        body, carrier, at[P] - body[P], at[P + 1] - body[P + 1], at[P + 2] - body[P + 2]
    )
    for c in range(_JERKS):
        own[c] = carrier[c]
    own[_J] += x
    own[_J + 1] += y
    own[_J + 2] += z


@inlined
def _jerk_links(tree, dq, ddq, place, jerk):
    """Third derivatives of the motion of all links, after ``move_links``; dddq is zero."""
    for i in range(dq.size):
        own, parent = jerk[i], tree.parent[i]
        for c in range(_JERKS):
            own[c] = 0.0
        if parent < 0:
            continue
        body = place[parent]
        _carry(body, jerk[parent], place[i], own)
        # the joint's axis z, fixed in the parent, with two derivatives
        wx, wy, wz = body[W], body[W + 1], body[W + 2]
        zx, zy, zz = place[i, 2], place[i, 5], place[i, 8]
        x1, y1, z1 = cross(wx, wy, wz, zx, zy, zz)
        px, py, pz = cross(body[ALPHA], body[ALPHA + 1], body[ALPHA + 2], zx, zy, zz)
        qx, qy, qz = cross(wx, wy, wz, x1, y1, z1)
        first, one, two = (_J, 3.0, 3.0) if tree.prismatic[i] else (_BETA, 1.0, 2.0)
        one, two = one * dq[i], two * ddq[i]
        own[first] += one * (px + qx) + two * x1
        own[first + 1] += one * (py + qy) + two * y1
        own[first + 2] += one * (pz + qz) + two * z1


@inlined
def _jerk_ends(table, work, slopes):
    """Third derivatives of the frames of the closures, from those of the links."""
    for k in range(table.link.shape[0]):
        for side in range(2):
            link, end, own = table.link[k, side], work.ends[k, side], slopes.ends[k, side]
            if link < 0:
                continue  # zero
            _carry(work.place[link], slopes.jerk[link], end, own)


@inlined
def _third_of_axis(end, jerk, axis):
    """Third derivative of a unit vector of a frame, behind the others."""
    axis[9], axis[10], axis[11] = _third(end, jerk, axis[0], axis[1], axis[2])


@inner
def _third_derivative(table, work, slopes):
    """T(v) of the dependent joints into ``work.step``, v = ``slopes.line``."""
    n, m = work.gain.shape
    v, dq, ddq = slopes.line, work.dq, slopes.ddq
    for i in range(n):
        dq[i], ddq[i] = 0.0, 0.0
        for a in range(m):
            dq[i] += work.gain[i, a] * v[a]
            for b in range(m):
                ddq[i] += slopes.gain[i, a, b] * v[a] * v[b]
    move_links(table.tree, dq, ddq, work.place)
    move_ends(table, work)
    _jerk_links(table.tree, dq, ddq, work.place, slopes.jerk)
    _jerk_ends(table, work, slopes)
    for row in range(table.equation.shape[0]):
        number, kind = table.equation[row, 0], table.equation[row, 1]
        third = 0.0
        if kind != LINEAR:
            first, second = work.ends[number, 0], work.ends[number, 1]
            one, two = slopes.ends[number, 0], slopes.ends[number, 1]
            x, y = table.equation[row, 2], table.equation[row, 3]
            if kind == PLACE:
                for c in range(3):
                    third += first[3 * c + x] * (one[_J + c] - two[_J + c])
            else:
                a, b = work.axes[0], work.axes[1]
                turned_axis(first, x, a)
                turned_axis(second, y, b)
                _third_of_axis(first, one, a)
                _third_of_axis(second, two, b)
                for c in range(3):
                    third += a[9 + c] * b[c] + a[c] * b[9 + c]
                    third += 3.0 * (a[6 + c] * b[3 + c] + a[3 + c] * b[6 + c])
        work.step[row] = -third
    solve(work.factors, work.step)


@inner
def _second_derivative(table, work, a, b):
    """γ(e_a + e_b), with equal a and b γ(e_a), of the dependent joints into ``work.step``."""
    for i in range(work.dq.size):
        work.dq[i] = work.gain[i, a] + (work.gain[i, b] if b != a else 0.0)
    find_drifts(table, work)
    for row in range(table.others.size):
        work.step[row] = -work.gap[1, row]
    solve(work.factors, work.step)


@inner
def find_closure_slopes(table, work, slopes):
    """∂N/∂q_a and ∂γ/∂q_a where ``close_loops`` has been, at the speeds that are there."""
    n, m = work.gain.shape
    r, v = table.others.size, slopes.line
    for i in range(n):
        slopes.dq[i] = work.dq[i]
    for way in range(m):
        for a in range(way, m):
            b = a - way
            _second_derivative(table, work, a, b)
            for k in range(r):
                i, bend = table.others[k], work.step[work.factors.row[k]]
                if a != b:
                    bend = 0.5 * (bend - slopes.gain[i, a, a] - slopes.gain[i, b, b])
                slopes.gain[i, a, b] = slopes.gain[i, b, a] = bend
    for c in range(m):
        for k in range(r):
            slopes.drift[table.others[k], c] = 0.0
        for turn in range(3):
            sign = (1.0, -1.0, 0.0)[turn]
            for a in range(m):
                v[a] = abs(sign) * slopes.dq[table.places[a]]
            v[c] += 1.0 if turn == 2 else sign
            _third_derivative(table, work, slopes)
            weight = -1.0 / 3.0 if turn == 2 else sign / 6.0
            for k in range(r):
                slopes.drift[table.others[k], c] += weight * work.step[work.factors.row[k]]
    for i in range(n):
        work.dq[i] = slopes.dq[i]
