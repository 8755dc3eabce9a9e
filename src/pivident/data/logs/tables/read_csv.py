"""Tables as text: .csv, .csv.gz, .txt, .tsv.

Commas, semicolons, tabs and blanks separate; ``#`` starts a comment line. A first line of nothing
but numbers is no header: its columns are then called column_1, column_2 … Numbers use a decimal
point, or a comma where something else separates. A title above the header and a line of units below
it are passed over; `pivident.data.logs.tables.dialect` finds all this out.
"""

from __future__ import annotations

import gzip
import io
import math
import zlib
from array import array
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import NoReturn

import numpy as np

from pivident.data.logs.reader import Reader
from pivident.data.logs.source_files import HARMLESS_SIZE, refuse_bomb
from pivident.data.logs.tables.dialect import (
    COMMENT,
    MAX_LINE,
    Dialect,
    cells_of,
    dialect_of,
    is_number,
    quoted,
)
from pivident.foundation.errors import BadCell, FileFormatError, NoSamples

#: Last line of the exports of some tools.
END = "EOF"

#: Share of empty cells in a column of so many lines from which on no single line is at fault.
SPARSE, MANY = 0.1, 20


def csv_names(path: Path) -> tuple[str, ...]:
    """Names of the columns, without loading them."""
    return _header(path).names


def read_csv(path: Path, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Columns of a text table, each of shape (samples,)."""
    header = _header(path)
    wanted = list(header.names if names is None else names)
    places = [header.names.index(name) for name in wanted]
    table = np.empty((0, len(places)))
    try:
        table = _numbers(path, header, places)
    except FileFormatError:
        raise
    except ValueError as error:
        try:
            table = _numbers(path, header, places, _last_sample(path, header, places))
        except ValueError:
            _explain(path, header, wanted, str(error).partition("\n")[0])
    if not len(table):
        raise NoSamples(path.name)
    return dict(zip(wanted, np.ascontiguousarray(table.T), strict=True))


def read_csv_forgiving(path: Path) -> dict[str, np.ndarray]:
    """All columns of a text table that hold numbers, NaN where a cell is empty or no number."""
    header = _header(path)
    columns = [array("d") for _ in header.names]
    holds_numbers = [False] * len(columns)
    with _whole_text(path) as text:
        for _, cells in _rows(_lines(path, text), header):
            for place, column in enumerate(columns):
                number = _number(cells[place], header) if place < len(cells) else None
                column.append(math.nan if number is None else number)
                if number is not None:
                    holds_numbers[place] = True
    return {
        name: np.array(column)
        for name, column, kept in zip(header.names, columns, holds_numbers, strict=True)
        if kept
    }


def _numbers(
    path: Path, header: Dialect, places: Sequence[int], last: int | None = None
) -> np.ndarray:
    """Columns at some places, shape (samples, columns), up to a line of the file."""
    with _whole_text(path) as text:
        lines = _plain_lines(_lines(path, text), header, last)
        first = next(lines, None)
        if first is None or not places:
            return np.empty((0, len(places)))
        return np.loadtxt(
            chain((first,), lines),
            delimiter=header.separator,
            comments=None,
            usecols=places,
            ndmin=2,
        )


def _plain_lines(lines: Iterable[str], header: Dialect, last: int | None) -> Iterator[str]:
    """Lines of samples as `numpy.loadtxt` reads them; blank ones at the end are left out."""
    separator, most = header.separator, len(header.names) - 1
    blank = False
    rows = _sample_lines(lines, header)
    for number, line in rows:
        if last is not None and number > last:
            return
        if header.blanks:
            line = separator.join(line.split())
        if '"' in line:
            cells = cells_of(_with_the_rest(line, rows), separator)
            line = separator.join(" ".join(cell.replace(separator, " ").split()) for cell in cells)
        if header.decimal_comma:
            line = line.replace(",", ".")
        if not line.strip(separator + " \t\r\n"):
            blank = True
        elif blank:
            raise ValueError("a line is blank")
        elif line.count(separator) > most:
            raise ValueError("a line has too many cells")
        else:
            yield line


def _with_the_rest(line: str, rows: Iterator[tuple[int, str]]) -> str:
    """A line with those on which its quoted cells go on."""
    parts, quotes, length = [line], line.count('"'), len(line)
    while quotes % 2 and length < MAX_LINE and (more := next(rows, None)):
        parts.append(more[1])
        quotes, length = quotes + more[1].count('"'), length + len(more[1])
    return "".join(parts)


def _last_sample(path: Path, header: Dialect, places: Sequence[int]) -> int:
    """Number of the last line that has any of the wanted cells, or too many."""
    found = 0
    with _whole_text(path) as text:
        for number, cells in _rows(_lines(path, text), header):
            filled = any(cells[place] for place in places if place < len(cells))
            if filled or len(cells) > len(header.names):
                found = number
    return found


def _number(cell: str, header: Dialect) -> float | None:
    """The number in a cell, if it holds one."""
    text = cell.strip('"')
    text = text.replace(",", ".", 1) if header.decimal_comma else text
    try:
        return float(text) if text.isascii() and "_" not in text else None
    except ValueError:
        return None


def _header(path: Path) -> Dialect:
    """What the first lines show; see `pivident.data.logs.tables.dialect`."""
    with _text(path) as lines:
        return dialect_of(path.name, _tables_only(path, _lines(path, lines)))


def _tables_only(path: Path, lines: Iterable[str]) -> Iterator[str]:
    """The same lines, while none shows that the file is something else."""
    for line in lines:
        _refuse_other_files(path, line)
        yield line


def _refuse_other_files(path: Path, line: str) -> None:
    """Say what a file is that is no table, where one of its first lines shows it."""
    if "\0" in line or line.startswith(("\ufffdPNG", "%PDF", "PK\x03")):
        raise FileFormatError(f"{path.name} is a binary file, not a text table")
    if line.lstrip().lower().startswith(("<!doctype html", "<html", "<?xml")):
        raise FileFormatError(
            f"{path.name} is a web page or XML, not a table",
            advice="the download went wrong, or another file was meant",
        )
    if line.startswith("version https://git-lfs"):
        raise FileFormatError(
            f"{path.name} is a Git LFS pointer and not the log itself",
            advice="fetch it with git lfs pull",
        )


def _lines(path: Path, text: io.TextIOWrapper) -> Iterator[str]:
    """The lines of a text, or one readable error where its gzip stream breaks."""
    try:
        while line := text.readline(MAX_LINE):
            yield line
    except (OSError, EOFError, zlib.error) as error:
        raise FileFormatError(f"{path.name} is not a whole gzip file ({error})") from error


def _is_gzipped(path: Path) -> bool:
    """Whether the file's name says that it is packed."""
    return path.suffix.lower() == ".gz"


def _text(path: Path) -> io.TextIOWrapper:
    """The file as lines of text, unpacked on the way."""
    raw = gzip.open(path, "rb") if _is_gzipped(path) else path.open("rb")
    return io.TextIOWrapper(raw, encoding=_encoding(path), errors="replace", newline="")


def _whole_text(path: Path) -> io.TextIOWrapper:
    """The same lines, once an archive is known to expand within reason."""
    if not _is_gzipped(path):
        return _text(path)
    content = io.BytesIO(_unpacked(path))
    return io.TextIOWrapper(content, encoding=_encoding(path), errors="replace", newline="")


def _encoding(path: Path) -> str:
    """UTF-16 where the first bytes say so, as exports of some controllers on Windows do."""
    try:
        with gzip.open(path, "rb") if _is_gzipped(path) else path.open("rb") as raw:
            mark = raw.read(2)
    except (OSError, EOFError, zlib.error):
        mark = b""  # said where the content is read
    return "utf-16" if mark in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"


def _unpacked(path: Path, chunk: int = 2**22) -> bytes:
    """Content of a gzip file, refused as soon as it grows out of proportion."""
    content = io.BytesIO()
    try:
        with gzip.open(path, "rb") as stream:
            while block := stream.read(chunk):
                content.write(block)
                if content.tell() > HARMLESS_SIZE:
                    refuse_bomb(path, content.tell())
    except (OSError, EOFError, zlib.error) as error:
        raise FileFormatError(f"{path.name} is not a whole gzip file ({error})") from error
    return content.getvalue()


def _explain(path: Path, header: Dialect, wanted: Sequence[str], reason: str) -> NoReturn:
    """Find the line at fault by reading slowly, and say so."""
    places = {name: header.names.index(name) for name in wanted}
    with _text(path) as lines:
        rows = _rows(lines, header)
        for number, cells in rows:
            if len(cells) != len(header.names):
                reason = f"it has {len(cells)} cells instead of {len(header.names)}"
                if header.separator == "," and len(cells) > len(header.names):
                    reason += ", perhaps because of decimal commas"
                text = header.separator.join(cells)[:MAX_LINE]
                raise BadCell(path.name, number, None, text, reason)
            for name, place in places.items():
                cell = cells[place]
                if not cell:
                    below = [not own[place] for _, own in rows if len(own) > place]
                    share = (1 + sum(below)) / (1 + len(below))
                    if share > SPARSE and len(below) > MANY:
                        raise BadCell(path.name, number, name, cell, *_sparse(share))
                if not is_number(cell, header.decimal_comma):
                    reason = _why_no_number(cell, name, number)
                    raise BadCell(path.name, number, name, cell, reason)
    raise FileFormatError(f"{path.name} cannot be read as a table of numbers ({reason})")


def _sparse(share: float) -> tuple[str, str]:
    """What is wrong with a column that is empty in a share of its lines, and what to do."""
    return (
        f"the cell is empty, as {100 * share:.0f} % of the column from there on: topics of "
        "different rates in one table",
        "export each topic to a file of its own, and give all of them (docs/logs.md, separate "
        "clocks)",
    )


def _why_no_number(cell: str, name: str, line: int) -> str:
    """What is wrong with a cell, as far as it shows."""
    if not cell:
        return "the cell is empty"
    reason = f"{quoted(cell)} is not a number"
    if cell == name:
        return f"{reason} but the header once more (were two logs joined?)"
    if line == 2:
        return f"{reason} (a line of units, or a second line of header?)"
    return reason


def _rows(lines: Iterable[str], header: Dialect) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of each line of samples."""
    for number, line in _sample_lines(lines, header):
        yield number, line.split() if header.blanks else cells_of(line, header.separator)


def _sample_lines(lines: Iterable[str], header: Dialect) -> Iterator[tuple[int, str]]:
    """Number and text of each line below the header that is no comment."""
    above, begun = int(header.present) + header.units, False
    for number, line in enumerate(lines, start=1):
        if number <= header.above or line.startswith(COMMENT):
            continue
        if (header.blanks or not begun) and not line.strip():
            continue
        if above:
            above -= 1
        elif not (line.startswith(END) and line.strip() == END):
            begun = True
            yield number, line


#: The reader of tables as text.
CSV = Reader(
    (".csv", ".txt", ".tsv"),
    csv_names,
    read_csv,
    forgiving=read_csv_forgiving,
    packed=(".gz",),
    is_text=True,
)
