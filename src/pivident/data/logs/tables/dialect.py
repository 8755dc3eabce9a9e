"""How a text table was written, by its first lines.

sep=;                                   a title or a hint to a spreadsheet: passed over
Zeit;A1_Ist;A2_Ist                      the header
s;Grad;Grad                             units: passed over
0,004;12,5;-90,0                        numbers with a decimal comma

A table that a drive or a controller wrote begins below lines about the trace, passed over, too:

Name    Scope 1                         lines about the recording, of other numbers of cells
File    C:/traces/one.svdx

Name    A1.ActPos   Name    A1.ActTrq   names, here each behind its key, over time and value
Unit    deg         Unit    Nm          lines about the channels: passed over
0       12.5        0       -3.1        numbers

Which lines are which shows in their structure: numbers begin where several lines have the same
number of cells and nothing but numbers in them. The names stand above, in as many cells.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from pivident.data.logs.recognition.channel_words import TIME_UNITS, UNITS
from pivident.foundation.errors import FileFormatError
from pivident.robot.naming import repeated

SEPARATORS = ",;\t"
COMMENT = "#"

#: Longest header, in characters; a file without line ends is not read into memory to find out.
MAX_LINE = 2**20

#: Most columns. Each costs the parser some kilobytes, and no log of a robot has so many.
MAX_COLUMNS = 10_000

#: Longest line or cell that a message repeats, in characters.
MAX_QUOTE = 80

#: Lines that are looked at.
LOOKED_AT = 100

_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")

_THOUSANDS = re.compile(r"[-+]?\d{1,3}(?:\.\d{3})+(?:,\d*)?")


@dataclass(frozen=True)
class Dialect:
    """How a table was written."""

    names: tuple[str, ...]  # names of the columns
    separator: str  # what stands between cells; a tab where runs of blanks do
    present: bool  # whether there is a header
    above: int = 0  # lines above it, or above the first numbers, that are no part of the table
    units: int = 0  # lines of units, types or comments that follow the header
    decimal_comma: bool = False  # whether numbers have a decimal comma
    blanks: bool = False  # whether cells are separated by blanks, one or more


def dialect_of(file: str, lines: Iterable[str]) -> Dialect:
    """How a table was written."""
    looked_at: list[tuple[int, str]] = []
    for number, line in enumerate(lines):
        if "\0" in line:
            raise FileFormatError(f"{file} is a binary file, not a text table")
        if len(line) >= MAX_LINE:
            if not looked_at:
                raise FileFormatError(
                    f"{file} has a first line of {MAX_LINE} characters or more",
                    advice="is it a table?",
                )
            break
        if line.strip() and not line.startswith(COMMENT):
            looked_at.append((number, line))
            if len(looked_at) >= LOOKED_AT:
                break
    if not looked_at:
        raise FileFormatError(f"{file} holds no table", advice="export the log again")
    title = _title(looked_at)
    rows = looked_at[title:]
    separator = _separator([line for _, line in rows])
    blanks = not _tail(rows)[0][1].count(separator) and _by_blanks([x for _, x in _tail(rows)])
    if max(line.count(separator) for _, line in rows) >= MAX_COLUMNS or (
        blanks and len(rows[0][1].split()) > MAX_COLUMNS
    ):
        raise FileFormatError(
            f"{file} has more than {MAX_COLUMNS} columns",
            advice="transpose the table, or export only those of the robot",
        )
    cells = [line.split() if blanks else cells_of(line, separator) for _, line in rows]
    comma = (separator != "," or blanks) and any(
        _DECIMAL_COMMA.fullmatch(cell) for row in cells for cell in row
    )
    begun = beginning(cells, lambda cell: is_number(cell, comma))
    if begun is not None:
        rows, cells = rows[begun.row :], cells[begun.row :]
        title += begun.row
    thousands = [c for row in cells for c in row if comma and _THOUSANDS.fullmatch(c)]
    if thousands:
        raise FileFormatError(
            f"{file} has decimal commas, and a number {quoted(thousands[0])} that may be a "
            "thousand",
            advice="export it without marks between thousands",
        )
    above = rows[0][0] if title else 0
    separator = "\t" if blanks else separator
    if begun is None and all(is_number(cell, comma) for cell in cells[0]):
        numbered = tuple(f"column_{i + 1}" for i in range(len(cells[0])))
        return Dialect(numbered, separator, False, above, 0, comma, blanks)
    names = tuple(cells[0]) if begun is None else begun.names
    twice = repeated(names)
    if twice:
        raise FileFormatError(
            f"{file} has more than one column {quoted(twice[0])}",
            advice="rename them in its header",
        )
    units = int(_has_units(cells, comma)) if begun is None else begun.below
    return Dialect(names, separator, True, above, units, comma, blanks)


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of one line, without blanks around them and quotes."""
    reader = csv.reader([line.rstrip("\r\n")], delimiter=separator, skipinitialspace=True)
    try:
        cells = next(reader, [])
    except csv.Error:  # a quote that does not end, before a cell longer than the module takes
        cells = line.split(separator)
    return [cell.strip() for cell in cells]


def quoted(cell: str) -> str:
    """A cell as a message repeats it."""
    return repr(cell if len(cell) <= MAX_QUOTE else f"{cell[: MAX_QUOTE - 1]}…")


def is_number(cell: str, decimal_comma: bool = False) -> bool:
    """Whether a cell reads as a number, NaN and infinity included."""
    if decimal_comma:
        cell = cell.replace(",", ".", 1)
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _tail(lines: Sequence[Any]) -> Sequence[Any]:
    """The later half of the lines, below what may stand above a table."""
    return lines[len(lines) // 2 :]


def _separator(lines: Sequence[str]) -> str:
    """What stands between cells: a semicolon or tab alike in all lines, else the most frequent."""
    for some in (lines, _tail(lines) if len(lines) > 2 * IN_A_ROW else lines):
        for separator in SEPARATORS[1:]:
            counts = {line.count(separator) for line in some}
            if len(counts) == 1 and counts.pop():
                return separator
    return max(SEPARATORS, key=lines[0].count)


def _title(lines: Sequence[tuple[int, str]]) -> int:
    """Number of lines that stand above the header: hints to spreadsheets, titles without cells."""

    def has_cells(line: str) -> bool:
        return any(separator in line for separator in SEPARATORS)

    if lines[0][1].lower().startswith("sep=") and len(lines) > 1:
        return 1
    if has_cells(lines[0][1]) or is_number(lines[0][1].strip()):
        return 0
    for k, (_, line) in enumerate(lines):
        if has_cells(line):
            # Every line from the header on has cells; of a column of text with one comma, not.
            return (
                k if all(has_cells(later) for _, later in lines[k:]) and len(lines) > k + 1 else 0
            )
        if is_number(line.split()[0]):
            return 0
    return 0


def _by_blanks(lines: Sequence[str]) -> bool:
    """Whether all lines have the same number of words, more than one."""
    counts = {len(line.split()) for line in lines}
    return len(counts) == 1 and counts.pop() > 1


def _has_units(cells: Sequence[Sequence[str]], comma: bool) -> bool:
    """Whether the line below the header holds no number, while the next one does."""
    if len(cells) < 3 or not any(cells[1]) or len(cells[1]) != len(cells[0]):
        return False
    second, third = (any(is_number(cell, comma) for cell in row) for row in cells[1:3])
    return third and not second


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
    if len(block) > 1 and all(cell.lower().strip("[](){} ") in _UNITS for cell in rows[last]):
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


def _mostly_numbers(row: Sequence[str], is_number: Callable[[str], bool]) -> bool:
    return 2 * sum(map(is_number, row)) > len(row)
