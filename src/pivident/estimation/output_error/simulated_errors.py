"""Simulation errors of all stretches, and their derivatives along the unknowns.

    e = y - y_s(p, x₀),   J = ∂y_s/∂(p, x₀),   y: positions, torques or both

y_s comes from a simulation with its tangents, p are the unknowns, x₀ the initial state of each
stretch. Only thinned rows are kept (`thinning`): e in memory, J in blocks (`kept_columns`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.estimation.output_error.kept_columns import (
    IN_MEMORY,
    ChannelColumns,
    Columns,
    KeptColumns,
)
from pivident.estimation.output_error.stretch import Stretch
from pivident.estimation.output_error.thinning import Thinning, means_at
from pivident.estimation.output_error.unknowns import Unknown, start_directions
from pivident.simulation.direction import Direction
from pivident.simulation.open_loop import OpenLoop
from pivident.simulation.tangents import TANGENT_BLOCK, TangentBlock, tangent_blocks
from pivident.threads import run_in_threads

#: Channels that may be compared.
POSITIONS, TORQUES = 0, 1

#: The tangents of an initial state are carried until they are this share of their largest values.
FORGOTTEN = 1e-6


@dataclass(frozen=True, eq=False)
class SimulatedErrors:
    """Thinned errors of one stretch, time last."""

    #: e, shape (channels, joints, rows) [rad or m, N m or N].
    errors: np.ndarray
    columns: Columns  #: J, unknowns first, then the initial positions and speeds
    used: np.ndarray  # rows that count, shape (channels, joints, rows)
    rate: float  # rows per second [Hz]
    factor: int  # measured samples for each row
    size: np.ndarray  # largest measured value, shape (channels, joints)
    mean_square: np.ndarray  # of e before thinning, shape (2, joints): positions, torques

    def of_channels(self, channels: tuple[int, ...]) -> SimulatedErrors:
        """Those of some channels, of errors of all of them."""
        own = list(channels)
        columns = ChannelColumns(self.columns, channels)
        return replace(
            self, errors=self.errors[own], columns=columns, used=self.used[own], size=self.size[own]
        )


def simulated_errors(
    stretches: Sequence[Stretch],
    unknowns: Sequence[Unknown],
    channels: Sequence[int],
    factors: Sequence[int],
) -> list[SimulatedErrors]:
    """Simulate all stretches with their tangents.

    ``factors``: measured samples for each row, one factor for each stretch.

    Raises:
        SimulationDiverged: a simulation leaves its bounds; names the joint and the time.
        MassMatrixNotPositiveDefinite: the values are those of no machine.
    """
    made: list[SimulatedErrors | None] = [None] * len(stretches)

    def work(k: int) -> None:
        made[k] = _of_stretch(stretches[k], unknowns, channels, factors[k], in_memory)

    in_memory = IN_MEMORY // max(len(stretches), 1)
    run_in_threads(work, range(len(stretches)))
    return [own for own in made if own is not None]


def _of_stretch(
    stretch: Stretch,
    unknowns: Sequence[Unknown],
    channels: Sequence[int],
    factor: int,
    in_memory: int,
) -> SimulatedErrors:
    """Errors and derivatives of one stretch; ``in_memory``: bytes that these may take."""
    n, directions = stretch.loop.robot.size, [u.direction for u in unknowns]
    starts = [] if stretch.start_std is None else start_directions(n)
    # what a closed loop forgets soon is carried by a run of its own, which ends there
    closed = not isinstance(stretch.loop.controller, OpenLoop)
    apart = starts if closed else []
    carried = directions if apart else [*directions, *starts]
    thinning = Thinning(factor)
    rows = thinning.rows(stretch.samples)
    errors = np.empty((len(channels), n, rows))
    columns = KeptColumns(len(channels), n, len(directions) + len(starts), rows, in_memory)
    squares = np.full((2, n), np.nan)
    both = [POSITIONS, TORQUES] if stretch.tau is not None else [POSITIONS]
    squares[both] = 0.0
    done = 0
    reading = _Reading(stretch)
    begun = _rows_of_starts(reading, apart, channels, factor)
    for error, slopes in reading.blocks(carried, factor, both):
        for channel in both:
            squares[channel] += (error[channel] ** 2).sum(axis=0)
        stack = np.stack(
            [np.concatenate([error[c][..., None], slopes[c]], axis=-1) for c in channels], axis=1
        )
        thin = thinning.process(np.ascontiguousarray(stack))
        errors[:, :, done : done + len(thin)] = thin[..., 0].transpose(1, 2, 0)
        done += len(thin)
        of_starts = next(begun, None)
        if of_starts is None:  # carried with the others, or forgotten
            of_starts = np.zeros((len(thin), len(channels), n, len(apart)))
        columns.add(np.concatenate([thin[..., 1:], of_starts], axis=3))
    moving = means_at(stretch.moving, factor).T > 0.5
    # at rest the loop does not pass on what its encoders read: other noise, and no information
    used = np.stack([moving if closed or c == TORQUES else np.ones_like(moving) for c in channels])
    used[:, :, : -(-stretch.first // factor)] = False
    measured = [_measured(stretch, c) for c in channels]
    size = np.array([np.maximum(own.max(axis=0), -own.min(axis=0)) for own in measured])
    mean_square = squares / max(stretch.samples, 1)
    return SimulatedErrors(errors, columns, used, stretch.rate / factor, factor, size, mean_square)


def _measured(stretch: Stretch, channel: int) -> np.ndarray:
    """Measured positions or torques."""
    if channel == POSITIONS:
        return stretch.q
    assert stretch.tau is not None
    return stretch.tau


def _rows_of_starts(
    reading: _Reading, starts: Sequence[Direction], channels: Sequence[int], factor: int
) -> Iterator[np.ndarray]:
    """Derivatives along the initial state, as long as it is not forgotten, block by block.

    Shape (rows, channels, joints, starts).
    """
    if not starts:
        return
    thinning, largest = Thinning(factor), np.zeros(len(channels))
    for _, slopes in reading.blocks(starts, factor, channels):
        stack = np.stack([slopes[c] for c in channels], axis=1)
        yield thinning.process(np.ascontiguousarray(stack))
        size = np.abs(stack).max(axis=(0, 2, 3))
        largest = np.maximum(largest, size)
        if (size <= FORGOTTEN * largest).all():
            return


class _Reading:
    """What is read of a simulation: its positions and torques at the measured samples."""

    def __init__(self, stretch: Stretch) -> None:
        self.stretch = stretch
        signals = stretch.loop.signals
        n = stretch.loop.robot.size
        #: What the encoders show beside the position.
        self.offset = np.zeros(n) if signals.noise is None else np.asarray(signals.noise)[0]
        late = float(signals.drive_delay) * float(signals.rate)
        #: Samples of the loop that the torque which acts is later than the command that was logged.
        self.late = int(np.ceil(late - 1e-9)) + stretch.tau_late

    def blocks(
        self, directions: Sequence[Direction], factor: int, channels: Sequence[int]
    ) -> Iterator[tuple[dict[int, np.ndarray], dict[int, np.ndarray]]]:
        """Errors and derivatives by channel, each block a multiple of ``factor`` samples long."""
        stretch = self.stretch
        step, samples = stretch.step, stretch.samples
        width = step * factor
        block = max(1, round(TANGENT_BLOCK / width)) * width
        whole = samples // factor * factor
        encoder = [d for d, own in enumerate(directions) if own.kind == "encoder_offset"]
        for made in tangent_blocks(stretch.loop, directions, block):
            first = made.samples.start // step
            if first >= whole:
                return
            last = min(-(-made.samples.stop // step), whole)
            rows = slice(first, last)
            errors: dict[int, np.ndarray] = {}
            slopes: dict[int, np.ndarray] = {}
            if POSITIONS in channels:
                q = made.motion.q[::step][: last - first]
                errors[POSITIONS] = stretch.q[rows] - q - self.offset
                slopes[POSITIONS] = made.q[::step][: last - first]
                if encoder:
                    slopes[POSITIONS] = slopes[POSITIONS].copy()
                    for d in encoder:
                        slopes[POSITIONS][:, directions[d].joint, d] += 1.0
            if TORQUES in channels:
                errors[TORQUES], slopes[TORQUES] = self._torques(made, rows)
            yield errors, slopes

    def _torques(self, made: TangentBlock, rows: slice) -> tuple[np.ndarray, np.ndarray]:
        """Errors of the torque; a sample that was logged ``late`` belongs to an earlier one.

        What acts at sample k of the loop was logged with sample k - late: the error at k is that
        of the measured torque that belongs there, by linear interpolation between measured ones.
        """
        stretch = self.stretch
        assert stretch.tau is not None
        step, length = stretch.step, rows.stop - rows.start
        tau = made.motion.tau[::step][:length]
        at = np.arange(rows.start, rows.stop) - self.late / step
        low = np.clip(np.floor(at).astype(int), 0, len(stretch.tau) - 2)
        part = np.clip(at - low, 0.0, 1.0)[:, None]
        measured = (1.0 - part) * stretch.tau[low] + part * stretch.tau[low + 1]
        return measured - tau, made.tau[::step][:length]
