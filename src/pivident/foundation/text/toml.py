"""TOML from untrusted files: results and errors in bounded time.

The standard parser takes time quadratic in the parts of a key, and follows nested values by
recursion; both are bounded here.

Keys, values and comments as TOML, laid out for people who edit them.
"""

from __future__ import annotations

import json
import math
import re
import textwrap
import tomllib
from collections.abc import Mapping
from datetime import date, time
from typing import Any

from pivident.foundation.text.printable import escaped

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


#: Width from which on a list takes a line for each entry, in characters.
WIDTH = 98

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def key_text(key: str) -> str:
    """A key of TOML, quoted where it has to be."""
    return key if _BARE_KEY.fullmatch(key) else string_text(key)


def string_text(text: str) -> str:
    """A string of TOML in quotation marks."""
    out = []
    for character in text:
        code = ord(character)
        if character in '"\\':
            out.append(f"\\{character}")
        elif code < 0x20 or 0x7F <= code < 0xA0 or code in (0x2028, 0x2029):
            out.append(f"\\u{code:04X}")
        else:
            out.append(character)
    return f'"{"".join(out)}"'


def value_text(value: Any, width: int = WIDTH) -> str:
    """A value of TOML; long lists take a line for each entry."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return string_text(value)
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, dict):  # TOML 1.0 keeps an inline table on one line
        return (
            "{"
            + ", ".join(f"{key_text(k)} = {value_text(v, 10**9)}" for k, v in value.items())
            + "}"
        )
    if isinstance(value, (date, time)):
        return value.isoformat()
    entries = [value_text(entry, 10**9) for entry in value]
    line = "[" + ", ".join(entries) + "]"
    if len(line) <= width:
        return line
    return "[\n" + "".join(f"    {entry},\n" for entry in entries) + "]"


def comment(text: str) -> str:
    """Text as comment lines that nothing in it can break out of."""
    clean = escaped(text.replace("\n", " ").replace("\r", " ").replace("\t", " "))
    clean = clean.encode("utf-8", "backslashreplace").decode()
    if text.startswith("    ") or not clean:
        return f"# {clean}".rstrip()
    lines = textwrap.wrap(clean, WIDTH, break_long_words=False, break_on_hyphens=False)
    return "\n".join(f"# {line}" for line in lines)
