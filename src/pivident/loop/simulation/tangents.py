"""A simulated loop with its tangents: derivatives of the motion along parameters of the loop.

Output-error methods compare what a simulation gives with what was measured and need the derivative
of the simulated motion along every parameter. Finite differences take two simulations for each;
the tangents of all are carried beside a single one (``loop_tangent``).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from pivident.dynamics.forward import Model
from pivident.dynamics.friction_table import PATH_ROWS, slopes_width
from pivident.dynamics.lanes import LANES, row_array
from pivident.dynamics.path_partials import partials_scratch
from pivident.dynamics.rigid_body_slopes import slope_scratch
from pivident.loop.simulation.closed_loop import Trajectory, simulate, simulate_blocks
from pivident.loop.simulation.controllers import TAPS, PythonController, SampledLaw
from pivident.loop.simulation.direction import Direction, ParametrisedLoop
from pivident.loop.simulation.friction_tangent import PAIR
from pivident.loop.simulation.integration import ROWS, Q, V
from pivident.loop.simulation.linear_law import LAW_COLUMNS
from pivident.loop.simulation.loop_tangent import (
    BEFORE,
    CLOCK_ENTRIES,
    DELAY,
    DELAYED,
    MATRIX_LAYERS,
    OF_DRIVE_GAIN,
    OF_INPUTS,
    TANGENT_ROWS,
    TIMES,
    LoopTangent,
    closed_tangent,
)
from pivident.loop.simulation.path_integration import SLOPE_ROWS
from pivident.loop.simulation.rigid_body_tangent import BLOCK_LAYERS
from pivident.loop.simulation.step_tangent import BLOCK_ROWS
from pivident.loop.simulation.tangent_entries import LawEntries, ModelEntries, law_slope
from pivident.robot.friction_terms.coulomb import LOAD

#: Samples of a block: a few MiB of tangents, so that what is done once a block hardly counts.
TANGENT_BLOCK = 512

#: Relative step of the central differences of a Python law's loop.
DIFFERENCE = 1e-6


class TangentBlock(NamedTuple):
    """A stretch of a simulated motion with its tangents."""

    samples: slice  # of the record
    motion: Trajectory
    q: np.ndarray  # ∂q/∂p, (samples, joints, directions)
    dq: np.ndarray  # ∂dq/∂p, likewise
    tau: np.ndarray  # ∂tau/∂p, likewise


def simulate_with_tangents(loop: ParametrisedLoop, directions: Sequence[Direction]) -> TangentBlock:
    """Simulate the closed loop with the derivatives of its motion along parameters.

    The motion is that of ``simulate``, to the last bit. The tangents are the derivatives of the
    scheme that the simulator runs; a loop with a Python law, and one with friction of the load or
    of several quantities, is differentiated by central differences instead, two simulations a
    direction.

    Args:
        loop: what is simulated, in terms of its parameters.
        directions: parameters to differentiate along.

    Returns:
        The whole motion and its tangents, 3 · samples · joints · directions numbers: see
        ``tangent_blocks`` for long records.

    Raises:
        ExperimentError: the loop has no such parameter; says which there are.
        SimulationDiverged: the loop is unstable; names the joint and the time.
        MassMatrixNotPositiveDefinite: the values are those of no machine; names the joint.
    """
    return next(tangent_blocks(loop, directions, len(loop.signals.q_ref)))


def tangent_blocks(
    loop: ParametrisedLoop, directions: Sequence[Direction], block: int = TANGENT_BLOCK
) -> Iterator[TangentBlock]:
    """As ``simulate_with_tangents``, a stretch at a time, so that memory does not grow with time.

    A Gauss–Newton step sums up JᵀJ and Jᵀe over the blocks.

    Args:
        loop: what is simulated, in terms of its parameters.
        directions: parameters to differentiate along.
        block: samples of a stretch. A loop that is differentiated by central differences comes as
            a single one.

    Yields:
        Stretch after stretch; the next one overwrites the arrays.

    Raises:
        ExperimentError: the loop has no such parameter; says which there are.
        SimulationDiverged: the loop is unstable; names the joint and the time.
        MassMatrixNotPositiveDefinite: the values are those of no machine; names the joint.
    """
    for direction in directions:
        loop.check(direction)
    model = loop.model
    if not has_compiled_tangents(loop, model):
        yield _by_differences(loop, directions)
        return
    if not directions:
        yield from _without_tangents(loop, model, block)
        return
    yield from _carried(loop, model, ModelEntries(loop, directions), directions, block)


def _carried(
    loop: ParametrisedLoop,
    model: Model,
    tables: ModelEntries,
    directions: Sequence[Direction],
    block: int,
) -> Iterator[TangentBlock]:
    """The motion with the tangents beside it, a block at a time."""
    block = min(block, len(loop.signals.q_ref))
    tangent = _initial_tangent(loop, model, tables, directions, block)
    for span, channels, states in simulate_blocks(
        model, loop.controller, loop.signals, loop.robot.joint_names, loop.begin, None, block,
        tangent,
    ):  # fmt: skip
        q, dq, ddq, tau, command = channels
        motion = Trajectory(float(loop.signals.rate), q, dq, ddq, tau, command, states)
        record = tangent.record[:, : span.stop - span.start, :, : len(directions)]
        yield TangentBlock(span, motion, *record)


def _without_tangents(loop: ParametrisedLoop, model: Model, block: int) -> Iterator[TangentBlock]:
    """The motion along no direction, a block at a time."""
    for span, channels, states in simulate_blocks(
        model, loop.controller, loop.signals, loop.robot.joint_names, loop.begin, None, block
    ):
        q, dq, ddq, tau, command = channels
        motion = Trajectory(float(loop.signals.rate), q, dq, ddq, tau, command, states)
        yield TangentBlock(span, motion, *np.zeros((3, *q.shape, 0)))


def has_compiled_tangents(loop: ParametrisedLoop, model: Model | None = None) -> bool:
    """Whether tangents are carried along; if not they are central differences.

    Args:
        loop: the loop.
        model: its model, where it is known already.
    """
    column = (model or loop.model).friction.path_index[:, 1]
    by_differences = ((column == int(LOAD)) | (column < 0)).any()
    return not (isinstance(loop.controller, PythonController) or by_differences)


def _by_differences(loop: ParametrisedLoop, directions: Sequence[Direction]) -> TangentBlock:
    """The whole motion, and central differences of it."""

    def run(changed: ParametrisedLoop) -> Trajectory:
        names = changed.robot.joint_names
        return simulate(changed.model, changed.controller, changed.signals, names, changed.begin)

    motion = run(loop)
    q, dq, tau = (np.zeros((*motion.q.shape, len(directions))) for _ in range(3))
    for d, direction in enumerate(directions):
        step = DIFFERENCE * (abs(loop.value(direction)) or 1.0)
        forward = run(loop.moved(direction, step))
        whole = direction.kind == "delay" and loop.signals.drive_delay < step
        backward = motion if whole else run(loop.moved(direction, -step))
        width = step if whole else 2.0 * step
        for out, channel in ((q, "q"), (dq, "dq"), (tau, "tau")):
            out[:, :, d] = (getattr(forward, channel) - getattr(backward, channel)) / width
    return TangentBlock(slice(0, len(motion.q)), motion, q, dq, tau)


def _initial_tangent(
    loop: ParametrisedLoop,
    model: Model,
    tables: ModelEntries,
    directions: Sequence[Direction],
    block: int,
) -> LoopTangent:
    """Tangents at the first sample, and the slopes of model and law along the directions."""
    n, count, signals = loop.robot.size, len(directions), loop.signals
    couplings, entries_of_path = len(model.friction.pair_index), len(model.friction.path_index)
    late = int(float(signals.drive_delay) * float(signals.rate) + 1e-9)
    dq_ref = signals.dq_ref
    q_ref = np.asarray(signals.q_ref, float)
    pole = loop.controller.law(float(signals.rate), q_ref, dq_ref).pole  # the rest is long
    entries = LawEntries(len(q_ref), sum(_law_joints(own, n) for own in directions))
    laws: dict[str, SampledLaw] = {}
    encoder, past = row_array(n, count), row_array(TAPS, n, count)
    vectors, times = row_array(TANGENT_ROWS, n, count), row_array(TIMES, count)
    total = pole.sum(axis=1)
    inverse = np.divide(1.0, total, out=np.zeros(n), where=total != 0.0)
    for d, direction in enumerate(directions):
        joints = range(n) if direction.joint < 0 else (direction.joint,)
        if direction.kind == "law":
            # joints have laws of their own, so that one difference shows the slopes of all of them
            if direction.name not in laws:  # only the last one is kept: it is as long as the record
                every = Direction("law", direction.name)
                laws = {direction.name: law_slope(loop, every, q_ref, dq_ref)}
            of_law = laws[direction.name]
            for j in joints:
                entries.add(j, d, of_law)
                past[:, j, d] = -loop.begin[0][j] * inverse[j] ** 2 * of_law.pole[j].sum()
        elif direction.kind in ("drive_gain", "inputs"):
            for j in joints:
                entries.add(j, d, OF_DRIVE_GAIN if direction.kind == "drive_gain" else OF_INPUTS)
        elif direction.kind == "delay":
            times[DELAY, d] = 1.0
        elif direction.kind == "encoder_offset":
            encoder[list(joints), d] = 1.0
        elif direction.kind == "initial_position":
            vectors[Q, direction.joint, d] = 1.0
            past[:, direction.joint, d] = inverse[direction.joint]
        elif direction.kind == "initial_speed":
            vectors[V, direction.joint, d] = 1.0
    slopes = row_array(3, 2 * (n + couplings), count)
    for (_, table, row, column, d), weight in tables.friction:
        if table == PAIR and column == 1:
            slopes[:, n + couplings + row, d] += weight
    constants, constant_slope = _entry_arrays(tables.friction)
    clock = np.zeros(CLOCK_ENTRIES)
    clock[DELAYED] = float(times[DELAY].any())
    index, slope, reference = entries.arrays()
    links, body = slope_scratch(len(model.inertia))
    loops = None
    if model.closed is not None:
        loops = closed_tangent(model.closed, *_entry_arrays(tables.passive), count)
    return LoopTangent(
        vectors=vectors,
        matrices=row_array(MATRIX_LAYERS, n, n, count),
        slopes=slopes,
        path=row_array(PATH_ROWS, entries_of_path, count),
        times=times,
        commanded=row_array(late + 2, n, count),
        integral=row_array(n, count),
        past=past,
        passed=np.zeros((n, 3)),
        encoder=encoder,
        law_index=index,
        law_slope=slope,
        law_reference=reference,
        inertial=np.array(sorted(tables.inertial), dtype=np.int64).reshape(-1, 3),
        rotor=np.array([i for i, _ in tables.rotor], dtype=np.int64).reshape(-1, 3),
        rotor_slope=np.array([w for _, w in tables.rotor], dtype=float),
        friction=constants,
        friction_slope=constant_slope,
        before=np.zeros((BEFORE, n + couplings)),
        clock=clock,
        bends=np.zeros(n + couplings),
        law_columns=row_array(LAW_COLUMNS, n, count),
        torque_columns=row_array(n, count),
        mass_columns=row_array(n, n, count),
        friction_columns=row_array(2 * n + couplings, count),
        block=row_array(BLOCK_ROWS, n, LANES),
        matrix_block=row_array(BLOCK_LAYERS, n, n, LANES),
        by_position=np.zeros((n, n)),
        by_speed=np.zeros((n, n)),
        of_mass=np.zeros((n, n, n)),
        weight_slope=np.zeros((n, n)),
        links=links,
        body=body,
        loops=loops,
        partials=partials_scratch(),
        path_copy=np.zeros((PATH_ROWS, entries_of_path)),
        vectors_copy=np.zeros((ROWS, n)),
        slopes_copy=np.zeros((SLOPE_ROWS, slopes_width(n, couplings))),
        record=row_array(3, block, n, count),
    )


def _entry_arrays(
    entries: Sequence[tuple[tuple[int, int, int, int, int], float]],
) -> tuple[np.ndarray, np.ndarray]:
    """Places and slopes of constants of friction as arrays."""
    where = np.array([place for place, _ in entries], dtype=np.int64).reshape(-1, 5)
    return where, np.array([weight for _, weight in entries], dtype=float)


def _law_joints(direction: Direction, joints: int) -> int:
    """How many joints have laws that depend on a direction."""
    if direction.kind not in ("law", "drive_gain", "inputs"):
        return 0
    return joints if direction.joint < 0 else 1
