"""Results as JSON, with the machine, the versions and the date that they belong to."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import platform
import sys
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from .timing import load

RESULTS = Path(__file__).resolve().parents[1] / "results"

#: Packages whose versions belong to the figures.
PACKAGES = (
    "pivident", "numpy", "scipy", "numba", "pin", "mujoco", "statsmodels", "simdkalman", "figaroh",
)  # fmt: skip


def machine() -> dict[str, object]:
    """Processor, cores, memory, versions, date and load."""
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "processor": processor(),
        "cores": len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else os.cpu_count(),
        "memory_gib": memory(),
        "system": platform.platform(),
        "python": sys.version.split()[0],
        "load": load(),
        "versions": {name: _version(name) for name in PACKAGES},
    }


def processor() -> str:
    """Name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def memory() -> float:
    """Physical memory [GiB]."""
    if not hasattr(os, "sysconf"):
        return math.nan
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def write_json(name: str, content: dict[str, object], folder: Path = RESULTS) -> Path:
    """Write ``NAME.json`` with the machine beside the content; NaN becomes null."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.json"
    plain = _plain({"machine": machine()} | content)
    path.write_text(json.dumps(plain, indent=1, ensure_ascii=False) + "\n")
    return path


def _plain(x: object) -> object:
    """Only what JSON knows."""
    if dataclasses.is_dataclass(x) and not isinstance(x, type):
        return _plain(dataclasses.asdict(x))
    if isinstance(x, dict):
        return {str(k): _plain(v) for k, v in x.items()}
    if isinstance(x, list | tuple | np.ndarray):
        return [_plain(v) for v in x]
    if isinstance(x, float | np.floating):
        return float(x) if math.isfinite(x) else None
    return x.item() if isinstance(x, np.generic) else x
