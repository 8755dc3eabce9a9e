"""Straight-line programs: inputs, a list of assignments, outputs.

A program is built from the expressions of its outputs. It contains nothing that no output needs,
and a common subexpression is assigned to a variable once. Printers for C99, Python, LaTeX and
SymPy are in separate files; `Program.function` runs the Python text.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.dynamics.grouping.expressions import (
    Add,
    Call,
    Constant,
    Cosine,
    Expression,
    Multiply,
    Negate,
    Operand,
    OperationCount,
    Sine,
    Symbol,
    as_expression,
    operation_count,
    ordered,
)
from pivident.text.identifiers import identifiers, one_line

if TYPE_CHECKING:
    import sympy

#: Operations in one assignment above which parts of it become variables.
MAX_OPERATIONS = 12


@dataclass(frozen=True)
class Input:
    """An argument of a program."""

    name: str  # such as ``q``
    symbols: tuple[Symbol, ...]  # names of its elements inside
    meaning: str = ""  # with its unit

    def __len__(self) -> int:
        return len(self.symbols)


@dataclass(frozen=True, eq=False)
class Output:
    """A result of a program."""

    name: str  # such as ``tau``
    elements: np.ndarray  # expressions, array of objects of any shape
    meaning: str = ""  # with its unit

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the result for one set of inputs."""
        return self.elements.shape


@dataclass(frozen=True, eq=False)
class Program:
    """Expressions in the order of their evaluation."""

    name: str  # of the generated function
    title: str  # what it computes, one line
    inputs: tuple[Input, ...]  # arguments that change from sample to sample
    parameters: Input  # constant arguments; without symbols where they are numbers
    outputs: tuple[Output, ...]
    variables: Mapping[Expression, str]  # expressions assigned to variables, and their names
    notes: tuple[str, ...] = ()  # sentences for the user

    @classmethod
    def build(
        cls,
        name: str,
        inputs: Sequence[Input],
        parameters: Input,
        outputs: Sequence[Output],
        *,
        title: str = "",
        hints: Iterable[tuple[str, Operand]] = (),
        notes: Sequence[str] = (),
    ) -> Program:
        """Order what the outputs need, and choose the variables.

        ``hints`` are descriptive names of expressions that should become variables. Trivial and
        unused ones are ignored, and where only the negative is needed the name gets ``minus_``.
        """
        given = {s for argument in (*inputs, parameters) for s in argument.symbols}
        nodes = ordered(_elements(outputs))
        for node in nodes:
            if isinstance(node, Symbol) and node not in given:
                raise ValueError(f"program {name!r} depends on {node.name!r}, which is no input")
        wanted: dict[Expression, str] = {}
        for hint, value in hints:
            expression = as_expression(value)
            if isinstance(expression, Negate):
                expression, hint = expression.operands[0], f"minus_{hint}"
            wanted.setdefault(expression, hint)
        taken = {a.name for a in (*inputs, parameters)} | {o.name for o in outputs}
        taken |= {s.name for s in given}
        variables = _variables(nodes, _elements(outputs), wanted)
        texts = identifiers(variables.values(), identifiers(sorted(taken)))
        named = dict(zip(variables, texts, strict=True))
        return cls(name, title, tuple(inputs), parameters, tuple(outputs), named, tuple(notes))

    @cached_property
    def expressions(self) -> tuple[Expression, ...]:
        """All elements of all outputs."""
        return tuple(_elements(self.outputs))

    @cached_property
    def operation_count(self) -> OperationCount:
        """Cost of one evaluation, operations on parameters alone included."""
        return operation_count(self.expressions)

    @cached_property
    def parameter_operation_count(self) -> OperationCount:
        """Cost of operations on parameters alone, needed once for all samples."""
        constant: dict[Expression, bool] = {}
        own = set(self.parameters.symbols)
        for node in ordered(self.expressions):
            leaf = isinstance(node, Constant) or node in own
            below = bool(node.operands) and all(constant[x] for x in node.operands)
            constant[node] = leaf or below
        return operation_count(node for node, alone in constant.items() if alone)

    @cached_property
    def used(self) -> frozenset[Expression]:
        """Symbols that at least one output depends on."""
        return frozenset(n for n in ordered(self.expressions) if isinstance(n, Symbol))

    @property
    def header(self) -> tuple[str, ...]:
        """Header of generated code: title, cost, arguments, results, notes."""
        count, alone = self.operation_count, self.parameter_operation_count
        lines = [self.title, f"Operations: {count}."] if self.title else [f"Operations: {count}."]
        if alone != OperationCount():
            lines.append(f"Of these, on parameters alone: {alone}.")
        for argument in (*self.inputs, self.parameters):
            if argument.symbols:
                lines.append(f"{argument.name}: {argument.meaning}, {len(argument)} numbers")
        for output in self.outputs:
            shape = " x ".join(map(str, output.shape))
            lines.append(f"{output.name}: {output.meaning}, {shape}")
        return tuple(map(one_line, (*lines, *self.notes)))

    def function(self) -> Callable[..., Any]:
        """The program as a function of NumPy arrays, compiled from `to_python`.

        Its arguments are the inputs, each of shape (..., elements), and the parameters, shape
        (parameters,); it returns the outputs, each of shape (..., *shape), a tuple if several.
        """
        from pivident.symbolic.print_python import python_function

        return python_function(self)

    def to_python(self) -> str:
        """A Python module with one function of NumPy arrays."""
        from pivident.symbolic.print_python import python_module

        return python_module([self])

    def to_c(self) -> str:
        """A C99 file with one function, and one for many samples."""
        from pivident.symbolic.print_c import c_source

        return c_source([self])

    def to_latex(self) -> str:
        """Assignments and outputs as a LaTeX document."""
        from pivident.symbolic.print_latex import latex_document

        return latex_document([self])

    def to_sympy(self) -> tuple[list[tuple[sympy.Symbol, sympy.Expr]], dict[str, sympy.Array]]:
        """Assignments and outputs for SymPy, as ``sympy.cse`` returns them."""
        from pivident.symbolic.print_sympy import sympy_program

        return sympy_program(self)


def output_array(values: Any) -> np.ndarray:
    """Nested sequences of expressions and numbers as an array of expressions."""
    array = np.array(values, dtype=object)
    flat = [as_expression(value) for value in array.ravel()]
    result = np.empty(len(flat), dtype=object)
    result[:] = flat
    return result.reshape(array.shape)


def _elements(outputs: Iterable[Output]) -> list[Expression]:
    return [element for output in outputs for element in output.elements.ravel()]


def _variables(
    nodes: Sequence[Expression], roots: Sequence[Expression], wanted: Mapping[Expression, str]
) -> dict[Expression, str]:
    """Expressions that become variables, with their names, in the order of evaluation.

    Expressions used twice, named ones, sines and cosines, and parts of expressions that would
    become too long.
    """
    uses: dict[Expression, int] = dict.fromkeys(nodes, 0)
    for operand in (x for node in nodes for x in node.operands):
        uses[operand] += 1
    for root in roots:
        uses[root] += 1
    chosen: dict[Expression, str] = {}
    length: dict[Expression, int] = {}
    for node in nodes:
        if not node.operands:
            length[node] = 0
            continue
        length[node] = isinstance(node, (Add, Multiply, Call)) + sum(
            0 if x in chosen else length[x] for x in node.operands
        )
        if isinstance(node, Negate):
            continue
        circular = isinstance(node, (Sine, Cosine))
        if uses[node] > 1 or node in wanted or circular or length[node] > MAX_OPERATIONS:
            chosen[node] = wanted.get(node, "")
    count = 0
    for node, name in chosen.items():
        if not name:
            count += 1
            chosen[node] = f"x{count}"
    return chosen
