"""How functions are compiled whose first call should not take long.

Numba compiles a function for Python together with two wrappers, each of which holds an inlined
body once more, and anew for every literal number, read-only array or memory layout it is given.
It also counts the references of every array that a function is given, atomically: half of the
time of a filter, a sixth of a simulation with its tangents. Where no array is made, none has to be
counted (``_nrt``); a function that makes one without ``allocating`` is refused by the compiler. One
that returns an array has to count as well, or its caller would free what it does not own.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

_COUNTING: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}
_OPTIONS: dict[str, Any] = {**_COUNTING, "_nrt": False}
_NOT_FOR_PYTHON: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}

#: Decorator of kernels that Python calls …
kernel = njit(**_OPTIONS)

#: … of those that make arrays of their own …
allocating = njit(**_COUNTING)

#: … of sums, whose terms may be added in any order, several at a time …
summing = njit(**_OPTIONS, fastmath={"contract", "reassoc"})

#: … of functions that only compiled code calls: without wrappers, Python must not …
inner = njit(**_OPTIONS, **_NOT_FOR_PYTHON)

#: … of small ones among them, that become part of their callers …
inlined = njit(**_OPTIONS, **_NOT_FOR_PYTHON, forceinline=True)

#: … of those with a single caller, that are compiled only as a part of it, with its options …
section = njit(**_OPTIONS, **_NOT_FOR_PYTHON, inline="always")

#: … and of such that Python calls, too.
shared = njit(**_OPTIONS, forceinline=True)


def rows(*numbers: int) -> tuple[np.int64, ...]:
    """Row numbers as variables of compiled code, which would be compiled once for each literal."""
    return tuple(np.int64(number) for number in numbers)


def read_only(array: np.ndarray) -> np.ndarray:
    """A view that cannot be written to: of two kinds of arrays one, for compiled code."""
    view = array.view()
    view.flags.writeable = False
    return view


def is_compiled(kernel: Any) -> bool:
    """Whether a compiled function lies in its cache; also where nothing is compiled at all."""
    if not hasattr(kernel, "stats"):
        return True
    folder, name = Path(kernel.stats.cache_path), kernel.py_func.__name__
    return any(folder.glob(f"*.{name}-*.nbi"))
