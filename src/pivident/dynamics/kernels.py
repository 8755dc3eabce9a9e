"""Compiled rigid-body recursions for one sample at a time, for any robot; M and N of (P-1).

The simulation computes one sample after the other; loops over many samples at once are in
``regressor_kernels``.

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

from pivident.dynamics.elementary import sine_and_cosine
from pivident.foundation.compiled import allocating, inlined, inner, kernel
from pivident.robot.description import Robot


class Tree(NamedTuple):
    """The robot's geometry as arrays for the kernels."""

    parent: np.ndarray  # index of the parent link or -1, (joints,)
    prismatic: np.ndarray  # 1 for prismatic, 0 for revolute joints, (joints,)
    rotation: np.ndarray  # in the parent at q = 0, (joints, 3, 3)
    translation: np.ndarray  # in the parent at q = 0 [m], (joints, 3)
    gravity: np.ndarray  # in the base frame [m/s²], (3,)


def tree_of(robot: Robot) -> Tree:
    """Geometry of a robot for the kernels."""
    return Tree(
        np.array([j.parent for j in robot.joints], dtype=np.int64),
        np.array([j.kind == "prismatic" for j in robot.joints], dtype=np.int64),
        np.array([j.rotation for j in robot.joints], dtype=float),
        np.array([j.translation for j in robot.joints], dtype=float),
        np.asarray(robot.gravity, dtype=float),
    )


class RigidBodyWork(NamedTuple):
    """Scratch of ``mass_matrix_and_bias``; made once per simulation by ``rigid_body_work``."""

    pose: np.ndarray  # ^pR_i row by row and ^pp_i, (joints, 12)
    motion: np.ndarray  # ω, dω, a, (joints, 9)
    force: np.ndarray  # f, n, (joints, 6)
    composite: np.ndarray  # ten parameters of the subtree, (joints, 10)


@allocating
def rigid_body_work(joints):
    """Empty scratch for a robot of so many joints."""
    return RigidBodyWork(
        np.empty((joints, 12)), np.empty((joints, 9)), np.empty((joints, 6)), np.empty((joints, 10))
    )


@inner
def link_poses(prismatic, rotation, translation, q, pose):
    """Pose of every link in its parent's frame: nine of ^pR_i row by row, three of ^pp_i."""
    for i in range(q.size):
        if prismatic[i]:
            for k in range(3):
                pose[i, 3 * k] = rotation[i, k, 0]
                pose[i, 3 * k + 1] = rotation[i, k, 1]
                pose[i, 3 * k + 2] = rotation[i, k, 2]
                pose[i, 9 + k] = translation[i, k] + rotation[i, k, 2] * q[i]
        else:
            s, c = sine_and_cosine(q[i])
            for k in range(3):
                pose[i, 3 * k] = rotation[i, k, 0] * c + rotation[i, k, 1] * s
                pose[i, 3 * k + 1] = rotation[i, k, 1] * c - rotation[i, k, 0] * s
                pose[i, 3 * k + 2] = rotation[i, k, 2]
                pose[i, 9 + k] = translation[i, k]


@inner
def bias_torque(parents, prismatic, gravity, pose, inertia, dq, ddq, motion, force, bias):
    """Torques of gravity, centrifugal and Coriolis effects: Newton–Euler with ddq = 0.

    ``ddq``: None, or accelerations whose torques are added, shape (joints,); decided by its type.
    """
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
        if ddq is not None:
            if prismatic[i]:
                bz += ddq[i]
            else:
                fz += ddq[i]
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


@inner
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


@inlined
def place_link(parent, pose, i, place):
    """Place of link i in the base, ⁰T_i = ⁰T_p ^pT_i, from its pose in its parent.

    ``place``: receives ⁰R_i row by row and ⁰p_i in columns 0 to 11 of row i; those of the parent
    are there already.
    """
    for a in range(3):
        if parent < 0:
            for b in range(3):
                place[i, 3 * a + b] = pose[i, 3 * a + b]
            place[i, 9 + a] = pose[i, 9 + a]
            continue
        x, y, z = place[parent, 3 * a], place[parent, 3 * a + 1], place[parent, 3 * a + 2]
        for b in range(3):
            place[i, 3 * a + b] = x * pose[i, b] + y * pose[i, 3 + b] + z * pose[i, 6 + b]
        place[i, 9 + a] = place[parent, 9 + a] + x * pose[i, 9] + y * pose[i, 10] + z * pose[i, 11]


@inner
def add_composite(pose, composite, i, parent):
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


@inner
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
            add_composite(pose, composite, i, parents[i])
        k, j = i, parents[i]
        while j >= 0:
            fx, fy, fz, nx, ny, nz = _carried(pose, k, fx, fy, fz, nx, ny, nz)
            mass[i, j] += fz if prismatic[j] else nz
            k, j = j, parents[j]


@inner
def mass_matrix_and_bias(tree, inertia, rotor, q, dq, work, mass, bias):
    """M(q), lower triangle, and the torques h(q, dq) of gravity and velocities, shape (joints,).

    Masses may be zero; ``rotor`` is symmetric, couplings off its diagonal.
    """
    link_poses(tree.prismatic, tree.rotation, tree.translation, q, work.pose)
    bias_torque(
        tree.parent, tree.prismatic, tree.gravity, work.pose, inertia, dq, None,
        work.motion, work.force, bias,
    )  # fmt: skip
    composite_mass_matrix(
        tree.parent, tree.prismatic, work.pose, inertia, rotor, work.composite, mass
    )


@kernel
def invert_mass_matrix(mass, factor, inverse):
    """M⁻¹ by Cholesky from the lower triangle of M; ``factor`` receives L⁻¹.

    Returns -1, or the index of the first pivot that is not positive (its value in ``factor``).
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
