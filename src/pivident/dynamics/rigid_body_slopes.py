"""Slopes of the rigid body's inverse dynamics and mass matrix by motion and inertia, one sample.

Spatial vectors are motions (v, w) and forces (f, n) at the origin of the base, in its axes. With
S_k the screw of joint k, p the parent of its link, V and A velocity and acceleration of links
(gravity is an upward acceleration of the base), the sums over the links that joint m moves

    C_m = Σ I_i,      F_m = Σ I_i A_i + V_i ×* I_i V_i,
    B_m = Σ (V_i ×* I_i - I_i V_i × + (·) ×* I_i V_i)

give the derivatives of the torques τ_j = S_j · F_j, with y_k = V_p × S_k and m the outer one of the
joints j and k (none: the derivative is zero)

    ∂τ_j/∂dq_k = S_j · (2 C_m y_k + B_m S_k)
    ∂τ_j/∂q_k  = S_j · (C_m (A_p × S_k + V_p × y_k) + B_m y_k + [k beyond j] S_k ×* F_k)

after Carpentier and Mansard (2018) and Singh, Russell and Wensing (2022). Of a rigid body with mass
m, first moments h, inertia J and momentum p, B only acts on turning:
B w = (2 w × p, (2 ω × J - tr J ω × - 2 (v hᵀ - h·v 1)) w).

The mass matrix M_ij = S_i · C_j S_j of an ancestor i of j has

    ∂M_ij/∂q_k = (S_i × S_k) · C_k S_j + (S_j × S_k) · C_k S_i     k beyond j
    ∂M_ij/∂q_k = (S_i × S_k) · C_j S_j                             k beyond i, up to j
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pivident.compiled import inlined as _inline
from pivident.compiled import inner
from pivident.dynamics.kernels import add_composite

# Columns of ``flow``: force F, momentum p, matrix of B's moments row by row.
_F, _P, _N, FLOWS = 0, 6, 9, 18

# Columns of ``pull``: y and A_p × S + V_p × y of each joint, C S and moment of Bᵀ S of its links.
_SWING, _BEND, _CARRIED, _TURNED, PULLS = 0, 6, 12, 18, 21


class SlopeWork(NamedTuple):
    """Scratch of the slopes; see ``slope_work``."""

    place: np.ndarray  # ^0R_i row by row and ^0p_i, (joints, 12)
    screw: np.ndarray  # S, (joints, 6)
    velocity: np.ndarray  # V, (joints, 6)
    acceleration: np.ndarray  # A, (joints, 6)
    body: (
        np.ndarray
    )  # ten parameters of each link in its frame, then of C in the base, (2 joints, 10)
    flow: np.ndarray  # F and B of the links that each joint moves, (joints, FLOWS)
    pull: np.ndarray  # see above, (joints, PULLS)
    crossed: np.ndarray  # S_i × S_k, (joints, joints, 6)
    carried: np.ndarray  # C_k S_j, (joints, joints, 6)
    seen: np.ndarray  # V, A and screws as a link's frame sees them, (2 + joints, 6)
    force: np.ndarray  # of a unit inertial parameter, (6,)


def slope_work(joints: int) -> SlopeWork:
    """Empty scratch for a robot of so many joints."""
    return SlopeWork(
        np.zeros((joints, 12)),
        np.zeros((joints, 6)),
        np.zeros((joints, 6)),
        np.zeros((joints, 6)),
        np.zeros((2 * joints, 10)),
        np.zeros((joints, FLOWS)),
        np.zeros((joints, PULLS)),
        np.zeros((joints, joints, 6)),
        np.zeros((joints, joints, 6)),
        np.zeros((2 + joints, 6)),
        np.zeros(6),
    )


@_inline
def _cross(ax, ay, az, bx, by, bz):
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@_inline
def _motion_cross(a, i, b, j, out, k, column):
    """(v, w) × (v', w') = (w × v' + v × w', w × w') of rows i and j into row k from a column on."""
    v0, v1, v2, w0, w1, w2 = a[i, 0], a[i, 1], a[i, 2], a[i, 3], a[i, 4], a[i, 5]
    x0, x1, x2, y0, y1, y2 = b[j, 0], b[j, 1], b[j, 2], b[j, 3], b[j, 4], b[j, 5]
    out[k, column] = w1 * x2 - w2 * x1 + v1 * y2 - v2 * y1
    out[k, column + 1] = w2 * x0 - w0 * x2 + v2 * y0 - v0 * y2
    out[k, column + 2] = w0 * x1 - w1 * x0 + v0 * y1 - v1 * y0
    out[k, column + 3] = w1 * y2 - w2 * y1
    out[k, column + 4] = w2 * y0 - w0 * y2
    out[k, column + 5] = w0 * y1 - w1 * y0


@_inline
def _inertia_times(body, i, vx, vy, vz, wx, wy, wz):
    """I x of the parameters in row i: f = m v + w × h, n = J w + h × v."""
    hx, hy, hz, m = body[i, 6], body[i, 7], body[i, 8], body[i, 9]
    return (
        m * vx + wy * hz - wz * hy,
        m * vy + wz * hx - wx * hz,
        m * vz + wx * hy - wy * hx,
        body[i, 0] * wx + body[i, 1] * wy + body[i, 2] * wz + hy * vz - hz * vy,
        body[i, 1] * wx + body[i, 3] * wy + body[i, 4] * wz + hz * vx - hx * vz,
        body[i, 2] * wx + body[i, 4] * wy + body[i, 5] * wz + hx * vy - hy * vx,
    )


@_inline
def _dot(a, i, fx, fy, fz, nx, ny, nz):
    return (
        a[i, 0] * fx + a[i, 1] * fy + a[i, 2] * fz
        + a[i, 3] * nx + a[i, 4] * ny + a[i, 5] * nz
    )  # fmt: skip


@inner
def place_links(parent, prismatic, pose, inertia, work):
    """Poses and screws in the base and the composite inertias C, from poses in the parents."""
    place, screw, body = work.place, work.screw, work.body
    n = parent.size
    for i in range(n):
        p = parent[i]
        for a in range(3):
            if p < 0:
                for b in range(3):
                    place[i, 3 * a + b] = pose[i, 3 * a + b]
                place[i, 9 + a] = pose[i, 9 + a]
                continue
            x, y, z = place[p, 3 * a], place[p, 3 * a + 1], place[p, 3 * a + 2]
            for b in range(3):
                place[i, 3 * a + b] = x * pose[i, b] + y * pose[i, 3 + b] + z * pose[i, 6 + b]
            place[i, 9 + a] = place[p, 9 + a] + x * pose[i, 9] + y * pose[i, 10] + z * pose[i, 11]
        zx, zy, zz = place[i, 2], place[i, 5], place[i, 8]
        if prismatic[i]:
            screw[i, 0], screw[i, 1], screw[i, 2] = zx, zy, zz
            screw[i, 3], screw[i, 4], screw[i, 5] = 0.0, 0.0, 0.0
        else:
            screw[i, 0], screw[i, 1], screw[i, 2] = _cross(
                place[i, 9], place[i, 10], place[i, 11], zx, zy, zz
            )
            screw[i, 3], screw[i, 4], screw[i, 5] = zx, zy, zz
        for c in range(10):
            body[i, c], body[n + i, c] = inertia[i, c], 0.0
        add_composite(place, body, i, n + i)


@inner
def sum_composites(parent, body):
    """Add up the inertias in the base over the links that each joint moves."""
    n = parent.size
    for i in range(n - 1, -1, -1):
        if parent[i] >= 0:
            for c in range(10):
                body[n + parent[i], c] += body[n + i, c]


@inner
def move_links(parent, gravity, dq, ddq, work):
    """V and A of every link, F and B of the links that each joint moves.

    Needs ``place_links``; ends with ``sum_composites``.
    """
    screw, velocity, acceleration = work.screw, work.velocity, work.acceleration
    body, flow, pull = work.body, work.flow, work.pull
    n = parent.size
    for i in range(n):
        p = parent[i]
        for c in range(6):
            velocity[i, c] = screw[i, c] * dq[i]
            acceleration[i, c] = screw[i, c] * ddq[i]
            if p >= 0:
                velocity[i, c] += velocity[p, c]
                acceleration[i, c] += acceleration[p, c]
        if p < 0:
            for c in range(3):
                acceleration[i, c] -= gravity[c]
        _motion_cross(velocity, i, screw, i, pull, i, _SWING)  # V_i × S_i = V_p × S_i
        for c in range(6):
            acceleration[i, c] += pull[i, _SWING + c] * dq[i]
        _add_flow(body, n + i, velocity, acceleration, i, flow)
    for i in range(n - 1, -1, -1):
        if parent[i] >= 0:
            for c in range(FLOWS):
                flow[parent[i], c] += flow[i, c]
    sum_composites(parent, body)


@_inline
def _add_flow(body, row, velocity, acceleration, i, flow):
    """F and B of one link, its parameters in the base in row ``row``."""
    vx, vy, vz = velocity[i, 0], velocity[i, 1], velocity[i, 2]
    wx, wy, wz = velocity[i, 3], velocity[i, 4], velocity[i, 5]
    px, py, pz, lx, ly, lz = _inertia_times(body, row, vx, vy, vz, wx, wy, wz)
    fx, fy, fz, nx, ny, nz = _inertia_times(
        body, row, acceleration[i, 0], acceleration[i, 1], acceleration[i, 2],
        acceleration[i, 3], acceleration[i, 4], acceleration[i, 5],
    )  # fmt: skip
    cx, cy, cz = _cross(wx, wy, wz, px, py, pz)
    flow[i, _F], flow[i, _F + 1], flow[i, _F + 2] = fx + cx, fy + cy, fz + cz
    cx, cy, cz = _cross(wx, wy, wz, lx, ly, lz)
    dx, dy, dz = _cross(vx, vy, vz, px, py, pz)
    flow[i, _F + 3], flow[i, _F + 4] = nx + cx + dx, ny + cy + dy
    flow[i, _F + 5] = nz + cz + dz
    flow[i, _P], flow[i, _P + 1], flow[i, _P + 2] = px, py, pz
    xx, xy, xz = body[row, 0], body[row, 1], body[row, 2]
    yy, yz, zz = body[row, 3], body[row, 4], body[row, 5]
    hx, hy, hz = body[row, 6], body[row, 7], body[row, 8]
    trace, along = xx + yy + zz, 2.0 * (hx * vx + hy * vy + hz * vz)
    # columns of ω × J
    a00, a10, a20 = _cross(wx, wy, wz, xx, xy, xz)
    a01, a11, a21 = _cross(wx, wy, wz, xy, yy, yz)
    a02, a12, a22 = _cross(wx, wy, wz, xz, yz, zz)
    flow[i, _N] = 2.0 * (a00 - vx * hx) + along
    flow[i, _N + 1] = 2.0 * (a01 - vx * hy) + trace * wz
    flow[i, _N + 2] = 2.0 * (a02 - vx * hz) - trace * wy
    flow[i, _N + 3] = 2.0 * (a10 - vy * hx) - trace * wz
    flow[i, _N + 4] = 2.0 * (a11 - vy * hy) + along
    flow[i, _N + 5] = 2.0 * (a12 - vy * hz) + trace * wx
    flow[i, _N + 6] = 2.0 * (a20 - vz * hx) + trace * wy
    flow[i, _N + 7] = 2.0 * (a21 - vz * hy) - trace * wx
    flow[i, _N + 8] = 2.0 * (a22 - vz * hz) + along


@_inline
def _swung(flow, i, wx, wy, wz):
    """B x of the links beyond joint i, for a motion that turns by w."""
    fx, fy, fz = _cross(wx, wy, wz, flow[i, _P], flow[i, _P + 1], flow[i, _P + 2])
    return (
        2.0 * fx,
        2.0 * fy,
        2.0 * fz,
        flow[i, _N] * wx + flow[i, _N + 1] * wy + flow[i, _N + 2] * wz,
        flow[i, _N + 3] * wx + flow[i, _N + 4] * wy + flow[i, _N + 5] * wz,
        flow[i, _N + 6] * wx + flow[i, _N + 7] * wy + flow[i, _N + 8] * wz,
    )


@inner
def torque_slopes(parent, gravity, work, by_position, by_speed):
    """∂τ_j/∂q_k and ∂τ_j/∂dq_k of the rigid body, shape (joints, joints); needs ``move_links``."""
    screw, velocity, acceleration = work.screw, work.velocity, work.acceleration
    body, flow, pull = work.body, work.flow, work.pull
    n = parent.size
    for j in range(n):
        for k in range(n):
            by_position[j, k], by_speed[j, k] = 0.0, 0.0
    for k in range(n):
        p = parent[k]
        s0, s1, s2 = screw[k, 0], screw[k, 1], screw[k, 2]
        w0, w1, w2 = screw[k, 3], screw[k, 4], screw[k, 5]
        if p >= 0:
            _motion_cross(acceleration, p, screw, k, pull, k, _BEND)
            y0, y1, y2 = pull[k, _SWING], pull[k, _SWING + 1], pull[k, _SWING + 2]
            z0, z1, z2 = pull[k, _SWING + 3], pull[k, _SWING + 4], pull[k, _SWING + 5]
            vx, vy, vz = velocity[p, 0], velocity[p, 1], velocity[p, 2]
            ox, oy, oz = velocity[p, 3], velocity[p, 4], velocity[p, 5]
            ax, ay, az = _cross(ox, oy, oz, y0, y1, y2)
            bx, by, bz = _cross(vx, vy, vz, z0, z1, z2)
            cx, cy, cz = _cross(ox, oy, oz, z0, z1, z2)
            pull[k, _BEND] += ax + bx
            pull[k, _BEND + 1] += ay + by
            pull[k, _BEND + 2] += az + bz
            pull[k, _BEND + 3] += cx
            pull[k, _BEND + 4] += cy
            pull[k, _BEND + 5] += cz
        else:
            y0, y1, y2, z0, z1, z2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for c in range(6):
                pull[k, _SWING + c], pull[k, _BEND + c] = 0.0, 0.0
            pull[k, _BEND], pull[k, _BEND + 1], pull[k, _BEND + 2] = _cross(
                -gravity[0], -gravity[1], -gravity[2], w0, w1, w2
            )
        # C S and the turning part of Bᵀ S, for the joints before k
        c0, c1, c2, c3, c4, c5 = _inertia_times(body, n + k, s0, s1, s2, w0, w1, w2)
        pull[k, _CARRIED], pull[k, _CARRIED + 1], pull[k, _CARRIED + 2] = c0, c1, c2
        pull[k, _CARRIED + 3], pull[k, _CARRIED + 4], pull[k, _CARRIED + 5] = c3, c4, c5
        bx, by, bz = _cross(flow[k, _P], flow[k, _P + 1], flow[k, _P + 2], s0, s1, s2)
        for c in range(3):
            pull[k, _TURNED + c] = (
                flow[k, _N + c] * w0 + flow[k, _N + 3 + c] * w1 + flow[k, _N + 6 + c] * w2
            )
        pull[k, _TURNED] += 2.0 * bx
        pull[k, _TURNED + 1] += 2.0 * by
        pull[k, _TURNED + 2] += 2.0 * bz
        # what joint k changes in the forces beyond it
        f0, f1, f2, f3, f4, f5 = _inertia_times(
            body, n + k, pull[k, _BEND], pull[k, _BEND + 1], pull[k, _BEND + 2],
            pull[k, _BEND + 3], pull[k, _BEND + 4], pull[k, _BEND + 5],
        )  # fmt: skip
        g0, g1, g2, g3, g4, g5 = _swung(flow, k, z0, z1, z2)
        fx, fy, fz = flow[k, _F], flow[k, _F + 1], flow[k, _F + 2]
        ax, ay, az = _cross(w0, w1, w2, fx, fy, fz)
        bx, by, bz = _cross(w0, w1, w2, flow[k, _F + 3], flow[k, _F + 4], flow[k, _F + 5])
        cx, cy, cz = _cross(s0, s1, s2, fx, fy, fz)
        f0, f1, f2 = f0 + g0 + ax, f1 + g1 + ay, f2 + g2 + az
        f3, f4, f5 = f3 + g3 + bx + cx, f4 + g4 + by + cy, f5 + g5 + bz + cz
        e0, e1, e2, e3, e4, e5 = _inertia_times(body, n + k, y0, y1, y2, z0, z1, z2)
        g0, g1, g2, g3, g4, g5 = _swung(flow, k, w0, w1, w2)
        e0, e1, e2 = 2.0 * e0 + g0, 2.0 * e1 + g1, 2.0 * e2 + g2
        e3, e4, e5 = 2.0 * e3 + g3, 2.0 * e4 + g4, 2.0 * e5 + g5
        j = k
        while j >= 0:
            by_position[j, k] = _dot(screw, j, f0, f1, f2, f3, f4, f5)
            by_speed[j, k] = _dot(screw, j, e0, e1, e2, e3, e4, e5)
            j = parent[j]
        # what the joints before k change in its own torque
        t0, t1, t2 = pull[k, _TURNED], pull[k, _TURNED + 1], pull[k, _TURNED + 2]
        j = p
        while j >= 0:
            bend, swing = 0.0, 0.0
            for c in range(6):
                bend += pull[k, _CARRIED + c] * pull[j, _BEND + c]
                swing += pull[k, _CARRIED + c] * pull[j, _SWING + c]
            by_position[k, j] = (
                bend
                + t0 * pull[j, _SWING + 3]
                + t1 * pull[j, _SWING + 4]
                + t2 * pull[j, _SWING + 5]
            )
            by_speed[k, j] = 2.0 * swing + t0 * screw[j, 3] + t1 * screw[j, 4] + t2 * screw[j, 5]
            j = parent[j]


@inner
def mass_slopes(parent, work, out):
    """∂M_ij/∂q_k of the lower triangle, shape (joints j, joints i ≤ j, joints k).

    Needs ``place_links`` and ``sum_composites``.
    """
    screw, body, crossed, carried = work.screw, work.body, work.crossed, work.carried
    n = parent.size
    for j in range(n):
        for i in range(j + 1):
            for k in range(n):
                out[j, i, k] = 0.0
    for k in range(n):
        j = k
        while j >= 0:
            c = _inertia_times(
                body, n + k, screw[j, 0], screw[j, 1], screw[j, 2],
                screw[j, 3], screw[j, 4], screw[j, 5],
            )  # fmt: skip
            for a in range(6):
                carried[k, j, a] = c[a]
            _motion_cross(screw, j, screw, k, crossed[k], j, 0)
            j = parent[j]
    for k in range(n):
        j = k
        while j >= 0:
            i = j if j < k else parent[j]
            while i >= 0:
                total = 0.0
                for a in range(6):
                    total += crossed[k, i, a] * carried[k, j, a]
                    if j < k:
                        total += crossed[k, j, a] * carried[k, i, a]
                out[j, i, k] = total
                i = parent[i]
            j = parent[j]
    # joints between the two
    for j in range(n):
        k = parent[j]
        while k >= 0:
            i = parent[k]
            while i >= 0:
                total = 0.0
                for a in range(6):
                    total += crossed[k, i, a] * carried[j, j, a]
                out[j, i, k] = total
                i = parent[i]
            k = parent[k]


@_inline
def _see(place, link, source, row, seen, target):
    """A motion vector at the base, in the frame of a link: Rᵀ (v + w × p), Rᵀ w."""
    wx, wy, wz = source[row, 3], source[row, 4], source[row, 5]
    cx, cy, cz = _cross(wx, wy, wz, place[link, 9], place[link, 10], place[link, 11])
    vx, vy, vz = source[row, 0] + cx, source[row, 1] + cy, source[row, 2] + cz
    for a in range(3):
        x, y, z = place[link, a], place[link, 3 + a], place[link, 6 + a]
        seen[target, a] = x * vx + y * vy + z * vz
        seen[target, 3 + a] = x * wx + y * wy + z * wz


@_inline
def _unit_times(stem, seen, row):
    """I x of one inertial parameter of value one, numbered as in ``INERTIAL``."""
    vx, vy, vz = seen[row, 0], seen[row, 1], seen[row, 2]
    wx, wy, wz = seen[row, 3], seen[row, 4], seen[row, 5]
    fx, fy, fz, nx, ny, nz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if stem == 0:
        nx = wx
    elif stem == 1:
        nx, ny = wy, wx
    elif stem == 2:
        nx, nz = wz, wx
    elif stem == 3:
        ny = wy
    elif stem == 4:
        ny, nz = wz, wy
    elif stem == 5:
        nz = wz
    elif stem == 6:
        fy, fz, ny, nz = wz, -wy, -vz, vy
    elif stem == 7:
        fx, fz, nx, nz = -wz, wx, vz, -vx
    elif stem == 8:
        fx, fy, nx, ny = wy, -wx, -vy, vx
    else:
        fx, fy, fz = vx, vy, vz
    return fx, fy, fz, nx, ny, nz


@inner
def inertial_columns(parent, index, work, out):
    """Columns of the regressor for inertial parameters, into ``out``, shape (joints, columns).

    ``index``: link, stem and column of ``out`` of each parameter, links in order, shape
    (parameters, 3); the columns of others are left as they are. Needs ``move_links``.
    """
    place, seen = work.place, work.seen
    screw, velocity, acceleration = work.screw, work.velocity, work.acceleration
    last = -1
    for e in range(index.shape[0]):
        link, stem, column = index[e, 0], index[e, 1], index[e, 2]
        if link != last:
            _see(place, link, velocity, link, seen, 0)
            _see(place, link, acceleration, link, seen, 1)
            j, row = link, 2
            while j >= 0:
                _see(place, link, screw, j, seen, row)
                j, row = parent[j], row + 1
            last = link
        px, py, pz, lx, ly, lz = _unit_times(stem, seen, 0)
        fx, fy, fz, nx, ny, nz = _unit_times(stem, seen, 1)
        vx, vy, vz = seen[0, 0], seen[0, 1], seen[0, 2]
        wx, wy, wz = seen[0, 3], seen[0, 4], seen[0, 5]
        ax, ay, az = _cross(wx, wy, wz, px, py, pz)
        bx, by, bz = _cross(wx, wy, wz, lx, ly, lz)
        cx, cy, cz = _cross(vx, vy, vz, px, py, pz)
        j, row = link, 2
        while j >= 0:
            out[j, column] = _dot(
                seen, row, fx + ax, fy + ay, fz + az, nx + bx + cx, ny + by + cy, nz + bz + cz
            )
            j, row = parent[j], row + 1


@inner
def inertial_masses(parent, index, work, out):
    """∂M/∂θ of inertial parameters, added to ``out``, shape (joints j, joints i ≤ j, columns).

    ``index``: as for ``inertial_columns``. Needs ``place_links``.
    """
    place, seen, screw = work.place, work.seen, work.screw
    last = -1
    for e in range(index.shape[0]):
        link, stem, column = index[e, 0], index[e, 1], index[e, 2]
        if link != last:
            j, row = link, 2
            while j >= 0:
                _see(place, link, screw, j, seen, row)
                j, row = parent[j], row + 1
            last = link
        j, row = link, 2
        while j >= 0:
            f0, f1, f2, f3, f4, f5 = _unit_times(stem, seen, row)
            i, other = j, row
            while i >= 0:
                out[j, i, column] += _dot(seen, other, f0, f1, f2, f3, f4, f5)
                i, other = parent[i], other + 1
            j, row = parent[j], row + 1
