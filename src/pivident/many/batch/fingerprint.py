"""Which program computed the numbers: the version alone does not tell while it is being changed."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

#: Packages whose code decides about the numbers of a result.
NUMERICAL = (
    "dynamics", "estimation", "experiment", "fleet", "recording", "robot", "signals", "simulation",
    "study",
)  # fmt: skip


@cache
def fingerprint() -> str:
    """Version of pivident with the first digits of the SHA-256 of its numerical code."""
    from pivident.version import __version__

    package = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    for name in NUMERICAL:
        for file in sorted((package / name).rglob("*.py")):
            digest.update(file.relative_to(package).as_posix().encode())
            digest.update(file.read_bytes())
    return f"{__version__} ({digest.hexdigest()[:12]})"
