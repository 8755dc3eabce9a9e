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
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pivident.compiled import inlined as _inline
from pivident.compiled import inner, rows
from pivident.dynamics.closed_chains.closed_slopes import (
    bias_slopes,
    mass_matrix_slopes,
    parameter_masses,
)
from pivident.dynamics.path_partials import spring_partials, spring_slopes
from pivident.dynamics.rigid_body_slopes import (
    inertial_columns,
    inertial_masses,
    mass_slopes,
    move_links,
    place_links,
    torque_slopes,
)
from pivident.simulation.closed_tangent import ClosedTangent, parameter_torques
from pivident.simulation.controllers import TAPS
from pivident.simulation.friction_tangent import PATH, friction_tangent
from pivident.simulation.gravity_compensation import gravity_slopes
from pivident.simulation.integration import (
    BIAS,
    CHANGE,
    FRICTION,
    FRICTION_KNOWN,
    INVERSE,
    LAST_BIAS,
    LAST_STEP,
    NOW,
    RENEWALS,
    SINCE,
    STEPS,
    STILL,
    Q,
    V,
    slope_times,
)
from pivident.simulation.row_sums import add_rows, add_rows_twice

# Rows of ``vectors`` of a tangent, shape (TANGENT_ROWS, joints, directions); those of Q, V,
# FRICTION, BIAS and LAST_BIAS are the rows of the simulation itself, the others scratch.
TANGENT_ROWS = 28
_READ, _U, _GROWTH, _SUM = rows(8, 9, 10, 11)
(STILL_TANGENT,) = rows(23)  # zeros

# Scratch rows of the simulation's ``vectors``, free between the steps.
_JUMP, _BRAKED = rows(9, 10)

#: Layers of ``matrices``: δM⁻¹ where it was renewed, its rate, that of the middle, and scratch.
RENEWED_TANGENT, CHANGE_TANGENT, MIDDLE_TANGENT, _MASS_TANGENT = rows(0, 1, 2, 3)
MATRIX_LAYERS = 4

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
    matrices: np.ndarray  # (MATRIX_LAYERS, joints, joints, directions)
    #: Of the friction slopes now, ahead and midway, then of the coupled viscous parameters, then of
    #: the stiffnesses, shape (3, 2 joints + 2 couplings, directions).
    slopes: np.ndarray
    path: np.ndarray  # of the states of friction, (PATH_ROWS, entries, directions)
    times: np.ndarray  # (TIMES, directions)
    commanded: np.ndarray  # (samples of delay + 2, joints, directions)
    integral: np.ndarray  # (joints, directions)
    past: np.ndarray  # (TAPS, joints, directions)
    passed: np.ndarray  # scratch of ``law_tangent``, (joints, 3)
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
    curvature: np.ndarray  # ∂²f/∂v² of joints and couplings, (joints + couplings,)
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


@_inline
def read_tangent(parent, prismatic, gravity, masses, place, vectors, flat, encoder, slopes):
    """Tangents of what the law reads, and of the gravity that it compensates.

    Counts of the encoder are passed over: in the mean what the law reads changes as the position.
    ``place``: poses of the links as the law reads them; ``flat``: ``vectors`` with joints and
    directions on one axis, so that one loop passes through them, here and below.
    """
    n = vectors.shape[1]
    for c in range(flat.shape[1]):
        flat[_READ, c] = flat[Q, c] + encoder[c]
    if masses.shape[0] > 0:
        gravity_slopes(parent, prismatic, gravity, masses, place, slopes)
        for j in range(n):
            add_rows(
                vectors,
                _SUM * n + j,
                vectors,
                STILL_TANGENT * n,
                1.0,
                n,
                slopes,
                j * n,
                vectors,
                _READ * n,
                1,
            )
    else:
        for c in range(flat.shape[1]):
            flat[_SUM, c] = 0.0


@_inline
def law_tangent(
    feedback, pole, integrand, integral_gain, integrand_reference, past, period, gains, inputs,
    command, k, given, late, passed, vectors, flat, past_tangent, flat_past, integral, commanded,
    flat_commanded, reference, index, slope,
):  # fmt: skip
    """Tangents of the control laws at sample ``k``, after their filters have moved on.

    ``given``: row of ``inputs``; ``command``: limited outputs, shape (joints,); ``passed``: what
    the integrator was given, whether the output is free, and whether the integrator moved, shape
    (joints, 3).
    """
    n, directions, width = vectors.shape[1], vectors.shape[2], flat.shape[1]
    for m in range(late + 1, 0, -1):
        for c in range(width):
            flat_commanded[m, c] = flat_commanded[m - 1, c]
    for j in range(n):
        add_rows(
            vectors,
            _READ * n + j,
            vectors,
            _READ * n + j,
            -1.0,
            TAPS - 1,
            pole,
            j * TAPS + 1,
            past_tangent,
            j,
            n,
        )
    for m in range(TAPS - 1, 0, -1):
        for c in range(width):
            flat_past[m, c] = flat_past[m - 1, c]
    for c in range(width):
        flat_past[0, c] = flat[_READ, c]
        flat[_U, c] = flat[_SUM, c] + integral[c]
    for e in range(index.shape[0]):
        for m in range(1, TAPS):
            j = index[e, 0]
            past_tangent[0, j, index[e, 1]] -= slope[e, OF_POLE + m] * past[j, m]
    integrated = False
    for j in range(n):
        row = _U * n + j
        add_rows(vectors, row, vectors, row, -1.0, TAPS, feedback, j * TAPS, past_tangent, j, n)
        if integral_gain[j] != 0.0:
            integrated = True
    for c in range(width):
        flat[_GROWTH, c] = 0.0
    if integrated:
        for j in range(n):
            row, rate = _GROWTH * n + j, -integral_gain[j] * period
            add_rows(
                vectors, row, vectors, row, rate, TAPS, integrand, j * TAPS, past_tangent, j, n
            )
    for e in range(index.shape[0]):
        j, d = index[e, 0], index[e, 1]
        u = reference[index[e, 2], k] if index[e, 2] >= 0 else 0.0
        summed = reference[index[e, 3], k] if index[e, 3] >= 0 else 0.0
        for m in range(TAPS):
            u -= slope[e, OF_FEEDBACK + m] * past[j, m]
            summed -= slope[e, OF_INTEGRAND + m] * past[j, m]
        vectors[_U, j, d] += u + slope[e, OF_INPUTS] * inputs[given, j]
        vectors[_GROWTH, j, d] += period * (
            integral_gain[j] * summed
            + slope[e, OF_INTEGRAL_GAIN] * (integrand_reference[k, j] - passed[j, 0])
        )
    for j in range(n):
        gain = gains[j] if passed[j, 1] > 0.0 else 0.0
        for d in range(directions):
            commanded[0, j, d] = gain * (vectors[_U, j, d] + vectors[_GROWTH, j, d])
        if passed[j, 2] > 0.0 and integral_gain[j] != 0.0:
            for d in range(directions):
                integral[j * directions + d] += vectors[_GROWTH, j, d]
    for e in range(index.shape[0]):
        j = index[e, 0]
        commanded[0, j, index[e, 1]] += slope[e, OF_DRIVE_GAIN] * command[j]
    if k == 0:
        for m in range(1, late + 2):
            for c in range(width):
                flat_commanded[m, c] = flat_commanded[0, c]


@_inline
def record_tangent(flat, flat_commanded, record, row, which):
    """Keep the tangents at a sample; ``which``: row of the torque that acts in ``commanded``."""
    width = flat.shape[1]
    for c in range(width):
        record[0, row, c] = flat[Q, c]
    for c in range(width):
        record[1, row, c] = flat[V, c]
    for c in range(width):
        record[2, row, c] = flat_commanded[which, c]


@inner
def switch_tangent(
    pair_index, pair_value, vectors, matrices, slopes, commanded, late, own, of_slopes, times,
    curvature,
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
            of_slopes[NOW, i, d] += curvature[i] * jump * times[DELAY, d]
    slope_times(pair_index, pair_value, slopes, NOW, vectors, _JUMP, _BRAKED)
    for i in range(n):
        for d in range(directions):
            own[FRICTION, i, d] += vectors[_BRAKED, i] * times[DELAY, d]


@_inline
def evaluate_tangent(
    parent, prismatic, gravity, inertia, term_index, term_value, pair_index, pair_value,
    path_index, path_value, vectors, matrices, slopes, clock, pose,
    own, flat, layers, flat_layers, times, of_slopes, constants, constant_slope, inertial, rotor,
    rotor_slope, before, old, curvature, by_position, by_speed, of_mass, links, body, closed, loops,
):  # fmt: skip
    """Tangents of h, of M⁻¹ where it was renewed, of friction where it was computed anew.

    To be called after ``integration.evaluate``, whose arguments are the first ones; the others are
    those of ``LoopTangent``; ``closed``: as there, and None as ``loops`` without closed loops.
    """
    n = own.shape[1]
    if closed is None:  # decided by its type, here and below
        place_links(parent, prismatic, pose, inertia, links, body)
        move_links(parent, gravity, vectors[V], vectors[STILL], links, body)
        torque_slopes(parent, gravity, links, body, by_position, by_speed)
    else:
        bias_slopes(closed, loops.slopes, links, body, by_position, by_speed)
    if path_index is not None:  # decided by its type, here and below
        spring_slopes(path_index, path_value, vectors, Q, by_position)
    for c in range(flat.shape[1]):
        flat[LAST_BIAS, c] = flat[BIAS, c]
    for i in range(n):
        add_rows_twice(
            own, BIAS * n + i, own, STILL_TANGENT * n, 1.0, n,
            by_position, i * n, own, Q * n, 1, by_speed, i * n, own, V * n, 1,
        )  # fmt: skip
    if closed is None:
        inertial_columns(parent, inertial, links, own[BIAS])
    else:
        parameter_torques(closed, loops, inertial, links, own[BIAS])
    if path_index is not None:
        for e in range(constants.shape[0]):
            if constants[e, 1] == PATH:
                k = constants[e, 2]
                j = path_index[k, 0]
                own[BIAS, j, constants[e, 4]] += constant_slope[e] * spring_partials(
                    path_index, path_value, k, constants[e, 3], vectors[Q, j]
                )
    if clock[STEPS] == 0.0:
        _renew(
            parent, matrices, clock, own, layers, flat_layers, times, inertial, rotor, rotor_slope,
            old, of_mass, links, body, closed, loops,
        )  # fmt: skip
    if path_index is None and clock[FRICTION_KNOWN] == 0.0:
        friction_tangent(
            term_index, term_value, pair_index, pair_value, constants, constant_slope,
            vectors, V, slopes, NOW, own, V, FRICTION, of_slopes, NOW, curvature,
        )  # fmt: skip
    for i in range(n):
        before[SPEED_BEFORE, i] = vectors[V, i]
        before[FRICTION_BEFORE, i] = vectors[FRICTION, i]
    for i in range(before.shape[1]):
        before[SLOPE_BEFORE, i] = slopes[NOW, i]
    old[SINCE_BEFORE], old[LAST_STEP_BEFORE] = clock[SINCE], clock[LAST_STEP]


@inner
def _renew(
    parent, matrices, clock, vectors, own, flat, times, inertial, rotor, rotor_slope, old, of_mass,
    links, body, closed, loops,
):  # fmt: skip
    """Tangents of M⁻¹ and of its rate where the simulation has computed M⁻¹ anew."""
    n, directions = vectors.shape[1], vectors.shape[2]
    mass, middle = _MASS_TANGENT * n * n, MIDDLE_TANGENT * n * n  # rows before their first ones
    if closed is None:
        mass_slopes(parent, links, body, of_mass)
    else:
        mass_matrix_slopes(closed, loops.slopes, links, body, of_mass)
    for j in range(n):
        for i in range(j + 1):
            add_rows(
                own,
                mass + j * n + i,
                vectors,
                STILL_TANGENT * n,
                1.0,
                n,
                of_mass,
                (j * n + i) * n,
                vectors,
                Q * n,
                1,
            )
    if closed is None:
        inertial_masses(parent, inertial, links, own[_MASS_TANGENT])
    else:
        parameter_masses(closed, inertial, links, loops.masses, own[_MASS_TANGENT])
    for e in range(rotor.shape[0]):
        own[_MASS_TANGENT, rotor[e, 0], rotor[e, 1], rotor[e, 2]] += rotor_slope[e]
    for j in range(n):
        for i in range(j):
            for d in range(directions):
                own[_MASS_TANGENT, i, j, d] = own[_MASS_TANGENT, j, i, d]
    # the first factor of M⁻¹ δM M⁻¹ into the layer of the middle, which is made anew in each step
    for i in range(n):
        for j in range(n):
            add_rows(
                own,
                middle + i * n + j,
                vectors,
                STILL_TANGENT * n,
                1.0,
                n,
                matrices,
                (INVERSE * n + i) * n,
                own,
                mass + j,
                n,
            )
    for i in range(n):
        for j in range(n):
            add_rows(
                own,
                mass + i * n + j,
                vectors,
                STILL_TANGENT * n,
                -1.0,
                n,
                matrices,
                (INVERSE * n + j) * n,
                own,
                middle + i * n,
                1,
            )
    since = old[SINCE_BEFORE] + clock[LAST_STEP]
    if clock[RENEWALS] > 1.0 and since > 0.0:
        rate = 1.0 / since
        for c in range(flat.shape[1]):
            flat[CHANGE_TANGENT, c] = rate * (flat[_MASS_TANGENT, c] - flat[RENEWED_TANGENT, c])
        if old[DELAYED] != 0.0:
            for i in range(n):
                for j in range(n):
                    change = rate * matrices[CHANGE, i, j]
                    for d in range(directions):
                        own[CHANGE_TANGENT, i, j, d] -= change * times[SINCE_TANGENT, d]
    for c in range(flat.shape[1]):
        flat[RENEWED_TANGENT, c] = flat[_MASS_TANGENT, c]
    for d in range(directions):
        times[SINCE_TANGENT, d] = 0.0
