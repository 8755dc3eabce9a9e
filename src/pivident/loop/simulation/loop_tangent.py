"""Tangents of the simulated loop: how law, torques and rigid body change along parameters.

A *direction* is one parameter, a *tangent* the derivative of a quantity along it. Tangents are
propagated beside the simulation, each the derivative of the very step that the simulation takes:
its held and extrapolated M⁻¹, its extrapolated h, its carried friction. With M held from the last
two places where it was computed, and h = h(q, dq; θ),

    δh = (∂h/∂q) δq + (∂h/∂dq) δdq + Φ δθ,      δM⁻¹ = -M⁻¹ (Σ_k ∂M/∂q_k δq_k + ∂M/∂θ δθ) M⁻¹

The matrices are made once for all directions, which lie on the last axis of all arrays here.

What the scheme decides stays as it is: where M⁻¹ is renewed, in how many inner steps, and whether
friction is linear in a step. Where a small change of a parameter would decide otherwise the motion
jumps by an error of the scheme; the tangent does not know of such jumps, and should not.

Tangents of a closed mechanism's h_a and M_a; see ``loop_tangent`` and ``closed_slopes``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pivident.dynamics.closed_chains.closed_dynamics import ClosedModel
from pivident.dynamics.closed_chains.closed_slopes import (
    ClosedSlopes,
    closed_slopes,
    project_columns,
)
from pivident.dynamics.friction_table import OF_POSITION
from pivident.dynamics.lanes import row_array
from pivident.dynamics.path_partials import position_partial
from pivident.dynamics.rigid_body_slopes import inertial_columns
from pivident.foundation.compiled import inlined as _inline, inner, rows
from pivident.loop.simulation.controllers import TAPS
from pivident.loop.simulation.friction_tangent import PATH, constant_torque
from pivident.loop.simulation.integration import (
    FRICTION,
    INVERSE,
    LAST_STEP,
    NOW,
    SINCE,
    V,
    slope_times,
)

# Rows of ``vectors`` of a tangent, shape (TANGENT_ROWS, joints, directions); those of Q, V,
# FRICTION, BIAS and LAST_BIAS are the rows of the simulation itself, the others scratch.
TANGENT_ROWS = 28
(READ,) = rows(8)  # what the law reads
(STILL_TANGENT,) = rows(23)  # zeros

# Scratch rows of the simulation's ``vectors``, free between the steps.
_JUMP, _BRAKED = rows(9, 10)

#: Layers of ``matrices``: δM⁻¹ where it was renewed, its rate, and that of the middle.
RENEWED_TANGENT, CHANGE_TANGENT, MIDDLE_TANGENT = rows(0, 1, 2)
MATRIX_LAYERS = 3

#: Rows of ``times``: change of the drive's delay, of the time since M⁻¹ was renewed, of the lengths
#: of the last step and of this one.
DELAY, SINCE_TANGENT, LAST_TANGENT, LENGTH, TIMES = 0, 1, 2, 3, 4

#: Rows of ``before``: speeds, friction and slopes at the start of the step; entries of ``clock``,
#: the last one 1 where a direction is the drive's delay.
SPEED_BEFORE, FRICTION_BEFORE, SLOPE_BEFORE, BEFORE = 0, 1, 2, 3
SINCE_BEFORE, LAST_STEP_BEFORE, DELAYED, CLOCK_ENTRIES = 0, 1, 2, 3

#: Columns of ``law_slope``: B, A and W, then K_i, drive gain and the share of the known inputs.
OF_FEEDBACK, OF_POLE, OF_INTEGRAND = 0, TAPS, 2 * TAPS
OF_INTEGRAL_GAIN, OF_DRIVE_GAIN, OF_INPUTS, LAW_SLOPES = 9, 10, 11, 12

#: In ``law_index``: a parameter that does not change the reference.
NO_REFERENCE = -1


class LoopTangent(NamedTuple):
    """Tangents of a simulated loop, the directions on the last axis, and what they depend on."""

    vectors: np.ndarray  # (TANGENT_ROWS, joints, directions)
    matrices: np.ndarray  # lower triangles, (MATRIX_LAYERS, joints, joints, directions)
    #: Of the friction slopes now, ahead and midway, then of the coupled viscous parameters, then of
    #: the stiffnesses, shape (3, 2 joints + 2 couplings, directions).
    slopes: np.ndarray
    path: np.ndarray  # of the states of friction, (PATH_ROWS, entries, directions)
    times: np.ndarray  # (TIMES, directions)
    commanded: np.ndarray  # (samples of delay + 2, joints, directions)
    integral: np.ndarray  # (joints, directions)
    past: np.ndarray  # (TAPS, joints, directions)
    passed: np.ndarray  # see ``law_columns``, (joints, 3)
    encoder: np.ndarray  # of what the law reads beside the position, (joints, directions)
    #: Joint and direction of a parameter of the law, and rows of ``law_reference`` of r and of w,
    #: (entries, 4).
    law_index: np.ndarray
    law_slope: np.ndarray  # (entries, LAW_SLOPES)
    law_reference: np.ndarray  # slopes of r or w, (rows, samples)
    inertial: np.ndarray  # link, stem and direction of inertial parameters, (entries, 3)
    rotor: np.ndarray  # joints i ≥ j and direction of rotor inertias, (entries, 3)
    rotor_slope: np.ndarray  # (entries,)
    #: Joint or coupling, table, row, column and direction of constants of friction, (entries, 5).
    friction: np.ndarray
    friction_slope: np.ndarray  # (entries,)
    before: np.ndarray  # see above, (BEFORE, joints + couplings)
    clock: np.ndarray  # (CLOCK_ENTRIES,)
    bends: np.ndarray  # ∂²f/∂v² of joints and couplings, (joints + couplings,)
    #: Derivatives by the constants themselves, zero where there is none: of the law, see
    #: ``law_columns``, of h, (joints, directions), of M, (joints, joints, directions), and of
    #: friction, see ``friction_columns``.
    law_columns: np.ndarray
    torque_columns: np.ndarray
    mass_columns: np.ndarray
    friction_columns: np.ndarray
    block: np.ndarray  # scratch of a block of directions, (BLOCK_ROWS, joints, LANES)
    matrix_block: np.ndarray  # likewise, (BLOCK_LAYERS, joints, joints, LANES)
    by_position: np.ndarray  # ∂h/∂q, (joints, joints)
    by_speed: np.ndarray  # ∂h/∂dq, (joints, joints)
    of_mass: np.ndarray  # ∂M/∂q, (joints, joints, joints)
    weight_slope: np.ndarray  # ∂g/∂q of the law's gravity, (joints, joints)
    links: np.ndarray  # scratch of ``rigid_body_slopes``, (tree joints, LINK)
    body: np.ndarray  # likewise, (2 tree joints, 10)
    loops: ClosedTangent | None  # of a mechanism with closed loops
    partials: np.ndarray  # scratch of ``path_partials``
    path_copy: np.ndarray  # states of friction before a step, see ``path_tangent``
    vectors_copy: np.ndarray  # likewise of the robot
    slopes_copy: np.ndarray  # and friction slopes
    #: Tangents of positions, speeds and torques at the samples, (3, rows, joints, directions).
    record: np.ndarray


@inner
def switch_tangent(
    pair_index, pair_value, vectors, matrices, slopes, commanded, late, own, of_slopes, times,
    bends,
):  # fmt: skip
    """Tangent along a delay of whole periods, at the instant where torques change.

    The old torque acts longer by δT: δdq = M⁻¹ (τ_old - τ_new) δT. Between samples the delay
    changes the lengths of two steps instead, see ``freeze_tangent``; at whole periods there is no
    step between the torques, and this is the limit.

    ``commanded late``: torques of the last samples, and the row of the one that acts now.
    """
    n, directions = own.shape[1], own.shape[2]
    for i in range(n):
        jump = 0.0
        for j in range(n):
            change = commanded[late + 1, j] - commanded[late, j]
            jump += matrices[INVERSE, i, j] * change
        vectors[_JUMP, i] = jump
        for d in range(directions):
            own[V, i, d] += jump * times[DELAY, d]
            of_slopes[NOW, i, d] += bends[i] * jump * times[DELAY, d]
    slope_times(pair_index, pair_value, slopes, NOW, vectors, _JUMP, _BRAKED)
    for i in range(n):
        for d in range(directions):
            own[FRICTION, i, d] += vectors[_BRAKED, i] * times[DELAY, d]


@_inline
def remember_start(vectors, slopes, clock, before, old):
    """Keep what the simulation overwrites in a step, and the tangents of the step still need."""
    for i in range(vectors.shape[1]):
        before[SPEED_BEFORE, i] = vectors[V, i]
        before[FRICTION_BEFORE, i] = vectors[FRICTION, i]
    for i in range(before.shape[1]):
        before[SLOPE_BEFORE, i] = slopes[NOW, i]
    old[SINCE_BEFORE], old[LAST_STEP_BEFORE] = clock[SINCE], clock[LAST_STEP]


class ClosedTangent(NamedTuple):
    """What the tangents of a closed mechanism need beside its slopes."""

    slopes: ClosedSlopes
    #: Joint, table, row, column and direction of constants of friction of passive joints,
    #: (entries, 5), and their slopes, (entries,).
    friction: np.ndarray
    friction_slope: np.ndarray
    columns: np.ndarray  # ∂u/∂θ, u the torques in all joints, (tree joints, directions)
    masses: np.ndarray  # ∂M/∂θ, (tree joints, tree joints, directions)


def closed_tangent(
    model: ClosedModel, friction: np.ndarray, friction_slope: np.ndarray, directions: int
) -> ClosedTangent:
    """Empty tangents along so many directions."""
    n = model.table.posture.size
    return ClosedTangent(
        closed_slopes(model), friction, friction_slope, row_array(n, directions),
        row_array(n, n, directions),
    )  # fmt: skip


@inner
def parameter_torques(run, tangent, inertial, links, out):
    """∂h_a/∂θ = Nᵀ ∂u/∂θ, added to ``out``, (joints, directions); after ``bias_slopes``."""
    columns, friction = tangent.columns, run.model.friction
    for i in range(columns.shape[0]):
        for d in range(columns.shape[1]):
            columns[i, d] = 0.0
    inertial_columns(run.model.table.tree.parent, inertial, links, columns)
    for e in range(tangent.friction.shape[0]):
        table, row, column = tangent.friction[e, 1], tangent.friction[e, 2], tangent.friction[e, 3]
        if table == PATH:
            joint = friction.path_index[row, 0]
            torque = position_partial(
                friction.path_index,
                friction.path_value,
                row,
                column,
                run.place.q[joint],
                OF_POSITION,
            )
        else:
            joint, torque = constant_torque(
                friction.term_index, friction.term_value, table, row, column, run.place.dq
            )
        columns[joint, tangent.friction[e, 4]] += tangent.friction_slope[e] * torque
    project_columns(run.place.gain, columns, out)
