"""What follows a finished estimate, attempted: what fails costs its own line, not the estimate.

Tests, held-out motion, causes of model error, the verdict and the report judge an estimate that is
there already. Where one ends with an error, of whatever kind, a line says so and the rest goes on.
"""

from __future__ import annotations

import os
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from pivident.foundation.errors.kinds import PividentError

Made = TypeVar("Made")


class Attempts:
    """Attempts, and the lines of those that failed; ``say`` is called with each line."""

    def __init__(self, say: Callable[[str], None] = lambda line: None) -> None:
        self._say = say
        self.lines: list[str] = []  # whole sentences, each once
        self.errors: list[Exception] = []  # of each attempt that failed

    def of(
        self, heading: str, make: Callable[..., Made], *given: Any, otherwise: Any = None
    ) -> Made | Any:
        """What ``make(*given)`` gives, or ``otherwise`` where it fails.

        ``heading`` begins the line, without a period: ``Nothing could be held out``.
        """
        try:
            return make(*given)
        except BrokenPipeError:  # the reader of what is printed has seen enough
            raise
        except Exception as error:
            line = f"{heading}: {in_words(error).rstrip('.')}."
            self.errors.append(error)
            if line not in self.lines:
                self.lines.append(line)
                self._say(line)
                if is_unexpected(error) and os.environ.get("PIVIDENT_DEBUG", "") not in ("", "0"):
                    traceback.print_exception(error)
            return otherwise

    @property
    def unexpected(self) -> bool:
        """Whether one ended with an error that pivident has not raised on purpose."""
        return any(map(is_unexpected, self.errors))


def is_unexpected(error: BaseException) -> bool:
    """Whether pivident has not raised an error on purpose."""
    return not isinstance(error, PividentError)


def in_words(error: BaseException) -> str:
    """An error with its notes in one line; one that was not raised on purpose says where it is."""
    text = " ".join(str(error).split())
    notes = "".join(f" ({n})" for n in getattr(error, "__notes__", ()))
    if not is_unexpected(error):
        return f"{text}{notes}"
    kind, frames = type(error).__name__, traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if f"{os.sep}pivident{os.sep}" in f.filename]
    where = f" ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own else ""
    if isinstance(error, FloatingPointError | OverflowError) or kind == "LinAlgError":
        return f"numbers that cannot be computed with, {kind}: {text or 'no message'}{where}{notes}"
    return (
        f"unexpected {kind}: {text or 'no message'}{where}{notes}; this is a bug in pivident, "
        "PIVIDENT_DEBUG=1 shows where"
    )
