"""Signed distances between a capsule and a solid, and where they are taken.

The axis of the capsule is p(t) = a + t (b - a), 0 ≤ t ≤ 1, and s the signed distance from the
surface of the solid, negative inside. s is convex for a convex solid, so its slope along the axis
rises, and bisection finds its zero: the point of the axis nearest to the solid, or deepest in it,

    d = min_t s(p(t)) - radius

This is the distance where the axis is outside. Where it is inside, d is how far its deepest point
is from the surface, less the radius; that leads out as well as the depth of the whole capsule does,
and is continuous. Solids are a segment (of another capsule; the radius is taken off by the
caller), and a box or a cylinder along z around the origin of its own frame.
"""

from __future__ import annotations

import numpy as np

from pivident.foundation.compiled import inner, kernel

#: Kinds of solids.
SEGMENT, BOX, CYLINDER = 0, 1, 2

#: Halvings of the axis; 2⁻⁴⁰ of a metre is 10⁻¹² m.
HALVINGS = 40

#: Gradient of s by the place of the axis below which a direction is chosen instead.
LEAST_GRADIENT = 0.1


@inner
def signed_distance(kind, solid, x, y, z):
    """The signed distance s and its gradient at a point.

    ``solid`` holds six numbers: both ends of a segment, or the half edges of a box, or radius and
    half length of a cylinder.
    """
    if kind == SEGMENT:
        ux, uy, uz = solid[3] - solid[0], solid[4] - solid[1], solid[5] - solid[2]
        rx, ry, rz = x - solid[0], y - solid[1], z - solid[2]
        squared = ux * ux + uy * uy + uz * uz
        along = 0.0
        if squared > 0.0:
            along = min(1.0, max(0.0, (rx * ux + ry * uy + rz * uz) / squared))
        rx, ry, rz = rx - along * ux, ry - along * uy, rz - along * uz
        distance = np.sqrt(rx * rx + ry * ry + rz * rz)
        if distance > 0.0:
            return distance, rx / distance, ry / distance, rz / distance
        return 0.0, 0.0, 0.0, 0.0
    if kind == BOX:
        ex, ey, ez = abs(x) - solid[0], abs(y) - solid[1], abs(z) - solid[2]
        sx, sy, sz = np.copysign(1.0, x), np.copysign(1.0, y), np.copysign(1.0, z)
        if ex <= 0.0 and ey <= 0.0 and ez <= 0.0:
            if ex >= ey and ex >= ez:
                return ex, sx, 0.0, 0.0
            if ey >= ez:
                return ey, 0.0, sy, 0.0
            return ez, 0.0, 0.0, sz
        ex, ey, ez = max(ex, 0.0), max(ey, 0.0), max(ez, 0.0)
        distance = np.sqrt(ex * ex + ey * ey + ez * ez)
        return distance, sx * ex / distance, sy * ey / distance, sz * ez / distance
    around = np.sqrt(x * x + y * y)
    cx, cy = (x / around, y / around) if around > 0.0 else (1.0, 0.0)
    er, ez = around - solid[0], abs(z) - solid[1]
    sz = np.copysign(1.0, z)
    if er <= 0.0 and ez <= 0.0:
        if er >= ez:
            return er, cx, cy, 0.0
        return ez, 0.0, 0.0, sz
    er, ez = max(er, 0.0), max(ez, 0.0)
    distance = np.sqrt(er * er + ez * ez)
    return distance, cx * er / distance, cy * er / distance, sz * ez / distance


@kernel
def axis_distances(kind, start, end, solid, distance, normal, point):
    """min_t s(p(t)) for each sample, with its normal and point.

    Args:
        kind: of the solid.
        start: one end of the capsule's axis, in the solid's frame [m], shape (samples, 3).
        end: its other end, likewise.
        solid: numbers of the solid, shape (samples, 6), or (1, 6) where it does not move.
        distance: receives the distance [m], shape (samples,).
        normal: receives its gradient by the point of the axis, shape (samples, 3).
        point: receives the point of the axis [m], shape (samples, 3).
    """
    for k in range(start.shape[0]):
        own = solid[k if solid.shape[0] > 1 else 0]
        ax, ay, az = start[k, 0], start[k, 1], start[k, 2]
        ux, uy, uz = end[k, 0] - ax, end[k, 1] - ay, end[k, 2] - az
        length = np.sqrt(ux * ux + uy * uy + uz * uz)
        t = 0.5
        s, nx, ny, nz = signed_distance(kind, own, ax + t * ux, ay + t * uy, az + t * uz)
        if length > 0.0:
            t, s, nx, ny, nz = _lowest(kind, own, ax, ay, az, ux, uy, uz)
        if kind == SEGMENT and nx * nx + ny * ny + nz * nz < LEAST_GRADIENT**2:
            nx, ny, nz = _across(ux, uy, uz, own)
        distance[k] = s
        normal[k, 0], normal[k, 1], normal[k, 2] = nx, ny, nz
        point[k, 0], point[k, 1], point[k, 2] = ax + t * ux, ay + t * uy, az + t * uz


@inner
def _lowest(kind, solid, ax, ay, az, ux, uy, uz):
    """Where s is least along an axis: t, s, and the gradient of that least s by the axis' place.

    Inside a box or cylinder s has edges, where the gradient jumps and the slope changes its sign.
    There the gradient of the least s is the mean of both sides whose slope is zero. It vanishes
    where the axis runs through the middle of the solid, from which no small step leads out; the
    normal at the end nearer to the surface then says which way is the shorter. Where the axis lies
    level, all of it is nearest; its middle stands for it.
    """
    s, lx, ly, lz = signed_distance(kind, solid, ax, ay, az)
    left = lx * ux + ly * uy + lz * uz
    e, hx, hy, hz = signed_distance(kind, solid, ax + ux, ay + uy, az + uz)
    right = hx * ux + hy * uy + hz * uz
    if left >= 0.0 and right > 0.0:
        return 0.0, s, lx, ly, lz
    if right <= 0.0 and left < 0.0:
        return 1.0, e, hx, hy, hz
    wx, wy, wz = (lx, ly, lz) if s > e else (hx, hy, hz)
    low, high, t = 0.0, 1.0, 0.5
    for _ in range(HALVINGS):
        t = 0.5 * (low + high)
        s, nx, ny, nz = signed_distance(kind, solid, ax + t * ux, ay + t * uy, az + t * uz)
        slope = nx * ux + ny * uy + nz * uz
        if slope == 0.0:
            return t, s, nx, ny, nz
        if slope > 0.0:
            high, right, hx, hy, hz = t, slope, nx, ny, nz
        else:
            low, left, lx, ly, lz = t, slope, nx, ny, nz
    share = right / (right - left)
    nx, ny, nz = (
        share * lx + (1.0 - share) * hx,
        share * ly + (1.0 - share) * hy,
        share * lz + (1.0 - share) * hz,
    )
    if kind != SEGMENT and nx * nx + ny * ny + nz * nz < LEAST_GRADIENT**2:
        return t, s, wx, wy, wz
    return t, s, nx, ny, nz


@inner
def _across(ux, uy, uz, solid):
    """A unit vector across both axes where they meet: any way out is as good as its opposite."""
    vx, vy, vz = solid[3] - solid[0], solid[4] - solid[1], solid[5] - solid[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    size = np.sqrt(nx * nx + ny * ny + nz * nz)
    if size > 1e-12:
        return nx / size, ny / size, nz / size
    if vx * vx + vy * vy + vz * vz > ux * ux + uy * uy + uz * uz:
        ux, uy, uz = vx, vy, vz
    size = np.sqrt(ux * ux + uy * uy)
    if size > 1e-12:
        return -uy / size, ux / size, 0.0
    return 1.0, 0.0, 0.0


@kernel
def gradient_by_joints(weights, prismatic, axes, origins, normal, point, gradient):
    """∂d/∂q_j = ± nᵀ ∂p/∂q_j, with ∂p/∂q = z × (p - o) of a revolute and z of a prismatic joint.

    Args:
        weights: +1 for a joint that moves the first body alone, -1 for one that moves the second
            alone, 0 for all others; shape (joints,).
        prismatic: whether a joint slides, shape (joints,).
        axes: unit vectors z of the joints, shape (joints, samples, 3).
        origins: origins o of the joints [m], shape (joints, samples, 3).
        normal: n, shape (samples, 3).
        point: p [m], shape (samples, 3). The nearest points of both bodies lie along n from each
            other, so one of them serves for both.
        gradient: receives ∂d/∂q [m/rad or 1], shape (samples, joints).
    """
    for k in range(normal.shape[0]):
        nx, ny, nz = normal[k, 0], normal[k, 1], normal[k, 2]
        for j in range(weights.size):
            if weights[j] == 0.0:
                gradient[k, j] = 0.0
                continue
            zx, zy, zz = axes[j, k, 0], axes[j, k, 1], axes[j, k, 2]
            if not prismatic[j]:
                rx = point[k, 0] - origins[j, k, 0]
                ry = point[k, 1] - origins[j, k, 1]
                rz = point[k, 2] - origins[j, k, 2]
                zx, zy, zz = zy * rz - zz * ry, zz * rx - zx * rz, zx * ry - zy * rx
            gradient[k, j] = weights[j] * (nx * zx + ny * zy + nz * zz)
