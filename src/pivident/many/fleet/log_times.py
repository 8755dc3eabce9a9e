"""When a log was taken, told from texts in its path: dates, moments, or plain numbers."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime

_DATE = re.compile(r"(?<!\d)(\d{4}-?[01]\d-?[0-3]\d)(?!\d)")

#: Place on the time axis and text of a moment, None where a text is none.
Moment = Callable[[str], tuple[float, str] | None]


def kind_of_times(texts: Sequence[str], required: bool) -> tuple[str, Moment | None]:
    """``date``, ``number`` or ``order``, and what reads such a text.

    As most texts are; ``order`` where that is unclear. A minority of texts named as times
    (``required``) may be faulty.
    """
    for kind, read in (("date", as_date), ("number", as_number)):
        wrong = sum(read(text) is None for text in texts)
        if wrong == 0 or (required and 2 * wrong < len(texts)):
            return kind, read
    return "order", None


def date_in(name: str) -> str:
    """A date in the name of a file, empty where there is none."""
    found = _DATE.search(name)
    return found[1] if found else ""


def as_date(text: str) -> tuple[float, str] | None:
    """Days since 1970 and ISO text of a date (and time of day), None where it is none."""
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
    """A moment as ISO has it, and as file names have it, where ':' is not allowed."""
    yield text
    found = re.fullmatch(r"(\d{4}-?\d\d-?\d\d)[T_ -](\d\d)[-_.]?(\d\d)(?:[-_.]?(\d\d))?", text)
    if found:
        yield f"{found[1]}T{found[2]}:{found[3]}:{found[4] or '00'}"


def as_number(text: str) -> tuple[float, str] | None:
    """A finite number, None where it is none."""
    try:
        value = float(text)
    except ValueError:
        return None
    return (value, text) if abs(value) < 1e15 else None
