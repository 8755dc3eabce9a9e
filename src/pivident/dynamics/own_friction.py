"""Friction terms that a program declares for itself: an expression, or a compiled function.

    bump = own_friction("bump", "s/(1 + (dq/0.3)**2)")
    robot = robot.with_friction(FrictionLaw((viscous(), coulomb(), bump)))

A function is called with those of ``q``, ``dq`` and ``load`` that its arguments name. It is
compiled, and kernels call it by its address, as they do with the columns of other distributions.
Slopes that are not given are differences, whose error is the ``slope_error`` of the column.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numba import cfunc

from pivident.dynamics import elementary
from pivident.dynamics.friction_kernels import ADDRESS_SIGNATURE, BY_LOAD, BY_POSITION, SLOPE
from pivident.dynamics.generate_friction import MOTION, column_source
from pivident.dynamics.own_functions import (
    STATES,
    arguments_of,
    best_step,
    check_finite,
    check_slope,
    difference_function,
    is_kinked,
    jitted,
    on_states,
    random_states,
)
from pivident.foundation.errors import UnusableValue
from pivident.foundation.text.plain_values import BY_NAME
from pivident.robot.description import INERTIAL
from pivident.robot.friction_column import FrictionColumn, Smoothing, evaluated, names_in
from pivident.robot.friction_term import FrictionTerm
from pivident.robot.friction_terms import OWN_COLUMNS, column_named, declared_columns

#: Functions in expressions.
_FUNCTIONS = ("abs", "exp", "sqrt", "sin", "cos", "max", "min", "power", "sign", "atan", "tanh")

#: Stems of parameters that are taken.
_TAKEN = frozenset(
    (*INERTIAL, *"ia iam fvm fcm fv fvp fvn fc fcp fcn off fs fp fl fd fm ks cbf cbk rc rs".split())
)

#: What its numbers are given a kernel as, see ``friction_kernels``.
_PLACES = {"dq": SLOPE, "q": BY_POSITION, "load": BY_LOAD}

#: Compiled functions, kept as long as the process runs: plans of kernels hold their addresses.
_COMPILED: list[Any] = []


@dataclass(frozen=True, kw_only=True)
class OwnColumn(FrictionColumn):
    """A column that a program declares: an expression without constants, or a function.

    Attributes:
        quantities: those of ``q``, ``dq`` and ``load`` that it depends on, in this order.
        function: compiled by Numba; None for an expression.
        bend_step: step of the difference that is its curvature, of one quantity.
        slopes: its given slopes by quantity, compiled.
        steps: steps of the differences that stand for the others, by quantity.
        slope_error: the largest error of these, relative to the largest slope; 0 without such.
    """

    quantities: tuple[str, ...] = ()
    function: Any = None
    bend_step: float = 0.0
    slopes: tuple[tuple[str, Any], ...] = ()
    steps: tuple[tuple[str, float], ...] = ()
    slope_error: float = 0.0

    @cached_property
    def names(self) -> frozenset[str]:
        """Names in the expression, or arguments of the function."""
        return names_in(self.expression) if self.expression else frozenset(self.quantities)

    @property
    def of_position(self) -> bool:
        """Whether it is a function of the position alone."""
        return self.quantities == ("q",)

    @property
    def of_motion(self) -> bool:
        """Whether it is a function of more than one quantity, or of the load."""
        return len(self.quantities) > 1 or "load" in self.quantities

    @cached_property
    def address(self) -> int:
        """Address of its function for kernels."""
        _COMPILED.append(_compiled(self))
        return int(_COMPILED[-1].address)

    def __index__(self) -> int:
        return -self.address if self.of_motion else self.address

    def __reduce__(self) -> tuple:
        return _received, ({entry.name: getattr(self, entry.name) for entry in fields(self)},)


BY_NAME[OwnColumn] = column_named


def own_friction(
    name: str,
    function: str | Callable[..., float],
    *,
    slopes: Mapping[str, Callable[..., float]] | None = None,
    c_source: str = "",
    smoothing: Smoothing = "atan",
    gamma: float | None = None,
    speed_power: float = 0.0,
    grows_with: Literal["", "load", "position"] = "",
    dissipative: bool = False,
) -> FrictionTerm:
    """A friction term of one's own: a parameter times a function of the joint's motion.

    Args:
        name: of the column and the stem of its parameter: lower-case letters and ``_``. Declaring
            it again replaces it for results that are loaded afterwards.
        function: an expression of ``q`` [rad or m], ``dq``, the smoothed sign ``s`` of dq, and the
            torque ``load`` [N m or N] that the joint carries, with ``abs exp sqrt sin cos max min
            power sign atan tanh pi``; or a function whose arguments are some of ``q``, ``dq`` and
            ``load``, compiled by ``numba.njit`` or such that it can be.
        slopes: derivatives of a function by ``q``, ``dq`` or ``load``, with the same arguments;
            those left out are differences. Those of an expression are derived (extra ``symbolic``).
        c_source: C99 text that defines ``double NAME(double q, double dq, double load)`` with the
            arguments of the function, for exports; expressions need none.
        smoothing: of the sign s: ``"atan"``, ``"tanh"`` or ``"sign"``.
        gamma: slope γ of the smoothed sign [s/rad or s/m]; None: from the joint's rated speed.
        speed_power: power of the speed that it grows with, for the unit of its parameter.
        grows_with: ``"load"`` or ``"position"`` if it grows with that, likewise.
        dissipative: whether the parameter cannot be negative.

    Returns:
        The term; ``slope_error`` of its column says how exact numeric slopes are.

    Raises:
        UnusableValue: a name that is taken; a function that cannot be compiled, has other
            arguments, is not a number somewhere, or jumps at standstill.
    """
    _check_name(name)
    options: dict[str, Any] = {
        "name": name, "speed_power": speed_power, "grows_with": grows_with,
        "dissipative": dissipative,
    }  # fmt: skip
    if isinstance(function, str):
        if slopes or c_source:
            raise UnusableValue(
                f"the expression of {name!r} has slopes or C of its own",
                advice="leave them out: they follow from the expression",
            )
        column = _of_expression(function, options)
    else:
        column = _of_function(function, dict(slopes or {}), c_source, options)
    term = FrictionTerm(name, column, smoothing, gamma)
    OWN_COLUMNS[name] = column
    return term


def _check_name(name: str) -> None:
    if not isinstance(name, str) or not re.fullmatch(r"[a-z][a-z_]*", name):
        raise UnusableValue(
            f"{name!r} cannot name a friction term", advice="take lower-case letters and `_`"
        )
    if name in _TAKEN or name in declared_columns():
        raise UnusableValue(
            f"the name {name!r} is that of another parameter or term", advice="take another one"
        )


def _of_expression(expression: str, options: dict[str, Any]) -> OwnColumn:
    name = options["name"]
    try:
        names = names_in(expression)
    except (SyntaxError, ValueError) as error:
        raise UnusableValue(f"{expression!r} of {name!r} is no expression: {error}") from None
    if unknown := names - {"s", "pi", *MOTION, *_FUNCTIONS}:
        raise UnusableValue(
            f"{expression!r} of {name!r} has the name {min(unknown)!r}",
            advice=f"there are q, dq, s, load, pi and {' '.join(_FUNCTIONS)}",
        )
    moved = names | ({"dq"} if "s" in names or not names & {*MOTION} else set())
    quantities = tuple(x for x in ("q", "dq", "load") if x in moved)

    def values(states: Mapping[str, np.ndarray]) -> np.ndarray:
        known = {**_NUMPY, **states, "s": np.tanh(states.get("dq", 0.0)), "pi": math.pi}
        with np.errstate(all="ignore"):
            try:
                found = evaluated(expression, known)
            except Exception as error:  # whatever the operators of the expression raise
                raise UnusableValue(f"{expression!r} of {name!r} has no value: {error}") from None
        return np.broadcast_to(np.asarray(found, dtype=float), (STATES,))

    states = random_states(quantities)
    check_finite(name, states, values(states))
    kinked = "dq" in quantities and is_kinked(name, states, values)
    return OwnColumn(
        expression=expression,
        text="{stem} (" + re.sub(r"\bs\b", "{s}", expression) + ")",
        quantities=quantities,
        kinked=kinked and quantities == ("dq",),
        **options,
    )


_NUMPY: dict[str, Any] = {
    "abs": np.abs, "exp": np.exp, "sqrt": np.sqrt, "sin": np.sin, "cos": np.cos, "max": np.maximum,
    "min": np.minimum, "power": np.power, "sign": np.sign, "atan": np.arctan, "tanh": np.tanh,
}  # fmt: skip


def _of_function(
    function: Any, slopes: dict[str, Any], c_source: str, options: dict[str, Any]
) -> OwnColumn:
    name = options["name"]
    plain, quantities = jitted(name, function), arguments_of(name, function)
    if wrong := set(slopes) - set(quantities):
        raise UnusableValue(
            f"the function of {name!r} has a slope by {min(wrong)!r}, which is no argument of it",
            advice=f"give those by {', '.join(quantities)}",
        )
    if c_source and not re.search(rf"\bdouble\s+{name}\s*\(", c_source):
        raise UnusableValue(
            f"the C of {name!r} does not define it",
            advice=f"give double {name}({', '.join(f'double {x}' for x in quantities)}) {{ … }}",
        )
    states = random_states(quantities)
    values = on_states(name, plain, quantities)
    check_finite(name, states, values(states))
    kinked = "dq" in quantities and is_kinked(name, states, values)
    given: dict[str, Any] = {}
    steps: dict[str, float] = {}
    errors = [0.0]
    for by in quantities:
        if by in slopes:
            given[by] = jitted(name, slopes[by])
            check_slope(name, by, states, values, on_states(name, given[by], quantities))
        else:
            steps[by], error = best_step(by, states, values)
            errors.append(error)
    ordered, bend_step = tuple(x for x in ("q", "dq", "load") if x in quantities), 0.0
    if len(quantities) == 1:
        (by,) = quantities
        slope = given.get(by) or difference_function(plain, quantities, by, steps[by])
        bend_step, _ = best_step(by, states, on_states(name, slope, quantities))
    return OwnColumn(
        expression="",
        text=f"{{stem}} {name}({', '.join(quantities)})",
        quantities=ordered,
        function=plain,
        arguments=quantities,
        bend_step=bend_step,
        slopes=tuple(given.items()),
        steps=tuple(steps.items()),
        slope_error=max(errors),
        c_source=c_source.strip(),
        kinked=kinked and ordered == ("dq",),
        **options,
    )


def _compiled(column: OwnColumn) -> Any:
    """Its function as kernels call it, see ``friction_kernels.call_column``."""
    namespace: dict[str, Any] = {
        **{x: getattr(math, x) for x in ("atan", "exp", "log", "pi", "sqrt", "tanh")},
        **{x: getattr(elementary, x) for x in ("cos", "direction", "power", "sin", "size")},
    }
    if column.expression:
        lines = column_source(column)
    else:
        lines = _function_source(column, namespace)
    exec("\n".join(lines), namespace)
    return cfunc(ADDRESS_SIGNATURE, error_model="numpy")(namespace[column.name])


def _function_source(column: OwnColumn, namespace: dict[str, Any]) -> list[str]:
    """Lines that choose between a function, its slopes and, of the speed or position, its bend."""
    function, arguments, slopes = column.function, column.arguments, dict(column.slopes)
    for by, step in column.steps:
        slopes[by] = difference_function(function, arguments, by, step)
    namespace |= {"f": function, **{f"slope_{by}": slope for by, slope in slopes.items()}}
    motion = "dq, load, q" if column.of_motion else f"first, second, {column.quantities[0]}"
    called = f"({', '.join(arguments)})"
    lines = [f"def {column.name}(which, s, s_v, s_vv, s_g, s_vg, {motion}):"]
    lines += ["    if which == 0:", f"        return float(f{called})"]
    for by in column.quantities:
        place = _PLACES[by] if column.of_motion else SLOPE
        lines += [f"    if which == {place}:", f"        return float(slope_{by}{called})"]
    if not column.of_motion:
        (by,) = column.quantities
        namespace["bend"] = difference_function(slopes[by], arguments, by, column.bend_step)
        lines += ["    if which == 2:", f"        return bend{called}"]
    return [*lines, "    return 0.0"]


def _received(values: dict[str, Any]) -> OwnColumn:
    """A column from another process, known here by its name from now on."""
    made = OwnColumn(**values)
    known = OWN_COLUMNS.setdefault(made.name, made)
    return known if isinstance(known, OwnColumn) and known == made else made
