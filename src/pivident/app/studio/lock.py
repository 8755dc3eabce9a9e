"""Locks on files: who holds one is alive, since the system takes it away when the process ends."""

from __future__ import annotations

import os
import sys
import time
from contextlib import suppress
from pathlib import Path

#: Between two tries to take a lock that somebody may only be testing [s].
PAUSE = 0.02


class Lock:
    """A lock that this process holds until it ends or releases it.

    Attributes:
        handle: of the locked file; a child process that inherits it holds the lock too.
    """

    def __init__(self, handle: int) -> None:
        self.handle = handle

    def release(self) -> None:
        """Let others have it."""
        with suppress(OSError):
            os.close(self.handle)


def take(path: Path, patience: float = 0.0) -> Lock | None:
    """Lock a file, which is created where there is none.

    Args:
        path: the file.
        patience: how long to try [s]; whoever asks `is_held` has the lock for a moment.

    Returns:
        The lock, or None where another process holds it.

    Raises:
        OSError: the file cannot be opened.
    """
    deadline = time.monotonic() + patience
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        if _locked(handle):
            return Lock(handle)
        os.close(handle)
        if time.monotonic() >= deadline:
            return None
        time.sleep(PAUSE)


def is_held(path: Path) -> bool:
    """Whether some process holds the lock of a file."""
    try:
        handle = os.open(path, os.O_RDWR)
    except OSError:
        return False
    try:
        return not _locked(handle)
    finally:
        os.close(handle)


if sys.platform == "win32":
    import msvcrt

    def _locked(handle: int) -> bool:
        """Lock the first byte of an open file, or say that another has it."""
        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

else:
    import fcntl

    def _locked(handle: int) -> bool:
        """Lock an open file, or say that another has it."""
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True
