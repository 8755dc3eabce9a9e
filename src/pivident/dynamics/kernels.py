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


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
def _tile_rotate(tile, r, v):
    """V <- Rᵀ v in place, R at offset r."""
    if r < 0 or v < 0:
        return
    for s in range(TILE):
        x, y, z = tile[v + s], tile[v + TILE + s], tile[v + 2 * TILE + s]
        tile[v + s] = tile[r + s] * x + tile[r + 3 * TILE + s] * y + tile[r + 6 * TILE + s] * z
        tile[v + TILE + s] = (
            tile[r + TILE + s] * x + tile[r + 4 * TILE + s] * y + tile[r + 7 * TILE + s] * z
        )
        tile[v + 2 * TILE + s] = (
            tile[r + 2 * TILE + s] * x + tile[r + 5 * TILE + s] * y + tile[r + 8 * TILE + s] * z
        )


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
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

    pose: np.ndarray  # ^pR_i row by row and ^pp_i, (joints, 12)
    motion: np.ndarray  # ω, dω, a, (joints, 9)
    force: np.ndarray  # f, n, (joints, 6)
    composite: np.ndarray  # ten parameters of the subtree, (joints, 10)


@njit(cache=True, nogil=True, error_model="numpy")
def rigid_body_work(joints):
    """Empty scratch for a robot of so many joints."""
    return RigidBodyWork(
        np.empty((joints, 12)), np.empty((joints, 9)), np.empty((joints, 6)), np.empty((joints, 10))
    )


@njit(cache=True, nogil=True, error_model="numpy")
def link_poses(prismatic, rotation, translation, q, pose):
    """Pose of every link in its parent's frame: nine of ^pR_i row by row, three of ^pp_i.

    Row views would be more readable than [i, k]; each costs an atomic reference count, which
    together would double the time of a simulation.
    """
    for i in range(q.size):
        if prismatic[i]:
            for k in range(3):
                pose[i, 3 * k] = rotation[i, k, 0]
                pose[i, 3 * k + 1] = rotation[i, k, 1]
                pose[i, 3 * k + 2] = rotation[i, k, 2]
                pose[i, 9 + k] = translation[i, k] + rotation[i, k, 2] * q[i]
        else:
            c, s = np.cos(q[i]), np.sin(q[i])
            for k in range(3):
                pose[i, 3 * k] = rotation[i, k, 0] * c + rotation[i, k, 1] * s
                pose[i, 3 * k + 1] = rotation[i, k, 1] * c - rotation[i, k, 0] * s
                pose[i, 3 * k + 2] = rotation[i, k, 2]
                pose[i, 9 + k] = translation[i, k]


@njit(cache=True, nogil=True, error_model="numpy")
def bias_torque(parents, prismatic, gravity, pose, inertia, dq, motion, force, bias):
    """Torques of gravity, centrifugal and Coriolis effects: Newton–Euler with ddq = 0."""
    n = dq.size
    for i in range(n):
        parent = parents[i]
        wx, wy, wz, ex, ey, ez = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        ax, ay, az = -gravity[0], -gravity[1], -gravity[2]
        if parent >= 0:
            wx, wy, wz = motion[parent, 0], motion[parent, 1], motion[parent, 2]
            ex, ey, ez = motion[parent, 3], motion[parent, 4], motion[parent, 5]
            lx, ly, lz = pose[i, 9], pose[i, 10], pose[i, 11]
            cx, cy, cz = wy * lz - wz * ly, wz * lx - wx * lz, wx * ly - wy * lx
            ax = motion[parent, 6] + ey * lz - ez * ly + wy * cz - wz * cy
            ay = motion[parent, 7] + ez * lx - ex * lz + wz * cx - wx * cz
            az = motion[parent, 8] + ex * ly - ey * lx + wx * cy - wy * cx
        r00, r01, r02 = pose[i, 0], pose[i, 1], pose[i, 2]
        r10, r11, r12 = pose[i, 3], pose[i, 4], pose[i, 5]
        r20, r21, r22 = pose[i, 6], pose[i, 7], pose[i, 8]
        ox = r00 * wx + r10 * wy + r20 * wz
        oy = r01 * wx + r11 * wy + r21 * wz
        oz = r02 * wx + r12 * wy + r22 * wz
        fx = r00 * ex + r10 * ey + r20 * ez
        fy = r01 * ex + r11 * ey + r21 * ez
        fz = r02 * ex + r12 * ey + r22 * ez
        bx = r00 * ax + r10 * ay + r20 * az
        by = r01 * ax + r11 * ay + r21 * az
        bz = r02 * ax + r12 * ay + r22 * az
        d = dq[i]
        if prismatic[i]:
            bx += 2.0 * oy * d
            by -= 2.0 * ox * d
        else:
            fx += oy * d
            fy -= ox * d
            oz += d
        motion[i, 0], motion[i, 1], motion[i, 2] = ox, oy, oz
        motion[i, 3], motion[i, 4], motion[i, 5] = fx, fy, fz
        motion[i, 6], motion[i, 7], motion[i, 8] = bx, by, bz
        xx, xy, xz = inertia[i, 0], inertia[i, 1], inertia[i, 2]
        yy, yz, zz = inertia[i, 3], inertia[i, 4], inertia[i, 5]
        hx, hy, hz, m = inertia[i, 6], inertia[i, 7], inertia[i, 8], inertia[i, 9]
        cx, cy, cz = oy * hz - oz * hy, oz * hx - ox * hz, ox * hy - oy * hx
        gx = xx * ox + xy * oy + xz * oz
        gy = xy * ox + yy * oy + yz * oz
        gz = xz * ox + yz * oy + zz * oz
        force[i, 0] = m * bx + fy * hz - fz * hy + oy * cz - oz * cy
        force[i, 1] = m * by + fz * hx - fx * hz + oz * cx - ox * cz
        force[i, 2] = m * bz + fx * hy - fy * hx + ox * cy - oy * cx
        force[i, 3] = xx * fx + xy * fy + xz * fz + oy * gz - oz * gy + hy * bz - hz * by
        force[i, 4] = xy * fx + yy * fy + yz * fz + oz * gx - ox * gz + hz * bx - hx * bz
        force[i, 5] = xz * fx + yz * fy + zz * fz + ox * gy - oy * gx + hx * by - hy * bx
    for i in range(n - 1, -1, -1):
        bias[i] = force[i, 2] if prismatic[i] else force[i, 5]
        parent = parents[i]
        if parent >= 0:
            fx, fy, fz, nx, ny, nz = _carried(
                pose,
                i,
                force[i, 0],
                force[i, 1],
                force[i, 2],
                force[i, 3],
                force[i, 4],
                force[i, 5],
            )
            force[parent, 0] += fx
            force[parent, 1] += fy
            force[parent, 2] += fz
            force[parent, 3] += nx
            force[parent, 4] += ny
            force[parent, 5] += nz


@njit(cache=True, nogil=True, error_model="numpy")
def _carried(pose, i, fx, fy, fz, nx, ny, nz):
    """A force and moment (f, n) at link i, in the parent's frame and at its origin."""
    gx = pose[i, 0] * fx + pose[i, 1] * fy + pose[i, 2] * fz
    gy = pose[i, 3] * fx + pose[i, 4] * fy + pose[i, 5] * fz
    gz = pose[i, 6] * fx + pose[i, 7] * fy + pose[i, 8] * fz
    mx = pose[i, 0] * nx + pose[i, 1] * ny + pose[i, 2] * nz
    my = pose[i, 3] * nx + pose[i, 4] * ny + pose[i, 5] * nz
    mz = pose[i, 6] * nx + pose[i, 7] * ny + pose[i, 8] * nz
    px, py, pz = pose[i, 9], pose[i, 10], pose[i, 11]
    return gx, gy, gz, mx + py * gz - pz * gy, my + pz * gx - px * gz, mz + px * gy - py * gx


@njit(cache=True, nogil=True, error_model="numpy")
def _add_composite(pose, composite, i, parent):
    """Add the ten parameters of link i's subtree to its parent's, at the parent's origin.

    With h' = R h:  I += R I Rᵀ - (p h'ᵀ + h' pᵀ) + 2 (p·h') 1 + m (p·p 1 - p pᵀ),  h += h' + m p.
    """
    r00, r01, r02 = pose[i, 0], pose[i, 1], pose[i, 2]
    r10, r11, r12 = pose[i, 3], pose[i, 4], pose[i, 5]
    r20, r21, r22 = pose[i, 6], pose[i, 7], pose[i, 8]
    px, py, pz = pose[i, 9], pose[i, 10], pose[i, 11]
    xx, xy, xz = composite[i, 0], composite[i, 1], composite[i, 2]
    yy, yz, zz = composite[i, 3], composite[i, 4], composite[i, 5]
    ix, iy, iz, m = composite[i, 6], composite[i, 7], composite[i, 8], composite[i, 9]
    a00 = r00 * xx + r01 * xy + r02 * xz
    a01 = r00 * xy + r01 * yy + r02 * yz
    a02 = r00 * xz + r01 * yz + r02 * zz
    a10 = r10 * xx + r11 * xy + r12 * xz
    a11 = r10 * xy + r11 * yy + r12 * yz
    a12 = r10 * xz + r11 * yz + r12 * zz
    a20 = r20 * xx + r21 * xy + r22 * xz
    a21 = r20 * xy + r21 * yy + r22 * yz
    a22 = r20 * xz + r21 * yz + r22 * zz
    hx = r00 * ix + r01 * iy + r02 * iz
    hy = r10 * ix + r11 * iy + r12 * iz
    hz = r20 * ix + r21 * iy + r22 * iz
    # the lever arm acts twice: on the first moments, and on the mass
    sx, sy, sz = px * (2.0 * hx + m * px), py * (2.0 * hy + m * py), pz * (2.0 * hz + m * pz)
    composite[parent, 0] += a00 * r00 + a01 * r01 + a02 * r02 + sy + sz
    composite[parent, 1] += a00 * r10 + a01 * r11 + a02 * r12 - px * hy - py * (hx + m * px)
    composite[parent, 2] += a00 * r20 + a01 * r21 + a02 * r22 - px * hz - pz * (hx + m * px)
    composite[parent, 3] += a10 * r10 + a11 * r11 + a12 * r12 + sx + sz
    composite[parent, 4] += a10 * r20 + a11 * r21 + a12 * r22 - py * hz - pz * (hy + m * py)
    composite[parent, 5] += a20 * r20 + a21 * r21 + a22 * r22 + sx + sy
    composite[parent, 6] += hx + m * px
    composite[parent, 7] += hy + m * py
    composite[parent, 8] += hz + m * pz
    composite[parent, 9] += m


@njit(cache=True, nogil=True, error_model="numpy")
def composite_mass_matrix(parents, prismatic, pose, inertia, rotor, composite, mass):
    """Lower triangle of M(q) by composite rigid bodies (Walker and Orin, method 3)."""
    n = inertia.shape[0]
    for i in range(n):
        for k in range(10):
            composite[i, k] = inertia[i, k]
        for k in range(n):
            mass[i, k] = rotor[i, k]
    for i in range(n - 1, -1, -1):
        fx, fy, fz = -composite[i, 7], composite[i, 6], 0.0
        nx, ny, nz = composite[i, 2], composite[i, 4], composite[i, 5]
        if prismatic[i]:
            fx, fy, fz, nx, ny, nz = 0.0, 0.0, composite[i, 9], -fx, -fy, 0.0
        mass[i, i] += fz if prismatic[i] else nz
        if parents[i] >= 0:
            _add_composite(pose, composite, i, parents[i])
        k, j = i, parents[i]
        while j >= 0:
            fx, fy, fz, nx, ny, nz = _carried(pose, k, fx, fy, fz, nx, ny, nz)
            mass[i, j] += fz if prismatic[j] else nz
            k, j = j, parents[j]


@njit(cache=True, nogil=True, error_model="numpy")
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
    link_poses(tree.prismatic, tree.rotation, tree.translation, q, work.pose)
    bias_torque(
        tree.parent, tree.prismatic, tree.gravity, work.pose, inertia, dq, work.motion,
        work.force, bias,
    )  # fmt: skip
    composite_mass_matrix(
        tree.parent, tree.prismatic, work.pose, inertia, rotor, work.composite, mass
    )


@njit(cache=True, nogil=True, error_model="numpy")
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
