"""Where a text table begins that a drive or a controller wrote: below lines about the trace.

Name    Scope 1                         lines about the recording, of other numbers of cells
File    C:/traces/one.svdx

Name    A1.ActPos   Name    A1.ActTrq   names, here each behind its key, over time and value
Unit    deg         Unit    Nm          lines about the channels: passed over
0       12.5        0       -3.1        numbers

Which lines are which shows in their structure: numbers begin where several lines have the same
number of cells and nothing but numbers in them. The names stand above, in as many cells.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

from pivident.logs.recognition.channel_words import TIME_UNITS, UNITS

#: Lines of numbers in a row that make a table begin.
IN_A_ROW = 3

#: What a tool writes before the names of its channels.
KEYS = {"name", "names", "channel", "channels", "signal", "kanal"}

#: Cells that are units, in small letters, without brackets.
_UNITS = {*UNITS, *(unit for own in TIME_UNITS.values() for unit in own), "grad", "%", "-", ""}


class Beginning(NamedTuple):
    """Where the names stand."""

    row: int  # of the names, counted from the first line that was looked at
    names: tuple[str, ...]
    below: int  # lines between the names and the numbers


def beginning(rows: Sequence[Sequence[str]], is_number: Callable[[str], bool]) -> Beginning | None:
    """The names below a preamble, or None for a table that begins with its first line.

    Args:
        rows: cells of the first lines.
        is_number: whether a cell is one.
    """
    width = Counter(len(row) for row in rows[len(rows) // 2 :]).most_common(1)[0][0]
    numeric = [
        len(row) == width and any(row) and all(not cell or is_number(cell) for cell in row)
        for row in rows
    ]
    first = next((k for k in range(len(rows)) if all(numeric[k : k + IN_A_ROW])), None)
    if first is None or width < 2 or any(numeric[:first]):  # that table begins before a bad line
        return None
    above = [k for k in range(first) if len(rows[k]) == width]
    keyed = _keyed(rows, above)
    if keyed is not None:
        return Beginning(*keyed, first - keyed[0] - 1)
    names = [k for k in above if _can_be_names(rows[k], is_number)]
    if not names or (first <= 2 and len(rows[0]) == width):
        return None
    block = [k for k in names if all(n in names for n in range(k, names[-1]))]
    last = block[-1]
    if len(block) > 1 and _are_units(rows[last]):
        last = block[-2]
    elif len(block) == 2 and last == first - 1:
        last = block[0]
    between = [k for k in range(last + 1, first) if not _mostly_numbers(rows[k], is_number)]
    below = len(between) if between == list(range(last + 1, last + 1 + len(between))) else 0
    return Beginning(last, tuple(rows[last]), below) if last else None


def _keyed(
    rows: Sequence[Sequence[str]], above: Sequence[int]
) -> tuple[int, tuple[str, ...]] | None:
    """The last line with a key before each name, or before all of them, and the columns' names."""
    if len(above) < 2:
        return None
    for k in reversed(above):
        keys = {cell.lower() for cell in rows[k][::2]}
        if len(rows[k]) > 2 and len(keys) == 1 and keys <= KEYS and len(rows[k]) % 2 == 0:
            names = rows[k][1::2]
            return k, tuple(text for name in names for text in (f"time {name}", name))
    for k in reversed(above):
        if rows[k][0].lower() in KEYS and all(rows[k]):
            return k, ("time", *rows[k][1:])
    return None


def _can_be_names(row: Sequence[str], is_number: Callable[[str], bool]) -> bool:
    """Whether the cells differ, no cell is a number, and none but the last is empty."""
    return all(row[:-1]) and len(set(row)) == len(row) and not any(map(is_number, row))


def _are_units(row: Sequence[str]) -> bool:
    return all(cell.lower().strip("[](){} ") in _UNITS for cell in row)


def _mostly_numbers(row: Sequence[str], is_number: Callable[[str], bool]) -> bool:
    return 2 * sum(map(is_number, row)) > len(row)
