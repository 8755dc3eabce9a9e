"""The row of a failed task: error class and message."""

from __future__ import annotations

from pivident.many.batch.results_folder import Row

#: Largest length of an error message.
MAX_MESSAGE = 500


def failure(error: BaseException, seconds: float) -> Row:
    """Error class and message in place of estimates."""
    notes = "".join(f" ({n})" for n in getattr(error, "__notes__", ()))
    message = (" ".join(str(error).split()) + notes)[:MAX_MESSAGE]
    return {"error": type(error).__name__, "message": message, "seconds": seconds}
