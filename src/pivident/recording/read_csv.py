"""Tables as text: .csv, .csv.gz, .txt, .tsv.

Commas, semicolons and tabs separate; ``#`` starts a comment line. A first line of nothing but
numbers is no header: its columns are then called column_1, column_2 … Numbers use a decimal point.
"""

from __future__ import annotations

import csv
import gzip
import io
import re
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from pivident.errors import BadCell, FileFormatError
from pivident.recording.files import HARMLESS_SIZE, existing_file, nameable, refuse_bomb
from pivident.robot.naming import repeated

if TYPE_CHECKING:
    import polars as pl

SEPARATORS = ",;\t"
COMMENT = "#"

#: Longest header, in characters; a file without line ends is not read into memory to find out.
LONGEST_LINE = 2**20

#: Most columns. Each costs the parser some kilobytes, and no log of a robot has so many.
MOST_COLUMNS = 10_000

_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")

#: Longest line or cell that a message repeats, in characters.
LONGEST_QUOTE = 80


def csv_names(path: str | Path) -> tuple[str, ...]:
    """Names of the columns, without loading them.

    Raises:
        FileFormatError: the file is missing, empty or not text.
    """
    return _header(existing_file(path)).names


def read_csv(path: str | Path, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Columns of a text table.

    Args:
        path: the file; ``.gz`` is unpacked on the way.
        names: the columns wanted, which are in the file; all where it is not given. Other
            columns may hold text.

    Returns:
        Each column by its name, shape (samples,).

    Raises:
        FileFormatError: the file is missing, empty, binary, or expands beyond reason.
        BadCell: a line is ragged, or a wanted cell is empty or not a number; names both.
    """
    import polars as pl

    path = existing_file(path)
    header = _header(path)
    wanted = list(header.names if names is None else names)
    place_of = {name: place for place, name in enumerate(header.names)}
    places = sorted({place_of[name] for name in wanted})
    chosen = set(places)
    try:
        frame = pl.read_csv(
            text_content(path),
            has_header=header.present,
            columns=places,
            schema_overrides=[
                pl.Float64 if place in chosen else pl.String for place in range(len(header.names))
            ],
            separator=header.separator,
            comment_prefix=COMMENT,
            encoding="utf8-lossy",
            glob=False,
        )
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        _explain(path, header, wanted, str(error).partition("\n")[0])
    frame = _without_blank_end(frame)
    if frame.height == 0:
        raise FileFormatError(f"{path.name} has a header but no samples; export the log again")
    if sum(frame.null_count().row(0)):
        _explain(path, header, wanted, "a cell is empty")
    by_place = dict(zip(places, frame.get_columns(), strict=True))
    return {name: by_place[place_of[name]].to_numpy() for name in wanted}


@dataclass(frozen=True)
class _Header:
    """What the first line tells: names of the columns, separator, whether it is a header at all."""

    names: tuple[str, ...]
    separator: str
    present: bool


def _header(path: Path) -> _Header:
    """Read the first line that is neither blank nor a comment."""
    first = ""
    with _text(path) as lines:
        for first in _lines(path, lines):
            _refuse_other_files(path, first)
            if first.strip() and not first.startswith(COMMENT):
                break
        else:
            raise FileFormatError(f"{path.name} holds no table; export the log again")
    if len(first) >= LONGEST_LINE:
        raise FileFormatError(
            f"{path.name} has a first line of {LONGEST_LINE} characters or more; is it a table?"
        )
    separator = max(SEPARATORS, key=first.count)
    if not first.count(separator):
        _refuse_title(path, first.strip())
    if first.count(separator) >= MOST_COLUMNS:
        raise FileFormatError(
            f"{path.name} has more than {MOST_COLUMNS} columns; transpose the table, or export "
            "only those of the robot"
        )
    cells = _cells(first, separator)
    if all(_is_number(cell) for cell in cells):
        return _Header(tuple(f"column_{i + 1}" for i in range(len(cells))), separator, False)
    twice = repeated(cells)
    if twice:
        raise FileFormatError(
            f"{path.name} has more than one column {_quoted(twice[0])}; rename them in its header"
        )
    return _Header(tuple(cells), separator, True)


def _refuse_other_files(path: Path, line: str) -> None:
    """Say what a file is that is no table, where one of its first lines tells."""
    beginning = path.read_bytes()[:2] if not _is_gzipped(path) else b""
    if beginning in (b"\xff\xfe", b"\xfe\xff"):
        raise FileFormatError(f"{path.name} is text in UTF-16; save it as UTF-8")
    if "\0" in line or line.startswith(("\ufffdPNG", "%PDF", "PK\x03")):
        raise FileFormatError(f"{path.name} is a binary file, not a text table")
    if line.lstrip().lower().startswith(("<!doctype html", "<html", "<?xml")):
        raise FileFormatError(
            f"{path.name} is a web page or XML, not a table; the download went wrong, or another "
            "file was meant"
        )
    if line.startswith("version https://git-lfs"):
        raise FileFormatError(
            f"{path.name} is a Git LFS pointer and not the log itself; fetch it with git lfs pull"
        )


def _refuse_title(path: Path, first: str) -> None:
    """Refuse a first line of one cell where the lines below it have several."""
    with _text(path) as text:
        below = [x.strip() for _, x in zip(range(20), _lines(path, text), strict=False)]
    below = [x for x in below if x and not x.startswith(COMMENT)][1:3]
    if not below:
        return
    if any(below[0].count(separator) for separator in SEPARATORS):
        raise FileFormatError(
            f"{path.name} begins with {_quoted(first)}, while the lines below have several "
            "columns; the first line must be the header: remove what stands above it, or put # in "
            "front of it"
        )
    words = first.split()
    if len(words) > 1 and len(below[0].split()) == len(words):
        raise FileFormatError(
            f"{path.name} separates its {len(words)} columns by blanks; separate them by commas, "
            "semicolons or tabs"
        )


def _lines(path: Path, text: io.TextIOWrapper) -> Iterator[str]:
    """The lines of a text, or one readable error where its gzip stream breaks."""
    try:
        while line := text.readline(LONGEST_LINE):
            yield line
    except (OSError, EOFError, zlib.error) as error:
        raise FileFormatError(f"{path.name} is not a whole gzip file ({error})") from error


def _without_blank_end(frame: pl.DataFrame) -> pl.DataFrame:
    """The table without blank lines after its last sample."""
    import polars as pl

    filled = frame.select(pl.any_horizontal(pl.all().is_not_null())).to_series().arg_true()
    return frame.head(int(filled[-1]) + 1) if len(filled) else frame.clear()


def text_content(path: Path) -> Path | bytes:
    """What a parser reads: the file itself, or what it holds where it is packed.

    Args:
        path: a text table.

    Raises:
        FileFormatError: it expands beyond reason, or is no whole gzip file.
    """
    return _unpacked(path) if _is_gzipped(path) else nameable(path)


def _is_gzipped(path: Path) -> bool:
    """Whether the file's name says that it is packed."""
    return path.suffix.lower() == ".gz"


def _text(path: Path) -> io.TextIOWrapper:
    """The file as lines of text, unpacked on the way."""
    raw = gzip.open(path, "rb") if _is_gzipped(path) else path.open("rb")
    return io.TextIOWrapper(raw, encoding="utf-8-sig", errors="replace", newline="")


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


def _explain(path: Path, header: _Header, wanted: Sequence[str], reason: str) -> NoReturn:
    """Find the line at fault by reading slowly, and say so."""
    places = {name: header.names.index(name) for name in wanted}
    with _text(path) as lines:
        for number, cells in _rows(lines, header):
            if len(cells) != len(header.names):
                reason = f"it has {len(cells)} cells instead of {len(header.names)}"
                if header.separator == "," and len(cells) > len(header.names):
                    reason += ", perhaps because of decimal commas"
                text = header.separator.join(cells)[:LONGEST_LINE]
                raise BadCell(path.name, number, None, text, reason)
            for name, place in places.items():
                cell = cells[place]
                if not _is_number(cell):
                    reason = _why_no_number(cell, name, number)
                    raise BadCell(path.name, number, name, cell, reason)
    raise FileFormatError(f"{path.name} cannot be read as a table of numbers ({reason})")


def _why_no_number(cell: str, name: str, line: int) -> str:
    """What is wrong with a cell, as far as it tells."""
    if not cell:
        return "the cell is empty"
    reason = f"{_quoted(cell)} is not a number"
    if _DECIMAL_COMMA.fullmatch(cell):
        return f"{reason} (a decimal comma: export with decimal points)"
    if cell == name:
        return f"{reason} but the header once more (were two logs joined?)"
    if line == 2:
        return f"{reason} (a line of units, or a second line of header?)"
    return reason


def _rows(lines: Iterable[str], header: _Header) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of each line below the header that is no comment."""
    above = header.present
    for number, line in enumerate(lines, start=1):
        if line.startswith(COMMENT) or (above and not line.strip()):
            continue
        if above:
            above = False
            continue
        yield number, _cells(line, header.separator)


def _cells(line: str, separator: str) -> list[str]:
    """The cells of one line, without blanks around them and quotes."""
    reader = csv.reader([line.rstrip("\r\n")], delimiter=separator, skipinitialspace=True)
    try:
        cells = next(reader, [])
    except csv.Error:  # a quote that does not end, before a cell longer than the module takes
        cells = line.split(separator)
    return [cell.strip() for cell in cells]


def _quoted(cell: str) -> str:
    """A cell as a message repeats it."""
    return repr(cell if len(cell) <= LONGEST_QUOTE else f"{cell[: LONGEST_QUOTE - 1]}…")


def _is_number(cell: str) -> bool:
    """Whether a cell reads as a number, NaN and infinity included."""
    try:
        float(cell)
    except ValueError:
        return False
    return True
