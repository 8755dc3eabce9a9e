"""Compiled motion of closed mechanisms: assembly, N and γ at one posture after the other.

    c(q) = 0,    A = ∂c/∂q = [A_a A_d],    N_d = -A_d⁻¹ A_a,    γ_d = -A_d⁻¹ (dA/dt dq)

The dependent joints are led from the posture before to second order, q_d + N Δq_a + γ Δt²/2, and
closed from there by Newton's method. While the gap is small the L and U of the posture before serve
it; whether they do is seen in the gap that is left.
"""

from __future__ import annotations

import numpy as np

from pivident.dynamics.closed_chains.closure_equations import (
    find_drifts,
    find_gaps,
    find_slopes,
    place_closures,
)
from pivident.dynamics.elimination import SIDE_BY_SIDE, factor, solve, solve_all
from pivident.foundation.compiled import inlined, inner, kernel

#: What may happen: nothing, the loops cannot be closed, the mechanism is singular.
CLOSED, OPEN, SINGULAR = 0, 1, 2

#: Largest gap of a closed loop [m, rad], that of one which Newton's method can close no further,
#: and its steps.
GAP, LAST_GAP, MAX_STEPS = 1e-13, 1e-10, 30

#: Largest gap that L and U of a posture before may close, and the share of it that they may leave.
SMALL_GAP, LEFT = 1e-8, 0.02

#: Least ratio of a step to the one before it at which the two are looked at together, and its
#: inverse the largest.
LEAST_RATIO = 0.2

#: Square of the cosine between the way and the speeds from which on it counts as along them.
PARALLEL = 0.9

#: Speed of a dependent joint, in those of the independent ones [rad or m over rad or m], that
#: counts as singular.
FASTEST = 1e4

#: Steps in which an assembly is followed from the posture of the description to a first sample.
APPROACH = 60


@inner
def _close_gaps(table, work):
    """Dependent positions by Newton's method, A where they are found, L and U; status."""
    r = table.others.size
    before, fresh = np.inf, False
    for _ in range(MAX_STEPS):
        place_closures(table, work)
        gap = find_gaps(table, work)
        if not gap < np.inf:
            return OPEN
        closed = gap <= GAP or (fresh and gap <= LAST_GAP and gap >= 0.5 * before)
        fresh = work.held[0] == 0 or gap > SMALL_GAP or gap > LEFT * before
        if closed or fresh:
            find_slopes(table, work)
            for e in range(table.slope.shape[0]):
                row, k = table.slope[e, 0], table.slope[e, 1]
                work.factors.matrix[row, k] = work.jacobian[row, table.others[k]]
            if not factor(work.factors):
                work.held[0] = 0
                return SINGULAR
            work.held[0] = 1
        if closed:
            return CLOSED
        before = gap
        for row in range(r):
            work.step[row] = -work.gap[0, row]
        solve(work.factors, work.step)
        for k in range(r):
            work.q[table.others[k]] += work.step[work.factors.row[k]]
    return OPEN


@inner
def close_loops(table, work):
    """Positions and speeds of the dependent joints, N and γ; those of the independent are there.

    The dependent positions in ``work.q`` are where Newton's method starts.
    """
    m, r = table.places.size, table.others.size
    status = _close_gaps(table, work)
    if status != CLOSED:
        return status
    for a in range(m + 1):
        right, column = work.right[a // SIDE_BY_SIDE], a % SIDE_BY_SIDE
        for row in range(r):
            own = work.jacobian[row, table.places[a]] if a < m else work.gap[0, row]
            right[row, column] = -own
    solve_all(work.factors, work.right)
    for k in range(r):
        work.dq[table.others[k]] = 0.0
    for a in range(m):
        right, column = work.right[a // SIDE_BY_SIDE], a % SIDE_BY_SIDE
        speed = work.dq[table.places[a]]
        for k in range(r):
            i, share = table.others[k], right[work.factors.row[k], column]
            if not abs(share) < FASTEST:
                return SINGULAR
            work.gain[i, a] = share
            work.dq[i] += share * speed
    right, column = work.right[m // SIDE_BY_SIDE], m % SIDE_BY_SIDE
    for k in range(r):  # what the smallest of gaps leaves
        work.q[table.others[k]] += right[work.factors.row[k], column]
    _find_accelerations(table, work)
    return CLOSED


@inner
def _find_accelerations(table, work):
    """γ at the present posture and speeds."""
    find_drifts(table, work)
    for row in range(table.others.size):
        work.step[row] = -work.gap[1, row]
    solve(work.factors, work.step)
    for k in range(table.others.size):
        work.drift[table.others[k]] = work.step[work.factors.row[k]]


@inlined
def move_closed(table, work, dq):
    """Speeds of all joints and γ at other independent speeds, where ``close_loops`` has been."""
    for a in range(dq.size):
        work.dq[table.places[a]] = dq[a]
    for k in range(table.others.size):
        i = table.others[k]
        work.dq[i] = 0.0
        for a in range(dq.size):
            work.dq[i] += work.gain[i, a] * dq[a]
    _find_accelerations(table, work)


@inner
def lead_on(table, work, q):
    """Independent joints to ``q``, the others where N and γ lead: a start for Newton's method.

    With the way Δq and t = Δq·dq/dq·dq, the time that it takes at the speeds dq of the posture
    before, the dependent joints go

        N Δq + γ t²/2 + dN/dt (t (Δq - t dq) - t² δ/3) + (γ - γ') t²/6,      δ = dq - dq',

    to third order where the posture before that, ', was left about as long ago as now it is led on:
    its N gives dN/dt. A way that is not along the speeds goes N Δq.
    """
    m = q.size
    change, bend = work.lead[0], work.lead[1]
    length, along, square = 0.0, 0.0, 0.0
    for a in range(m):
        i = table.places[a]
        change[a] = q[a] - work.q[i]
        length += change[a] * change[a]
        along += change[a] * work.dq[i]
        square += work.dq[i] * work.dq[i]
    ahead = abs(along) < square and along * along > PARALLEL * length * square
    time = along / square if ahead else 0.0
    ratio = time / work.time[0] if work.time[0] != 0.0 else 0.0
    if not LEAST_RATIO < ratio < 1.0 / LEAST_RATIO:
        ratio = 0.0
    second, third = 0.5 * time * time, ratio * time * time / 6.0
    for a in range(m):
        i = table.places[a]
        faster = work.dq[i] - work.before[i, m + 1]
        bend[a] = ratio * (change[a] - time * work.dq[i] - ratio * time * faster / 3.0)
        work.before[i, m + 1] = work.dq[i]
        work.q[i] = q[a]
    for k in range(table.others.size):
        i = table.others[k]
        drift, before = work.drift[i], work.before[i]
        way = second * drift + third * (drift - before[m])
        for a in range(m):
            gain = work.gain[i, a]
            way += gain * change[a] + (gain - before[a]) * bend[a]
            before[a] = gain
        before[m] = drift
        work.q[i] += way
    work.time[0] = time


@kernel
def approach(table, work, goal, middle):
    """Follow the assembly from where it is to the independent positions ``goal``, (joints,)."""
    for a in range(goal.size):
        i = table.places[a]
        middle[0, a] = work.q[i]
        work.dq[i] = (goal[a] - work.q[i]) / APPROACH
    for step in range(APPROACH + 1):
        share = step / APPROACH
        for a in range(goal.size):
            middle[1, a] = middle[0, a] + share * (goal[a] - middle[0, a])
        lead_on(table, work, middle[1])
        status = close_loops(table, work)
        if status != CLOSED:
            return status
    work.dq[:] = 0.0
    work.drift[:] = 0.0
    work.time[0] = 0.0
    return CLOSED


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
