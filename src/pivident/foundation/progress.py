"""What long work says while it goes on: to who asked for it, and to the logger ``pivident``.

A stage that has ended is logged with its time as INFO; each line when it is said, those of the
iterations among them, as DEBUG. Nothing is shown unless the program around sets up `logging`.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from time import perf_counter
from typing import Self

LOGGER = logging.getLogger("pivident")
LOGGER.addHandler(logging.NullHandler())

#: Called with one line at each stage.
Say = Callable[[str], None]


class IterationLine(str):
    """A line about an iteration that has been done; any other line begins a stage."""


class Stages:
    """Lines of long work as it says them; its stages are timed and logged.

    Use it as a context: the last stage ends with it.
    """

    def __init__(self, say: Say | None) -> None:
        self._say, self._stage, self._begin = say, "", 0.0

    @classmethod
    def of(cls, say: Say | None) -> Stages:
        """Those of the caller where it has some; what it is part of logs its lines then.

        Args:
            say: called with each line, or None.
        """
        return say if isinstance(say, Stages) else cls(say)

    def __call__(self, line: str) -> None:
        """Log a line and hand it on; the stage before ends where it begins another.

        Args:
            line: of a stage that begins, or an `IterationLine`.
        """
        if not isinstance(line, IterationLine):
            self._end()
            self._stage, self._begin = line, perf_counter()
        LOGGER.debug("%s", line)
        if self._say is not None:
            self._say(line)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._end()

    def _end(self) -> None:
        if self._stage:
            LOGGER.info("%s: %.2f s", self._stage, perf_counter() - self._begin)
        self._stage = ""
