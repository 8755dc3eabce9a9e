"""One sampling period of the robot under a held torque.

Rigid-body terms change slowly over a sampling period, friction near standstill does not: the
slope 2/π γ fc over a wrist's inertia gives rates of 27,000 1/s, five per period at 5 kHz. So the
rigid body is frozen at the middle of the step,

    M⁻¹ ≈ M_k⁻¹ + ΔM⁻¹/2,     h ≈ h_k + (h_k - h_{k-1})/2

(M⁻¹ is renewed when a joint has moved ``RENEWAL`` since, and extrapolated linearly in between),
and dv/dt = M⁻¹ (τ - h - f(v)) is integrated inside the step:

*linear step*, almost always: with D = df/dv at v_k the linear equation dy/dt = a_k - M⁻¹ D y is
integrated by its fourth-order Taylor polynomial, in as many inner steps as ‖M⁻¹D‖h asks for. What
the linearisation misses, r = f(v_{k+1}) - f(v_k) - D y, grows like t² and is corrected by its
integral, (h/3) M⁻¹ r. f(v_{k+1}) serves the next step too.

*nonlinear step*, while a joint passes through standstill (r not small): Runge–Kutta 4 on the
friction itself, in inner steps as short as its stiffness at any stage asks for, and that of a
smoothed sign which a whole step may pass over.

Runge–Kutta 4 on the full dynamics is there as the oracle that this scheme is measured against.
"""

from __future__ import annotations

import numpy as np

from pivident.dynamics.closed_chains.closed_dynamics import closed_bias, closed_mass
from pivident.dynamics.friction_table import (
    AHEAD,
    MIDWAY,
    RATE,
    SPRINGS,
    STATE,
    accept_states,
    friction_torque,
    path_torque,
    position_torque,
)
from pivident.dynamics.kernels import (
    bias_torque,
    composite_mass_matrix,
    invert_mass_matrix,
    link_poses,
)
from pivident.foundation.compiled import inlined as _inline, inner, rows, section

#: Largest ‖M⁻¹D‖·h of an inner step: of the linear one (its polynomial is stable to 2.8) …
STIFFNESS_PER_STEP = 1.0

#: … and of the nonlinear one, where the slope D changes on the way. With 1.0 a single passage
#: through standstill cost the wrist up to 15 rad/s² for one sample.
NONLINEAR_STIFFNESS = 0.3

#: Largest ‖M⁻¹D‖·h at standstill of a smoothed sign that a nonlinear step may pass over: more is
#: beyond what Runge–Kutta 4 is stable for (2.8), and its stages may see none of the sign.
PASSED_OVER = 2.8

#: Most inner steps. What needs more has a mass matrix next to singular; it may diverge instead.
MAX_INNER_STEPS = 5000

#: Motion of any joint after which M⁻¹ is computed anew [rad or m].
RENEWAL = 2e-3

#: Steps after which it is computed anew in any case: extrapolation goes on when the robot stops.
RENEWAL_STEPS = 8.0

#: Friction that the linearisation may miss over a step, relative to the joint's friction level.
LINEAR_REMAINDER = 2e-4

# The state of a simulated robot is a handful of arrays, not an object: numba counts references of
# every array in a tuple at every call, which took two thirds of the simulation's time.
# Rows of ``vectors``, shape (ROWS, joints):
Q, V, DDQ = rows(0, 1, 2)  # positions, speeds, accelerations right after the torque was applied
FRICTION, LEVEL = rows(3, 4)  # friction torque at V, largest dry friction (for tolerances)
BIAS, LAST_BIAS, MIDDLE_BIAS = rows(5, 6, 7)  # h now, one step before, extrapolated to the middle
(RENEWED_AT,) = rows(8)  # positions at which M⁻¹ was computed last
_A0, _A, _Y, _X, _Z, _W, _AHEAD, _REST = rows(9, 10, 11, 12, 13, 14, 15, 16)
(STILL,) = rows(17)  # no travel
ROWS = 26  # more scratch, see ``path_integration`` and ``step_tangent``
_Z0, _DZ = MIDWAY, MIDWAY + 1  # rows of ``path``, where the oracle keeps states meanwhile
# Rows of ``slopes``: at the start of the step, at its end, of a robot at rest.
NOW, THEN, AT_REST = rows(0, 1, 3)
# Layers of ``matrices``, shape (LAYERS, joints, joints):
INVERSE, CHANGE, RENEWED, MIDDLE, MASS, FACTOR = rows(0, 1, 2, 3, 4, 5)  # M⁻¹, its rate, …
LAYERS = 6
# Entries of ``clock``: time since M⁻¹ was computed, how often it was, whether FRICTION is valid,
# steps since M⁻¹ was computed, length of the last step.
SINCE, RENEWALS, FRICTION_KNOWN, STEPS, LAST_STEP = 0, 1, 2, 3, 4
CLOCKS = 5


@_inline
def apply_matrix(matrices, layer, vectors, torque, bias, friction, out):
    """Out = matrix (torque - bias - friction), matrix symmetric."""
    n = torque.size
    for i in range(n):
        vectors[out, i] = 0.0
    for j in range(n):
        net = torque[j] - vectors[bias, j] - vectors[friction, j]
        for i in range(n):
            vectors[out, i] += matrices[layer, j, i] * net


@_inline
def _has_moved(vectors, clock):
    """Whether M⁻¹ must be computed anew."""
    if clock[RENEWALS] < 2.0 or clock[STEPS] >= RENEWAL_STEPS:
        return True
    for i in range(vectors.shape[1]):
        if abs(vectors[Q, i] - vectors[RENEWED_AT, i]) > RENEWAL:
            return True
    return False


@section
def evaluate(
    parent, prismatic, rotation, translation, gravity, inertia, rotor,
    linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
    vectors, matrices, slopes, clock, pose, motion, force, composite, torque, exact, closed,
):  # fmt: skip
    """Rigid body, friction and acceleration at the present state under ``torque``.

    Returns -1, the joint at which M(q) is indefinite, or below -1 a `closure_kernels` status
    subtracted from -1.

    ``inertia``: ten inertial parameters of every link, shape (joints, 10); ``rotor``: rotor
    inertias, shape (joints, joints); ``path_index``: terms of position, path and load, or None;
    ``path_value``: their values, or None; ``path``: states of friction, see ``friction_table``, or
    None; ``slopes``: friction slopes at V and scratch, shape (4, joints + couplings) or wider;
    ``torque``: held joint torques, shape (joints,); ``closed``: the loops of a
    mechanism, a ``ClosedRun``, or None.
    """
    n = torque.size
    for i in range(n):
        vectors[LAST_BIAS, i] = vectors[BIAS, i]
    if closed is None:  # decided by its type, too: trees are compiled without
        link_poses(prismatic, rotation, translation, vectors[Q], pose)
        bias_torque(
            parent, prismatic, gravity, pose, inertia, vectors[V], None, motion, force,
            vectors[BIAS],
        )  # fmt: skip
    else:
        status = closed_bias(closed, vectors[Q], vectors[V], vectors[BIAS])
        if status > 0:
            return -1 - status
    if path is not None:  # decided by its type: laws of speed alone are compiled without
        position_torque(path_index, path_value, vectors, Q, BIAS, SPRINGS)
    if exact or _has_moved(vectors, clock):
        if closed is None:
            composite_mass_matrix(
                parent, prismatic, pose, inertia, rotor, composite, matrices[MASS]
            )
        else:
            closed_mass(closed, rotor, matrices[MASS])
        joint = invert_mass_matrix(matrices[MASS], matrices[FACTOR], matrices[INVERSE])
        if joint >= 0:
            return joint
        known = clock[RENEWALS] > 0.0 and clock[SINCE] > 0.0
        for i in range(n):
            vectors[RENEWED_AT, i] = vectors[Q, i]
            for j in range(n):
                fresh = matrices[INVERSE, i, j]
                if known:
                    matrices[CHANGE, i, j] = (fresh - matrices[RENEWED, i, j]) / clock[SINCE]
                matrices[RENEWED, i, j] = fresh
        clock[SINCE] = 0.0
        clock[STEPS] = 0.0
        clock[RENEWALS] += 1.0
    else:
        for i in range(n):
            for j in range(n):
                matrices[INVERSE, i, j] = (
                    matrices[RENEWED, i, j] + clock[SINCE] * matrices[CHANGE, i, j]
                )
    if exact or clock[FRICTION_KNOWN] == 0.0:
        friction_torque(
            linear,
            term_index,
            term_value,
            pair_index,
            pair_value,
            vectors,
            V,
            FRICTION,
            slopes,
            NOW,
        )
        if path is not None:
            path_torque(
                path_index, path_value, path, AHEAD, pair_index.shape[0], torque,
                vectors, Q, V, 0.0, STILL, V, FRICTION, slopes, NOW,
            )  # fmt: skip
            accept_states(path)
    apply_matrix(matrices, INVERSE, vectors, torque, BIAS, FRICTION, DDQ)
    return -1


@_inline
def damping_rate(pair_index, pair_value, matrices, slopes, row):
    """Upper bound of the largest eigenvalue of M⁻¹ D, D the friction's slope matrix: its trace."""
    n = matrices.shape[1]
    total = 0.0
    for i in range(n):
        total += matrices[MIDDLE, i, i] * slopes[row, i]
    for k in range(pair_index.shape[0]):
        i, j, ratio = pair_index[k, 0], pair_index[k, 1], pair_value[k, 0]
        cross = 2.0 * ratio * matrices[MIDDLE, i, j]
        total += cross * pair_value[k, 1] + slopes[row, n + k] * (
            matrices[MIDDLE, i, i] + cross + ratio * ratio * matrices[MIDDLE, j, j]
        )
    return total


@_inline
def rate_at_reversals(pair_index, pair_value, matrices, slopes, vectors, start, speed):
    """Bound of ‖M⁻¹D‖ [1/s] that joints and rotors pass which turn on the way between two rows.

    A whole smoothed sign may lie between two stages of a step and be seen by none of them.
    """
    n, total = matrices.shape[1], 0.0
    for i in range(n):
        if vectors[start, i] * vectors[speed, i] < 0.0:
            total += matrices[MIDDLE, i, i] * slopes[AT_REST, i]
    for k in range(pair_index.shape[0]):
        i, j, ratio = pair_index[k, 0], pair_index[k, 1], pair_value[k, 0]
        before = vectors[start, i] + ratio * vectors[start, j]
        if before * (vectors[speed, i] + ratio * vectors[speed, j]) < 0.0:
            total += slopes[AT_REST, n + k] * (
                matrices[MIDDLE, i, i]
                + 2.0 * ratio * matrices[MIDDLE, i, j]
                + ratio * ratio * matrices[MIDDLE, j, j]
            )
    return total


@_inline
def slope_times(pair_index, pair_value, slopes, row, vectors, y, out):
    """Out = D y."""
    n = vectors.shape[1]
    for i in range(n):
        vectors[out, i] = slopes[row, i] * vectors[y, i]
    for k in range(pair_index.shape[0]):
        i, j = pair_index[k, 0], pair_index[k, 1]
        ratio, viscous = pair_value[k, 0], pair_value[k, 1]
        common = slopes[row, n + k] * (vectors[y, i] + ratio * vectors[y, j])
        vectors[out, i] += common + ratio * viscous * vectors[y, j]
        vectors[out, j] += ratio * (common + viscous * vectors[y, i])


@_inline
def subtract_product(matrices, vectors, x, scale, base, out):
    """Out = base - scale · M⁻¹ x, M⁻¹ that of the middle."""
    n = vectors.shape[1]
    for i in range(n):
        vectors[out, i] = vectors[base, i]
    for j in range(n):
        factor = scale * vectors[x, j]
        for i in range(n):
            vectors[out, i] -= matrices[MIDDLE, j, i] * factor


@section
def freeze_at_middle(vectors, matrices, clock, h):
    """Extrapolate h and M⁻¹ to the middle of the step of length ``h`` [s]."""
    n = vectors.shape[1]
    weight = 0.0 if clock[RENEWALS] < 2.0 else 0.5 * (h / clock[LAST_STEP])
    for i in range(n):
        vectors[MIDDLE_BIAS, i] = vectors[BIAS, i] + weight * (
            vectors[BIAS, i] - vectors[LAST_BIAS, i]
        )
        for j in range(n):
            matrices[MIDDLE, i, j] = matrices[INVERSE, i, j] + 0.5 * h * matrices[CHANGE, i, j]
    clock[SINCE] += h
    clock[STEPS] += 1.0
    clock[LAST_STEP] = h


@section
def advance(
    linear, term_index, term_value, pair_index, pair_value,
    vectors, matrices, slopes, clock, torque, h,
):  # fmt: skip
    """Integrate one step of length ``h`` [s] with the rigid body frozen at the step's middle.

    The state must come from ``evaluate``; the arguments are described there.
    """
    n = torque.size
    freeze_at_middle(vectors, matrices, clock, h)
    apply_matrix(matrices, MIDDLE, vectors, torque, MIDDLE_BIAS, FRICTION, _A0)
    _linear_step(pair_index, pair_value, vectors, matrices, slopes, h)
    slope_times(pair_index, pair_value, slopes, NOW, vectors, _Y, _Z)
    for i in range(n):
        vectors[_AHEAD, i] = vectors[V, i] + vectors[_Y, i]
    friction_torque(
        linear, term_index, term_value, pair_index, pair_value, vectors, _AHEAD, _REST, slopes, THEN
    )
    small = True
    for i in range(n):
        vectors[_REST, i] -= vectors[FRICTION, i] + vectors[_Z, i]
        if not abs(vectors[_REST, i]) <= LINEAR_REMAINDER * vectors[LEVEL, i]:
            small = False
    if not small:
        _nonlinear_step(
            linear, term_index, term_value, pair_index, pair_value,
            vectors, matrices, slopes, torque, h,
        )  # fmt: skip
        clock[FRICTION_KNOWN] = 0.0
        return
    subtract_product(matrices, vectors, _REST, h / 3.0, _AHEAD, V)
    for i in range(n):
        vectors[FRICTION, i] += vectors[_Z, i] + vectors[_REST, i]
        vectors[_A, i] = vectors[V, i] - vectors[_AHEAD, i]
        vectors[Q, i] += vectors[_X, i] + 0.25 * h * vectors[_A, i]
    # f was taken at the uncorrected speed: carried on by its slope there
    slope_times(pair_index, pair_value, slopes, THEN, vectors, _A, _Z)
    for i in range(n):
        vectors[FRICTION, i] += vectors[_Z, i]
    for k in range(slopes.shape[1]):
        slopes[0, k] = slopes[1, k]
    clock[FRICTION_KNOWN] = 1.0


@section
def _linear_step(pair_index, pair_value, vectors, matrices, slopes, h):
    """Change of speed _Y and of position _X from dy/dt = a - M⁻¹ D y, over ``h`` [s].

    Taylor polynomial of fourth order by Horner's rule, with K = M⁻¹ D:
    y(s) = s (1 - sK/2 (1 - sK/3 (1 - sK/4))) a.
    """
    n = vectors.shape[1]
    stiffness = damping_rate(pair_index, pair_value, matrices, slopes, NOW)
    count = int(np.ceil(min(max(stiffness * h / STIFFNESS_PER_STEP, 1e-3), MAX_INNER_STEPS)))
    step = h / count
    for i in range(n):
        vectors[_Y, i], vectors[_X, i], vectors[_A, i] = 0.0, 0.0, vectors[_A0, i]
    for s in range(count):
        for i in range(n):
            vectors[_W, i] = vectors[_A, i]
        for order in range(4, 1, -1):
            slope_times(pair_index, pair_value, slopes, NOW, vectors, _W, _Z)
            subtract_product(matrices, vectors, _Z, step / order, _A, _W)
            if order == 3:
                for i in range(n):
                    vectors[_X, i] += step * (
                        vectors[V, i] + vectors[_Y, i] + 0.5 * step * vectors[_W, i]
                    )
        for i in range(n):
            vectors[_Y, i] += step * vectors[_W, i]
        if s < count - 1:
            slope_times(pair_index, pair_value, slopes, NOW, vectors, _Y, _Z)
            subtract_product(matrices, vectors, _Z, 1.0, _A0, _A)


@section
def _nonlinear_step(
    linear, term_index, term_value, pair_index, pair_value, vectors, matrices, slopes, torque, h
):
    """One step by Runge–Kutta 4 on the friction, rigid body frozen as prepared by ``advance``.

    Friction may be much stiffer ahead than here, where a joint is about to stand still; so the
    stiffness is looked at again at every stage, and the inner step is shortened if it is too long.
    """
    n = torque.size
    k1, k2, k3, k4, trial, f = _A0, _A, _Y, _X, _Z, _W
    left, shortest = h, h / MAX_INNER_STEPS
    while left > 1e-9 * h:
        friction_torque(
            linear, term_index, term_value, pair_index, pair_value, vectors, V, f, slopes, THEN
        )
        stiffness = damping_rate(pair_index, pair_value, matrices, slopes, THEN)
        step = left / np.ceil(max(stiffness * left / NONLINEAR_STIFFNESS, 1e-3))
        step = min(max(step, shortest), left)
        apply_matrix(matrices, MIDDLE, vectors, torque, MIDDLE_BIAS, f, k1)
        stage = 1
        while stage < 4:
            last = k1 if stage == 1 else (k2 if stage == 2 else k3)
            weight = 1.0 if stage == 3 else 0.5
            for i in range(n):
                vectors[trial, i] = vectors[V, i] + weight * step * vectors[last, i]
            friction_torque(
                linear,
                term_index,
                term_value,
                pair_index,
                pair_value,
                vectors,
                trial,
                f,
                slopes,
                THEN,
            )
            ahead = damping_rate(pair_index, pair_value, matrices, slopes, THEN)
            turning = rate_at_reversals(pair_index, pair_value, matrices, slopes, vectors, V, trial)
            if turning * step > PASSED_OVER:
                ahead = max(ahead, turning)
            if ahead * step > 1.5 * NONLINEAR_STIFFNESS and step > shortest:
                step = max(NONLINEAR_STIFFNESS / ahead, shortest)
                stage = 1
                continue
            target = k2 if stage == 1 else (k3 if stage == 2 else k4)
            apply_matrix(matrices, MIDDLE, vectors, torque, MIDDLE_BIAS, f, target)
            stage += 1
        for i in range(n):
            inner = vectors[k2, i] + vectors[k3, i]
            vectors[Q, i] += step * (vectors[V, i] + step / 6.0 * (vectors[k1, i] + inner))
            vectors[V, i] += step / 6.0 * (vectors[k1, i] + 2.0 * inner + vectors[k4, i])
        left -= step


@inner
def advance_runge_kutta(
    parent, prismatic, rotation, translation, gravity, inertia, rotor,
    linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
    vectors, matrices, slopes, clock, pose, motion, force, composite, torque, h, substeps, closed,
):  # fmt: skip
    """Integrate one step by classical Runge–Kutta on the full dynamics, the oracle."""
    n = torque.size
    step = h / substeps
    q0, v0, dq, dv = _A0, _A, _Y, _X
    for _ in range(substeps):
        for i in range(n):
            vectors[q0, i], vectors[v0, i] = vectors[Q, i], vectors[V, i]
            vectors[dq, i], vectors[dv, i] = 0.0, 0.0
        for stage in range(4):
            joint = evaluate(
                parent, prismatic, rotation, translation, gravity, inertia, rotor,
                linear, term_index, term_value, pair_index, pair_value,
                path_index, path_value, path,
                vectors, matrices, slopes, clock, pose, motion, force, composite, torque, True,
                closed,
            )  # fmt: skip
            if joint != -1:
                return joint
            weight = 2.0 if stage in (1, 2) else 1.0
            ahead = step if stage == 2 else 0.5 * step
            if path is not None:
                _advance_states(path_index, path, vectors, stage, weight, ahead)
            for i in range(n):
                vectors[dq, i] += weight * vectors[V, i]
                vectors[dv, i] += weight * vectors[DDQ, i]
                vectors[Q, i] = vectors[q0, i] + ahead * vectors[V, i]
                vectors[V, i] = vectors[v0, i] + ahead * vectors[DDQ, i]
        for i in range(n):
            vectors[Q, i] = vectors[q0, i] + step / 6.0 * vectors[dq, i]
            vectors[V, i] = vectors[v0, i] + step / 6.0 * vectors[dv, i]
        if path is not None:
            for k in range(path.shape[1]):
                path[STATE, k] = path[_Z0, k] + step / 6.0 * path[_DZ, k]
    return -1


@_inline
def _advance_states(path_index, path, vectors, stage, weight, ahead):
    """One stage for the states of friction: their differential equation, dz/dt = v dz/dx."""
    for k in range(path.shape[1]):
        if stage == 0:
            path[_Z0, k], path[_DZ, k] = path[STATE, k], 0.0
        rate = path[RATE, k] * vectors[V, path_index[k, 0]]
        path[_DZ, k] += weight * rate
        path[STATE, k] = path[_Z0, k] + ahead * rate
