"""Simulation errors of all stretches, and their derivatives along the unknowns.

    e = y - y_s(p, x₀),   J = ∂y_s/∂(p, x₀),   y: positions, torques or both

y_s comes from a simulation with its tangents, p are the unknowns, x₀ the initial state of each
stretch. Only thinned rows are kept (`thinning`): e in memory, J in blocks (`KeptColumns`).

A fit passes through J several times with other weights each time, always from its beginning to its
end. So J is kept in blocks of time, the first of them in memory and the others in a file, and no
more than a block of it is looked at: memory does not grow with the length of the record.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from pivident.estimation.output_error.loop_unknowns import Unknown, start_directions
from pivident.estimation.output_error.record_stretches import OpenLoop, Stretch
from pivident.estimation.output_error.thinning import POSITIONS, TORQUES, Thinning, means_at
from pivident.foundation.scratch import Blocks
from pivident.foundation.threads import run_in_threads
from pivident.loop.simulation.direction import Direction
from pivident.loop.simulation.tangents import TANGENT_BLOCK, TangentBlock, tangent_blocks

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


#: Rows of a block. Filters and sums over the columns of a joint pass through it in the cache.
ROWS = 1024

#: Bytes of J that all stretches together keep in memory.
IN_MEMORY = 2**24


class Columns(Protocol):
    """Columns of J that can be passed through."""

    @property
    def count(self) -> int:
        """How many columns there are."""
        ...

    def blocks(self, channel: int, joint: int) -> Iterator[tuple[slice, np.ndarray]]:
        """Blocks of rows in order: which rows, and columns there, shape (columns, rows)."""
        ...


class KeptColumns:
    """J of one stretch.

    Args:
        channels: compared signals of each joint.
        joints: of the robot.
        count: columns, one for each unknown and each part of the initial state.
        rows: how many rows there will be.
        in_memory: bytes that may lie in memory.
    """

    def __init__(
        self, channels: int, joints: int, count: int, rows: int, in_memory: int = IN_MEMORY
    ) -> None:
        self._count, self._kept = count, Blocks(in_memory)
        self._open = np.empty((channels, joints, count, min(rows, ROWS)))
        self._filled, self._left = 0, rows

    @property
    def count(self) -> int:
        """How many columns there are."""
        return self._count

    def add(self, rows: np.ndarray) -> None:
        """Take the next rows, shape (rows, channels, joints, columns)."""
        done = 0
        while done < len(rows):
            room = self._open.shape[3] - self._filled
            part = rows[done : done + room]
            span = slice(self._filled, self._filled + len(part))
            self._open[..., span] = part.transpose(1, 2, 3, 0)
            self._filled, done = span.stop, done + len(part)
            if self._filled == self._open.shape[3]:
                self._close()

    def _close(self) -> None:
        """Put away a block that is full."""
        self._kept.append(self._open)
        self._left -= self._filled
        self._filled = 0
        if self._left < self._open.shape[3]:
            self._open = np.empty((*self._open.shape[:3], self._left))

    def blocks(self, channel: int, joint: int) -> Iterator[tuple[slice, np.ndarray]]:
        """Blocks of rows in order: which rows, and columns there, shape (columns, rows)."""
        assert self._left == 0, "rows are missing"
        first = 0
        for k in range(len(self._kept)):
            block = self._kept.read(k, (channel, joint))
            yield slice(first, first + block.shape[1]), block
            first += block.shape[1]


@dataclass(frozen=True)
class ChannelColumns:
    """Columns of one stretch, of some of its channels.

    Attributes:
        whole: of all channels.
        channels: which are taken, in their order.
    """

    whole: Columns
    channels: tuple[int, ...]

    @property
    def count(self) -> int:
        """How many columns there are."""
        return self.whole.count

    def blocks(self, channel: int, joint: int) -> Iterator[tuple[slice, np.ndarray]]:
        """Blocks of rows in order: which rows, and columns there, shape (columns, rows)."""
        return self.whole.blocks(self.channels[channel], joint)


@dataclass(frozen=True)
class JoinedColumns:
    """Columns of one stretch with others between them.

    Attributes:
        outer: columns that come first and last.
        inner: those in between.
        at: how many of the outer ones come first.
    """

    outer: Columns
    inner: Columns
    at: int

    @property
    def count(self) -> int:
        """How many columns there are."""
        return self.outer.count + self.inner.count

    def blocks(self, channel: int, joint: int) -> Iterator[tuple[slice, np.ndarray]]:
        """Blocks of rows in order: which rows, and columns there, shape (columns, rows)."""
        pairs = zip(
            self.outer.blocks(channel, joint), self.inner.blocks(channel, joint), strict=True
        )
        for (rows, outer), (_, inner) in pairs:
            yield rows, np.concatenate([outer[: self.at], inner, outer[self.at :]])
