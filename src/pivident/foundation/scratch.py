"""Working arrays of records that are larger than the memory: in a file where they would not fit.

A mapped file is an array like any other, but the system may write its pages back and take them
from memory. The file has no name any more when the array is handed out, so nothing is left behind
however the process ends.

What is only passed through from its beginning to its end lies in ``Blocks``: these read and write
their file piece by piece, so that it takes no memory at all.

``PIVIDENT_SCRATCH_ABOVE`` is the size in bytes from which on arrays lie in a file (an eighth of the
memory unless it says otherwise), ``PIVIDENT_SCRATCH`` the folder for them (that for temporary
files).
"""

from __future__ import annotations

import math
import mmap
import os
import tempfile
import threading
from functools import cache
from typing import IO

import numpy as np

from pivident.foundation.errors import PividentError

#: Share of the memory above which an array lies in a file.
SHARE = 8


def working_array(shape: tuple[int, ...]) -> np.ndarray:
    """An array of float64 to be written to; its content is undefined until then."""
    size = 8 * math.prod(shape)
    if size <= largest_in_memory():
        return np.empty(shape)
    try:
        with tempfile.TemporaryFile(prefix="pivident-", dir=_folder()) as file:
            # a hole would end the process by a signal where the disk is full, this says so
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, size)
            else:
                file.truncate(size)
            mapped = mmap.mmap(file.fileno(), size)
    except OSError as error:
        raise _no_room(size, error) from error
    return np.frombuffer(mapped, dtype=float).reshape(shape)


class Blocks:
    """Arrays of float64 one after the other: the first ones in memory, the others in a file.

    Args:
        limit: bytes of those that are kept in memory.
    """

    def __init__(self, limit: int) -> None:
        self._left = min(limit, largest_in_memory())
        self._blocks: list[np.ndarray | tuple[int, tuple[int, ...]]] = []  # else place and shape
        self._file: IO[bytes] | None = None
        self._end = 0  # of the file [bytes]
        self._turn = threading.Lock()

    def __len__(self) -> int:
        return len(self._blocks)

    def __reduce__(self) -> tuple[object, ...]:
        """A copy, in another process as well, begins with what is kept here."""
        return _blocks_of, (self._left, [self.read(k) for k in range(len(self))])

    def append(self, block: np.ndarray) -> None:
        """Keep another array, of one axis or more; its numbers are copied."""
        block = np.array(block, dtype=float, order="C")
        if self._file is None and block.nbytes <= self._left:
            self._left -= block.nbytes
            self._blocks.append(block)
            return
        with self._turn:
            try:
                if self._file is None:  # open as long as its blocks are there
                    self._file = tempfile.TemporaryFile(prefix="pivident-", dir=_folder())
                self._file.seek(self._end)
                self._file.write(block.data)
                self._file.flush()
            except OSError as error:
                raise _no_room(self._end + block.nbytes, error) from error
            self._blocks.append((self._end, block.shape))
            self._end += block.nbytes

    def read(self, k: int, place: tuple[int, ...] = ()) -> np.ndarray:
        """Block k, or what its first indices ``place`` select; not to be written to."""
        block = self._blocks[k]
        if isinstance(block, np.ndarray):
            return block[place]
        first, shape = block
        for index in place:
            shape = shape[1:]
            first += 8 * index * math.prod(shape)
        with self._turn:
            assert self._file is not None
            self._file.seek(first)
            content = self._file.read(8 * math.prod(shape))
        return np.frombuffer(content, dtype=float).reshape(shape)


def _blocks_of(left: int, kept: list[np.ndarray]) -> Blocks:
    """Blocks with such a content."""
    made = Blocks(left + sum(own.nbytes for own in kept))
    for own in kept:
        made.append(own)
    return made


def _folder() -> str:
    """Where files lie."""
    return os.environ.get("PIVIDENT_SCRATCH") or tempfile.gettempdir()


def _no_room(size: int, error: OSError) -> PividentError:
    """The error where a file of so many bytes cannot be written."""
    return PividentError(
        f"no room for {size / 2**30:.1f} GiB of working data in {_folder()} "
        f"({error.strerror or error})",
        advice="name a folder with more in PIVIDENT_SCRATCH, or cut the recording",
    )


def largest_in_memory() -> int:
    """Bytes up to which an array is kept in memory, by ``PIVIDENT_SCRATCH_ABOVE``."""
    given = os.environ.get("PIVIDENT_SCRATCH_ABOVE", "")
    if not given:
        return _memory() // SHARE
    if not given.isdigit():
        raise PividentError(
            f"PIVIDENT_SCRATCH_ABOVE is {given!r}",
            advice="give a number of bytes, such as 1000000000",
        )
    return int(given)


@cache
def _memory() -> int:
    """Physical memory [bytes]."""
    if not hasattr(os, "sysconf"):
        return 2**33
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
