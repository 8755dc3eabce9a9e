"""Expressions as text: Python, C99 and LaTeX."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import cast

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
from pivident.foundation.errors import UnusableValue
from pivident.foundation.text.identifiers import identifier, latex_name

#: Precedence of a text: a sum, a sign, a product, anything else.
_SUM, _SIGN, _PRODUCT, _ATOM = 0, 1, 2, 3


@dataclass(frozen=True)
class Notation:
    """How one language writes an expression.

    Where a machine ``computes`` with the text, sums and products are bracketed in the order in
    which they are evaluated, because rounding depends on it.
    """

    times: str  # between factors
    functions: Mapping[str, str]
    number: Callable[[float], str]  # text of a constant that is not negative
    symbol: Callable[[str], str]  # text of a symbol's name
    opening: str = "("
    closing: str = ")"
    computes: bool = True
    foreign: bool = False  # whether it may call functions that are defined beside it


def _latex_number(value: float) -> str:
    text = f"{value:.6g}"
    if "e" in text:
        mantissa, exponent = text.split("e")
        return rf"{mantissa} \cdot 10^{{{int(exponent)}}}"
    return text


PYTHON = Notation(
    "*",
    {
        "sin": "sin", "cos": "cos", "sqrt": "sqrt", "abs": "abs", "sign": "sign", "exp": "exp",
        "atan": "arctan", "tanh": "tanh", "power": "power", "maximum": "maximum",
        "minimum": "minimum",
    },
    repr,
    identifier,
)  # fmt: skip
C99 = Notation(
    "*",
    {
        "sin": "sin", "cos": "cos", "sqrt": "sqrt", "abs": "fabs", "sign": "sign_of",
        "exp": "exp", "atan": "atan", "tanh": "tanh", "power": "pow", "maximum": "fmax",
        "minimum": "fmin",
    },
    repr,  # has a point or an exponent, so it is a double in C
    identifier,
    foreign=True,
)  # fmt: skip
LATEX = Notation(
    r" \, ",
    {
        "sin": r"\sin", "cos": r"\cos", "sqrt": r"\sqrt", "sign": r"\operatorname{sign}",
        "exp": r"\exp", "atan": r"\arctan", "tanh": r"\tanh", "maximum": r"\max",
        "minimum": r"\min",
    },
    _latex_number,
    latex_name,
    r"\left(",
    r"\right)",
    False,
)  # fmt: skip


def expression_text(expression: Expression, notation: Notation, prefix: str = "") -> str:
    """One expression as text, in full."""
    return expression_texts([expression], notation, {}, prefix)[0]


def expression_texts(
    expressions: Iterable[Expression],
    notation: Notation,
    names: Mapping[Expression, str],
    prefix: str = "",
) -> list[str]:
    """Expressions as text; each root is written in full even where it is in ``names``."""
    return [_written_out(root, notation, names, prefix) for root in expressions]


def _written_out(
    root: Expression, notation: Notation, names: Mapping[Expression, str], prefix: str
) -> str:
    parts: dict[Expression, tuple[str, int]] = {}
    for node in ordered([root], stop=names):
        if node in names and (node is not root or isinstance(node, Symbol)):
            parts[node] = (names[node], _ATOM)
        elif node is root and (difference := _reversed_difference(node, names)):
            operands = [parts[operand] for operand in difference]
            parts[node] = _text(node.operands[0], operands, notation, prefix, minus=True)
        else:
            operands = [parts[operand] for operand in node.operands]
            parts[node] = _text(node, operands, notation, prefix)
    return parts[root][0]


def _reversed_difference(
    node: Expression, names: Mapping[Expression, str]
) -> tuple[Expression, Expression] | None:
    """(b, a) of -(a - b), which is written b - a; None for anything else."""
    if not isinstance(node, Negate) or node.operands[0] in names:
        return None
    total = node.operands[0]
    if not isinstance(total, Add) or not isinstance(total.operands[1], Negate):
        return None
    return total.operands[1].operands[0], total.operands[0]


def _text(
    node: Expression,
    operands: list[tuple[str, int]],
    notation: Notation,
    prefix: str,
    minus: bool = False,
) -> tuple[str, int]:
    """Text of a node from its operands (text, precedence); ``minus``: of a reversed difference."""

    def bracketed(k: int, least: int) -> str:
        text, precedence = operands[k]
        return text if precedence >= least else f"{notation.opening}{text}{notation.closing}"

    if isinstance(node, Constant):
        text = notation.number(abs(node.value))
        return (f"-{text}", _SIGN) if node.value < 0.0 else (text, _ATOM)
    if isinstance(node, Symbol):
        return notation.symbol(node.name), _ATOM
    if isinstance(node, Negate):
        return f"-{bracketed(0, _PRODUCT)}", _SIGN
    if minus:
        return f"{bracketed(0, _SUM)} - {bracketed(1, _PRODUCT)}", _SUM
    if isinstance(node, Add):
        return _sum(node, bracketed, notation), _SUM
    if isinstance(node, Multiply):
        if not notation.computes and node.operands[0] is node.operands[1]:
            plain = operands[0][1] == _ATOM
            base = operands[0][0] if plain else rf"\left({operands[0][0]}\right)"
            return f"{base}^{{2}}", _PRODUCT
        second = bracketed(1, _ATOM if notation.computes else _PRODUCT)
        return f"{bracketed(0, _PRODUCT)}{notation.times}{second}", _PRODUCT
    texts = [text for text, _ in operands]
    name = _function_name(node)
    if name not in (*notation.functions, "divide", "abs", "power") and not notation.foreign:
        raise UnusableValue(
            f"the function {name!r} is known in C only",
            advice="export it as C, or declare it by an expression",
        )
    if not notation.computes:
        return _latex_function(name, texts, operands, notation)
    if name == "divide":
        return f"{bracketed(0, _PRODUCT)}/{bracketed(1, _ATOM)}", _PRODUCT
    return f"{prefix}{notation.functions.get(name, name)}({', '.join(texts)})", _ATOM


def _sum(node: Add, bracketed: Callable[[int, int], str], notation: Notation) -> str:
    """The sum a + b, or a - b where b has a minus sign (its text then begins with one)."""
    second = bracketed(1, _SIGN if notation.computes else _SUM)
    if isinstance(node.operands[1], Negate) and second.startswith("-"):
        return f"{bracketed(0, _SUM)} - {second[1:]}"
    return f"{bracketed(0, _SUM)} + {second}"


def _function_name(node: Expression) -> str:
    if isinstance(node, Sine):
        return "sin"
    return "cos" if isinstance(node, Cosine) else cast(Call, node).function


def _latex_function(
    name: str, texts: list[str], operands: list[tuple[str, int]], notation: Notation
) -> tuple[str, int]:
    if name == "divide":
        return rf"\frac{{{texts[0]}}}{{{texts[1]}}}", _ATOM
    if name == "abs":
        return rf"\left|{texts[0]}\right|", _ATOM
    if name == "sqrt":
        return rf"\sqrt{{{texts[0]}}}", _ATOM
    if name == "power":
        return rf"\left({texts[0]}\right)^{{{texts[1]}}}", _PRODUCT
    if len(texts) == 1 and operands[0][1] == _ATOM:
        return rf"{notation.functions[name]} {texts[0]}", _PRODUCT
    return rf"{notation.functions[name]}\left({', '.join(texts)}\right)", _ATOM


@provides("to_python")
def _to_python(expression: Expression, prefix: str = "np.") -> str:
    return expression_text(expression, PYTHON, prefix=prefix)


@provides("to_c")
def _to_c(expression: Expression) -> str:
    return expression_text(expression, C99)


@provides("to_latex")
def _to_latex(expression: Expression) -> str:
    return expression_text(expression, LATEX)
