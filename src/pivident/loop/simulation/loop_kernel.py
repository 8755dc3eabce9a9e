"""The compiled loop: discrete control law and robot, sample by sample."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pivident.dynamics.closed_chains.closed_dynamics import ClosedRun, closed_run
from pivident.dynamics.closed_chains.closed_motion import closed_place
from pivident.dynamics.forward import Model
from pivident.dynamics.friction_table import (
    PATH_ROWS,
    STATE,
    FrictionTable,
    dry_friction_level,
    friction_torque,
    slopes_width,
)
from pivident.foundation.compiled import kernel
from pivident.loop.simulation.controllers import TAPS, SampledLaw
from pivident.loop.simulation.friction_tangent import friction_tangent
from pivident.loop.simulation.gravity_compensation import PLACE, gravity_torques
from pivident.loop.simulation.integration import (
    AT_REST,
    CLOCKS,
    DDQ,
    FACTOR,
    FRICTION,
    FRICTION_KNOWN,
    LAYERS,
    LEVEL,
    MIDDLE_BIAS,
    NOW,
    ROWS,
    STEPS,
    Q,
    V,
    advance,
    advance_runge_kutta,
    evaluate,
)
from pivident.loop.simulation.linear_law import law_columns, law_tangent, record_tangent
from pivident.loop.simulation.loop_tangent import DELAYED, remember_start, switch_tangent
from pivident.loop.simulation.nonlinear_tangent import nonlinear_tangent
from pivident.loop.simulation.path_friction_tangent import copy_state
from pivident.loop.simulation.path_integration import SLOPE_ROWS, advance_on_path
from pivident.loop.simulation.path_tangent import path_step_tangent
from pivident.loop.simulation.rigid_body_tangent import bias_tangent, renew_tangent
from pivident.loop.simulation.step_tangent import (
    freeze_tangent,
    length_tangent,
    linear_tangent,
)
from pivident.robot.friction_terms import friction_columns

#: What may happen: nothing, M(q) is indefinite, a joint is too far off, a joint is too fast, a
#: mechanism cannot be closed or is singular (its status stands in for the joint, and the
#: sample's positions are where it happened).
DONE, INDEFINITE, TOO_FAR, TOO_FAST, NOT_CLOSED = 0, 1, 2, 3, 4

# Rows of ``limits``: joint torque per controller output, largest output, largest distance from the
# reference, largest speed, and what the law's encoder counts in, zero for no counts.
GAIN, OUTPUT, DISTANCE, SPEED, COUNT, LIMITS = 0, 1, 2, 3, 4, 5

# Layers of ``channels``: positions, speeds, accelerations right after the new torque was applied,
# torques, limited outputs of the law.
_Q, _DQ, _DDQ, TORQUE, _COMMAND, CHANNELS = 0, 1, 2, 3, 4, 5


class LoopState(NamedTuple):
    """State and scratch of a simulated loop."""

    vectors: np.ndarray  # state of the robot and more, see ``integration``; likewise the next three
    matrices: np.ndarray  # mass matrices
    slopes: np.ndarray  # friction slopes
    path: np.ndarray  # states of friction, shape (PATH_ROWS, entries); may have no entries
    clock: np.ndarray  # how old M⁻¹ is
    pose: np.ndarray  # scratch of the rigid body; likewise the next three
    motion: np.ndarray  # scratch
    force: np.ndarray  # scratch
    composite: np.ndarray  # scratch
    torque: np.ndarray  # joint torques that act, shape (joints,)
    #: Torques of the last samples, the newest first, for drives that answer late, shape
    #: (samples of delay + 2, joints).
    commanded: np.ndarray
    integral: np.ndarray  # I of the control law, shape (joints,)
    past: np.ndarray  # inner state of B/A and W/A in direct form II, shape (joints, TAPS)
    place: np.ndarray  # scratch of the law's gravity model, shape (joints, PLACE)
    measured: np.ndarray  # positions that the law reads, shape (joints,)
    weight: np.ndarray  # gravity that it compensates, shape (joints,); zero where it does not


def initial_state(
    model: Model, law: SampledLaw, q: np.ndarray, dq: np.ndarray, late: int = 0
) -> LoopState:
    """A loop at positions ``q`` with speeds ``dq``, shape (joints,), whose law has been at rest."""
    n, friction = len(model.rotor), model.friction
    couplings, entries = len(friction.pair_index), len(friction.path_index)
    state = LoopState(
        vectors=np.zeros((ROWS, n)),
        matrices=np.zeros((LAYERS, n, n)),
        slopes=np.zeros((SLOPE_ROWS, slopes_width(n, couplings))),
        path=np.zeros((PATH_ROWS, entries)),
        clock=np.zeros(CLOCKS),
        pose=np.zeros((n, 12)),
        motion=np.zeros((n, 9)),
        force=np.zeros((n, 6)),
        composite=np.zeros((n, 10)),
        torque=np.zeros(n),
        commanded=np.zeros((late + 2, n)),
        integral=np.zeros(n),
        past=np.zeros((n, TAPS)),
        place=np.zeros((n, PLACE)),
        measured=np.zeros(n),
        weight=np.zeros(n),
    )
    friction_torque(*friction[:5], state.vectors, V, FRICTION, state.slopes, AT_REST)
    state.vectors[Q], state.vectors[V] = q, dq
    state.vectors[LEVEL] = dry_friction_level(friction, n)
    # the filters hold their stationary state
    total = law.pole.sum(axis=1)
    state.past[:] = np.divide(q, total, out=np.zeros(n), where=total != 0.0)[:, None]
    return state


def loops_of(model: Model, q: np.ndarray) -> ClosedRun | None:
    """The last argument of ``run_loop`` at positions ``q``, shape (joints,); None without loops.

    Raises:
        LoopNotClosed: they do not close there.
    """
    return (
        None
        if model.closed is None
        else closed_run(model.closed, closed_place(model.closed.table, q))
    )


def is_on_path(friction: FrictionTable) -> bool:
    """Whether friction is integrated by the scheme of ``path_integration``.

    Powers of the speed and one-sided viscous friction have the kinks that it looks out for, too.
    """
    kinked = [int(column) for column in friction_columns().values() if column.kinked]
    return bool(len(friction.path_index) or np.isin(friction.term_index[:, 1], kinked).any())


def path_arguments(
    friction: FrictionTable, state: LoopState, samples: int, oracle: int | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | tuple[None, None, None, None]:
    """Arguments of ``run_loop`` for friction of position, path and load; Nones without such.

    The last argument receives the states, shape (samples, entries). The oracle is compiled for
    friction on the path, of no entry where there is none.
    """
    if oracle is None and not is_on_path(friction):
        return None, None, None, None
    record = np.zeros((samples, len(friction.path_index)))
    return friction.path_index, friction.path_value, state.path, record


@kernel
def run_loop(
    model, law, state, rate, delay, q_ref, inputs, noise, limits, steps, oracle, first, last,
    origin, channels, failure, tangent, path_index, path_value, path, path_record, closed,
):  # fmt: skip
    """Simulate the samples from ``first`` to before ``last``.

    ``delay``: time from a sample until the torque that answers it acts [s]; ``q_ref``: reference
    positions, shape (samples, joints); ``inputs``: added to the law's output, shape
    (samples, joints) or (1, joints); ``limits``: gains, bounds and counts, see above, shape
    (LIMITS, joints); ``oracle``: None, or Runge–Kutta substeps per control period; ``channels``:
    receives the motion, see above, shape (CHANNELS, rows, joints); ``failure``: receives the pivot,
    distance or speed that ended the run, shape (1,); ``tangent``: None, or a ``LoopTangent`` that
    is carried along: compiled where it is asked for; ``closed``: None, or the loops of a mechanism,
    see ``closed_run``, whose bodies and closures are then those that count.
    """
    n = q_ref.shape[1]
    period = 1.0 / rate
    # Everything is unpacked once: numba counts references of arrays in tuples at every use.
    tree, friction, inertia, rotor = model.tree, model.friction, model.inertia, model.rotor
    parent, prismatic, rotation = tree.parent, tree.prismatic, tree.rotation
    translation, gravity = tree.translation, tree.gravity
    linear, term_index, term_value = friction.linear, friction.term_index, friction.term_value
    pair_index, pair_value = friction.pair_index, friction.pair_value
    feedback, pole, integrand = law.feedback, law.pole, law.integrand
    integral_gain, reference = law.integral_gain, law.reference
    integrand_reference, masses = law.integrand_reference, law.masses
    place, measured, weight = state.place, state.measured, state.weight
    vectors, matrices, slopes, clock = state.vectors, state.matrices, state.slopes, state.clock
    pose, motion, force, composite = state.pose, state.motion, state.force, state.composite
    torque, commanded, integral, past = state.torque, state.commanded, state.integral, state.past
    # the torque of ``late`` samples ago comes a part of a period after the sample
    late = int(delay * rate + 1e-9)
    if tangent is not None:
        own, layers, of_slopes, times = (
            tangent.vectors, tangent.matrices, tangent.slopes, tangent.times
        )  # fmt: skip
        of_commanded, of_integral, of_past = tangent.commanded, tangent.integral, tangent.past
        # joints and directions on one axis, for loops that pass through all of them
        flat = own.reshape(own.shape[0], -1)
        encoder, passed, record = tangent.encoder, tangent.passed, tangent.record
        weight_slope = tangent.weight_slope
        law_index, law_slope = tangent.law_index, tangent.law_slope
        law_reference, inertial = tangent.law_reference, tangent.inertial
        rotor_index, rotor_slope = tangent.rotor, tangent.rotor_slope
        constants, constant_slope = tangent.friction, tangent.friction_slope
        before_step, old, bends = tangent.before, tangent.clock, tangent.bends
        of_law, of_torque = tangent.law_columns, tangent.torque_columns
        of_inertia, of_friction = tangent.mass_columns, tangent.friction_columns
        block, matrix_block = tangent.block, tangent.matrix_block
        by_position, by_speed, of_mass = tangent.by_position, tangent.by_speed, tangent.of_mass
        links, body = tangent.links, tangent.body
        of_path, partials, path_copy = tangent.path, tangent.partials, tangent.path_copy
        vectors_copy, slopes_copy = tangent.vectors_copy, tangent.slopes_copy
    waiting = max(delay - late * period, 0.0)
    if waiting < 1e-9 * period:
        waiting = 0.0
    heard = 0  # row of noise and of inputs; a single row stands for all samples
    given = 0
    for k in range(first, last):
        row = k - origin
        if noise.shape[0] > 1:
            heard = k
        if inputs.shape[0] > 1:
            given = k
        for j in range(n):
            measured[j] = vectors[Q, j] + noise[heard, j]
            if limits[COUNT, j] > 0.0:
                measured[j] = limits[COUNT, j] * np.rint(measured[j] / limits[COUNT, j])
        if masses.shape[0] > 0:
            gravity_torques(
                parent, prismatic, rotation, translation, gravity, masses, measured, pose, place,
                weight,
            )  # fmt: skip
        for j in range(n):
            w = measured[j]
            for m in range(1, TAPS):
                w -= pole[j, m] * past[j, m - 1]
            proportional, integrated = feedback[j, 0] * w, integrand[j, 0] * w
            for m in range(1, TAPS):
                proportional += feedback[j, m] * past[j, m - 1]
                integrated += integrand[j, m] * past[j, m - 1]
            for m in range(TAPS - 1, 0, -1):
                past[j, m] = past[j, m - 1]
            past[j, 0] = w
            growth = integral_gain[j] * period * (integrand_reference[k, j] - integrated)
            u = reference[k, j] - proportional + integral[j] + growth
            u += weight[j] + inputs[given, j]
            held = min(max(u, -limits[OUTPUT, j]), limits[OUTPUT, j])
            # anti-windup: the integrator rests while it would push further into the limit
            if (u - held) * growth <= 0.0:
                integral[j] += growth
            channels[_COMMAND, row, j] = held
            for m in range(late + 1, 0, -1):
                commanded[m, j] = commanded[m - 1, j]
            commanded[0, j] = limits[GAIN, j] * held
            if k == 0:  # until the first answer acts the torque is as if it did
                for m in range(1, late + 2):
                    commanded[m, j] = commanded[0, j]
            if tangent is not None:
                passed[j, 0] = integrated
                passed[j, 1] = 1.0 if u == held else 0.0
                passed[j, 2] = 1.0 if (u - held) * growth <= 0.0 else 0.0
        if tangent is not None:
            law_columns(
                integral_gain, integrand_reference, past, period, inputs, channels[_COMMAND, row],
                k, given, passed, law_reference, law_index, law_slope, of_law,
            )  # fmt: skip
            law_tangent(
                parent, prismatic, gravity, masses, place, feedback, pole, integrand,
                integral_gain, period, limits[GAIN], k == 0, late, passed, own, encoder,
                weight_slope, of_law, of_past, of_integral, of_commanded,
            )  # fmt: skip
        for turn in range(2 * steps):
            before = turn < steps  # the torque of the sample before is still acting
            if before and waiting == 0.0:
                continue
            step = (waiting if before else period - waiting) / steps
            # how much longer the step is for a longer delay
            share = 0.0 if waiting == 0.0 else (1.0 if before else -1.0) / steps
            for j in range(n):
                torque[j] = commanded[late + 1 if before else late, j]
            joint = evaluate(
                parent, prismatic, rotation, translation, gravity, inertia, rotor,
                linear, term_index, term_value, pair_index, pair_value,
                path_index, path_value, path,
                vectors, matrices, slopes, clock, pose, motion, force, composite, torque,
                oracle is not None, closed,
            )  # fmt: skip
            if joint < -1:
                for j in range(n):
                    channels[_Q, row, j] = vectors[Q, j]
                return NOT_CLOSED, -1 - joint, k
            if joint >= 0:
                failure[0] = matrices[FACTOR, joint, joint]
                return INDEFINITE, joint, k
            if turn == 0 or (turn == steps and waiting == 0.0):
                for j in range(n):
                    channels[_Q, row, j], channels[_DQ, row, j] = vectors[Q, j], vectors[V, j]
                    channels[_DDQ, row, j], channels[TORQUE, row, j] = vectors[DDQ, j], torque[j]
                    # comparisons are written so that NaN fails them
                    failure[0] = abs(vectors[Q, j] - q_ref[k, j])
                    if not failure[0] <= limits[DISTANCE, j]:
                        return TOO_FAR, j, k
                    failure[0] = abs(vectors[V, j])
                    if not failure[0] <= limits[SPEED, j]:
                        return TOO_FAST, j, k
                if path is not None:
                    for entry in range(path.shape[1]):
                        path_record[row, entry] = path[STATE, entry]
                if tangent is not None:
                    record_tangent(own, of_commanded, record, row, late + 1 if before else late)
            if tangent is not None:
                if turn == steps and waiting == 0.0 and old[DELAYED] != 0.0:
                    switch_tangent(
                        pair_index, pair_value, vectors, matrices, slopes, commanded, late,
                        own, of_slopes, times, bends,
                    )  # fmt: skip
                bias_tangent(
                    parent, prismatic, gravity, inertia, path_index, path_value, vectors, pose,
                    own, constants, constant_slope, inertial, of_torque, by_position, by_speed,
                    links, body, closed, tangent.loops,
                )  # fmt: skip
                if clock[STEPS] == 0.0:
                    renew_tangent(
                        parent, matrices, clock, own, layers, times, inertial, rotor_index,
                        rotor_slope, old, of_inertia, matrix_block, of_mass, links, body, closed,
                        tangent.loops,
                    )  # fmt: skip
                if path is None and clock[FRICTION_KNOWN] == 0.0:
                    friction_tangent(
                        term_index, term_value, pair_index, pair_value, constants, constant_slope,
                        vectors, V, slopes, NOW, own, V, FRICTION, of_slopes, NOW, of_friction,
                        bends,
                    )  # fmt: skip
                remember_start(vectors, slopes, clock, before_step, old)
                if path is not None:
                    copy_state(
                        linear, term_index, term_value, pair_index, pair_value, path_index,
                        path_value, path, vectors, slopes, torque, path_copy, vectors_copy,
                        slopes_copy, clock[FRICTION_KNOWN] != 0.0, own, of_slopes, of_path, times,
                        constants, constant_slope, of_friction, bends, partials,
                    )  # fmt: skip
            if oracle is not None:  # decided by its type: the oracle is compiled when asked for
                joint = advance_runge_kutta(
                    parent, prismatic, rotation, translation, gravity, inertia, rotor,
                    linear, term_index, term_value, pair_index, pair_value,
                    path_index, path_value, path,
                    vectors, matrices, slopes, clock, pose, motion, force, composite, torque,
                    step, oracle, closed,
                )  # fmt: skip
                if joint < -1:
                    for j in range(n):
                        channels[_Q, row, j] = vectors[Q, j]
                    return NOT_CLOSED, -1 - joint, k
                if joint >= 0:
                    failure[0] = matrices[FACTOR, joint, joint]
                    return INDEFINITE, joint, k
                continue
            if path is not None:  # so are laws of friction on the path
                advance_on_path(
                    linear, term_index, term_value, pair_index, pair_value,
                    path_index, path_value, path,
                    vectors, matrices, slopes, clock, torque, step,
                )  # fmt: skip
                if tangent is not None:
                    length_tangent(times, share, old)
                    freeze_tangent(
                        vectors, matrices, clock, step, late + 1 if before else late,
                        own, layers, times, of_commanded, old,
                    )  # fmt: skip
                    for i in range(n):
                        vectors_copy[MIDDLE_BIAS, i] = vectors[MIDDLE_BIAS, i]
                    path_step_tangent(
                        linear, term_index, term_value, pair_index, pair_value, path_index,
                        path_value, path_copy, vectors_copy, matrices, slopes_copy, torque, step,
                        own, flat, layers, times, of_slopes, of_path, constants, constant_slope,
                        of_friction, bends, partials,
                    )  # fmt: skip
            else:
                advance(
                    linear, term_index, term_value, pair_index, pair_value,
                    vectors, matrices, slopes, clock, torque, step,
                )  # fmt: skip
                if tangent is not None:
                    length_tangent(times, share, old)
                    if clock[FRICTION_KNOWN] == 0.0:
                        freeze_tangent(
                            vectors, matrices, clock, step, late + 1 if before else late,
                            own, layers, times, of_commanded, old,
                        )  # fmt: skip
                        nonlinear_tangent(
                            linear, term_index, term_value, pair_index, pair_value,
                            vectors, matrices, slopes, torque, step,
                            own, layers, times, of_slopes, constants, constant_slope,
                            before_step, of_friction, bends, old[DELAYED] != 0.0,
                        )  # fmt: skip
                    else:
                        linear_tangent(
                            term_index, term_value, pair_index, pair_value,
                            vectors, matrices, slopes, clock, torque, step,
                            late + 1 if before else late, own, layers, times, of_slopes,
                            of_commanded, constants, constant_slope, before_step, old,
                            of_friction, bends, block, matrix_block,
                        )  # fmt: skip
    return DONE, -1, -1
