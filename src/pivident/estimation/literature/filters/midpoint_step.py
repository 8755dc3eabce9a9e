"""One sampling period of the robot under a held torque, as a map of (q, dq, θ), with its tangent.

Half a drift, a kick with the midpoint rule, half a drift (order two, stable for stiff friction):

    q_m = q + h/2 dq
    ID(q_m, dq + h/2 a, a; θ) = τ                        solved for a by Newton's method
    dq⁺ = dq + h a,     q⁺ = q + h dq + h²/2 a

The mass matrix stands still during the iteration, for q_m does; the slopes of centrifugal torques
are left to convergence. The rule for implicit functions gives the exact tangent of this very step,

    A δa = δτ - Φ δθ - K (δq + h/2 δdq) - B δdq,     A = M + h/2 B

with Φ, K = ∂ID/∂q and B = ∂ID/∂dq at (q_m, dq + h/2 a, a), by the recursions of
``rigid_body_slopes``: ∂a/∂θ = -A⁻¹Φ is that of the forward dynamics for h → 0. With other
parameters the same motion has another a. Steps A⁻¹(τ - ID) lead there, each of which leaves of the
error the share by which M and B differ. ID, M and Φ of a mechanism with closed loops are those of
its independent joints (``closed_step``). The simulator's own step carries memory from step to step
(M⁻¹ is extrapolated), which the state (q, dq, θ) of a filter does not hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pivident.dynamics.elimination import eliminate
from pivident.dynamics.kernels import bias_torque, composite_mass_matrix, link_poses
from pivident.dynamics.rigid_body_slopes import (
    inertial_columns,
    move_links,
    place_links,
    slope_scratch,
    torque_slopes,
)
from pivident.estimation.literature.filters.closed_step import (
    ClosedStep,
    closed_columns,
    closed_masses,
    closed_step,
    closed_torque_slopes,
    closed_torques,
    place_closed,
    take_rotors,
)
from pivident.estimation.literature.filters.robot_equations import (
    RobotEquations,
    add_local_columns,
    add_local_slopes,
    local_torques,
    take_parameters,
)
from pivident.estimation.literature.filters.triangular import cholesky, solve_cholesky
from pivident.foundation.compiled import inlined, inner

#: Most iterations of Newton's method, and halvings of one of its steps.
MAX_ITERATIONS, MAX_HALVINGS = 25, 6

#: Relative step of the acceleration that is the last one: each is a hundredth of the one before.
SETTLED = 1e-11

#: Most steps to the acceleration of other parameters, what the first one leaves of the error at
#: most, and the relative error that may be left: a millionth of a count in a position.
MAX_CHORDS, LEFT, BESIDE = 8, 1e-2, 1e-10

# Rows of ``vectors``: q_m, dq_m, a; residual, step, bias and local torques, zeros, a tried.
MIDDLE, SPEED, ACCELERATION, _RESIDUAL, _STEP, _BIAS, _LOCAL, _STILL, _TRIED = range(9)

# Layers of ``matrices``: M, M + h/2 f', its factor, K, B, A.
_MASS, _SUM, FACTOR, _POSITION, _SPEED, _WHOLE = range(6)


class StepWork(NamedTuple):
    """Scratch of one step, and what it found."""

    vectors: np.ndarray  # see above, (9, joints)
    matrices: np.ndarray  # see above, (6, joints, joints)
    inertia: np.ndarray  # ten inertial parameters of every link, (tree joints, 10)
    rotor: np.ndarray  # (tree joints, tree joints)
    used: np.ndarray  # parameters as the dynamics take them, (parameters,)
    pose: np.ndarray  # scratch of the rigid body, likewise the next five
    motion: np.ndarray
    force: np.ndarray
    composite: np.ndarray
    links: np.ndarray
    body: np.ndarray
    #: A⁻¹ times K, B, Φ and the unit matrix, (joints, 3 joints + parameters).
    solved: np.ndarray
    closed: ClosedStep | None  # of a mechanism with closed loops


def step_work(
    equations: RobotEquations, q: np.ndarray | None = None, joint_names: Sequence[str] = ()
) -> StepWork:
    """Scratch for a robot, a mechanism with closed loops near the positions ``q``, (joints,).

    Raises:
        LoopNotClosed: the loops do not close there.
    """
    n, links, p = equations.joints, len(equations.tree.parent), len(equations.floor)
    inertia, closed = np.zeros((links, 10)), None
    if equations.loops is not None:
        closed = closed_step(equations.loops._replace(inertia=inertia), p, q, joint_names)
    return StepWork(
        np.zeros((9, n)), np.zeros((6, n, n)), inertia, np.zeros((links, links)), np.zeros(p),
        np.zeros((links, 12)), np.zeros((links, 9)), np.zeros((links, 6)), np.zeros((links, 10)),
        *slope_scratch(links), np.zeros((n, 3 * n + p)), closed,
    )  # fmt: skip


@inner
def _residual(
    parent, prismatic, gravity, local_index, local_value, used, v, a, dq, tau, h, work, closed
):
    """τ - ID at the acceleration in row ``a``: its size Σ r²/M_jj."""
    vectors, matrices, n = work.vectors, work.matrices, tau.size
    for i in range(n):
        v[i] = dq[i] + 0.5 * h * a[i]
    if closed is None:  # decided by its type, here and below
        bias_torque(
            parent, prismatic, gravity, work.pose, work.inertia, v, None, work.motion, work.force,
            vectors[_BIAS],
        )  # fmt: skip
        local_torques(
            local_index, local_value, used, vectors[MIDDLE], v, vectors[_STILL], vectors[_LOCAL],
            matrices[_POSITION], matrices[_SPEED],
        )  # fmt: skip
    else:
        closed_torques(
            closed, local_index, local_value, used, v, None, vectors[_BIAS], vectors[_LOCAL],
            matrices[_SPEED],
        )  # fmt: skip
    size = 0.0
    for i in range(n):
        r = tau[i] - vectors[_BIAS, i] - vectors[_LOCAL, i]
        for j in range(n):
            r -= matrices[_MASS, i, j] * a[j]
        vectors[_RESIDUAL, i] = r
        size += r * r / matrices[_MASS, i, i]
    return size


@inner
def _place(tree, middle, dq, rotor, mass, work, closed):
    """Posture of the middle and its mass matrix; whether the loops close there."""
    if closed is None:
        link_poses(tree.prismatic, tree.rotation, tree.translation, middle, work.pose)
        composite_mass_matrix(
            tree.parent, tree.prismatic, work.pose, work.inertia, rotor, work.composite, mass
        )
    else:
        if not place_closed(closed, middle, dq):
            return False
        closed_masses(closed, rotor, mass)
    return True


@inner
def midpoint_step(equations, work, theta, q, dq, tau, h, q_next, dq_next):
    """Advance (q, dq), each (joints,), by the time h under the torque ``tau``; see above.

    Returns -1, the joint whose pivot of the mass matrix is not positive, or their number where the
    loops of a mechanism do not close.
    """
    tree, local_index, local_value = equations.tree, equations.local_index, equations.local_value
    parent, prismatic, gravity = tree.parent, tree.prismatic, tree.gravity
    vectors, matrices, used, n = work.vectors, work.matrices, work.used, q.size
    take_parameters(
        equations.inertial, local_index, local_value, equations.floor, theta, work.inertia,
        work.rotor, used,
    )  # fmt: skip
    middle, v, a, tried = vectors[MIDDLE], vectors[SPEED], vectors[ACCELERATION], vectors[_TRIED]
    mass, total, factor, step = matrices[_MASS], matrices[_SUM], matrices[FACTOR], vectors[_STEP]
    for i in range(n):
        middle[i] = q[i] + 0.5 * h * dq[i]
    if not _place(tree, middle, dq, work.rotor, mass, work, work.closed):
        return n
    for i in range(n):
        for j in range(i):
            mass[j, i] = mass[i, j]
    joint = cholesky(mass, factor)
    if joint >= 0:
        return joint
    size = _residual(
        parent, prismatic, gravity, local_index, local_value, used, v, a, dq, tau, h, work,
        work.closed,
    )  # fmt: skip
    for _ in range(MAX_ITERATIONS):
        for i in range(n):
            step[i] = vectors[_RESIDUAL, i]
            for j in range(i + 1):
                total[i, j] = mass[i, j] + 0.5 * h * matrices[_SPEED, i, j]
        joint = cholesky(total, factor)
        if joint >= 0:
            return joint
        solve_cholesky(factor, step)
        largest, change = 0.0, 0.0
        for i in range(n):
            largest, change = max(largest, abs(a[i])), max(change, abs(step[i]))
        if change <= SETTLED * largest:
            for i in range(n):
                a[i] += step[i]
            break
        share = 1.0
        for _ in range(MAX_HALVINGS):
            for i in range(n):
                tried[i] = a[i] + share * step[i]
            now = _residual(
                parent, prismatic, gravity, local_index, local_value, used, v, tried, dq, tau, h,
                work, work.closed,
            )  # fmt: skip
            if now <= size:
                break
            share *= 0.5
        for i in range(n):
            a[i] = tried[i]
        size = now
    for i in range(n):
        v[i] = dq[i] + 0.5 * h * a[i]
        q_next[i] = q[i] + h * (dq[i] + 0.5 * h * a[i])
        dq_next[i] = dq[i] + h * a[i]
    return -1


@inner
def _slopes_and_columns(equations, work, by_position, by_speed, phi, closed):
    """K, B and Φ of the step just taken; Φ is added to ``phi``, (joints, parameters)."""
    tree, local_index, local_value = equations.tree, equations.local_index, equations.local_value
    vectors, links, body = work.vectors, work.links, work.body
    middle, v, a = vectors[MIDDLE], vectors[SPEED], vectors[ACCELERATION]
    if closed is None:
        place_links(tree.parent, tree.prismatic, work.pose, work.inertia, links, body)
        move_links(tree.parent, tree.gravity, v, a, links, body)
        torque_slopes(tree.parent, tree.gravity, links, body, by_position, by_speed)
        add_local_slopes(
            local_index, local_value, work.used, middle, v, vectors[_STILL], vectors[_LOCAL],
            by_position, by_speed,
        )  # fmt: skip
        inertial_columns(tree.parent, equations.inertial, links, phi)
        add_local_columns(local_index, local_value, middle, v, a, phi)
    else:
        closed_torques(
            closed, local_index, local_value, work.used, v, a, vectors[_BIAS], vectors[_LOCAL],
            by_speed,
        )  # fmt: skip
        closed_torque_slopes(
            closed, local_index, local_value, work.used, a, links, body, by_position, by_speed
        )
        closed_columns(closed, equations.inertial, local_index, local_value, links, phi)


@inner
def step_tangent(equations, work, h):
    """A⁻¹ times [K B Φ 1] of the step just taken, into ``solved``; False: A is singular."""
    vectors, matrices, solved = work.vectors, work.matrices, work.solved
    n = vectors.shape[1]
    by_position, by_speed, whole = matrices[_POSITION], matrices[_SPEED], matrices[_WHOLE]
    phi = solved[:, 2 * n : solved.shape[1] - n]
    for i in range(n):
        for c in range(solved.shape[1]):
            solved[i, c] = 0.0
        solved[i, solved.shape[1] - n + i] = 1.0
    _slopes_and_columns(equations, work, by_position, by_speed, phi, work.closed)
    for i in range(n):
        for j in range(n):
            solved[i, j], solved[i, n + j] = by_position[i, j], by_speed[i, j]
            whole[i, j] = matrices[_MASS, i, j] + 0.5 * h * by_speed[i, j]
    return eliminate(whole, solved)


@inner
def _left(tree, local_index, local_value, v, a, tau, work, closed):
    """τ - ID at speeds and accelerations, (joints,), where the step has been."""
    vectors, matrices = work.vectors, work.matrices
    if closed is None:
        bias_torque(
            tree.parent, tree.prismatic, tree.gravity, work.pose, work.inertia, v, a, work.motion,
            work.force, vectors[_BIAS],
        )  # fmt: skip
        local_torques(
            local_index, local_value, work.used, vectors[MIDDLE], v, vectors[_STILL],
            vectors[_LOCAL], matrices[_POSITION], matrices[_SPEED],
        )  # fmt: skip
        _subtract(vectors, work.rotor, a, tau)
    else:
        closed_torques(
            closed, local_index, local_value, work.used, v, a, vectors[_BIAS], vectors[_LOCAL],
            matrices[_SPEED],
        )  # fmt: skip
        take_rotors(closed, work.rotor)  # those of other parameters than the step's
        _subtract(vectors, closed.rotor, a, tau)


@inlined
def _subtract(vectors, rotor, a, tau):
    """The residual of torques that have been found."""
    for i in range(tau.size):
        vectors[_RESIDUAL, i] = tau[i] - vectors[_BIAS, i] - vectors[_LOCAL, i]
        for j in range(tau.size):
            vectors[_RESIDUAL, i] -= rotor[i, j] * a[j]


@inner
def beside(equations, work, theta, dq, tau, h, a):
    """Acceleration of the parameters ``theta`` in the step whose tangent was just made.

    ``a``: (joints,), a first value, receives it. False: those of the step are too far.
    """
    local_index, local_value = equations.local_index, equations.local_value
    vectors, solved, n = work.vectors, work.solved, tau.size
    v, residual, inverse = vectors[SPEED], vectors[_RESIDUAL], solved[:, solved.shape[1] - n :]
    take_parameters(
        equations.inertial, local_index, local_value, equations.floor, theta, work.inertia,
        work.rotor, work.used,
    )  # fmt: skip
    before = 0.0
    for _ in range(MAX_CHORDS):
        for i in range(n):
            v[i] = dq[i] + 0.5 * h * a[i]
        _left(equations.tree, local_index, local_value, v, a, tau, work, work.closed)
        largest, change = 0.0, 0.0
        for i in range(n):
            step = 0.0
            for j in range(n):
                step += inverse[i, j] * residual[j]
            largest, change = max(largest, abs(a[i])), max(change, abs(step))
            vectors[_STEP, i] = step
        for i in range(n):
            a[i] += vectors[_STEP, i]
        # what is left is to this step as this step to the one before
        share = change / before if before > 0.0 else LEFT
        if share * change <= BESIDE * largest:
            return True
        before = change
    return False
