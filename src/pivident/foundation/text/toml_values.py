"""Keys, values and comments as TOML, laid out for people who edit them."""

from __future__ import annotations

import re
import textwrap
from datetime import date, time
from typing import Any

from pivident.foundation.text.printable import escaped

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
