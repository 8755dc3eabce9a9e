"""Derivatives of simulated signals, block after block of rows.

A fit passes through J several times with other weights each time, always from its beginning to its
end. So J is kept in blocks of time, the first of them in memory and the others in a file, and no
more than a block of it is looked at: memory does not grow with the length of the record.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pivident.scratch import Blocks

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
