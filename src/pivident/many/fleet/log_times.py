"""Time of a log from texts in its path: dates, times of day, or plain numbers."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime

_DATE = re.compile(r"(?<!\d)(\d{4}-?[01]\d-?[0-3]\d)(?!\d)")

#: Position on the time axis and text of a moment, None for another text.
Moment = Callable[[str], tuple[float, str] | None]


def kind_of_times(texts: Sequence[str], required: bool) -> tuple[str, Moment | None]:
    """``date``, ``number`` or ``order`` (if unclear), and the parser of such a text.

    A minority of texts named as times (``required``) may be faulty.
    """
    for kind, read in (("date", as_date), ("number", as_number)):
        wrong = sum(read(text) is None for text in texts)
        if wrong == 0 or (required and 2 * wrong < len(texts)):
            return kind, read
    return "order", None


def date_in(name: str) -> str:
    """A date in the name of a file, empty without one."""
    found = _DATE.search(name)
    return found[1] if found else ""


def as_date(text: str) -> tuple[float, str] | None:
    """Days since 1970 and ISO text of a date (and time of day), None for another text."""
    for candidate in _spellings(text):
        try:
            moment = datetime.fromisoformat(candidate)
        except ValueError:
            continue
        aware = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
        plain = moment.date().isoformat() if len(text) <= 10 else moment.isoformat()
        return aware.timestamp() / 86400.0, plain
    return None


def _spellings(text: str) -> Iterator[str]:
    """A moment in ISO format, and in that of file names, where ':' is not allowed."""
    yield text
    found = re.fullmatch(r"(\d{4}-?\d\d-?\d\d)[T_ -](\d\d)[-_.]?(\d\d)(?:[-_.]?(\d\d))?", text)
    if found:
        yield f"{found[1]}T{found[2]}:{found[3]}:{found[4] or '00'}"


def as_number(text: str) -> tuple[float, str] | None:
    """A finite number, None for another text."""
    try:
        value = float(text)
    except ValueError:
        return None
    return (value, text) if abs(value) < 1e15 else None
