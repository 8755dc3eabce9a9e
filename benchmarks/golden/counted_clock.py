"""``python counted_clock.py COMMAND …``: pivident with a clock that counts, not one that runs.

The search of `pivident excite` ends by the clock, and so would its result depend on the machine.
Here each thread but the main one has a clock of its own, which goes on by a hundredth of a second
whenever it is read: the search ends after as many motions on every machine.
"""

from __future__ import annotations

import runpy
import sys
import threading
import time

#: Seconds between two readings.
TICK = 0.01

_readings = threading.local()


def counted_clock() -> float:
    """Time [s] by how often this thread has asked for it; in the main thread it stands still."""
    if threading.current_thread() is threading.main_thread():
        return 0.0
    if not sys._getframe(1).f_globals["__name__"].startswith("pivident."):
        return 0.0  # numba reads it as often as it has kernels to load
    _readings.count = getattr(_readings, "count", 0) + 1
    return TICK * _readings.count


if __name__ == "__main__":
    time.perf_counter = counted_clock
    runpy.run_module("pivident", run_name="__main__")
