"""Compiled equations of closed loops at one posture: the gap c, its slopes A, and dA/dt dq.

    c(q) = 0,      A = ∂c/∂q

Everything is seen from the base: R_i, p_i, ω_i, v_i and, of the speeds alone with ddq = 0, the
accelerations α_i and a_i.
"""

from __future__ import annotations

from pivident.dynamics.closed_chains.closure_table import (
    ALPHA,
    LINEAR,
    PLACE,
    PLACE_COLUMNS,
    A,
    P,
    V,
    W,
)
from pivident.dynamics.kernels import link_poses, place_link
from pivident.foundation.compiled import inlined, inner


@inlined
def _add_cross(x, xc, y, yc, out, oc):
    """Out += x × y, at columns."""
    out[oc] += x[xc + 1] * y[yc + 2] - x[xc + 2] * y[yc + 1]
    out[oc + 1] += x[xc + 2] * y[yc] - x[xc] * y[yc + 2]
    out[oc + 2] += x[xc] * y[yc + 1] - x[xc + 1] * y[yc]


@inlined
def _carry(source, x, y, z, target):
    """Motion of what is fixed in a body at (x, y, z) from its origin, v + ω × r and so on."""
    for c in range(W, PLACE_COLUMNS):
        target[c] = source[c]
    wx, wy, wz = source[W], source[W + 1], source[W + 2]
    ax, ay, az = source[ALPHA], source[ALPHA + 1], source[ALPHA + 2]
    cx, cy, cz = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
    target[V] += cx
    target[V + 1] += cy
    target[V + 2] += cz
    target[A] += ay * z - az * y + wy * cz - wz * cy
    target[A + 1] += az * x - ax * z + wz * cx - wx * cz
    target[A + 2] += ax * y - ay * x + wx * cy - wy * cx


@inner
def move_links(tree, dq, ddq, place):
    """ω, v, α and a of all links, from their places, speeds and accelerations (None: zero)."""
    n = dq.size
    for i in range(n):
        own, parent = place[i], tree.parent[i]
        for c in range(W, PLACE_COLUMNS):
            own[c] = 0.0
        zx, zy, zz = own[2], own[5], own[8]
        if parent >= 0:
            before = place[parent]
            _carry(
                before,
                own[P] - before[P],
                own[P + 1] - before[P + 1],
                own[P + 2] - before[P + 2],
                own,
            )
            wx, wy, wz = before[W], before[W + 1], before[W + 2]
            px, py, pz = wy * zz - wz * zy, wz * zx - wx * zz, wx * zy - wy * zx
            first, factor = (A, 2.0 * dq[i]) if tree.prismatic[i] else (ALPHA, dq[i])
            own[first] += factor * px
            own[first + 1] += factor * py
            own[first + 2] += factor * pz
        first = V if tree.prismatic[i] else W
        own[first] += zx * dq[i]
        own[first + 1] += zy * dq[i]
        own[first + 2] += zz * dq[i]
        if ddq is not None:  # decided by its type
            first = A if tree.prismatic[i] else ALPHA
            own[first] += zx * ddq[i]
            own[first + 1] += zy * ddq[i]
            own[first + 2] += zz * ddq[i]


@inlined
def _place_end(link, frame, place, end):
    """Place of a frame that is fixed in a link."""
    if link < 0:
        for c in range(12):
            end[c] = frame[c]
        return
    own = place[link]
    for a in range(3):
        x, y, z = own[3 * a], own[3 * a + 1], own[3 * a + 2]
        for b in range(3):
            end[3 * a + b] = x * frame[b] + y * frame[3 + b] + z * frame[6 + b]
        end[P + a] = own[P + a] + x * frame[9] + y * frame[10] + z * frame[11]


@inner
def place_closures(table, work):
    """Places of all links and of the frames of the closures at the present posture."""
    tree, place = table.tree, work.place
    link_poses(tree.prismatic, tree.rotation, tree.translation, work.q, work.pose)
    for i in range(work.q.size):
        place_link(tree.parent[i], work.pose, i, place)
    for k in range(table.link.shape[0]):
        for end in range(2):
            _place_end(table.link[k, end], table.frame[k, end], place, work.ends[k, end])


@inlined
def _axis(end, axis, out):
    """A unit vector of a frame, u."""
    for a in range(3):
        out[a] = end[3 * a + axis]


@inner
def find_gaps(table, work):
    """Gaps of all equations after ``place_closures``; the largest."""
    n, largest = work.q.size, 0.0
    for row in range(table.equation.shape[0]):
        number, kind = table.equation[row, 0], table.equation[row, 1]
        gap = 0.0
        if kind == LINEAR:
            gap = -table.ratio[number, n]
            for i in range(n):
                gap += table.ratio[number, i] * work.q[i]
        else:
            first, second = work.ends[number, 0], work.ends[number, 1]
            x, y = table.equation[row, 2], table.equation[row, 3]
            for c in range(3):
                if kind == PLACE:
                    gap += first[3 * c + x] * (first[P + c] - second[P + c])
                else:
                    gap += first[3 * c + x] * second[3 * c + y]
        work.gap[0, row] = gap
        largest = max(largest, abs(gap))
    return largest


@inlined
def _place_slope(parent, prismatic, place, link, sign, axis, end, slope):
    """Add one end's part to a row of A: ± axis · v of the link where another end is."""
    u0, u1, u2 = axis[0], axis[1], axis[2]
    # axis · (z × r) = z · (r × axis), r × axis with r from the joint to the end
    mx = end[P + 1] * u2 - end[P + 2] * u1
    my = end[P + 2] * u0 - end[P] * u2
    mz = end[P] * u1 - end[P + 1] * u0
    i = link
    while i >= 0:
        zx, zy, zz = place[i, 2], place[i, 5], place[i, 8]
        if prismatic[i]:
            part = u0 * zx + u1 * zy + u2 * zz
        else:
            x, y, z = place[i, P], place[i, P + 1], place[i, P + 2]
            part = (
                zx * (mx - y * u2 + z * u1)
                + zy * (my - z * u0 + x * u2)
                + zz * (mz - x * u1 + y * u0)
            )
        slope[i] += sign * part
        i = parent[i]


@inlined
def _turning_slope(parent, prismatic, place, link, sign, normal, slope):
    """Add one end's part to a row of A: ± normal · ω of the link."""
    i = link
    while i >= 0:
        if not prismatic[i]:
            part = place[i, 2] * normal[0] + place[i, 5] * normal[1] + place[i, 8] * normal[2]
            slope[i] += sign * part
        i = parent[i]


@inner
def find_slopes(table, work):
    """A, the slopes of all equations, after ``place_closures``."""
    n, axes, place = work.q.size, work.axes, work.place
    parent, prismatic = table.tree.parent, table.tree.prismatic
    for row in range(table.equation.shape[0]):
        number, kind = table.equation[row, 0], table.equation[row, 1]
        slope = work.jacobian[row]
        for i in range(n):
            slope[i] = table.ratio[number, i] if kind == LINEAR else 0.0
        if kind == LINEAR:
            continue
        first, second = work.ends[number, 0], work.ends[number, 1]
        link_1, link_2 = table.link[number, 0], table.link[number, 1]
        a, b, normal = axes[0], axes[1], axes[2]
        _axis(first, table.equation[row, 2], a)
        if kind == PLACE:
            # the axis turns with the first link, so that its end counts where the second one is
            _place_slope(parent, prismatic, place, link_1, 1.0, a, second, slope)
            _place_slope(parent, prismatic, place, link_2, -1.0, a, second, slope)
            continue
        _axis(second, table.equation[row, 3], b)
        for c in range(3):
            normal[c] = 0.0
        _add_cross(a, 0, b, 0, normal, 0)
        _turning_slope(parent, prismatic, place, link_1, 1.0, normal, slope)
        _turning_slope(parent, prismatic, place, link_2, -1.0, normal, slope)


@inlined
def turned_axis(end, axis, out):
    """A unit vector of a frame and its first two derivatives, u, ω × u, α × u + ω × (ω × u)."""
    for a in range(3):
        out[a] = end[3 * a + axis]
    for c in range(3, 9):
        out[c] = 0.0
    _add_cross(end, W, out, 0, out, 3)
    _add_cross(end, ALPHA, out, 0, out, 6)
    _add_cross(end, W, out, 3, out, 6)


@inlined
def _move_end(link, place, end):
    """Motion of a frame that is fixed in a link."""
    if link < 0:
        return
    own = place[link]
    _carry(own, end[P] - own[P], end[P + 1] - own[P + 1], end[P + 2] - own[P + 2], end)


@inner
def move_ends(table, work):
    """Motion of the frames of the closures, from that of the links."""
    for k in range(table.link.shape[0]):
        for end in range(2):
            _move_end(table.link[k, end], work.place, work.ends[k, end])


@inner
def find_drifts(table, work):
    """dA/dt dq of all equations at the present speeds, where the loops are closed."""
    move_links(table.tree, work.dq, None, work.place)
    move_ends(table, work)
    for row in range(table.equation.shape[0]):
        number, kind = table.equation[row, 0], table.equation[row, 1]
        drift = 0.0
        if kind != LINEAR:
            first, second = work.ends[number, 0], work.ends[number, 1]
            x, y = table.equation[row, 2], table.equation[row, 3]
            if kind == PLACE:
                for c in range(3):
                    drift += first[3 * c + x] * (first[A + c] - second[A + c])
            else:
                a, b = work.axes[0], work.axes[1]
                turned_axis(first, x, a)
                turned_axis(second, y, b)
                for c in range(3):
                    drift += a[6 + c] * b[c] + 2.0 * a[3 + c] * b[3 + c] + a[c] * b[6 + c]
        work.gap[1, row] = drift
