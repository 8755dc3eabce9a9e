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

import numpy as np

from pivident.dynamics.kernels import add_composite, place_link
from pivident.foundation.compiled import inlined as _inline, inner, rows

# Columns of ``links``: ^0R_i row by row and ^0p_i, S, V, A; force F, momentum p and matrix of B's
# moments of the links that a joint moves; y and A_p × S + V_p × y of the joint, C S and the moment
# of Bᵀ S of its links; what the frame of a link sees; C S of another joint.
_PLACE, _S, _V, _A, _F, _P, _N, _SWING, _BEND, _CARRIED, _TURNED, _SEEN, _MOVED = rows(
    0, 12, 18, 24, 30, 36, 39, 48, 54, 60, 66, 69, 75
)
LINK = 81
_LAST_FLOW = 48

#: Rows of ``links`` beyond those of the joints: V and A as the frame of a link sees them.
MORE_LINKS = 2


def slope_scratch(joints: int) -> tuple[np.ndarray, np.ndarray]:
    """Empty scratch for a robot of so many joints: ``links`` and ``body``.

    ``links``: see above, shape (joints + MORE_LINKS, LINK); ``body``: ten parameters of each link
    in its frame, then of C in the base, shape (2 joints, 10).
    """
    return np.zeros((joints + MORE_LINKS, LINK)), np.zeros((2 * joints, 10))


@_inline
def cross(ax, ay, az, bx, by, bz):
    """A × b of numbers, which stay in registers."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@_inline
def _motion_cross(links, i, a, j, b, k, out):
    """(v, w) × (v', w') = (w × v' + v × w', w × w'), row and first column of each."""
    v0, v1, v2 = links[i, a], links[i, a + 1], links[i, a + 2]
    w0, w1, w2 = links[i, a + 3], links[i, a + 4], links[i, a + 5]
    x0, x1, x2 = links[j, b], links[j, b + 1], links[j, b + 2]
    y0, y1, y2 = links[j, b + 3], links[j, b + 4], links[j, b + 5]
    links[k, out] = w1 * x2 - w2 * x1 + v1 * y2 - v2 * y1
    links[k, out + 1] = w2 * x0 - w0 * x2 + v2 * y0 - v0 * y2
    links[k, out + 2] = w0 * x1 - w1 * x0 + v0 * y1 - v1 * y0
    links[k, out + 3] = w1 * y2 - w2 * y1
    links[k, out + 4] = w2 * y0 - w0 * y2
    links[k, out + 5] = w0 * y1 - w1 * y0


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
def _dot(links, i, a, fx, fy, fz, nx, ny, nz):
    return (
        links[i, a] * fx + links[i, a + 1] * fy + links[i, a + 2] * fz
        + links[i, a + 3] * nx + links[i, a + 4] * ny + links[i, a + 5] * nz
    )  # fmt: skip


@_inline
def place_links(parent, prismatic, pose, inertia, links, body):
    """Poses and screws in the base and the composite inertias C, from poses in the parents."""
    n = parent.size
    for i in range(n):
        place_link(parent[i], pose, i, links)
        zx, zy, zz = links[i, 2], links[i, 5], links[i, 8]
        if prismatic[i]:
            links[i, _S], links[i, _S + 1], links[i, _S + 2] = zx, zy, zz
            links[i, _S + 3], links[i, _S + 4], links[i, _S + 5] = 0.0, 0.0, 0.0
        else:
            links[i, _S], links[i, _S + 1], links[i, _S + 2] = cross(
                links[i, 9], links[i, 10], links[i, 11], zx, zy, zz
            )
            links[i, _S + 3], links[i, _S + 4], links[i, _S + 5] = zx, zy, zz
        for c in range(10):
            body[i, c], body[n + i, c] = inertia[i, c], 0.0
        add_composite(links, body, i, n + i)


@_inline
def move_links(parent, gravity, dq, ddq, links, body):
    """V and A of every link; C, F and B of the links that a joint moves; after ``place_links``."""
    n = parent.size
    for i in range(n):
        p = parent[i]
        for c in range(6):
            links[i, _V + c] = links[i, _S + c] * dq[i]
            links[i, _A + c] = links[i, _S + c] * ddq[i]
            if p >= 0:
                links[i, _V + c] += links[p, _V + c]
                links[i, _A + c] += links[p, _A + c]
        if p < 0:
            for c in range(3):
                links[i, _A + c] -= gravity[c]
        _motion_cross(links, i, _V, i, _S, i, _SWING)  # V_i × S_i = V_p × S_i
        for c in range(6):
            links[i, _A + c] += links[i, _SWING + c] * dq[i]
        _add_flow(body, n + i, links, i)
    for i in range(n - 1, -1, -1):
        p = parent[i]
        if p >= 0:
            for c in range(_F, _LAST_FLOW):
                links[p, c] += links[i, c]
            for c in range(10):
                body[n + p, c] += body[n + i, c]


@_inline
def _add_flow(body, row, links, i):
    """F and B of one link, its parameters in the base in row ``row``."""
    vx, vy, vz = links[i, _V], links[i, _V + 1], links[i, _V + 2]
    wx, wy, wz = links[i, _V + 3], links[i, _V + 4], links[i, _V + 5]
    px, py, pz, lx, ly, lz = _inertia_times(body, row, vx, vy, vz, wx, wy, wz)
    fx, fy, fz, nx, ny, nz = _inertia_times(
        body, row, links[i, _A], links[i, _A + 1], links[i, _A + 2],
        links[i, _A + 3], links[i, _A + 4], links[i, _A + 5],
    )  # fmt: skip
    cx, cy, cz = cross(wx, wy, wz, px, py, pz)
    links[i, _F], links[i, _F + 1], links[i, _F + 2] = fx + cx, fy + cy, fz + cz
    cx, cy, cz = cross(wx, wy, wz, lx, ly, lz)
    dx, dy, dz = cross(vx, vy, vz, px, py, pz)
    links[i, _F + 3], links[i, _F + 4] = nx + cx + dx, ny + cy + dy
    links[i, _F + 5] = nz + cz + dz
    links[i, _P], links[i, _P + 1], links[i, _P + 2] = px, py, pz
    xx, xy, xz = body[row, 0], body[row, 1], body[row, 2]
    yy, yz, zz = body[row, 3], body[row, 4], body[row, 5]
    hx, hy, hz = body[row, 6], body[row, 7], body[row, 8]
    trace, along = xx + yy + zz, 2.0 * (hx * vx + hy * vy + hz * vz)
    # columns of ω × J
    a00, a10, a20 = cross(wx, wy, wz, xx, xy, xz)
    a01, a11, a21 = cross(wx, wy, wz, xy, yy, yz)
    a02, a12, a22 = cross(wx, wy, wz, xz, yz, zz)
    links[i, _N] = 2.0 * (a00 - vx * hx) + along
    links[i, _N + 1] = 2.0 * (a01 - vx * hy) + trace * wz
    links[i, _N + 2] = 2.0 * (a02 - vx * hz) - trace * wy
    links[i, _N + 3] = 2.0 * (a10 - vy * hx) - trace * wz
    links[i, _N + 4] = 2.0 * (a11 - vy * hy) + along
    links[i, _N + 5] = 2.0 * (a12 - vy * hz) + trace * wx
    links[i, _N + 6] = 2.0 * (a20 - vz * hx) + trace * wy
    links[i, _N + 7] = 2.0 * (a21 - vz * hy) - trace * wx
    links[i, _N + 8] = 2.0 * (a22 - vz * hz) + along


@_inline
def _swung(links, i, wx, wy, wz):
    """B x of the links beyond joint i, for a motion that turns by w."""
    fx, fy, fz = cross(wx, wy, wz, links[i, _P], links[i, _P + 1], links[i, _P + 2])
    return (
        2.0 * fx,
        2.0 * fy,
        2.0 * fz,
        links[i, _N] * wx + links[i, _N + 1] * wy + links[i, _N + 2] * wz,
        links[i, _N + 3] * wx + links[i, _N + 4] * wy + links[i, _N + 5] * wz,
        links[i, _N + 6] * wx + links[i, _N + 7] * wy + links[i, _N + 8] * wz,
    )


@_inline
def torque_slopes(parent, gravity, links, body, by_position, by_speed):
    """∂τ_j/∂q_k and ∂τ_j/∂dq_k of the rigid body, shape (joints, joints); needs ``move_links``."""
    n = parent.size
    for j in range(n):
        for k in range(n):
            by_position[j, k], by_speed[j, k] = 0.0, 0.0
    for k in range(n):
        p = parent[k]
        s0, s1, s2 = links[k, _S], links[k, _S + 1], links[k, _S + 2]
        w0, w1, w2 = links[k, _S + 3], links[k, _S + 4], links[k, _S + 5]
        if p >= 0:
            _motion_cross(links, p, _A, k, _S, k, _BEND)
            y0, y1, y2 = links[k, _SWING], links[k, _SWING + 1], links[k, _SWING + 2]
            z0, z1, z2 = links[k, _SWING + 3], links[k, _SWING + 4], links[k, _SWING + 5]
            vx, vy, vz = links[p, _V], links[p, _V + 1], links[p, _V + 2]
            ox, oy, oz = links[p, _V + 3], links[p, _V + 4], links[p, _V + 5]
            ax, ay, az = cross(ox, oy, oz, y0, y1, y2)
            bx, by, bz = cross(vx, vy, vz, z0, z1, z2)
            cx, cy, cz = cross(ox, oy, oz, z0, z1, z2)
            links[k, _BEND] += ax + bx
            links[k, _BEND + 1] += ay + by
            links[k, _BEND + 2] += az + bz
            links[k, _BEND + 3] += cx
            links[k, _BEND + 4] += cy
            links[k, _BEND + 5] += cz
        else:
            y0, y1, y2, z0, z1, z2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for c in range(6):
                links[k, _SWING + c], links[k, _BEND + c] = 0.0, 0.0
            links[k, _BEND], links[k, _BEND + 1], links[k, _BEND + 2] = cross(
                -gravity[0], -gravity[1], -gravity[2], w0, w1, w2
            )
        # C S and the turning part of Bᵀ S, for the joints before k
        c0, c1, c2, c3, c4, c5 = _inertia_times(body, n + k, s0, s1, s2, w0, w1, w2)
        links[k, _CARRIED], links[k, _CARRIED + 1], links[k, _CARRIED + 2] = c0, c1, c2
        links[k, _CARRIED + 3], links[k, _CARRIED + 4], links[k, _CARRIED + 5] = c3, c4, c5
        bx, by, bz = cross(links[k, _P], links[k, _P + 1], links[k, _P + 2], s0, s1, s2)
        for c in range(3):
            links[k, _TURNED + c] = (
                links[k, _N + c] * w0 + links[k, _N + 3 + c] * w1 + links[k, _N + 6 + c] * w2
            )
        links[k, _TURNED] += 2.0 * bx
        links[k, _TURNED + 1] += 2.0 * by
        links[k, _TURNED + 2] += 2.0 * bz
        # what joint k changes in the forces beyond it
        f0, f1, f2, f3, f4, f5 = _inertia_times(
            body, n + k, links[k, _BEND], links[k, _BEND + 1], links[k, _BEND + 2],
            links[k, _BEND + 3], links[k, _BEND + 4], links[k, _BEND + 5],
        )  # fmt: skip
        g0, g1, g2, g3, g4, g5 = _swung(links, k, z0, z1, z2)
        fx, fy, fz = links[k, _F], links[k, _F + 1], links[k, _F + 2]
        ax, ay, az = cross(w0, w1, w2, fx, fy, fz)
        bx, by, bz = cross(w0, w1, w2, links[k, _F + 3], links[k, _F + 4], links[k, _F + 5])
        cx, cy, cz = cross(s0, s1, s2, fx, fy, fz)
        f0, f1, f2 = f0 + g0 + ax, f1 + g1 + ay, f2 + g2 + az
        f3, f4, f5 = f3 + g3 + bx + cx, f4 + g4 + by + cy, f5 + g5 + bz + cz
        e0, e1, e2, e3, e4, e5 = _inertia_times(body, n + k, y0, y1, y2, z0, z1, z2)
        g0, g1, g2, g3, g4, g5 = _swung(links, k, w0, w1, w2)
        e0, e1, e2 = 2.0 * e0 + g0, 2.0 * e1 + g1, 2.0 * e2 + g2
        e3, e4, e5 = 2.0 * e3 + g3, 2.0 * e4 + g4, 2.0 * e5 + g5
        j = k
        while j >= 0:
            by_position[j, k] = _dot(links, j, _S, f0, f1, f2, f3, f4, f5)
            by_speed[j, k] = _dot(links, j, _S, e0, e1, e2, e3, e4, e5)
            j = parent[j]
        # what the joints before k change in its own torque
        t0, t1, t2 = links[k, _TURNED], links[k, _TURNED + 1], links[k, _TURNED + 2]
        j = p
        while j >= 0:
            bend, swing = 0.0, 0.0
            for c in range(6):
                bend += links[k, _CARRIED + c] * links[j, _BEND + c]
                swing += links[k, _CARRIED + c] * links[j, _SWING + c]
            by_position[k, j] = (
                bend
                + t0 * links[j, _SWING + 3]
                + t1 * links[j, _SWING + 4]
                + t2 * links[j, _SWING + 5]
            )
            by_speed[k, j] = (
                2.0 * swing + t0 * links[j, _S + 3] + t1 * links[j, _S + 4] + t2 * links[j, _S + 5]
            )
            j = parent[j]


@inner
def mass_slopes(parent, links, body, out):
    """∂M_ij/∂q_k of the lower triangle, shape (joints j, joints i ≤ j, joints k).

    Needs ``torque_slopes``.
    """
    n = parent.size
    for j in range(n):
        for i in range(j + 1):
            for k in range(n):
                out[j, i, k] = 0.0
    for k in range(n):
        j = k
        while j >= 0:
            c = _inertia_times(
                body, n + k, links[j, _S], links[j, _S + 1], links[j, _S + 2],
                links[j, _S + 3], links[j, _S + 4], links[j, _S + 5],
            )  # fmt: skip
            for a in range(6):
                links[j, _MOVED + a] = c[a]
            _motion_cross(links, j, _S, k, _S, j, _SEEN)
            j = parent[j]
        j = k
        while j >= 0:
            i = j if j < k else parent[j]
            while i >= 0:
                total = 0.0
                for a in range(6):
                    total += links[i, _SEEN + a] * links[j, _MOVED + a]
                    if j < k:
                        total += links[j, _SEEN + a] * links[i, _MOVED + a]
                out[j, i, k] = total
                i = parent[i]
            j = parent[j]
        for j in range(k + 1, n):
            p = parent[j]
            while p > k:
                p = parent[p]
            i = parent[k] if p == k else -1
            while i >= 0:  # k lies between the two
                total = 0.0
                for a in range(6):
                    total += links[i, _SEEN + a] * links[j, _CARRIED + a]
                out[j, i, k] = total
                i = parent[i]


@_inline
def _see(links, link, source, row, target):
    """A motion vector at the base, in the frame of a link: Rᵀ (v + w × p), Rᵀ w."""
    wx, wy, wz = links[row, source + 3], links[row, source + 4], links[row, source + 5]
    cx, cy, cz = cross(wx, wy, wz, links[link, 9], links[link, 10], links[link, 11])
    vx = links[row, source] + cx
    vy = links[row, source + 1] + cy
    vz = links[row, source + 2] + cz
    for a in range(3):
        x, y, z = links[link, a], links[link, 3 + a], links[link, 6 + a]
        links[target, _SEEN + a] = x * vx + y * vy + z * vz
        links[target, _SEEN + 3 + a] = x * wx + y * wy + z * wz


@_inline
def _unit_times(stem, links, row):
    """I x of one inertial parameter of value one, numbered as in ``INERTIAL``."""
    vx, vy, vz = links[row, _SEEN], links[row, _SEEN + 1], links[row, _SEEN + 2]
    wx, wy, wz = links[row, _SEEN + 3], links[row, _SEEN + 4], links[row, _SEEN + 5]
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
def inertial_columns(parent, index, links, out):
    """Columns of the regressor for inertial parameters, added to ``out``, (joints, columns).

    ``index``: link, stem and column of ``out`` of each parameter, links in order, shape
    (parameters, 3); the columns of others are left as they are. Needs ``move_links``.
    """
    n, last = parent.size, -1
    for e in range(index.shape[0]):
        link, stem, column = index[e, 0], index[e, 1], index[e, 2]
        if link != last:
            _see(links, link, _V, link, n)
            _see(links, link, _A, link, n + 1)
            j, row = link, 0
            while j >= 0:
                _see(links, link, _S, j, row)
                j, row = parent[j], row + 1
            last = link
        px, py, pz, lx, ly, lz = _unit_times(stem, links, n)
        fx, fy, fz, nx, ny, nz = _unit_times(stem, links, n + 1)
        vx, vy, vz = links[n, _SEEN], links[n, _SEEN + 1], links[n, _SEEN + 2]
        wx, wy, wz = links[n, _SEEN + 3], links[n, _SEEN + 4], links[n, _SEEN + 5]
        ax, ay, az = cross(wx, wy, wz, px, py, pz)
        bx, by, bz = cross(wx, wy, wz, lx, ly, lz)
        cx, cy, cz = cross(vx, vy, vz, px, py, pz)
        j, row = link, 0
        while j >= 0:
            out[j, column] += _dot(
                links,
                row,
                _SEEN,
                fx + ax,
                fy + ay,
                fz + az,
                nx + bx + cx,
                ny + by + cy,
                nz + bz + cz,
            )
            j, row = parent[j], row + 1


@inner
def inertial_masses(parent, index, links, out):
    """∂M/∂θ of inertial parameters, added to ``out``, shape (joints j, joints i ≤ j, columns).

    ``index``: as for ``inertial_columns``. Needs ``place_links``.
    """
    last = -1
    for e in range(index.shape[0]):
        link, stem, column = index[e, 0], index[e, 1], index[e, 2]
        if link != last:
            j, row = link, 0
            while j >= 0:
                _see(links, link, _S, j, row)
                j, row = parent[j], row + 1
            last = link
        j, row = link, 0
        while j >= 0:
            f0, f1, f2, f3, f4, f5 = _unit_times(stem, links, row)
            i, other = j, row
            while i >= 0:
                out[j, i, column] += _dot(links, other, _SEEN, f0, f1, f2, f3, f4, f5)
                i, other = parent[i], other + 1
            j, row = parent[j], row + 1
