"""How commands end: their exit codes, and the error of a command line that means nothing."""

from __future__ import annotations

from pivident.errors import PividentError

DONE, WRONG_INPUT, WRONG_USAGE, NOT_CONVERGED, FAULTY_LOG, INTERRUPTED = 0, 1, 2, 3, 4, 130


class UsageError(PividentError):
    """A command line that cannot be understood."""
