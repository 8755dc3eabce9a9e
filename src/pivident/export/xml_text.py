"""Pieces of XML: names escaped, numbers with all their digits."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from xml.sax.saxutils import quoteattr

import numpy as np

from pivident.errors import ExportError

#: Characters that XML 1.0 cannot hold, escaped or not.
_FORBIDDEN = re.compile("[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def quoted(name: str) -> str:
    """A name as the value of an attribute, quotes included."""
    bad = _FORBIDDEN.search(name)
    if bad:
        raise ExportError(
            f"the name {name!r} holds the character {bad[0]!r}, which XML cannot write even "
            "escaped",
            advice="rename it",
        )
    return quoteattr(name)


def number(value: float) -> str:
    """The shortest text that reads back as the same number; no negative zero."""
    if not np.isfinite(value):
        raise ExportError(
            f"a value is {value}, which robot files cannot hold", advice="identify again"
        )
    return repr(float(value) + 0.0).removesuffix(".0")


def numbers(values: Iterable[float]) -> str:
    """Numbers with a space between them."""
    return " ".join(number(value) for value in values)


def comment(text: str) -> str:
    """A comment; two hyphens would end it and are separated."""
    return f"<!-- {_FORBIDDEN.sub('?', text).replace('--', '- -').rstrip('-')} -->"


def unlike(name: str, taken: Iterable[str]) -> str:
    """A name that is not taken: the name itself, or with underscores added."""
    used = set(taken)
    while name in used:
        name += "_"
    return name


def distinct(
    names: Sequence[str], others: Sequence[str], reserved: Sequence[str] = ()
) -> tuple[str, ...]:
    """Names of links, each once: repeated or empty ones become ``<joint>_link``."""
    out: list[str] = []
    for name, joint in zip(names, others, strict=True):
        own = name if name and names.count(name) == 1 else f"{joint}_link"
        out.append(unlike(own, [*reserved, *out, *(names if own != name else ())]))
    return tuple(out)


def rpy(rotation: np.ndarray) -> np.ndarray:
    """Roll, pitch and yaw [rad] of R = Rz(yaw) Ry(pitch) Rx(roll), accurate at pitch = ±90° too.

    The yaw is removed from R first, then roll and pitch are read from the rest; where roll and yaw
    cannot be separated, the roll compensates for any yaw.
    """
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    c, s = np.cos(yaw), np.sin(yaw)
    rest = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ rotation
    pitch = np.arctan2(-rest[2, 0], rest[0, 0])
    roll = np.arctan2(-rest[1, 2], rest[1, 1])
    return np.array([roll, pitch, yaw])
