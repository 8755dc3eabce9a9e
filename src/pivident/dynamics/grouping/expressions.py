"""Expressions as a graph in which every subexpression exists once.

An expression is built by the functions of this module or by ``+ - * / **`` between expressions and
numbers, never by calling the classes. Building one applies the simplifications that are always
valid and cost nothing:

- constants are folded, terms of 0 and factors of 1 disappear, equal terms are collected;
- signs move outwards, a·(-b) = -(a·b) and (-a) + (-b) = -(a + b), so that an expression and its
  negative share everything but the sign;
- operands of + and · have one order, so that a·b and b·a are the same object;
- sine and cosine of multiples of π/2 are exact, sin(x + π/2) = cos x, cos²x + sin²x = 1.

Equal expressions are one object: compare them with ``is``. The order of operands depends on the
expressions alone and not on what was built before, so generated code is reproducible.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, cast

# It provides methods of every expression.
from pivident.dynamics.grouping import notation as _notation  # noqa: F401
from pivident.dynamics.grouping.expression_graph import (
    ONE,
    ZERO,
    Add,
    Call,
    Constant,
    Cosine,
    Expression,
    Multiply,
    Negate,
    Number,
    Operand,
    Sine,
    Symbol,
    as_expression,
    constant,
    make_node,
    negate,
    ordered,
    provides,
    without_constant,
    without_sign,
)
from pivident.foundation.extras import require

#: Distance from 0, ±1 or a multiple of π/2 below which a constant is taken to be that number.
EXACT = 1e-12

#: Functions of `call` beside sine and cosine, with their number of arguments.
FUNCTIONS = {
    "sqrt": 1,
    "abs": 1,
    "sign": 1,
    "exp": 1,
    "atan": 1,
    "tanh": 1,
    "power": 2,
    "maximum": 2,
    "minimum": 2,
    "divide": 2,
}

#: Cost of a sine or a cosine, in products.
SINE_PRICE = 4


@dataclass(frozen=True)
class OperationCount:
    """Cost of an evaluation; a change of sign is free."""

    multiplications: int = 0
    additions: int = 0
    sines: int = 0  # sines and cosines, each counted once
    functions: int = 0  # other functions and divisions

    def __str__(self) -> str:
        text = (
            f"{self.multiplications} multiplications, {self.additions} additions, "
            f"{self.sines} sines and cosines"
        )
        return f"{text}, {self.functions} other functions" if self.functions else text

    @property
    def price(self) -> int:
        """Cost in products, for comparing two forms of a model; other functions not counted."""
        return self.multiplications + self.additions + SINE_PRICE * self.sines

    def __add__(self, other: OperationCount) -> OperationCount:
        return OperationCount(
            self.multiplications + other.multiplications,
            self.additions + other.additions,
            self.sines + other.sines,
            self.functions + other.functions,
        )


def sine(a: Operand) -> Expression:
    """Sine of an angle in radians."""
    minus, a = without_sign(as_expression(a))
    result = _turned(a, 0)
    return negate(result) if minus else result


def cosine(a: Operand) -> Expression:
    """Cosine of an angle in radians."""
    return _turned(without_sign(as_expression(a))[1], 1)


def _turned(a: Expression, quarters: int) -> Expression:
    """sin(a + quarters π/2) for an angle without sign."""
    rest, own = _quarter_turns(a)
    quarters += own
    minus, rest = without_sign(rest)
    if minus and quarters % 2 == 0:
        quarters += 2
    if rest is ZERO:
        return constant((0.0, 1.0, 0.0, -1.0)[quarters % 4])
    if isinstance(rest, Constant):
        return constant((math.cos if quarters % 2 else math.sin)(rest.value))
    result = make_node(Cosine if quarters % 2 else Sine, (rest,))
    return negate(result) if quarters % 4 >= 2 else result


def _number(a: Expression) -> float:
    return cast(Constant, a).value


def _quarter_turns(a: Expression) -> tuple[Expression, int]:
    """(x, k) with a = x + k π/2 where its constant part is such a multiple, else (a, 0)."""
    part = (ZERO, a.value) if isinstance(a, Constant) else without_constant(a)
    if part is None:
        return a, 0
    quarters = round(part[1] / (0.5 * math.pi))
    if abs(part[1] - quarters * 0.5 * math.pi) > EXACT * max(1.0, abs(quarters)):
        return a, 0
    return part[0], quarters


@provides("divide")
def divide(a: Operand, b: Operand) -> Expression:
    """The quotient a / b; by a constant it is a product."""
    a, b = as_expression(a), as_expression(b)
    if b.is_zero:
        raise ZeroDivisionError("division of an expression by 0")
    if isinstance(b, Constant):
        return constant(_number(a) / b.value) if isinstance(a, Constant) else a * (1.0 / b.value)
    if a is b or a.is_zero:
        return ONE if a is b else ZERO
    minus_a, a = without_sign(a)
    minus_b, b = without_sign(b)
    quotient = make_node(Call, (a, b), "divide")
    return quotient if minus_a == minus_b else negate(quotient)


@provides("power")
def power(a: Operand, exponent: Number) -> Expression:
    """A power with constant exponent; whole ones up to 8 become products."""
    a = as_expression(a)
    if isinstance(a, Call) and a.function == "abs" and exponent % 2 == 0:
        a = a.operands[0]
    if exponent == int(exponent) and 0 <= exponent <= 8:
        product: Expression = ONE
        for bit in bin(int(exponent))[2:]:
            product = product * product * (a if bit == "1" else ONE)
        return product
    return call("power", a, float(exponent))


def call(function: str, *arguments: Operand) -> Expression:
    """Another function of ``FUNCTIONS``; of constants it is evaluated."""
    if FUNCTIONS.get(function) != len(arguments):
        raise ValueError(f"there is no function {function!r} of {len(arguments)} arguments")
    if function == "divide":
        return divide(*arguments)
    operands = tuple(as_expression(a) for a in arguments)
    if all(isinstance(a, Constant) for a in operands):
        return constant(float(_numeric(function)(*(_number(a) for a in operands))))
    return make_node(Call, operands, function)


def foreign_call(name: str, *arguments: Operand) -> Expression:
    """A function that C source beside the program defines, see `FrictionColumn.c_source`."""
    return make_node(Call, tuple(as_expression(a) for a in arguments), name)


def _numeric(function: str) -> Callable[..., Any]:
    """A function of ``FUNCTIONS`` for numbers and arrays."""
    import numpy as np

    return getattr(np, {"atan": "arctan"}.get(function, function))


@provides("evaluate")
def _evaluated(expression: Expression, values: Mapping[str, Any]) -> Any:
    return evaluate([expression], values)[0]


def evaluate(expressions: Iterable[Expression], values: Mapping[str, Any]) -> list[Any]:
    """Values of expressions, common parts once; symbols become numbers, arrays or expressions."""
    roots = list(expressions)
    result: dict[Expression, Any] = {}
    for node in ordered(roots):
        result[node] = _value(node, [result[operand] for operand in node.operands], values)
    return [result[root] for root in roots]


def _value(node: Expression, inputs: list[Any], values: Mapping[str, Any]) -> Any:
    if isinstance(node, Constant):
        return node.value
    if isinstance(node, Symbol):
        return values[node.name]
    if isinstance(node, Add):
        return inputs[0] + inputs[1]
    if isinstance(node, Multiply):
        return inputs[0] * inputs[1]
    if isinstance(node, Negate):
        return -inputs[0]
    symbolic = any(isinstance(x, Expression) for x in inputs)
    if isinstance(node, (Sine, Cosine)):
        function = sine if isinstance(node, Sine) else cosine
        name = "sin" if isinstance(node, Sine) else "cos"
        return function(inputs[0]) if symbolic else _numeric(name)(inputs[0])
    name = cast(Call, node).function
    return call(name, *inputs) if symbolic else _numeric(name)(*inputs)


def operation_count(expressions: Iterable[Expression]) -> OperationCount:
    """Cost of evaluating all of them, common parts counted once."""
    kinds = [type(node) for node in ordered(expressions)]
    return OperationCount(
        kinds.count(Multiply),
        kinds.count(Add),
        kinds.count(Sine) + kinds.count(Cosine),
        kinds.count(Call),
    )


def sympy_expressions(
    expressions: Iterable[Expression], names: Mapping[Expression, Any] | None = None
) -> list[Any]:
    """Expressions for SymPy, roots in full; symbols are real, whole numbers exact."""
    sympy = require("sympy", extra="symbolic", purpose="an expression of SymPy")

    known = names or {}
    translated = []
    for root in expressions:
        parts: dict[Expression, Any] = {}
        for node in ordered([root], stop=known):
            if node in known and (node is not root or isinstance(node, Symbol)):
                parts[node] = known[node]
            else:
                parts[node] = _translated(node, [parts[x] for x in node.operands], sympy)
        translated.append(parts[root])
    return translated


def _translated(node: Expression, operands: list[Any], sympy: Any) -> Any:
    if isinstance(node, Constant):
        whole = node.value == int(node.value)
        return sympy.Integer(int(node.value)) if whole else sympy.Float(node.value)
    if isinstance(node, Symbol):
        return sympy.Symbol(node.name, real=True)
    if isinstance(node, Add):
        return operands[0] + operands[1]
    if isinstance(node, Multiply):
        return operands[0] * operands[1]
    if isinstance(node, Negate):
        return -operands[0]
    if isinstance(node, (Sine, Cosine)):
        return (sympy.sin if isinstance(node, Sine) else sympy.cos)(operands[0])
    function = cast(Call, node).function
    if function == "divide":
        return operands[0] / operands[1]
    if function == "power":
        return operands[0] ** operands[1]
    names = {"abs": "Abs", "maximum": "Max", "minimum": "Min"}
    return getattr(sympy, names.get(function, function))(*operands)


@provides("to_sympy")
def _to_sympy(expression: Expression) -> Any:
    return sympy_expressions([expression])[0]
