"""Every compiled rigid-body loop: recursions over links, generic over the robot.

Two families live here. The *packed regressor* works on many samples at once: quantities are
stored with time last, in tiles of ``TILE`` samples, so that the innermost loops run over samples
and the compiler turns them into vector instructions. The *rigid body* functions work on one
sample at a time, because the simulation cannot know the next sample before it has made this one.

Spatial conventions (Khalil and Dombre; Featherstone): a link frame sits on its joint with z along
the joint axis; ``R`` rotates from the link into its parent, ``p`` is the link's origin in the
parent. Gravity enters as an upward acceleration of the base.

The ten inertial parameters enter linearly: with ω, dω, a the angular velocity, angular
acceleration and linear acceleration of the frame's origin, I the inertia about that origin and
h = (mx, my, mz) the first moments,

    f = m a + dω × h + ω × (ω × h),        n = I dω + ω × (I ω) + h × a
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

TILE = 128  # samples per tile: long enough to vectorise, small enough for the second-level cache


class Tree(NamedTuple):
    """The robot's geometry as arrays for the kernels.

    Attributes:
        parent: index of the parent link or -1, shape (joints,).
        prismatic: 1 for prismatic, 0 for revolute joints, shape (joints,).
        rotation: frame orientations in the parent at q = 0, shape (joints, 3, 3).
        translation: frame origins in the parent at q = 0 [m], shape (joints, 3).
        gravity: acceleration of gravity in the base frame [m/s²], shape (3,).
    """

    parent: np.ndarray
    prismatic: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray
    gravity: np.ndarray


# Slots of a link's tile: orientation (9), origin (3), ω, dω, a (9), products of ω and dω (9).
_R, _P, _W, _DW, _A, _G, _SLOTS = 0, 9, 12, 15, 18, 21, 30


@njit(cache=True, nogil=True)
def _tile_orientation(tile, base, rotation, translation, prismatic, q, sin, cos):
    """Orientation and origin of a link in its parent, for one tile of samples."""
    if prismatic:
        for k in range(9):
            value = rotation[k // 3, k % 3]
            for s in range(TILE):
                tile[(base + _R + k) * TILE + s] = value
        for k in range(3):
            r0, r2 = translation[k], rotation[k, 2]
            for s in range(TILE):
                tile[(base + _P + k) * TILE + s] = r0 + r2 * q[s]
        return
    if base < 0:
        return
    for k in range(3):
        r0, r1, r2 = rotation[k, 0], rotation[k, 1], rotation[k, 2]
        i0 = (base + _R + 3 * k) * TILE
        for s in range(TILE):
            tile[i0 + s] = r0 * cos[s] + r1 * sin[s]
            tile[i0 + TILE + s] = r1 * cos[s] - r0 * sin[s]
            tile[i0 + 2 * TILE + s] = r2
        r0 = translation[k]
        for s in range(TILE):
            tile[(base + _P + k) * TILE + s] = r0


@njit(cache=True, nogil=True)
def _tile_motion(tile, base, parent, prismatic, dq, ddq, gravity):
    """ω, dω, a of a link's frame from its parent's, and G = [dω]× + [ω]×[ω]×, for one tile."""
    b, u = base * TILE, max(parent, 0) * TILE
    if b < 0 or u < 0:
        return
    w, e, a = b + _W * TILE, b + _DW * TILE, b + _A * TILE
    if parent < 0:
        gx, gy, gz = gravity[0], gravity[1], gravity[2]
        for s in range(TILE):
            for k in range(3):
                tile[w + k * TILE + s] = 0.0
                tile[e + k * TILE + s] = 0.0
            tile[a + s] = -gx
            tile[a + TILE + s] = -gy
            tile[a + 2 * TILE + s] = -gz
    else:
        # G of the parent turns the lever arm p into its centripetal and tangential acceleration
        g, p = u + _G * TILE, b + _P * TILE
        for k in range(3):
            ak, gk = k * TILE, 3 * k * TILE
            for s in range(TILE):
                tile[w + ak + s] = tile[u + _W * TILE + ak + s]
                tile[e + ak + s] = tile[u + _DW * TILE + ak + s]
                tile[a + ak + s] = (
                    tile[u + _A * TILE + ak + s]
                    + tile[g + gk + s] * tile[p + s]
                    + tile[g + gk + TILE + s] * tile[p + TILE + s]
                    + tile[g + gk + 2 * TILE + s] * tile[p + 2 * TILE + s]
                )
    _tile_rotate(tile, b, w)
    _tile_rotate(tile, b, e)
    _tile_rotate(tile, b, a)
    if prismatic:
        for s in range(TILE):
            tile[a + s] += 2.0 * tile[w + TILE + s] * dq[s]
            tile[a + TILE + s] -= 2.0 * tile[w + s] * dq[s]
            tile[a + 2 * TILE + s] += ddq[s]
    else:
        for s in range(TILE):
            tile[e + s] += tile[w + TILE + s] * dq[s]
            tile[e + TILE + s] -= tile[w + s] * dq[s]
            tile[e + 2 * TILE + s] += ddq[s]
            tile[w + 2 * TILE + s] += dq[s]
    g = b + _G * TILE
    for s in range(TILE):
        x, y, z = tile[w + s], tile[w + TILE + s], tile[w + 2 * TILE + s]
        ex, ey, ez = tile[e + s], tile[e + TILE + s], tile[e + 2 * TILE + s]
        tile[g + s] = -y * y - z * z
        tile[g + TILE + s] = x * y - ez
        tile[g + 2 * TILE + s] = x * z + ey
        tile[g + 3 * TILE + s] = x * y + ez
        tile[g + 4 * TILE + s] = -x * x - z * z
        tile[g + 5 * TILE + s] = y * z - ex
        tile[g + 6 * TILE + s] = x * z - ey
        tile[g + 7 * TILE + s] = y * z + ex
        tile[g + 8 * TILE + s] = -x * x - y * y


@njit(cache=True, nogil=True)
def _tile_rotate(tile, r, v):
    """v <- Rᵀ v in place, R at offset r."""
    if r < 0 or v < 0:
        return
    for s in range(TILE):
        x, y, z = tile[v + s], tile[v + TILE + s], tile[v + 2 * TILE + s]
        tile[v + s] = (
            tile[r + s] * x + tile[r + 3 * TILE + s] * y + tile[r + 6 * TILE + s] * z
        )
        tile[v + TILE + s] = (
            tile[r + TILE + s] * x + tile[r + 4 * TILE + s] * y + tile[r + 7 * TILE + s] * z
        )
        tile[v + 2 * TILE + s] = (
            tile[r + 2 * TILE + s] * x + tile[r + 5 * TILE + s] * y + tile[r + 8 * TILE + s] * z
        )


@njit(cache=True, nogil=True)
def _tile_screw(tile, base, source, target):
    """Carry a joint's screw (v, w) into the link's frame: w' = Rᵀw, v' = Rᵀ(v + w × p)."""
    b, i, o = base * TILE, source * TILE, target * TILE
    if b < 0 or i < 0 or o < 0:
        return
    p, w = b + _P * TILE, i + 3 * TILE
    for s in range(TILE):
        px, py, pz = tile[p + s], tile[p + TILE + s], tile[p + 2 * TILE + s]
        wx, wy, wz = tile[w + s], tile[w + TILE + s], tile[w + 2 * TILE + s]
        tile[o + s] = tile[i + s] + wy * pz - wz * py
        tile[o + TILE + s] = tile[i + TILE + s] + wz * px - wx * pz
        tile[o + 2 * TILE + s] = tile[i + 2 * TILE + s] + wx * py - wy * px
        tile[o + 3 * TILE + s] = wx
        tile[o + 4 * TILE + s] = wy
        tile[o + 5 * TILE + s] = wz
    _tile_rotate(tile, b, o)
    _tile_rotate(tile, b, o + 3 * TILE)


@njit(cache=True, nogil=True)
def _diagonal_column(tile, w0, w1, e, x0, x1, x2, out):
    """Column of a diagonal inertia about axis 2: w₂ dω₂ + (w₀ω₁ - w₁ω₀) ω₂, axes cyclic."""
    if w0 < 0 or w1 < 0 or e < 0 or x0 < 0 or x1 < 0 or x2 < 0:
        return
    w2 = e - 3 * TILE
    for s in range(out.size):
        out[s] = (
            tile[x2 + s] * tile[e + s]
            + (tile[x0 + s] * tile[w1 + s] - tile[x1 + s] * tile[w0 + s]) * tile[w2 + s]
        )


@njit(cache=True, nogil=True)
def _product_column(tile, w0, w1, w2, e0, e1, x0, x1, x2, out):
    """Column of the product of inertia of axes 0 and 1: w₀dω₁ + w₁dω₀ + u₀ω₁ + u₁ω₀, u = w × ω."""
    if w0 < 0 or w1 < 0 or w2 < 0 or e0 < 0 or e1 < 0 or x0 < 0 or x1 < 0 or x2 < 0:
        return
    for s in range(out.size):
        o0, o1, o2 = tile[w0 + s], tile[w1 + s], tile[w2 + s]
        a0, a1, a2 = tile[x0 + s], tile[x1 + s], tile[x2 + s]
        out[s] = (
            a0 * tile[e1 + s]
            + a1 * tile[e0 + s]
            + (a1 * o2 - a2 * o1) * o1
            + (a2 * o0 - a0 * o2) * o0
        )


@njit(cache=True, nogil=True)
def _moment_column(tile, g, v, a1, a2, x1, x2, out):
    """Column of the first moment along axis 0: (Gᵀv)₀ + a₁w₂ - a₂w₁, axes cyclic."""
    if g < 0 or v < 0 or a1 < 0 or a2 < 0 or x1 < 0 or x2 < 0:
        return
    for s in range(out.size):
        out[s] = (
            tile[g + s] * tile[v + s]
            + tile[g + 3 * TILE + s] * tile[v + TILE + s]
            + tile[g + 6 * TILE + s] * tile[v + 2 * TILE + s]
            + tile[a1 + s] * tile[x2 + s]
            - tile[a2 + s] * tile[x1 + s]
        )


@njit(cache=True, nogil=True)
def _mass_column(tile, v, a, out):
    """Column of the mass: v·a."""
    if v < 0 or a < 0:
        return
    for s in range(out.size):
        out[s] = (
            tile[v + s] * tile[a + s]
            + tile[v + TILE + s] * tile[a + TILE + s]
            + tile[v + 2 * TILE + s] * tile[a + 2 * TILE + s]
        )


@njit(cache=True, nogil=True)
def _tile_columns(tile, base, screw, rows, out, start, stop):
    """Columns of one link's ten parameters in the row of the joint with screw (v, w).

    The torque of that joint is v·f + w·n; with u = w × ω its inertia part is w·(I dω) + u·(I ω).
    """
    w, e, a = (base + _W) * TILE, (base + _DW) * TILE, (base + _A) * TILE
    g, v = (base + _G) * TILE, screw * TILE
    x = v + 3 * TILE
    one, two = TILE, 2 * TILE
    if rows[0] >= 0:
        _diagonal_column(tile, w + one, w + two, e, x + one, x + two, x, out[rows[0], start:stop])
    if rows[1] >= 0:
        _product_column(
            tile, w, w + one, w + two, e, e + one, x, x + one, x + two, out[rows[1], start:stop]
        )
    if rows[2] >= 0:
        _product_column(
            tile, w + two, w, w + one, e + two, e, x + two, x, x + one, out[rows[2], start:stop]
        )
    if rows[3] >= 0:
        _diagonal_column(tile, w + two, w, e + one, x + two, x, x + one, out[rows[3], start:stop])
    if rows[4] >= 0:
        _product_column(
            tile, w + one, w + two, w, e + one, e + two, x + one, x + two, x,
            out[rows[4], start:stop],
        )  # fmt: skip
    if rows[5] >= 0:
        _diagonal_column(tile, w, w + one, e + two, x, x + one, x + two, out[rows[5], start:stop])
    if rows[6] >= 0:
        _moment_column(tile, g, v, a + one, a + two, x + one, x + two, out[rows[6], start:stop])
    if rows[7] >= 0:
        _moment_column(tile, g + one, v, a + two, a, x + two, x, out[rows[7], start:stop])
    if rows[8] >= 0:
        _moment_column(tile, g + two, v, a, a + one, x, x + one, out[rows[8], start:stop])
    if rows[9] >= 0:
        _mass_column(tile, v, a, out[rows[9], start:stop])


@njit(cache=True, nogil=True)
def inertial_entries(tree, joint_of, rows_of, q, dq, ddq, sin, cos, out):
    """Packed inertial entries of the observation matrix.

    Args:
        tree: the robot's geometry.
        joint_of: ancestors of each link, itself first, filled with -1, shape (links, depth).
        rows_of: for each link, ancestor and parameter the row of ``out`` that receives the entry
            (that joint's torque per that parameter), -1: not wanted; shape (links, depth, 10).
        q: joint positions, and likewise ``dq ddq sin cos``, time last, shape (joints, samples).
        out: entries, time last, shape (entries, samples).
    """
    links, depth = joint_of.shape
    samples = q.shape[1]
    screws = links * _SLOTS
    tile = np.zeros((screws + links * depth * 6) * TILE)
    angle = np.zeros((5, TILE))
    for start in range(0, samples, TILE):
        count = min(TILE, samples - start)
        for i in range(links):
            for s in range(count):
                angle[0, s] = q[i, start + s]
                angle[1, s] = dq[i, start + s]
                angle[2, s] = ddq[i, start + s]
                angle[3, s] = sin[i, start + s]
                angle[4, s] = cos[i, start + s]
            base = i * _SLOTS
            parent = tree.parent[i]
            prismatic = tree.prismatic[i]
            _tile_orientation(
                tile, base, tree.rotation[i], tree.translation[i], prismatic,
                angle[0], angle[3], angle[4],
            )  # fmt: skip
            parent_base = parent * _SLOTS if parent >= 0 else -1
            _tile_motion(tile, base, parent_base, prismatic, angle[1], angle[2], tree.gravity)
            for k in range(depth):
                joint = joint_of[i, k]
                if joint < 0:
                    break
                screw = screws + (i * depth + k) * 6
                if k == 0:
                    axis = 2 if prismatic else 5
                    for s in range(TILE):
                        tile[(screw + axis) * TILE + s] = 1.0
                else:
                    _tile_screw(tile, base, screws + (parent * depth + k - 1) * 6, screw)
                _tile_columns(tile, base, screw, rows_of[i, k], out, start, start + count)


class RigidBodyWork(NamedTuple):
    """Scratch of ``mass_matrix_and_bias``; made once per simulation by ``rigid_body_work``."""

    rotation: np.ndarray  # ^pR_i, (joints, 9)
    origin: np.ndarray  # ^pp_i, (joints, 3)
    motion: np.ndarray  # ω, dω, a, (joints, 9)
    force: np.ndarray  # f, n, (joints, 6)
    composite: np.ndarray  # ten parameters of the subtree, (joints, 10)


@njit(cache=True, nogil=True)
def rigid_body_work(joints):
    """Empty scratch for a robot of so many joints."""
    return RigidBodyWork(
        np.empty((joints, 9)),
        np.empty((joints, 3)),
        np.empty((joints, 9)),
        np.empty((joints, 6)),
        np.empty((joints, 10)),
    )


@njit(cache=True, nogil=True)
def _link_poses(tree, q, work):
    """Pose of every link in its parent's frame."""
    for i in range(q.size):
        rotation, translation = tree.rotation[i], tree.translation[i]
        r, p = work.rotation[i], work.origin[i]
        if tree.prismatic[i]:
            for k in range(3):
                r[3 * k], r[3 * k + 1], r[3 * k + 2] = (
                    rotation[k, 0],
                    rotation[k, 1],
                    rotation[k, 2],
                )
                p[k] = translation[k] + rotation[k, 2] * q[i]
        else:
            c, s = np.cos(q[i]), np.sin(q[i])
            for k in range(3):
                r[3 * k] = rotation[k, 0] * c + rotation[k, 1] * s
                r[3 * k + 1] = rotation[k, 1] * c - rotation[k, 0] * s
                r[3 * k + 2] = rotation[k, 2]
                p[k] = translation[k]


@njit(cache=True, nogil=True)
def _bias_torque(tree, inertia, dq, work, bias):
    """Torques of gravity, centrifugal and Coriolis effects: Newton–Euler with ddq = 0."""
    n = dq.size
    for i in range(n):
        parent = tree.parent[i]
        r, p, m = work.rotation[i], work.origin[i], work.motion[i]
        if parent >= 0:
            u = work.motion[parent]
            wx, wy, wz, ex, ey, ez = u[0], u[1], u[2], u[3], u[4], u[5]
            lx, ly, lz = p[0], p[1], p[2]
            cx, cy, cz = wy * lz - wz * ly, wz * lx - wx * lz, wx * ly - wy * lx
            ax = u[6] + ey * lz - ez * ly + wy * cz - wz * cy
            ay = u[7] + ez * lx - ex * lz + wz * cx - wx * cz
            az = u[8] + ex * ly - ey * lx + wx * cy - wy * cx
        else:
            wx, wy, wz, ex, ey, ez = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            ax, ay, az = -tree.gravity[0], -tree.gravity[1], -tree.gravity[2]
        ox = r[0] * wx + r[3] * wy + r[6] * wz
        oy = r[1] * wx + r[4] * wy + r[7] * wz
        oz = r[2] * wx + r[5] * wy + r[8] * wz
        fx = r[0] * ex + r[3] * ey + r[6] * ez
        fy = r[1] * ex + r[4] * ey + r[7] * ez
        fz = r[2] * ex + r[5] * ey + r[8] * ez
        bx = r[0] * ax + r[3] * ay + r[6] * az
        by = r[1] * ax + r[4] * ay + r[7] * az
        bz = r[2] * ax + r[5] * ay + r[8] * az
        d = dq[i]
        if tree.prismatic[i]:
            bx += 2.0 * oy * d
            by -= 2.0 * ox * d
        else:
            fx += oy * d
            fy -= ox * d
            oz += d
        m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8] = ox, oy, oz, fx, fy, fz, bx, by, bz
        j = inertia[i]
        hx, hy, hz = j[6], j[7], j[8]
        cx, cy, cz = oy * hz - oz * hy, oz * hx - ox * hz, ox * hy - oy * hx
        gx = j[0] * ox + j[1] * oy + j[2] * oz
        gy = j[1] * ox + j[3] * oy + j[4] * oz
        gz = j[2] * ox + j[4] * oy + j[5] * oz
        f = work.force[i]
        f[0] = j[9] * bx + fy * hz - fz * hy + oy * cz - oz * cy
        f[1] = j[9] * by + fz * hx - fx * hz + oz * cx - ox * cz
        f[2] = j[9] * bz + fx * hy - fy * hx + ox * cy - oy * cx
        f[3] = j[0] * fx + j[1] * fy + j[2] * fz + oy * gz - oz * gy + hy * bz - hz * by
        f[4] = j[1] * fx + j[3] * fy + j[4] * fz + oz * gx - ox * gz + hz * bx - hx * bz
        f[5] = j[2] * fx + j[4] * fy + j[5] * fz + ox * gy - oy * gx + hx * by - hy * bx
    for i in range(n - 1, -1, -1):
        f = work.force[i]
        bias[i] = f[2] if tree.prismatic[i] else f[5]
        parent = tree.parent[i]
        if parent >= 0:
            _add_wrench(work.rotation[i], work.origin[i], f, work.force[parent])


@njit(cache=True, nogil=True, inline="always")
def _add_wrench(r, p, f, target):
    """Carry a force and moment (f, n) into the parent's frame and add it there."""
    fx = r[0] * f[0] + r[1] * f[1] + r[2] * f[2]
    fy = r[3] * f[0] + r[4] * f[1] + r[5] * f[2]
    fz = r[6] * f[0] + r[7] * f[1] + r[8] * f[2]
    nx = r[0] * f[3] + r[1] * f[4] + r[2] * f[5]
    ny = r[3] * f[3] + r[4] * f[4] + r[5] * f[5]
    nz = r[6] * f[3] + r[7] * f[4] + r[8] * f[5]
    target[0] += fx
    target[1] += fy
    target[2] += fz
    target[3] += nx + p[1] * fz - p[2] * fy
    target[4] += ny + p[2] * fx - p[0] * fz
    target[5] += nz + p[0] * fy - p[1] * fx


@njit(cache=True, nogil=True)
def _add_composite(r, p, child, target):
    """Add the ten parameters of a link to its parent's, at the parent's origin.

    With h' = R h:  I += R I Rᵀ - (p h'ᵀ + h' pᵀ) + 2 (p·h') 1 + m (p·p 1 - p pᵀ),  h += h' + m p.
    """
    xx, xy, xz, yy, yz, zz = child[0], child[1], child[2], child[3], child[4], child[5]
    m = child[9]
    # A = R I
    a00 = r[0] * xx + r[1] * xy + r[2] * xz
    a01 = r[0] * xy + r[1] * yy + r[2] * yz
    a02 = r[0] * xz + r[1] * yz + r[2] * zz
    a10 = r[3] * xx + r[4] * xy + r[5] * xz
    a11 = r[3] * xy + r[4] * yy + r[5] * yz
    a12 = r[3] * xz + r[4] * yz + r[5] * zz
    a20 = r[6] * xx + r[7] * xy + r[8] * xz
    a21 = r[6] * xy + r[7] * yy + r[8] * yz
    a22 = r[6] * xz + r[7] * yz + r[8] * zz
    hx = r[0] * child[6] + r[1] * child[7] + r[2] * child[8]
    hy = r[3] * child[6] + r[4] * child[7] + r[5] * child[8]
    hz = r[6] * child[6] + r[7] * child[7] + r[8] * child[8]
    px, py, pz = p[0], p[1], p[2]
    # the lever arm acts twice: on the first moments, and on the mass
    gx, gy, gz = 2.0 * hx + m * px, 2.0 * hy + m * py, 2.0 * hz + m * pz
    sx, sy, sz = px * gx, py * gy, pz * gz
    target[0] += a00 * r[0] + a01 * r[1] + a02 * r[2] + sy + sz
    target[1] += a00 * r[3] + a01 * r[4] + a02 * r[5] - px * hy - py * hx - m * px * py
    target[2] += a00 * r[6] + a01 * r[7] + a02 * r[8] - px * hz - pz * hx - m * px * pz
    target[3] += a10 * r[3] + a11 * r[4] + a12 * r[5] + sx + sz
    target[4] += a10 * r[6] + a11 * r[7] + a12 * r[8] - py * hz - pz * hy - m * py * pz
    target[5] += a20 * r[6] + a21 * r[7] + a22 * r[8] + sx + sy
    target[6] += hx + m * px
    target[7] += hy + m * py
    target[8] += hz + m * pz
    target[9] += m


@njit(cache=True, nogil=True)
def _composite_mass_matrix(tree, inertia, work, mass):
    """Lower triangle of M(q) by composite rigid bodies (Walker and Orin, method 3)."""
    n = inertia.shape[0]
    composite = work.composite
    for i in range(n):
        for k in range(10):
            composite[i, k] = inertia[i, k]
        for k in range(n):
            mass[i, k] = 0.0
    for i in range(n - 1, -1, -1):
        parent = tree.parent[i]
        c = composite[i]
        if tree.prismatic[i]:
            fx, fy, fz, nx, ny, nz = 0.0, 0.0, c[9], c[7], -c[6], 0.0
            mass[i, i] = fz
        else:
            fx, fy, fz, nx, ny, nz = -c[7], c[6], 0.0, c[2], c[4], c[5]
            mass[i, i] = nz
        if parent < 0:
            continue
        _add_composite(work.rotation[i], work.origin[i], c, composite[parent])
        k = i
        j = parent
        while j >= 0:
            r, p = work.rotation[k], work.origin[k]
            gx = r[0] * fx + r[1] * fy + r[2] * fz
            gy = r[3] * fx + r[4] * fy + r[5] * fz
            gz = r[6] * fx + r[7] * fy + r[8] * fz
            mx = r[0] * nx + r[1] * ny + r[2] * nz
            my = r[3] * nx + r[4] * ny + r[5] * nz
            mz = r[6] * nx + r[7] * ny + r[8] * nz
            fx, fy, fz = gx, gy, gz
            nx = mx + p[1] * gz - p[2] * gy
            ny = my + p[2] * gx - p[0] * gz
            nz = mz + p[0] * gy - p[1] * gx
            mass[i, j] = fz if tree.prismatic[j] else nz
            k = j
            j = tree.parent[j]


@njit(cache=True, nogil=True)
def mass_matrix_and_bias(tree, inertia, rotor, q, dq, work, mass, bias):
    """M(q), lower triangle, and the torques of gravity and velocities.

    Args:
        tree: the robot's geometry.
        inertia: ten inertial parameters of every link, shape (joints, 10); masses may be zero.
        rotor: symmetric matrix of rotor inertias on the joint side (couplings off its
            diagonal), shape (joints, joints).
        q: joint positions [rad or m], shape (joints,); ``dq`` likewise.
        dq: joint speeds.
        work: scratch from ``rigid_body_work``.
        mass: receives the lower triangle of M(q), shape (joints, joints).
        bias: receives h(q, dq), shape (joints,).
    """
    _link_poses(tree, q, work)
    _bias_torque(tree, inertia, dq, work, bias)
    _composite_mass_matrix(tree, inertia, work, mass)
    for i in range(q.size):
        for j in range(i + 1):
            mass[i, j] += rotor[i, j]


@njit(cache=True, nogil=True)
def invert_mass_matrix(mass, factor, inverse):
    """Inverse of a symmetric positive definite matrix by Cholesky, from its lower triangle.

    Args:
        mass: M, only its lower triangle is read, shape (n, n).
        factor: receives L⁻¹ (lower triangle), shape (n, n).
        inverse: receives M⁻¹, shape (n, n).

    Returns:
        -1, or the index of the first pivot that is not positive (its value in ``factor``).
    """
    n = mass.shape[0]
    for i in range(n):
        for j in range(i + 1):
            total = mass[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if i == j:
                if not total > 0.0:
                    factor[i, i] = total
                    return i
                factor[i, i] = 1.0 / np.sqrt(total)
            else:
                factor[i, j] = total * factor[j, j]
    # L⁻¹ in place, column by column (the diagonal already holds 1/L_jj)
    for j in range(n):
        for i in range(j + 1, n):
            total = 0.0
            for k in range(j, i):
                total -= factor[i, k] * factor[k, j]
            factor[i, j] = total * factor[i, i]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for k in range(i, n):
                total += factor[k, i] * factor[k, j]
            inverse[i, j] = total
            inverse[j, i] = total
    return -1
