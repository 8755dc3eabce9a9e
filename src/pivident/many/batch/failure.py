"""What is kept of a task that failed: whatever went wrong is a row too."""

from __future__ import annotations

from pivident.many.batch.results_folder import Row

#: Longest error message that is kept.
MAX_MESSAGE = 500


def failure(error: BaseException, seconds: float) -> Row:
    """Error class and message in place of estimates."""
    notes = "".join(f" ({n})" for n in getattr(error, "__notes__", ()))
    message = (" ".join(str(error).split()) + notes)[:MAX_MESSAGE]
    return {"error": type(error).__name__, "message": message, "seconds": seconds}
