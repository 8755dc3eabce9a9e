"""Working arrays of records that are larger than the memory: in a file where they would not fit.

A mapped file is an array like any other, but the system may write its pages back and take them
from memory. The file has no name any more when the array is handed out, so nothing is left behind
however the process ends.

``PIVIDENT_SCRATCH_ABOVE`` is the size in bytes from which on arrays lie in a file (an eighth of the
memory unless it says otherwise), ``PIVIDENT_SCRATCH`` the folder for them (that for temporary
files).
"""

from __future__ import annotations

import math
import mmap
import os
import tempfile
from functools import cache

import numpy as np

from pivident.errors import PividentError

#: Share of the memory above which an array lies in a file.
SHARE = 8


def working_array(shape: tuple[int, ...]) -> np.ndarray:
    """An array of float64 to be written to; its content is undefined until then."""
    size = 8 * math.prod(shape)
    if size <= largest_in_memory():
        return np.empty(shape)
    folder = os.environ.get("PIVIDENT_SCRATCH") or tempfile.gettempdir()
    try:
        with tempfile.TemporaryFile(prefix="pivident-", dir=folder) as file:
            # a hole would end the process by a signal where the disk is full, this says so
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, size)
            else:
                file.truncate(size)
            mapped = mmap.mmap(file.fileno(), size)
    except OSError as error:
        raise PividentError(
            f"no room for {size / 2**30:.1f} GiB of working data in {folder} "
            f"({error.strerror or error}); name a folder with more in PIVIDENT_SCRATCH, or cut "
            "the recording"
        ) from error
    return np.frombuffer(mapped, dtype=float).reshape(shape)


def largest_in_memory() -> int:
    """Bytes up to which an array is kept in memory, by ``PIVIDENT_SCRATCH_ABOVE``."""
    given = os.environ.get("PIVIDENT_SCRATCH_ABOVE", "")
    if not given:
        return _memory() // SHARE
    if not given.isdigit():
        raise PividentError(
            f"PIVIDENT_SCRATCH_ABOVE is {given!r}; give a number of bytes, such as 1000000000"
        )
    return int(given)


@cache
def _memory() -> int:
    """Physical memory [bytes]."""
    if not hasattr(os, "sysconf"):
        return 2**33
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
