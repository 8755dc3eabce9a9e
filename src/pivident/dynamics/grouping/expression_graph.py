"""The graph of expressions: its unique nodes, their sums and products.

`pivident.dynamics.grouping.expressions` is the module to import from; it adds the functions.
"""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Callable, Iterable, Mapping
from threading import Lock
from typing import TYPE_CHECKING, Any, TypeVar, Union, cast
from weakref import WeakValueDictionary

if TYPE_CHECKING:
    import sympy

Number = Union[int, float]  # noqa: UP007
Operand = Union["Expression", int, float]


_Method = TypeVar("_Method", bound=Callable[..., Any])

#: Methods of expressions that other modules of this package provide: texts, values, SymPy.
_PROVIDED: dict[str, Callable[..., Any]] = {}


def provides(name: str) -> Callable[[_Method], _Method]:
    """Register a function as a method of expressions."""

    def register(function: _Method) -> _Method:
        _PROVIDED[name] = function
        return function

    return register


class Expression:
    """An immutable node of the graph."""

    __slots__ = ("__weakref__", "operands", "order")

    operands: tuple[Expression, ...]
    order: tuple[int, float, str, int]  # sort key among operands; the same in every process

    def __add__(self, other: Operand) -> Expression:
        return add(self, other)

    def __radd__(self, other: Operand) -> Expression:
        return add(other, self)

    def __sub__(self, other: Operand) -> Expression:
        return add(self, negate(other))

    def __rsub__(self, other: Operand) -> Expression:
        return add(other, negate(self))

    def __mul__(self, other: Operand) -> Expression:
        return multiply(self, other)

    def __rmul__(self, other: Operand) -> Expression:
        return multiply(other, self)

    def __truediv__(self, other: Operand) -> Expression:
        return _PROVIDED["divide"](self, other)

    def __rtruediv__(self, other: Operand) -> Expression:
        return _PROVIDED["divide"](other, self)

    def __pow__(self, exponent: Number) -> Expression:
        return _PROVIDED["power"](self, exponent)

    def __neg__(self) -> Expression:
        return negate(self)

    def __reduce__(self) -> tuple[Any, ...]:
        """Copying and unpickling return the unique object that equals this one."""
        if isinstance(self, Constant):
            return constant, (self.value,)
        if isinstance(self, Symbol):
            return symbol, (self.name,)
        return make_node, (type(self), self.operands, getattr(self, "function", ""))

    def __str__(self) -> str:
        return self.to_python(prefix="")

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self}>"

    @property
    def is_zero(self) -> bool:
        """Whether it is the constant 0."""
        return isinstance(self, Constant) and self.value == 0.0

    @property
    def is_one(self) -> bool:
        """Whether it is the constant 1."""
        return isinstance(self, Constant) and self.value == 1.0

    @property
    def symbols(self) -> tuple[Symbol, ...]:
        """Symbols that it depends on, in their order."""
        found = [node for node in ordered([self]) if isinstance(node, Symbol)]
        return tuple(sorted(found, key=lambda node: node.order))

    def evaluate(self, values: Mapping[str, Any]) -> Any:
        """Its value; symbols become numbers, arrays that broadcast, or other expressions."""
        return _PROVIDED["evaluate"](self, values)

    def to_python(self, prefix: str = "np.") -> str:
        """As Python text; ``prefix`` precedes the names of functions."""
        return _PROVIDED["to_python"](self, prefix)

    def to_c(self) -> str:
        """As C99 text with the functions of ``math.h``."""
        return _PROVIDED["to_c"](self)

    def to_latex(self) -> str:
        """As LaTeX for math mode."""
        return _PROVIDED["to_latex"](self)

    def to_sympy(self) -> sympy.Expr:
        """As a SymPy expression, with real symbols of the same names."""
        return _PROVIDED["to_sympy"](self)


class Constant(Expression):
    """A finite number."""

    __slots__ = ("value",)
    value: float


class Symbol(Expression):
    """A named quantity; the name is any text, printers turn it into a valid identifier."""

    __slots__ = ("name",)
    name: str


class Add(Expression):
    """a + b, or a - b where the second operand is a `Negate`."""

    __slots__ = ()


class Multiply(Expression):
    """a · b."""

    __slots__ = ()


class Negate(Expression):
    """-a."""

    __slots__ = ()


class Sine(Expression):
    """sin a."""

    __slots__ = ()


class Cosine(Expression):
    """cos a."""

    __slots__ = ()


class Call(Expression):
    """Another function of its operands, one of ``expressions.FUNCTIONS``."""

    __slots__ = ("function",)
    function: str


_known: WeakValueDictionary[tuple, Expression] = WeakValueDictionary()
_lock = Lock()


def constant(value: Number) -> Constant:
    """The number as an expression."""
    number = float(value) + 0.0  # no negative zero
    if not math.isfinite(number):
        raise ValueError(f"a constant must be finite, not {value}")
    key = (Constant, number)
    node = _known.get(key)
    if node is None:
        with _lock:
            node = Constant()
            node.operands, node.order = (), (0, number, "", hash(key[1]))
            cast(Constant, node).value = number
            node = _known.setdefault(key, node)
    return cast(Constant, node)


def symbol(name: str) -> Symbol:
    """The quantity of that name; the same object each time."""
    key = (Symbol, name)
    node = _known.get(key)
    if node is None:
        with _lock:
            node = Symbol()
            padded = re.sub(r"[0-9]+", lambda digits: digits.group().zfill(6), name)
            node.operands, node.order = (), (1, 0.0, padded, zlib.crc32(name.encode()))
            cast(Symbol, node).name = name
            node = _known.setdefault(key, node)
    return cast(Symbol, node)


def as_expression(value: Operand) -> Expression:
    """An expression as it is, a number as a constant."""
    return value if isinstance(value, Expression) else constant(value)


ZERO: Expression = constant(0.0)
ONE: Expression = constant(1.0)
_KIND = {Add: 2, Multiply: 3, Negate: 4, Sine: 5, Cosine: 6, Call: 7}


def make_node(kind: type[Expression], operands: tuple[Expression, ...], function: str = "") -> Any:
    """The one node of this kind with these operands."""
    key = (kind, function, *operands)
    node = _known.get(key)
    if node is None:
        with _lock:
            node = kind()
            node.operands = operands
            depth = 1.0 + max(operand.order[1] * (operand.order[0] == 2) for operand in operands)
            content = (_KIND[kind], zlib.crc32(function.encode()), *(x.order[3] for x in operands))
            node.order = (2, depth, "", hash(content))
            if function:
                cast(Call, node).function = function
            node = _known.setdefault(key, node)
    return node


def without_sign(x: Expression) -> tuple[bool, Expression]:
    """Whether it has a minus sign, and the expression without it."""
    if isinstance(x, Negate):
        return True, x.operands[0]
    if isinstance(x, Constant) and x.value < 0.0:
        return True, constant(-x.value)
    return False, x


def negate(a: Operand) -> Expression:
    """The negative -a."""
    a = as_expression(a)
    if isinstance(a, Constant):
        return constant(-a.value)
    return a.operands[0] if isinstance(a, Negate) else make_node(Negate, (a,))


def add(a: Operand, b: Operand) -> Expression:
    """The sum a + b."""
    a, b = as_expression(a), as_expression(b)
    if isinstance(a, Constant):
        a, b = b, a
    if isinstance(b, Constant):
        if isinstance(a, Constant):
            return constant(a.value + b.value)
        if b.value == 0.0:
            return a
        inner = without_constant(a)
        if inner is not None:
            return add(inner[0], inner[1] + b.value)
    minus_a, a = without_sign(a)
    minus_b, b = without_sign(b)
    if a is b:
        return ZERO if minus_a != minus_b else multiply(-2.0 if minus_a else 2.0, a)
    if minus_a == minus_b and _is_circle(a, b):
        return negate(ONE) if minus_a else ONE
    # constants stand last in a sum
    if isinstance(a, Constant) or (not isinstance(b, Constant) and b.order < a.order):
        (minus_a, a), (minus_b, b) = (minus_b, b), (minus_a, a)
    total = make_node(Add, (a, b if minus_a == minus_b else make_node(Negate, (b,))))
    return negate(total) if minus_a else total


def without_constant(a: Expression) -> tuple[Expression, float] | None:
    """(x, c) where a is ±(x ± c), else None."""
    minus, total = without_sign(a)
    if not isinstance(total, Add):
        return None
    first, last = total.operands
    minus_last, last = (True, last.operands[0]) if isinstance(last, Negate) else (False, last)
    if not isinstance(last, Constant):
        return None
    value = -last.value if minus_last else last.value
    return (negate(first), -value) if minus else (first, value)


def _is_circle(a: Expression, b: Expression) -> bool:
    """Whether a + b is cos²x + sin²x."""
    if not (isinstance(a, Multiply) and isinstance(b, Multiply)):
        return False
    x, y = a.operands[0], b.operands[0]
    if a.operands[1] is not x or b.operands[1] is not y:
        return False
    return {type(x), type(y)} == {Sine, Cosine} and x.operands[0] is y.operands[0]


def multiply(a: Operand, b: Operand) -> Expression:
    """The product a · b."""
    minus_a, a = without_sign(as_expression(a))
    minus_b, b = without_sign(as_expression(b))
    factor_a, rest_a = _factored(a)
    factor_b, rest_b = _factored(b)
    if rest_a is ONE or rest_b is ONE or (factor_a != 1.0 and factor_b != 1.0):
        product = _scaled(factor_a * factor_b, _product(rest_a, rest_b))
    else:
        product = _product(a, b)
    return product if minus_a == minus_b else negate(product)


def _factored(a: Expression) -> tuple[float, Expression]:
    """Constant factor and the rest, for an expression without sign."""
    if isinstance(a, Constant):
        return a.value, ONE
    if isinstance(a, Multiply) and isinstance(a.operands[0], Constant):
        return a.operands[0].value, a.operands[1]
    return 1.0, a


def _scaled(factor: float, a: Expression) -> Expression:
    """The product factor · a of an expression without constant factor."""
    if factor == 0.0 or a is ONE:
        return constant(factor)
    return a if factor == 1.0 else make_node(Multiply, (constant(factor), a))


def _product(a: Expression, b: Expression) -> Expression:
    """The product a · b, neither of them a constant other than 1."""
    if a is ONE or b is ONE:
        return b if a is ONE else a
    return make_node(Multiply, (a, b) if a.order <= b.order else (b, a))


def ordered(
    roots: Iterable[Expression], stop: Mapping[Expression, Any] | None = None
) -> list[Expression]:
    """All subexpressions of the roots, each once, operands first; ``stop`` is not entered."""
    roots = list(roots)
    known = () if stop is None else stop
    own = set(roots)
    found: dict[Expression, None] = {}
    waiting: list[tuple[Expression, bool]] = [(root, False) for root in reversed(roots)]
    while waiting:
        node, complete = waiting.pop()
        if node in found:
            continue
        if complete or not node.operands or (node in known and node not in own):
            found[node] = None
            continue
        waiting.append((node, True))
        waiting.extend((operand, False) for operand in reversed(node.operands))
    return list(found)
