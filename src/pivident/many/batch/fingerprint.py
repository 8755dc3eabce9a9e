"""Fingerprint of the program: the version alone does not identify code under development."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

#: Packages whose code affects the numbers of a result.
NUMERICAL = (
    "control_law", "drives", "dynamics", "estimation", "experiment", "friction", "many/fleet",
    "many/study", "recording", "robot", "signals", "simulation",
)  # fmt: skip


@cache
def fingerprint() -> str:
    """Version of pivident with the first digits of the SHA-256 of its numerical code."""
    from pivident.version import __version__

    package = Path(__file__).resolve().parents[2]
    digest = hashlib.sha256()
    for name in NUMERICAL:
        for file in sorted((package / name).rglob("*.py")):
            digest.update(file.relative_to(package).as_posix().encode())
            digest.update(file.read_bytes())
    return f"{__version__} ({digest.hexdigest()[:12]})"
