"""Compiled loops of the observation matrix, generic over the robot, many samples at once.

Quantities are stored with time last, in rows of ``TILE`` samples, so that the innermost loops run
over samples and the compiler vectorises them. All rows lie in one array, the *tile*. The compiler
checks at run time that the rows of a loop do not overlap, but not for loops with many rows; such
loops are split.

The ten inertial parameters enter linearly. With ω, dω, a of the frame's origin (gravity is an
upward acceleration of the base), I the inertia about that origin and h the first moments,

    f = m a + G h,    n = I dω + ω × (I ω) + h × a,      G = [dω]× + [ω]×[ω]×

and the torque of a joint with the screw (v, w), seen from the link's frame, is v·f + w·n. With
u = w × ω its inertia part is w·(I dω) + u·(I ω), its first-moment part h·(Gᵀv + a × w).

Columns without inertial parameter in a tile: rotor, friction, spring and coupling of joints.

They are functions of the motion of one joint or two at one instant; see ``regressor_kernels`` for
the tile, and ``friction`` for friction that needs the path so far.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pivident.dynamics.elementary import TILE, arctangent, sine_and_cosine
from pivident.dynamics.entry_plan import ACCELERATION, INERTIAS, INNER, MOMENTS, EntryPlan
from pivident.dynamics.friction_generated import position_row, speed_row
from pivident.dynamics.friction_kernels import FIRST_ADDRESS, VALUE, call_column
from pivident.foundation.compiled import inlined as _inline, kernel, section
from pivident.robot.friction_column import SignFunction
from pivident.robot.friction_terms.offset import OFFSET
from pivident.robot.friction_terms.viscous import VISCOUS

# Rows of the tile. The joint at work: cosine and sine of its turn, its slide, and their rates.
_COS, _SIN, _SLIDE, _DTURN, _DDTURN, _DSLIDE, _DDSLIDE = 0, 1, 2, 3, 4, 5, 6
# The link at work: ^pR_i row by row, ^pp_i.
_ROTATION, _ORIGIN, _FIXED = 7, 16, 19
# Then 18 rows for the base and for each link: ω, dω, a, and G row by row.
_A, _G, _LINK = 6, 9, 18


@section
def _load_joint(tile, signals, joints, i, prismatic):
    """Turn, slide and their rates of joint i into the rows of the joint at work."""
    if prismatic:
        for s in range(TILE):
            tile[_COS, s] = 1.0
            tile[_SIN, s] = 0.0
            tile[_SLIDE, s] = tile[signals + i, s]
            tile[_DTURN, s] = 0.0
            tile[_DDTURN, s] = 0.0
            tile[_DSLIDE, s] = tile[signals + joints + i, s]
            tile[_DDSLIDE, s] = tile[signals + 2 * joints + i, s]
    else:
        for s in range(TILE):
            sine, cosine = sine_and_cosine(tile[signals + i, s])
            tile[_COS, s] = cosine
            tile[_SIN, s] = sine
            tile[_SLIDE, s] = 0.0
            tile[_DTURN, s] = tile[signals + joints + i, s]
            tile[_DDTURN, s] = tile[signals + 2 * joints + i, s]
            tile[_DSLIDE, s] = 0.0
            tile[_DDSLIDE, s] = 0.0


@section
def _pose(tile, rotation, translation, i):
    """Orientation and origin of link i in its parent."""
    for k in range(3):
        r0, r1, r2, p = rotation[i, k, 0], rotation[i, k, 1], rotation[i, k, 2], translation[i, k]
        for s in range(TILE):
            cosine, sine = tile[_COS, s], tile[_SIN, s]
            tile[_ROTATION + 3 * k, s] = r0 * cosine + r1 * sine
            tile[_ROTATION + 3 * k + 1, s] = r1 * cosine - r0 * sine
            tile[_ROTATION + 3 * k + 2, s] = r2
            tile[_ORIGIN + k, s] = p + r2 * tile[_SLIDE, s]


@_inline
def _rotated(tile, s, x, y, z):
    """Rᵀ (x, y, z) at sample s."""
    return (
        tile[_ROTATION, s] * x + tile[_ROTATION + 3, s] * y + tile[_ROTATION + 6, s] * z,
        tile[_ROTATION + 1, s] * x + tile[_ROTATION + 4, s] * y + tile[_ROTATION + 7, s] * z,
        tile[_ROTATION + 2, s] * x + tile[_ROTATION + 5, s] * y + tile[_ROTATION + 8, s] * z,
    )


@section
def _move(tile, parent, link):
    """ω, dω, a and G of the link at row ``link`` from those of its parent."""
    up, own = parent + _G, link + _G
    for s in range(TILE):
        wx, wy, wz = _rotated(tile, s, tile[parent, s], tile[parent + 1, s], tile[parent + 2, s])
        tile[link, s], tile[link + 1, s], tile[link + 2, s] = wx, wy, wz + tile[_DTURN, s]
    for s in range(TILE):
        ex, ey, ez = _rotated(
            tile, s, tile[parent + 3, s], tile[parent + 4, s], tile[parent + 5, s]
        )
        tile[link + 3, s] = ex + tile[link + 1, s] * tile[_DTURN, s]
        tile[link + 4, s] = ey - tile[link, s] * tile[_DTURN, s]
        tile[link + 5, s] = ez + tile[_DDTURN, s]
    for s in range(TILE):
        px, py, pz = tile[_ORIGIN, s], tile[_ORIGIN + 1, s], tile[_ORIGIN + 2, s]
        # G of the parent turns the lever arm into its tangential and centripetal acceleration
        ax = tile[up, s] * px + tile[up + 1, s] * py + tile[up + 2, s] * pz
        ay = tile[up + 3, s] * px + tile[up + 4, s] * py + tile[up + 5, s] * pz
        az = tile[up + 6, s] * px + tile[up + 7, s] * py + tile[up + 8, s] * pz
        ax, ay, az = _rotated(
            tile, s, tile[parent + 6, s] + ax, tile[parent + 7, s] + ay, tile[parent + 8, s] + az
        )
        tile[link + 6, s] = ax + 2.0 * tile[link + 1, s] * tile[_DSLIDE, s]
        tile[link + 7, s] = ay - 2.0 * tile[link, s] * tile[_DSLIDE, s]
        tile[link + 8, s] = az + tile[_DDSLIDE, s]
    for s in range(TILE):
        wx, wy, wz = tile[link, s], tile[link + 1, s], tile[link + 2, s]
        ex, ey, ez = tile[link + 3, s], tile[link + 4, s], tile[link + 5, s]
        xx, yy, zz, xy, xz, yz = wx * wx, wy * wy, wz * wz, wx * wy, wx * wz, wy * wz
        tile[own, s], tile[own + 1, s], tile[own + 2, s] = -yy - zz, xy - ez, xz + ey
        tile[own + 3, s], tile[own + 4, s], tile[own + 5, s] = xy + ez, -xx - zz, yz - ex
        tile[own + 6, s], tile[own + 7, s], tile[own + 8, s] = xz - ey, yz + ex, -xx - yy


@section
def _carry(tile, source, target):
    """Carry a screw (v, w) from the parent's frame into the link's: Rᵀ(v + w × p), Rᵀw."""
    for s in range(TILE):
        px, py, pz = tile[_ORIGIN, s], tile[_ORIGIN + 1, s], tile[_ORIGIN + 2, s]
        wx, wy, wz = tile[source + 3, s], tile[source + 4, s], tile[source + 5, s]
        vx, vy, vz = _rotated(
            tile,
            s,
            tile[source, s] + wy * pz - wz * py,
            tile[source + 1, s] + wz * px - wx * pz,
            tile[source + 2, s] + wx * py - wy * px,
        )
        wx, wy, wz = _rotated(tile, s, wx, wy, wz)
        tile[target, s], tile[target + 1, s], tile[target + 2, s] = vx, vy, vz
        tile[target + 3, s], tile[target + 4, s], tile[target + 5, s] = wx, wy, wz


@section
def _inertia_columns(tile, link, screw, out):
    """Columns of ``xx xy xz yy yz zz``: w·(I dω) + u·(I ω) with u = w × ω."""
    for s in range(TILE):
        ox, oy, oz = tile[link, s], tile[link + 1, s], tile[link + 2, s]
        ex, ey, ez = tile[link + 3, s], tile[link + 4, s], tile[link + 5, s]
        wx, wy, wz = tile[screw + 3, s], tile[screw + 4, s], tile[screw + 5, s]
        ux, uy, uz = wy * oz - wz * oy, wz * ox - wx * oz, wx * oy - wy * ox
        tile[out, s] = wx * ex + ux * ox
        tile[out + 1, s] = wx * ey + wy * ex + ux * oy + uy * ox
        tile[out + 2, s] = wx * ez + wz * ex + ux * oz + uz * ox
        tile[out + 3, s] = wy * ey + uy * oy
        tile[out + 4, s] = wy * ez + wz * ey + uy * oz + uz * oy
        tile[out + 5, s] = wz * ez + uz * oz


@section
def _moment_columns(tile, link, screw, out):
    """Columns of ``mx my mz m``: Gᵀv + a × w and v·a."""
    g = link + _G
    for s in range(TILE):
        ax, ay, az = tile[link + 6, s], tile[link + 7, s], tile[link + 8, s]
        vx, vy, vz = tile[screw, s], tile[screw + 1, s], tile[screw + 2, s]
        wx, wy, wz = tile[screw + 3, s], tile[screw + 4, s], tile[screw + 5, s]
        gx = tile[g, s] * vx + tile[g + 3, s] * vy + tile[g + 6, s] * vz
        gy = tile[g + 1, s] * vx + tile[g + 4, s] * vy + tile[g + 7, s] * vz
        gz = tile[g + 2, s] * vx + tile[g + 5, s] * vy + tile[g + 8, s] * vz
        tile[out + 6, s] = gx + ay * wz - az * wy
        tile[out + 7, s] = gy + az * wx - ax * wz
        tile[out + 8, s] = gz + ax * wy - ay * wx
        tile[out + 9, s] = vx * ax + vy * ay + vz * az


class _Rows(NamedTuple):
    """First row of each part of a tile, after the fixed rows."""

    links: int
    screws: int
    signals: int
    columns: int


@section
def _layout(plan):
    """Where the links, screws, signals and columns are in the tile."""
    joints, depth = plan.work.shape
    links = _FIXED
    screws = links + (joints + 1) * _LINK
    signals = screws + joints * depth * 6
    return _Rows(links, screws, signals, signals + 3 * joints)


def tile_rows(plan: EntryPlan) -> int:
    """Rows of the tile that the loops of a plan need."""
    joints, depth = plan.work.shape
    return _FIXED + (joints + 1) * _LINK + joints * depth * 6 + 3 * joints + plan.columns


@section
def _prepare(plan, tile):
    """Write the rows of the tile that do not depend on the sample."""
    joints, depth = plan.work.shape
    rows = _layout(plan)
    tile[rows.links : rows.links + _LINK] = 0.0
    for k in range(3):  # the base does not move, but gravity accelerates it upwards
        tile[rows.links + _A + k] = -plan.tree.gravity[k]
    for i in range(joints):  # a joint's own screw is its z axis
        own = rows.screws + i * depth * 6
        tile[own : own + 6] = 0.0
        tile[own + (2 if plan.tree.prismatic[i] else 5)] = 1.0
    return rows


@section
def _fill(plan, tile, rows, q, dq, ddq, inner, start, count):
    """Compute all columns of the ``count`` samples from ``start`` on."""
    joints, depth = plan.work.shape
    parents, prismatic = plan.tree.parent, plan.tree.prismatic
    rotation, translation = plan.tree.rotation, plan.tree.translation
    moved, work, index, value = plan.moved, plan.work, plan.joint_index, plan.joint_value
    links, screws, signals, out = rows.links, rows.screws, rows.signals, rows.columns
    for i in range(joints):
        for s in range(count):
            tile[signals + i, s] = q[i, start + s]
            tile[signals + joints + i, s] = dq[i, start + s]
            tile[signals + 2 * joints + i, s] = ddq[i, start + s]
    for i in range(joints):
        if not moved[i]:
            continue
        parent, link = parents[i], links + (i + 1) * _LINK
        _load_joint(tile, signals, joints, i, prismatic[i])
        _pose(tile, rotation, translation, i)
        _move(tile, links + (parent + 1) * _LINK, link)
        for k in range(depth):
            wanted = work[i, k]
            screw = screws + (i * depth + k) * 6
            if wanted and k > 0:
                _carry(tile, screws + (parent * depth + k - 1) * 6, screw)
            if wanted & INERTIAS:
                _inertia_columns(tile, link, screw, out)
            if wanted & MOMENTS:
                _moment_columns(tile, link, screw, out)
            if wanted & (INERTIAS | MOMENTS):
                out += 10
    dq_rows, ddq_rows = signals + joints, signals + 2 * joints
    for e in range(index.shape[0]):
        if index[e, 0] == INNER:
            for s in range(count):
                tile[out + e, s] = inner[index[e, 2], start + s]
        else:
            joint_row(tile, signals, dq_rows, ddq_rows, index, value, e, out + e)


#: Results of ``observe``: packed rows, the dense matrix, or joint torques.
PACKED, DENSE, TORQUES = 0, 1, 2


# One kernel for all three: most of its code is that of ``_fill``, and would be compiled with each.
@kernel
def observe(plan, tile, kind, place, weight, q, dq, ddq, inner, out):
    """Entries of Φ, packed or at their places, or weighted sums of them; signals time last.

    ``place`` of each entry is its row of ``out`` (PACKED: rows, samples) or its place in a
    sample's row-major matrix (DENSE: samples, joints · parameters); for TORQUES (joints, samples)
    the entries of joint j are ``place[j]:place[j+1]``, with parameter values ``weight``. ``tile``
    has ``tile_rows`` or more rows.
    """
    samples, source = q.shape[1], plan.source
    rows = _prepare(plan, tile)
    for start in range(0, samples, TILE):
        count = min(TILE, samples - start)
        _fill(plan, tile, rows, q, dq, ddq, inner, start, count)
        if kind == PACKED:
            for e in range(source.size):
                target = place[e]
                for s in range(count):
                    out[target, start + s] = tile[rows.columns + source[e], s]
        elif kind == DENSE:
            # eight samples at a time: one cache line of each column, eight lines written in order
            for first in range(0, count, 8):
                last = min(first + 8, count)
                for e in range(source.size):
                    column, target = rows.columns + source[e], place[e]
                    for s in range(first, last):
                        out[start + s, target] = tile[column, s]
        else:
            for j in range(q.shape[0]):
                for s in range(count):
                    out[j, start + s] = 0.0
                for e in range(place[j], place[j + 1]):
                    column, factor = rows.columns + source[e], weight[e]
                    for s in range(count):
                        out[j, start + s] += factor * tile[column, s]


_SPEED, _CONSTANT = int(VISCOUS), int(OFFSET)
_OF_POSITION = int(SignFunction.NONE)
_ATAN, _TANH = int(SignFunction.ATAN), int(SignFunction.TANH)


@_inline
def _scaled_row(tile, source, factor, target):
    for s in range(TILE):
        tile[target, s] = factor * tile[source, s]


@_inline
def _sign_row(tile, sign, gamma, row):
    """The (smoothed) sign function of a row, in place."""
    if sign == _ATAN:
        for s in range(TILE):
            tile[row, s] = (2.0 / np.pi) * arctangent(gamma * tile[row, s])
    elif sign == _TANH:
        for s in range(TILE):
            tile[row, s] = np.tanh(gamma * tile[row, s])
    else:
        for s in range(TILE):
            tile[row, s] = np.sign(tile[row, s])


@_inline
def _called_row(tile, function, row, position, value, e, out):
    """A column whose function has an address, of the quantity in a row; or of two quantities."""
    if abs(function) >= FIRST_ADDRESS:
        first, second, last = value[e, 3], value[e, 4], row
        for k in range(TILE):
            if function < 0:
                first, second, last = tile[row, k], 0.0, position
            tile[out, k] = call_column(
                abs(function), VALUE, tile[out, k], 0.0, 0.0, 0.0, 0.0,
                first, second, tile[last, k],
            )  # fmt: skip


@_inline
def joint_row(tile, q, dq, ddq, index, value, e, out):
    """Entry e without inertial parameter: a function of the motion of one joint or two."""
    function, sign, a, b = index[e, 0], index[e, 1], index[e, 2], index[e, 3]
    factor, ratio, gamma = value[e, 0], value[e, 1], value[e, 2]
    if function == ACCELERATION:
        _scaled_row(tile, ddq + a, factor, out)
    elif function == _SPEED:
        _scaled_row(tile, dq + a, factor, out)
    elif function == _CONSTANT:
        for s in range(TILE):
            tile[out, s] = factor
    elif sign <= _OF_POSITION:
        position_row(tile, function, q + a, value, e, out)
        _called_row(tile, function, q + a, q + a, value, e, out)
    else:
        for s in range(TILE):
            tile[out, s] = tile[dq + a, s] + ratio * tile[dq + b, s]
        _sign_row(tile, sign, gamma, out)
        speed_row(tile, function, dq + a, value, e, out)
        _called_row(tile, function, dq + a, q + a, value, e, out)
        _scaled_row(tile, out, factor, out)
