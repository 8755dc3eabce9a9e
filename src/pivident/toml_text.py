"""TOML from files that nobody has checked: answers and errors come in bounded time.

The standard parser takes time with the square of a key's length in parts, and follows nested
values by recursion; both are bounded here.
"""

from __future__ import annotations

import re
import tomllib
from typing import Any

#: Largest file that is read as TOML [bytes]; larger ones are logs.
LARGEST_FILE = 2**20

#: Most parts of a dotted key. Nothing here has more than five.
MOST_PARTS = 32

_PART = r"(?:[\w-]++|\"(?:[^\"\\\n]|\\.)*+\"|'[^'\n]*+')"
_LONG_KEY = re.compile(rf"(?<![\w\"'-])(?:{_PART}[ \t]*+\.[ \t]*+){{{MOST_PARTS}}}")


def parse_toml(text: str) -> dict[str, Any]:
    """The tables of a TOML text.

    Args:
        text: content of a file.

    Raises:
        ValueError: it is not TOML, or nested or dotted beyond what any file of ours is.
    """
    long_key = _LONG_KEY.search(text)
    if long_key is not None:
        line = text.count("\n", 0, long_key.start()) + 1
        raise ValueError(f"a key has more than {MOST_PARTS} parts (at line {line})")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("its values are nested too deeply") from None
    except tomllib.TOMLDecodeError:
        raise
    except ValueError as error:  # a whole number of thousands of digits
        raise ValueError(str(error).partition(";")[0]) from None
