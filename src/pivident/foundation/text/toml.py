"""TOML from untrusted files: results and errors in bounded time.

The standard parser takes time quadratic in the parts of a key, and follows nested values by
recursion; both are bounded here.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Mapping
from typing import Any

#: Largest file that is read as TOML [bytes]; larger ones are logs.
MAX_FILE = 2**20

#: Maximum number of parts of a dotted key. No key here has more than seven.
MAX_PARTS = 12

_PART = r"(?:[\w-]++|\"(?:[^\"\\\n]|\\.)*+\"|'[^'\n]*+')"
_LONG_KEY = re.compile(rf"(?<![\w.\"'-])(?:{_PART}[ \t]*+\.[ \t]*+){{{MAX_PARTS}}}")


def parse_toml(text: str) -> dict[str, Any]:
    """The tables of a TOML text."""
    long_key = _LONG_KEY.search(text)
    if long_key is not None:
        line = text.count("\n", 0, long_key.start()) + 1
        raise ValueError(f"a key has more than {MAX_PARTS} parts (at line {line})")
    try:
        tables = tomllib.loads(text)
    except RecursionError:
        raise ValueError("its values are nested too deeply") from None
    except tomllib.TOMLDecodeError:
        raise
    except ValueError as error:  # a whole number of thousands of digits
        raise ValueError(str(error).partition(";")[0]) from None
    _check_whole_numbers(tables)
    return tables


def toml_lines(tables: Mapping[str, Any], heading: str = "") -> list[str]:
    """Tables as TOML, one dotted key to a line; keys of None are left out."""
    lines = []
    for key, value in tables.items():
        name = f"{heading}.{key}" if heading else key
        if isinstance(value, Mapping) and value:
            lines += toml_lines(value, name)
        elif value is not None:
            lines.append(f"{name} = {toml_value(value)}")
    return lines


def toml_value(value: Any) -> str:
    """One value on one line; keys of None are left out."""
    if isinstance(value, Mapping):
        pairs = (f"{key} = {toml_value(x)}" for key, x in value.items() if x is not None)
        return "{" + ", ".join(pairs) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return json.dumps(value, ensure_ascii=False, default=str)


def _check_whole_numbers(value: Any, key: str = "") -> None:
    """Refuse whole numbers beyond 64 bits, which the parser accepts."""
    if isinstance(value, dict):
        for name, inner in value.items():
            _check_whole_numbers(inner, name)
    elif isinstance(value, list):
        for inner in value:
            _check_whole_numbers(inner, key)
    elif isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise ValueError(f"key {key!r} is a whole number beyond the 64 bits that TOML has for it")
