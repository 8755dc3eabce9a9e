"""The text of an experiment file, or of another small TOML file, and errors that name it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pivident.errors import ExperimentError, PividentError
from pivident.files import regular_file
from pivident.text.toml import MAX_FILE, parse_toml


@contextmanager
def errors_name(path: Path, table: str) -> Iterator[None]:
    """Name file and table in front of an `ExperimentError`, in a note of errors with evidence."""
    try:
        yield
    except ExperimentError as error:
        raise error.headed(f"{path}: {table}".rstrip()) from error
    except PividentError as error:
        error.add_note(f"{path}: {table.rstrip(':')}".rstrip(": "))
        raise


def toml_content(path: Path) -> dict[str, Any]:
    """The tables of an experiment file or another small TOML file, unchecked."""
    try:
        return parse_toml(_file_text(path))
    except ExperimentError:
        raise
    except ValueError as error:
        raise ExperimentError(
            f"is not TOML: {error}", advice=f"{_advice(path, str(error))}"
        ) from error


def _advice(path: Path, error: str) -> str:
    """What to do about a text that is not TOML, as far as the text shows."""
    text = _file_text(path)
    beginning = text.lstrip("\ufeff \t\r\n")
    first = beginning.partition("\n")[0]
    if path.suffix.lower() in (".urdf", ".xacro") or beginning.startswith("<"):
        return "this is a robot description: name it as robot = in an experiment file (.toml)"
    if beginning.startswith("{"):
        return "this looks like JSON; an experiment file is written in TOML"
    if path.suffix.lower() != ".toml" and max(map(first.count, ",;\t")) > 1:
        return (
            "this looks like a log: name it as files = under [recording] of an experiment file, "
            "or ask pivident audit about it"
        )
    line = re.search(r"at line (\d+)", error)
    said = text.splitlines()[int(line[1]) - 1] if line else ""
    if "\\" in said:
        return "a backslash needs single quotes around it, or write / in paths"
    return "correct this line"


def _file_text(path: Path) -> str:
    """Content of an experiment file, or of another small TOML file."""
    try:
        if regular_file(path).stat().st_size > MAX_FILE:
            raise ExperimentError(
                f"has {path.stat().st_size} bytes, too many for an experiment file",
                advice="is it the log?",
            )
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise ExperimentError(
            f"cannot be read ({error.strerror})", advice="check the path and its permissions"
        ) from error
    except UnicodeDecodeError as error:
        raise ExperimentError(
            f"is not UTF-8 text (byte {error.start})", advice="save it as UTF-8"
        ) from None
