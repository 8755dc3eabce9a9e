"""How functions are compiled whose first call should not take long.

Numba compiles a function for Python together with two wrappers, each of which holds an inlined
body once more, and anew for every literal number, read-only array or memory layout it is given.
It also counts the references of every array that a function is given, atomically: half of the
time of a filter, a sixth of a simulation with its tangents. Where no array is made, none has to be
counted (``_nrt``); a function that makes one without ``allocating`` is refused by the compiler. One
that returns an array has to count as well, or its caller would free what it does not own.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numba import njit
from numba.core import event as events
from numba.core.caching import FunctionCache
from numba.core.runtime import rtsys

_COUNTING: dict[str, Any] = {"error_model": "numpy"}
_OPTIONS: dict[str, Any] = {**_COUNTING, "_nrt": False}
_NOT_FOR_PYTHON: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


class _KernelCache(FunctionCache):
    """A cache that loads functions without what only their compiler needs.

    Before it looks into its cache, numba refreshes its context: it imports and registers all that
    it knows of NumPy, and looks for more at every function, a fifth of the time of a command. What
    is loaded calls nothing of it but the runtime. Before numba compiles, it refreshes once more.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What was compiled for a signature; numba calls it under the lock of its compiler."""
        target_context.refresh = partial(rtsys.initialize, target_context)
        try:
            return super().load_overload(sig, target_context)
        finally:
            del target_context.refresh


class _NoCollection(events.Listener):
    """While numba compiles, no garbage is searched for: that was a fifth of the compiler's time.

    It makes millions of small objects and drops them; its events nest, and lie within its lock.
    """

    were_on: ClassVar[list[bool]] = []

    def on_start(self, event: events.Event) -> None:
        self.were_on.append(gc.isenabled())
        gc.disable()

    def on_end(self, event: events.Event) -> None:
        if self.were_on.pop():
            gc.enable()


events.register("numba:compile", _NoCollection())


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Decorator of a function that numba compiles, once for all processes.

    Args:
        options: of `numba.njit`, besides those of the cache and of threads.
    """

    def decorate(function: Callable[..., Any]) -> Any:
        made = njit(cache=True, nogil=True, **options)(function)
        if hasattr(made, "_cache"):  # a plain function where nothing is compiled at all
            made._cache = _KernelCache(function)
        return made

    return decorate


#: Decorator of kernels that Python calls …
kernel = compiled(**_OPTIONS)

#: … of those that make arrays of their own …
allocating = compiled(**_COUNTING)

#: … of sums, whose terms may be added in any order, several at a time …
summing = compiled(**_OPTIONS, fastmath={"contract", "reassoc"})

#: … of functions that only compiled code calls: without wrappers, Python must not …
inner = compiled(**_OPTIONS, **_NOT_FOR_PYTHON)

#: … of small ones among them, that become part of their callers …
inlined = compiled(**_OPTIONS, **_NOT_FOR_PYTHON, forceinline=True)

#: … of those with a single caller, that are compiled only as a part of it, with its options …
section = compiled(**_OPTIONS, **_NOT_FOR_PYTHON, inline="always")

#: … and of such that Python calls, too.
shared = compiled(**_OPTIONS, forceinline=True)


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
