"""Compiled loops of closed mechanisms: assembly, N and γ at one posture after the other.

    c(q) = 0,    A = ∂c/∂q = [A_a A_d],    N_d = -A_d⁻¹ A_a,    γ_d = -A_d⁻¹ (dA/dt dq)

The dependent joints come from Newton's method, started where the speeds lead from the posture
before. Everything is seen from the base: R_i, p_i, and with ddq = 0 ω_i, v_i and what the speeds
alone make of the accelerations, α_i and a_i.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pivident.compiled import inlined, inner, kernel
from pivident.dynamics.elimination import factor, solve
from pivident.dynamics.kernels import Tree, link_poses, place_link, tree_of
from pivident.robot.constraints import DIRECTIONS
from pivident.robot.description import Robot

#: What may happen: nothing, the loops cannot be closed, the mechanism is singular.
CLOSED, OPEN, SINGULAR = 0, 1, 2

#: Largest gap of a closed loop [m, rad], that of one which Newton's method can close no further,
#: and its steps.
GAP, LAST_GAP, MAX_STEPS = 1e-13, 1e-10, 30

#: Speed of a dependent joint, in those of the independent ones [rad or m over rad or m], that
#: counts as singular.
FASTEST = 1e4

#: Steps in which an assembly is followed from the posture of the description to a first sample.
APPROACH = 60

# Kinds of equations.
_PLACE, _DIRECTION, _LINEAR = 0, 1, 2

# Columns of a link's place: ⁰R row by row, ⁰p, ω, v, α, a.
_P, _W, _V, _ALPHA, _A, _PLACE_COLUMNS = 9, 12, 15, 18, 21, 24


class ClosureTable(NamedTuple):
    """The constraints of a robot as arrays."""

    tree: Tree
    places: np.ndarray  # independent joints, (joints,)
    others: np.ndarray  # dependent joints, (dependent,)
    equation: np.ndarray  # number in its list, kind, axis of the first and second, (dependent, 4)
    link: np.ndarray  # links of each closure, (closures, 2)
    frame: np.ndarray  # rotation row by row and origin in each link, (closures, 2, 12)
    ratio: np.ndarray  # of linear constraints, their offset last, (linear, tree joints + 1)
    posture: np.ndarray  # where the loops are closed, (tree joints,)


class ClosureWork(NamedTuple):
    """Where a mechanism is, and scratch."""

    q: np.ndarray  # positions of all joints, (tree joints,)
    dq: np.ndarray  # speeds, likewise
    gain: np.ndarray  # N, (tree joints, joints)
    drift: np.ndarray  # γ, (tree joints,)
    pose: np.ndarray  # (tree joints, 12)
    place: np.ndarray  # (tree joints, 24)
    ends: np.ndarray  # the two frames of a closure, (2, 24)
    axes: np.ndarray  # two of their axes with derivatives, and their normal, (3, 9)
    jacobian: np.ndarray  # A, (dependent, tree joints)
    gap: np.ndarray  # c, and dA/dt dq, (2, dependent)
    square: np.ndarray  # L and U of A_d, (dependent, dependent)
    order: np.ndarray  # its row exchanges, (dependent,)
    right: np.ndarray  # (dependent, joints)
    step: np.ndarray  # (dependent, 1)


def closure_table(robot: Robot) -> ClosureTable:
    """Constraints of a closed robot for the kernels."""
    constraints, tree = robot.constraints, robot.tree
    assert constraints is not None
    rows: list[tuple[int, int, int, int]] = []
    for k, closure in enumerate(constraints.closures):
        rows += [(k, _PLACE, axis, axis) for axis in range(3)]
        rows += [(k, _DIRECTION, a, b) for a, b in DIRECTIONS[closure.kind]]
    rows += [(k, _LINEAR, 0, 0) for k in range(len(constraints.linear))]
    frames = [
        [np.concatenate([f.rotation.ravel(), f.translation]) for f in closure.frames]
        for closure in constraints.closures
    ]
    ratios = [np.append(one.ratios, one.offset) for one in constraints.linear]
    others = [i for i in range(tree.size) if i not in constraints.places]
    return ClosureTable(
        tree_of(tree),
        np.array(constraints.places, dtype=np.int64),
        np.array(others, dtype=np.int64),
        np.array([rows[k] for k in constraints.kept], dtype=np.int64).reshape(-1, 4),
        np.array([c.links for c in constraints.closures], dtype=np.int64).reshape(-1, 2),
        np.array(frames, dtype=float).reshape(-1, 2, 12),
        np.array(ratios, dtype=float).reshape(-1, tree.size + 1),
        np.array(constraints.posture, dtype=float),
    )


def closure_work(table: ClosureTable) -> ClosureWork:
    """A mechanism at the posture of its description."""
    n, m, r = table.posture.size, table.places.size, table.others.size
    return ClosureWork(
        table.posture.copy(), np.zeros(n), np.zeros((n, m)), np.zeros(n), np.zeros((n, 12)),
        np.zeros((n, _PLACE_COLUMNS)), np.zeros((2, _PLACE_COLUMNS)), np.zeros((3, 9)),
        np.zeros((r, n)),
        np.zeros((2, r)), np.zeros((r, r)), np.zeros(r, dtype=np.int64), np.zeros((r, m)),
        np.zeros((r, 1)),
    )  # fmt: skip


@inlined
def _add_cross(x, xc, y, yc, out, oc):
    """Out += x × y, at columns."""
    out[oc] += x[xc + 1] * y[yc + 2] - x[xc + 2] * y[yc + 1]
    out[oc + 1] += x[xc + 2] * y[yc] - x[xc] * y[yc + 2]
    out[oc + 2] += x[xc] * y[yc + 1] - x[xc + 1] * y[yc]


@inlined
def _carry(source, x, y, z, target):
    """Motion of what is fixed in a body at (x, y, z) from its origin, v + ω × r and so on."""
    for c in range(_W, _PLACE_COLUMNS):
        target[c] = source[c]
    wx, wy, wz = source[_W], source[_W + 1], source[_W + 2]
    ax, ay, az = source[_ALPHA], source[_ALPHA + 1], source[_ALPHA + 2]
    cx, cy, cz = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
    target[_V] += cx
    target[_V + 1] += cy
    target[_V + 2] += cz
    target[_A] += ay * z - az * y + wy * cz - wz * cy
    target[_A + 1] += az * x - ax * z + wz * cx - wx * cz
    target[_A + 2] += ax * y - ay * x + wx * cy - wy * cx


@inner
def _move_links(tree, dq, place):
    """ω, v, α and a of all links, from their places and the speeds."""
    n = dq.size
    for i in range(n):
        own, parent = place[i], tree.parent[i]
        for c in range(_W, _PLACE_COLUMNS):
            own[c] = 0.0
        zx, zy, zz = own[2], own[5], own[8]
        if parent >= 0:
            before = place[parent]
            _carry(
                before,
                own[_P] - before[_P],
                own[_P + 1] - before[_P + 1],
                own[_P + 2] - before[_P + 2],
                own,
            )
            wx, wy, wz = before[_W], before[_W + 1], before[_W + 2]
            px, py, pz = wy * zz - wz * zy, wz * zx - wx * zz, wx * zy - wy * zx
            first, factor = (_A, 2.0 * dq[i]) if tree.prismatic[i] else (_ALPHA, dq[i])
            own[first] += factor * px
            own[first + 1] += factor * py
            own[first + 2] += factor * pz
        first = _V if tree.prismatic[i] else _W
        own[first] += zx * dq[i]
        own[first + 1] += zy * dq[i]
        own[first + 2] += zz * dq[i]


@inner
def _place_end(link, frame, place, end, moving):
    """Place and, where asked for, motion of a frame that is fixed in a link."""
    for c in range(_PLACE_COLUMNS):
        end[c] = 0.0
    if link < 0:
        for c in range(12):
            end[c] = frame[c]
        return
    own = place[link]
    for a in range(3):
        for b in range(3):
            total = 0.0
            for c in range(3):
                total += own[3 * a + c] * frame[3 * c + b]
            end[3 * a + b] = total
    x = own[0] * frame[9] + own[1] * frame[10] + own[2] * frame[11]
    y = own[3] * frame[9] + own[4] * frame[10] + own[5] * frame[11]
    z = own[6] * frame[9] + own[7] * frame[10] + own[8] * frame[11]
    end[_P], end[_P + 1], end[_P + 2] = own[_P] + x, own[_P + 1] + y, own[_P + 2] + z
    if not moving:
        return
    _carry(own, x, y, z, end)


@inner
def _turned_axis(end, axis, out):
    """A unit vector of a frame and its first two derivatives, u, ω × u, α × u + ω × (ω × u)."""
    for a in range(3):
        out[a] = end[3 * a + axis]
    for c in range(3, 9):
        out[c] = 0.0
    _add_cross(end, _W, out, 0, out, 3)
    _add_cross(end, _ALPHA, out, 0, out, 6)
    _add_cross(end, _W, out, 3, out, 6)


@inner
def _place_slope(table, work, row, link, sign, axis, point):
    """Add one end's part to a row of A: ± axis · v of a point of the link, (3,)."""
    tree, place = table.tree, work.place
    i = link
    while i >= 0:
        zx, zy, zz = place[i, 2], place[i, 5], place[i, 8]
        if tree.prismatic[i]:
            part = axis[0] * zx + axis[1] * zy + axis[2] * zz
        else:
            x, y = point[0] - place[i, _P], point[1] - place[i, _P + 1]
            z = point[2] - place[i, _P + 2]
            part = (
                axis[0] * (zy * z - zz * y)
                + axis[1] * (zz * x - zx * z)
                + axis[2] * (zx * y - zy * x)
            )
        work.jacobian[row, i] += sign * part
        i = tree.parent[i]


@inner
def _turning_slope(table, work, row, link, sign, normal):
    """Add one end's part to a row of A: ± normal · ω of the link."""
    tree, place = table.tree, work.place
    i = link
    while i >= 0:
        if not tree.prismatic[i]:
            part = place[i, 2] * normal[0] + place[i, 5] * normal[1] + place[i, 8] * normal[2]
            work.jacobian[row, i] += sign * part
        i = tree.parent[i]


@inner
def _equations(table, work, moving):
    """Gap and slopes of all equations at the present posture; ``moving``: their drift instead."""
    tree, q, dq = table.tree, work.q, work.dq
    n, size = q.size, table.equation.shape[0]
    if moving:
        _move_links(tree, dq, work.place)
    else:
        link_poses(tree.prismatic, tree.rotation, tree.translation, q, work.pose)
        for i in range(n):
            place_link(tree.parent[i], work.pose, i, work.place)
    first, second = work.ends[0], work.ends[1]
    axes = work.axes
    at = -1
    for row in range(size):
        number, kind = table.equation[row, 0], table.equation[row, 1]
        if moving and kind == _LINEAR:
            work.gap[1, row] = 0.0
            continue
        if not moving:
            for i in range(n):
                work.jacobian[row, i] = 0.0
        if kind == _LINEAR:
            total = -table.ratio[number, n]
            for i in range(n):
                total += table.ratio[number, i] * q[i]
                work.jacobian[row, i] = table.ratio[number, i]
            work.gap[0, row] = total
            continue
        link_1, link_2 = table.link[number, 0], table.link[number, 1]
        if number != at:
            _place_end(link_1, table.frame[number, 0], work.place, first, moving)
            _place_end(link_2, table.frame[number, 1], work.place, second, moving)
            at = number
        if kind == _PLACE:
            axis, gap, drift = axes[2], 0.0, 0.0
            for c in range(3):
                axis[c] = first[3 * c + table.equation[row, 2]]
                gap += axis[c] * (first[_P + c] - second[_P + c])
                drift += axis[c] * (first[_A + c] - second[_A + c])
            if moving:
                work.gap[1, row] = drift
                continue
            work.gap[0, row] = gap
            # the axis turns with the first link, so that its end counts where the second one is
            _place_slope(table, work, row, link_1, 1.0, axis, second[_P : _P + 3])
            _place_slope(table, work, row, link_2, -1.0, axis, second[_P : _P + 3])
            continue
        a, b, normal = axes[0], axes[1], axes[2]
        _turned_axis(first, table.equation[row, 2], a)
        _turned_axis(second, table.equation[row, 3], b)
        along, drift = 0.0, 0.0
        for c in range(3):
            along += a[c] * b[c]
            drift += a[6 + c] * b[c] + 2.0 * a[3 + c] * b[3 + c] + a[c] * b[6 + c]
            normal[c] = 0.0
        if moving:
            work.gap[1, row] = drift
            continue
        work.gap[0, row] = along
        _add_cross(a, 0, b, 0, normal, 0)
        _turning_slope(table, work, row, link_1, 1.0, normal)
        _turning_slope(table, work, row, link_2, -1.0, normal)


@inner
def close_loops(table, work):
    """Positions and speeds of the dependent joints, N and γ; those of the independent are there.

    The dependent positions in ``work.q`` are where Newton's method starts.
    """
    m, r = table.places.size, table.others.size
    before = np.inf
    for attempt in range(MAX_STEPS):
        _equations(table, work, False)
        gap = 0.0
        for row in range(r):
            gap = max(gap, abs(work.gap[0, row]))
            for k in range(r):
                work.square[row, k] = work.jacobian[row, table.others[k]]
        if not gap < np.inf:
            return OPEN
        if not factor(work.square, work.order):
            return SINGULAR
        if gap <= GAP or (gap <= LAST_GAP and gap >= 0.5 * before):
            break
        if attempt == MAX_STEPS - 1:
            return OPEN
        before = gap
        for row in range(r):
            work.step[row, 0] = -work.gap[0, row]
        solve(work.square, work.order, work.step)
        for k in range(r):
            work.q[table.others[k]] += work.step[k, 0]
    for row in range(r):
        for a in range(m):
            work.right[row, a] = -work.jacobian[row, table.places[a]]
    solve(work.square, work.order, work.right)
    for a in range(m):
        for b in range(m):
            work.gain[table.places[a], b] = 1.0 if a == b else 0.0
        work.drift[table.places[a]] = 0.0
    for k in range(r):
        i = table.others[k]
        speed = 0.0
        for a in range(m):
            share = work.right[k, a]
            if not abs(share) < FASTEST:
                return SINGULAR
            work.gain[i, a] = share
            speed += share * work.dq[table.places[a]]
        work.dq[i] = speed
    _equations(table, work, True)
    for row in range(r):
        work.step[row, 0] = -work.gap[1, row]
    solve(work.square, work.order, work.step)
    for k in range(r):
        work.drift[table.others[k]] = work.step[k, 0]
    return CLOSED


@inner
def lead_on(table, work, q):
    """Independent joints to ``q``, the others where N leads: a start for Newton's method."""
    for a in range(q.size):
        way = q[a] - work.q[table.places[a]]
        for k in range(table.others.size):
            i = table.others[k]
            work.q[i] += work.gain[i, a] * way
    for a in range(q.size):
        work.q[table.places[a]] = q[a]


@kernel
def approach(table, work, goal, middle):
    """Follow the assembly from where it is to the independent positions ``goal``, (joints,)."""
    for a in range(goal.size):
        middle[0, a] = work.q[table.places[a]]
    work.dq[:] = 0.0
    status = close_loops(table, work)
    for step in range(1, APPROACH + 1):
        if status != CLOSED:
            return status
        share = step / APPROACH
        for a in range(goal.size):
            middle[1, a] = middle[0, a] + share * (goal[a] - middle[0, a])
        lead_on(table, work, middle[1])
        for i in range(work.dq.size):
            work.dq[i] = 0.0
        status = close_loops(table, work)
    return status


@kernel
def follow(table, work, q, dq, ddq, positions, speeds, accelerations, gains):
    """Motion of all joints from that of the independent ones, time last; status and sample.

    ``work`` is near the first sample. ``positions``, ``speeds`` and ``accelerations``: receive the
    motion of the tree, shape (tree joints, samples); ``gains``: N, shape
    (tree joints, joints, samples).
    """
    n, m = work.gain.shape
    for t in range(q.shape[1]):
        lead_on(table, work, q[:, t])
        for a in range(m):
            work.dq[table.places[a]] = dq[a, t]
        status = close_loops(table, work)
        if status != CLOSED:
            return status, t
        for i in range(n):
            positions[i, t], speeds[i, t] = work.q[i], work.dq[i]
            total = work.drift[i]
            for a in range(m):
                gains[i, a, t] = work.gain[i, a]
                total += work.gain[i, a] * ddq[a, t]
            accelerations[i, t] = total
    return CLOSED, -1
