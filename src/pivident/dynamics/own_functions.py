"""Functions that a program gives: compiled by Numba, tried at states at random, and their slopes.

Where a slope is not given, it is the five-point difference

    f'(x) = (8 (f(x + h) - f(x - h)) - (f(x + 2h) - f(x - 2h)))/(12 h)

whose step h is the one of many with the least change of all slopes to half of it. That change,
relative to the largest slope, is taken for its error.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numba import njit
from numba.core.errors import NumbaError
from numba.extending import is_jitted

from pivident.dynamics.generate_friction import MOTION
from pivident.foundation.errors import UnusableValue

#: Steps of differences that are tried.
STEPS = tuple(10.0 ** (-0.5 * k) for k in range(2, 15))

#: States at random at which a function is tried, their seed, and how far they reach.
STATES, SEED = 400, 20180501
REACH = {"q": math.pi, "dq": 5.0, "load": 100.0}

#: A speed beside rest: values and slopes on both sides say whether it jumps there.
BESIDE_REST = 1e-9
_PLACES = (-2.0, -1.0, 1.0, 2.0, 100.0, 101.0)


def jitted(name: str, function: Any) -> Any:
    """The function compiled by Numba, or as it is where it is compiled already."""
    if is_jitted(function):
        return function
    if not inspect.isfunction(function):
        raise UnusableValue(
            f"the function of {name!r} is of type {type(function).__name__}",
            advice="give an expression, a Python function or one of numba.njit",
        )
    return njit(error_model="numpy")(function)


def arguments_of(name: str, function: Any) -> tuple[str, ...]:
    """Arguments of a function, each a quantity."""
    found = inspect.signature(getattr(function, "py_func", function)).parameters
    names, kinds = tuple(found), {p.kind for p in found.values()}
    usable = kinds <= {inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.POSITIONAL_ONLY}
    if not names or not usable or set(names) - {*MOTION}:
        raise UnusableValue(
            f"the function of {name!r} has the arguments ({', '.join(map(str, found.values()))})",
            advice="its arguments are some of q, dq and load, by these names",
        )
    return names


def random_states(quantities: Sequence[str]) -> dict[str, np.ndarray]:
    """Values of the quantities at random, small and large ones, and zero, shape (STATES,)."""
    rng = np.random.default_rng(SEED)
    out = {}
    for name in quantities:
        size = REACH[name] * 10.0 ** rng.uniform(-4.0, 0.0, STATES)
        out[name] = size * rng.choice([-1.0, 1.0], STATES)
        out[name][:2] = 0.0
    return out


def on_states(name: str, function: Any, quantities: Sequence[str]) -> Callable[..., np.ndarray]:
    """A compiled function of one state as one of the states in a dictionary."""
    called = ", ".join(f"{x}[k]" for x in quantities)
    lines = [f"def many({', '.join(quantities)}, out):", "    for k in range(out.size):"]
    lines += [f"        out[k] = f({called})"]
    namespace: dict[str, Any] = {"f": function}
    exec("\n".join(lines), namespace)
    many = njit(error_model="numpy")(namespace["many"])

    def values(states: Mapping[str, np.ndarray]) -> np.ndarray:
        out = np.empty(STATES)
        try:
            many(*(states[x] for x in quantities), out)
        except NumbaError as error:
            raise UnusableValue(
                f"numba cannot compile the function of {name!r}: {_said(error)}",
                advice="write it for single numbers, with math or numpy, and return one number",
            ) from None
        except Exception as error:  # whatever the function raises
            raise UnusableValue(f"the function of {name!r} fails: {error}") from None
        return out

    return values


def _said(error: Exception) -> str:
    """What Numba says, its first line that is no heading."""
    lines = [re.sub(r"\x1b\[[0-9;]*m", "", line).strip() for line in str(error).splitlines()]
    heads = ("Failed in", "During", "File", "-", "There are", "No implementation")
    return next((x for x in lines if x and not x.startswith(heads)), lines[0] if lines else "")


def check_finite(name: str, states: Mapping[str, np.ndarray], values: np.ndarray) -> None:
    """Refuse a function that is no number at some state."""
    if not np.isfinite(values).all():
        k = int(np.argmin(np.isfinite(values)))
        where = ", ".join(f"{x} = {states[x][k]:.4g}" for x in states)
        raise UnusableValue(
            f"the function of {name!r} is {values[k]} at {where}",
            advice="it needs a finite value everywhere",
        )


def is_kinked(
    name: str, states: Mapping[str, np.ndarray], values: Callable[..., np.ndarray]
) -> bool:
    """Whether its slope by the speed jumps at standstill; a value that jumps is refused."""
    beside = {x: values({**states, "dq": np.full(STATES, x * BESIDE_REST)}) for x in _PLACES}
    scale = np.abs(values(states)).max()
    if (np.abs(beside[1.0] - beside[-1.0]) > 1e-3 * scale).any():
        raise UnusableValue(
            f"the function of {name!r} jumps at standstill, and a simulation needs its slope",
            advice="smooth it, as in np.tanh(150 * dq), or take the sign s in an expression",
        )
    slopes = np.array([beside[x + 1.0] - beside[x] for x in (-2.0, 1.0, 100.0)])
    spread, largest = np.ptp(slopes, axis=0), np.abs(slopes).max(axis=0)
    return bool((spread > 0.01 * largest + 1e-12 * scale).any())


def best_step(
    by: str, states: Mapping[str, np.ndarray], values: Callable[..., np.ndarray]
) -> tuple[float, float]:
    """Step of the difference by a quantity, and its error relative to the largest slope."""
    found = {}
    for step in STEPS:
        wide, narrow = (_difference(by, states, values, h) for h in (step, 0.5 * step))
        found[step] = float(np.abs(wide - narrow).max() / max(np.abs(narrow).max(), 1e-300))
    best = min(found, key=found.__getitem__)
    return best, found[best]


def _difference(
    by: str, states: Mapping[str, np.ndarray], values: Callable[..., np.ndarray], h: float
) -> np.ndarray:
    at = [values({**states, by: states[by] + k * h}) for k in (2.0, 1.0, -1.0, -2.0)]
    return (8.0 * (at[1] - at[2]) - (at[0] - at[3])) / (12.0 * h)


def check_slope(
    name: str,
    by: str,
    states: Mapping[str, np.ndarray],
    values: Callable[..., np.ndarray],
    slope: Callable[..., np.ndarray],
) -> None:
    """Refuse a given slope that is not the function's."""
    step, error = best_step(by, states, values)
    found, expected = slope(states), _difference(by, states, values, step)
    scale = max(np.abs(expected).max(), np.abs(found).max())
    off = np.abs(found - expected) > max(1e-3, 100.0 * error) * scale
    check_finite(f"{name}: slope by {by}", states, found)
    if np.mean(off) > 0.02:  # beyond single states at which a slope jumps
        k = int(np.argmax(np.abs(found - expected)))
        where = ", ".join(f"{x} = {states[x][k]:.4g}" for x in states)
        raise UnusableValue(
            f"the slope of {name!r} by {by} is {found[k]:.4g} at {where}, and differences of the "
            f"function {expected[k]:.4g}",
            advice="mend the one or the other, or leave the slope out",
        )


def difference_function(function: Any, arguments: Sequence[str], by: str, step: float) -> Any:
    """Five-point difference of a compiled function by one of its arguments, compiled."""
    at = [
        f"f({', '.join(f'{x} + {k}*h' if x == by else x for x in arguments)})"
        for k in ("2.0", "1.0", "(-1.0)", "(-2.0)")
    ]
    text = (
        f"def slope({', '.join(arguments)}):\n    h = {step!r}\n"
        f"    return (8.0*({at[1]} - {at[2]}) - ({at[0]} - {at[3]}))/(12.0*h)"
    )
    namespace: dict[str, Any] = {"f": function}
    exec(text, namespace)
    return njit(error_model="numpy")(namespace["slope"])
