"""Tables as text: .csv, .csv.gz, .txt, .tsv.

Commas, semicolons, tabs and blanks separate; ``#`` starts a comment line. A first line of nothing
but numbers is no header: its columns are then called column_1, column_2 … Numbers use a decimal
point, or a comma where something else separates. A title above the header and a line of units below
it are passed over; `pivident.logs.tables.dialect` finds all this out.
"""

from __future__ import annotations

import gzip
import io
import zlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from pivident.errors import BadCell, FileFormatError
from pivident.logs.source_files import HARMLESS_SIZE, existing_file, nameable, refuse_bomb
from pivident.logs.tables.dialect import (
    COMMENT,
    MAX_LINE,
    Dialect,
    cells_of,
    dialect_of,
    is_number,
    quoted,
)

if TYPE_CHECKING:
    import polars as pl


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
            _table_content(path, header),
            columns=places,
            schema_overrides=[
                pl.Float64 if place in chosen else pl.String for place in range(len(header.names))
            ],
            **_parsing(header),
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


def read_csv_forgiving(path: str | Path) -> dict[str, np.ndarray]:
    """All columns of a text table that hold numbers, NaN where a cell is empty or no number.

    Raises:
        FileFormatError: the file cannot be read as a table at all.
    """
    import polars as pl

    path = existing_file(path)
    header = _header(path)
    try:
        frame = pl.read_csv(
            _table_content(path, header),
            infer_schema=False,
            truncate_ragged_lines=True,
            **(_parsing(header) | {"decimal_comma": False}),
        )
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        reason = str(error).partition("\n")[0]
        raise FileFormatError(f"{path.name} cannot be read as a table ({reason})") from error
    table = {}
    for name, column in zip(header.names, frame.get_columns(), strict=False):
        text = column.str.strip_chars()
        text = text.str.replace(",", ".", literal=True) if header.decimal_comma else text
        numbers = text.cast(pl.Float64, strict=False)
        if numbers.null_count() < len(numbers):
            values = numbers.fill_null(float("nan")).to_numpy()
            table[name] = np.array(values, dtype=float)
    return table


def _parsing(header: Dialect) -> dict[str, Any]:
    """The parser's options for a dialect."""
    return {
        "has_header": header.present,
        "separator": header.separator,
        "decimal_comma": header.decimal_comma,
        "skip_rows": 0 if header.blanks else header.above,
        "skip_rows_after_header": int(header.units),
        "comment_prefix": COMMENT,
        "encoding": "utf8-lossy",
        "glob": False,
    }


def _header(path: Path) -> Dialect:
    """What the first lines show; see `pivident.logs.tables.dialect`."""
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
            f"{path.name} is a web page or XML, not a table; the download went wrong, or another "
            "file was meant"
        )
    if line.startswith("version https://git-lfs"):
        raise FileFormatError(
            f"{path.name} is a Git LFS pointer and not the log itself; fetch it with git lfs pull"
        )


def _lines(path: Path, text: io.TextIOWrapper) -> Iterator[str]:
    """The lines of a text, or one readable error where its gzip stream breaks."""
    try:
        while line := text.readline(MAX_LINE):
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

    Raises:
        FileFormatError: it expands beyond reason, or is no whole gzip file.
    """
    encoding = _encoding(path)
    if encoding == "utf-16":
        content = _unpacked(path) if _is_gzipped(path) else path.read_bytes()
        return content.decode(encoding, "replace").encode()
    return _unpacked(path) if _is_gzipped(path) else nameable(path)


def _table_content(path: Path, header: Dialect) -> Path | bytes:
    """What the parser reads, with single tabs for the blanks that separate."""
    if not header.blanks:
        return text_content(path)
    out = io.BytesIO()
    with _text(path) as lines:
        for number, line in enumerate(_lines(path, lines)):
            if number >= header.above and (line.startswith(COMMENT) or line.strip()):
                out.write(b"\t".join(cell.encode() for cell in line.split()) + b"\n")
    return out.getvalue()


def _is_gzipped(path: Path) -> bool:
    """Whether the file's name says that it is packed."""
    return path.suffix.lower() == ".gz"


def _text(path: Path) -> io.TextIOWrapper:
    """The file as lines of text, unpacked on the way."""
    raw = gzip.open(path, "rb") if _is_gzipped(path) else path.open("rb")
    return io.TextIOWrapper(raw, encoding=_encoding(path), errors="replace", newline="")


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
        for number, cells in _rows(lines, header):
            if len(cells) != len(header.names):
                reason = f"it has {len(cells)} cells instead of {len(header.names)}"
                if header.separator == "," and len(cells) > len(header.names):
                    reason += ", perhaps because of decimal commas"
                text = header.separator.join(cells)[:MAX_LINE]
                raise BadCell(path.name, number, None, text, reason)
            for name, place in places.items():
                cell = cells[place]
                if not is_number(cell, header.decimal_comma):
                    reason = _why_no_number(cell, name, number)
                    raise BadCell(path.name, number, name, cell, reason)
    raise FileFormatError(f"{path.name} cannot be read as a table of numbers ({reason})")


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
    """Line number and cells of each line below the header that is no comment."""
    above = int(header.present) + int(header.units)
    for number, line in enumerate(lines, start=1):
        if number <= header.above or line.startswith(COMMENT) or (above and not line.strip()):
            continue
        if header.blanks and not line.strip():
            continue
        if above:
            above -= 1
            continue
        yield number, line.split() if header.blanks else cells_of(line, header.separator)
