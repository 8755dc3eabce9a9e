"""Where a run is, from the lines that the command appends to its progress file."""

from __future__ import annotations

import json
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from pivident.studio.output import cleaned
from pivident.text.printable import shortened

#: Bytes that are read at a time, and lines that are kept of what has been done.
CHUNK, KEPT = 1_000_000, 50


class RunProgress:
    """The last state of a run; each call of `now` reads only what is new.

    Args:
        path: the progress file.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._offset, self._rest = path, 0, b""
        self._left: float | None = None
        self._written_at = 0.0
        self._stage, self._number, self._of, self._line = "", 0, 0, ""
        self._kept: list[str] = []

    def now(self) -> dict[str, Any]:
        """Stage, its number and how many there are, seconds left, last line, what has been done."""
        self._read()
        left = self._left
        if left is not None:
            left = max(left - (time.time() - self._written_at), 0.0)
        return {
            "stage": self._stage,
            "number": self._number,
            "of": self._of,
            "left_s": left,
            "line": self._line,
            "kept": list(self._kept),
        }

    def _read(self) -> None:
        try:
            status = self._path.stat()
            if status.st_size < self._offset:  # the run was begun again
                self.__init__(self._path)  # type: ignore[misc]
            self._written_at = status.st_mtime
            with self._path.open("rb") as file:
                file.seek(self._offset)
                while chunk := file.read(CHUNK):
                    self._offset += len(chunk)
                    *lines, self._rest = (self._rest + chunk).split(b"\n")
                    for line in lines:
                        with suppress(ValueError, TypeError, AttributeError):
                            self._take(json.loads(line))
        except OSError:
            return

    def _take(self, entry: dict[str, Any]) -> None:
        if "stages" in entry:
            expected = [float(seconds) for seconds in entry["stages"].values()]
            self._of, self._left = len(expected), sum(expected)
        if "left_s" in entry:
            self._left = float(entry["left_s"])
            self._number, self._of = int(entry["number"]), int(entry["of"])
        self._stage = str(entry.get("stage", self._stage))
        self._line = _line(entry.get("say", self._line))
        if "keep" in entry:
            self._kept = [*self._kept, _line(entry["keep"])][-KEPT:]


def _line(value: Any) -> str:
    """A line for a page."""
    return shortened(cleaned(str(value)))
