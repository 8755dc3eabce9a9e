"""Translation of expressions to SymPy."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, cast

from pivident.dynamics.grouping.expression_graph import (
    Add,
    Call,
    Constant,
    Cosine,
    Expression,
    Multiply,
    Negate,
    Sine,
    Symbol,
    ordered,
    provides,
)
from pivident.extras import require


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
