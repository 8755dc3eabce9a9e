"""Results as plain values, as CSV, and as strict JSON: numbers that are not finite are null."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any


def plain(value: Any) -> Any:
    """Lists, dictionaries, texts and finite numbers; anything else as its text.

    Fields that a dataclass does not print, such as drawn arrays, stay out.
    """
    if isinstance(value, float):  # most values are
        return float(value) if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    if hasattr(value, "tolist"):  # an array or number of NumPy, which is heavy to import
        return plain(value.tolist())
    if is_dataclass(value) and not isinstance(value, type):
        return {
            field.name: plain(getattr(value, field.name)) for field in fields(value) if field.repr
        }
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    return str(value)


def strict_json(value: Any) -> str:
    """JSON on one line."""
    return json.dumps(value, allow_nan=False, ensure_ascii=False)


def json_of_entries(content: Mapping[str, Any]) -> str:
    """A JSON object with a line for each key, and for each element of a list."""
    entries = []
    for key, value in content.items():
        text = strict_json(value)
        if isinstance(value, list) and value:
            text = "[\n    " + ",\n    ".join(map(strict_json, value)) + "\n  ]"
        entries.append(f"  {strict_json(key)}: {text}")
    return "{\n" + ",\n".join(entries) + "\n}\n"


def csv_table(columns: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """A table with its header as comma-separated values; None is left empty."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return stream.getvalue()


def write_json(path: Path, content: Any) -> None:
    """Write plain values as JSON; file names in it may hold bytes that are no text."""
    text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
    path.write_text(text, encoding="utf-8", errors="backslashreplace")
