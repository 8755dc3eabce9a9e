"""The compiled functions of friction terms, generated from their declarations with SymPy.

    python -m pivident.dynamics.generate_friction > src/pivident/dynamics/friction_generated.py
    python -m pivident.dynamics.generate_friction my_package.wave:WAVE > my_package/compiled_wave.py

Slopes and partial derivatives follow from the expression of a column. A smoothed sign enters with
its own derivatives ``s_v s_vv s_g s_vg``. At rest |dq| is replaced by a tiny speed, so that
|dq|^p/|dq| is finite, and the direction sign(dq) by zero: derivatives that jump have their mean.
It needs SymPy, the extra ``symbolic``.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from importlib import import_module
from itertools import chain
from typing import Any

from pivident.dynamics.friction_kernels import COUNT
from pivident.foundation.extras import require
from pivident.robot.friction_column import FrictionColumn, evaluated
from pivident.robot.friction_term import TermKind
from pivident.robot.friction_terms import friction_columns

_HEAD = '''"""{title}

Written by ``python -m pivident.dynamics.generate_friction`` from declarations, not by hand.
"""

# fmt: off
# ruff: noqa
from __future__ import annotations

from math import {functions}

from pivident.{compiled}
from pivident.dynamics.elementary import {elementary}
'''

#: Numbers that the functions of speed are given before the constants, those of position not.
_SIGN = ("s", "s_v", "s_vv", "s_g", "s_vg")

#: Names of the constants of shape in compiled code.
_CONSTANTS = ("first", "second")

#: What functions of more than one quantity are given in place of constants and quantity.
MOTION = ("dq", "load", "q")


def built_in_module() -> str:
    """Text of the module of all columns of pivident that are functions of speed or position."""
    columns = [c for c in friction_columns().values() if c.code is not None and c.expression]
    columns.sort(key=int)
    lines = [
        _HEAD.format(
            title="Functions of friction: values and derivatives, and rows of a tile.",
            functions="exp, log, sqrt",
            compiled="foundation.compiled import inlined",
            elementary="TILE, cos, direction, power, sin, size",
        )
    ]
    for name, quantity, sign in (("speed", "dq", _SIGN), ("position", "q", ())):
        chosen = [c for c in columns if not c.of_load and c.of_position == (quantity == "q")]
        arguments = ", ".join(("column", *sign, *_CONSTANTS, quantity))
        lines += ["", "@inlined", f"def {name}_derivatives({arguments}):"]
        lines += [
            f'    """What the constants of ``compiled_columns`` count, of a function of {name}."""'
        ]
        for column in chosen:
            steps, shown = _derivatives(column)
            lines += _branch(column, [*steps, f"return {', '.join(shown)}"])
        lines += [f"    return {', '.join(['0.0'] * COUNT)}", ""]
        lines += ["", "@inlined", f"def {name}_row(tile, column, row, value, e, out):"]
        lines += [
            '    """A column of the quantity in ``row``, into row ``out``, which holds its sign."""'
        ]
        lines += ["    first, second = value[e, 3], value[e, 4]"]
        for column in chosen:
            if column.expression not in ("s", "1", "dq"):  # there already, or without a function
                lines += _branch(
                    column, ["for k in range(TILE):", f"    tile[out, k] = {_in_tile(column)}"]
                )
        lines += [""]
    return "\n".join(lines)


def foreign_module(columns: Sequence[FrictionColumn]) -> str:
    """Text of the module of columns of another distribution."""
    lines = [
        _HEAD.format(
            title="Functions of friction terms.",
            functions="atan, exp, log, pi, sqrt, tanh",
            compiled="dynamics.friction_kernels import column_function",
            elementary="cos, direction, power, sin, size",
        )
    ]
    for column in columns:
        lines += ["", "@column_function", *column_source(column), ""]
    return "\n".join(lines)


def column_source(column: FrictionColumn) -> list[str]:
    """Lines of the function of one column, without its decorator."""
    steps, shown = _derivatives(column)
    quantities = MOTION if column.of_motion else (*_CONSTANTS, _quantity(column))
    return [
        f"def {column.name}({', '.join(('which', *_SIGN, *quantities))}):",
        f'    """{column.expression}"""',
        *(f"    {step}" for step in steps),
        f"    return ({', '.join(shown)})[which]",
    ]


def _branch(column: FrictionColumn, lines: Sequence[str]) -> list[str]:
    head = f"    if column == {column.code}:  # {column.name}: {column.expression}"
    return [head, *(f"        {line}" for line in lines)]


def _quantity(column: FrictionColumn) -> str:
    return "q" if column.of_position else "dq"


def _in_tile(column: FrictionColumn) -> str:
    """The expression with the numbers of a sample in place of names."""
    names = dict(zip(column.constants, _CONSTANTS, strict=False))
    names |= {_quantity(column): "tile[row, k]", "s": "tile[out, k]"}
    return re.sub(r"[a-z_]+", lambda found: names.get(found[0], found[0]), column.expression)


def _derivatives(column: FrictionColumn) -> tuple[list[str], list[str]]:
    """Assignments of common parts, then what the constants of ``friction_kernels`` count."""
    sympy = require("sympy", extra="symbolic", purpose="generating functions of friction")
    motion = {name: sympy.Symbol(name, real=True) for name in MOTION}
    x, gamma = motion[_quantity(column)], sympy.Symbol("gamma", positive=True)
    sign = sympy.Function("s")(x, gamma)
    constants = [sympy.Symbol(name, positive=True) for name in _CONSTANTS]
    names = {**_functions(), "s": sign, **motion}
    names |= dict(zip(column.constants, constants, strict=False))
    value = sympy.sympify(evaluated(column.expression, names))
    further: Iterable[Any] = (
        chain(*((value.diff(c), value.diff(x, c)) for c in (gamma, *constants)))
        if not column.of_motion
        else (value.diff(motion["q"]), value.diff(motion["load"]))
    )
    of_sign = {  # higher ones first, which contain the others
        sign.diff(x, 2): "s_vv",
        sign.diff(x, gamma): "s_vg",
        sign.diff(x): "s_v",
        sign.diff(gamma): "s_g",
        sign: "s",
    }
    wanted = [value, value.diff(x), value.diff(x, x), *further]
    symbols = [(of, sympy.Symbol(name)) for of, name in of_sign.items()]
    parts, reduced = sympy.cse([one.subs(symbols) for one in wanted], order="none")
    shown = [repr(float(one)) if one.is_number else str(one) for one in reduced]
    return [f"{name} = {part}" for name, part in parts], shown


@cache
def _functions() -> dict[str, Any]:
    """Functions of expressions for SymPy; the own ones have derivatives that contain them again.

    They have the names of the compiled ones, ``size`` for |x| with the slope ``direction``.
    """
    import sympy

    def function(name: str, *slopes: Callable[..., Any]) -> Any:
        """A function of SymPy with its derivatives by its arguments."""
        slope = {"fdiff": lambda self, index=1: slopes[index - 1](self, *self.args)}
        return type(name, (sympy.Function,), slope)

    direction = function("direction", lambda f, x: sympy.Integer(0))
    half = sympy.Rational(1, 2)
    return {
        "abs": function("size", lambda f, x: direction(x)),
        "sqrt": function("sqrt", lambda f, x: half / f),
        "power": function("power", lambda f, x, p: p * f / x, lambda f, x, p: f * sympy.log(x)),
        "max": function("max", lambda f, x, y: half + half * direction(x - y)),
        "min": function("min", lambda f, x, y: half - half * direction(x - y)),
        "sign": direction,
        "pi": sympy.pi,
        "atan": sympy.atan,
        "tanh": sympy.tanh,
        "exp": sympy.exp,
        "sin": sympy.sin,
        "cos": sympy.cos,
    }


if __name__ == "__main__":
    named = [name.partition(":") for name in sys.argv[1:]]
    kinds: list[TermKind] = [getattr(import_module(module), term) for module, _, term in named]
    declared = [column for kind in kinds for column in kind.columns]
    print(foreign_module(declared) if declared else built_in_module(), end="")
