"""Where a function with one minimum is lowest, by golden sections.

A few calls more than parabolas would take; to load the optimisers of SciPy takes longer than all of
these, where a call takes a millisecond.
"""

from __future__ import annotations

import math
from collections.abc import Callable

SHARE = 0.5 * (math.sqrt(5.0) - 1.0)


def lowest(f: Callable[[float], float], low: float, high: float, accuracy: float) -> float:
    """The middle of the interval, at most so wide, in which the minimum of ``f`` lies."""
    left, right = high - SHARE * (high - low), low + SHARE * (high - low)
    f_left, f_right = f(left), f(right)
    while high - low > accuracy:
        if f_left < f_right:
            high, right, f_right = right, left, f_left
            left = high - SHARE * (high - low)
            f_left = f(left)
        else:
            low, left, f_left = left, right, f_right
            right = low + SHARE * (high - low)
            f_right = f(right)
    return 0.5 * (low + high)
