"""Straight-line programs: inputs, a list of assignments, outputs.

A program is made from the expressions of its outputs. What no output needs is not in it, and what
is needed twice is assigned to a variable once.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

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
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.identifiers import identifiers, one_line

#: Operations in one assignment above which parts of it get a variable of their own.
MAX_OPERATIONS = 12

#: How generated code closes loops: change of an independent joint after which they are closed anew
#: on the way [rad or m], the longest way that is followed in such strides, gap below which one more
#: step of Newton's method is enough [m or rad], and its steps in one stride.
STRIDE, MAX_WAY, GAP, MAX_STEPS = 0.05, 1000.0, 1e-9, 30


@dataclass(frozen=True)
class Input:
    """An argument of a program.

    Attributes:
        name: its name, such as ``q``.
        symbols: what its elements are called inside.
        meaning: what it is, with its unit.
    """

    name: str
    symbols: tuple[Symbol, ...]
    meaning: str = ""

    def __len__(self) -> int:
        return len(self.symbols)


@dataclass(frozen=True, eq=False)
class Output:
    """A result of a program.

    Attributes:
        name: its name, such as ``tau``.
        elements: an expression for each element, array of objects of any shape.
        meaning: what it is, with its unit.
    """

    name: str
    elements: np.ndarray
    meaning: str = ""

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the result for one set of inputs."""
        return self.elements.shape


@dataclass(frozen=True, eq=False)
class Assignments(Displayed):
    """Expressions in the order of their evaluation; `Program` writes them in a language.

    Attributes:
        name: name of the function that it becomes.
        title: what it computes, one line.
        inputs: arguments that change from sample to sample.
        parameters: arguments that stay; without symbols where they are numbers.
        outputs: results.
        variables: expressions that are assigned to a variable and its name, in their order.
        notes: what one must know, sentences.
        closing: what finds positions of a closed mechanism that have no closed form; None: all
            have one, or no output depends on them.
    """

    name: str
    title: str
    inputs: tuple[Input, ...]
    parameters: Input
    outputs: tuple[Output, ...]
    variables: Mapping[Expression, str]
    notes: tuple[str, ...] = ()
    closing: LoopClosing | None = None

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
        closing: LoopClosing | None = None,
    ) -> Self:
        """Order what the outputs need, and choose what becomes a variable.

        Args:
            name: name of the function.
            inputs: arguments that change from sample to sample.
            parameters: arguments that stay.
            outputs: results.
            title: what it computes.
            hints: name of a variable and its expression, for expressions that should have a
                telling name; those that turn out to be trivial or unused are passed over, and
                where only the negative is needed the name gets ``minus_`` before it.
            notes: what one must know.
            closing: what finds positions of a closed mechanism that are no arguments.

        Raises:
            ValueError: an output depends on a symbol that is no argument.
        """
        nodes = ordered(_elements(outputs))
        if closing is not None and not set(closing.unknown.symbols).intersection(nodes):
            closing = None
        arguments = (*inputs, *((closing.unknown,) if closing else ()), parameters)
        given = {s for argument in arguments for s in argument.symbols}
        for node in nodes:
            if isinstance(node, Symbol) and node not in given:
                raise ValueError(f"program {name!r} depends on {node.name!r}, which is no input")
        wanted: dict[Expression, str] = {}
        for hint, value in hints:
            expression = as_expression(value)
            if isinstance(expression, Negate):
                expression, hint = expression.operands[0], f"minus_{hint}"
            wanted.setdefault(expression, hint)
        taken = {a.name for a in arguments} | {o.name for o in outputs}
        taken |= {s.name for s in given}
        variables = _variables(nodes, _elements(outputs), wanted)
        texts = identifiers(variables.values(), identifiers(sorted(taken)))
        named = dict(zip(variables, texts, strict=True))
        return cls(
            name, title, tuple(inputs), parameters, tuple(outputs), named, tuple(notes), closing
        )

    @property
    def symbols(self) -> tuple[Symbol, ...]:
        """All that its expressions are made of: inputs, passive positions, parameters."""
        passive = (self.closing.unknown,) if self.closing else ()
        return tuple(s for a in (*self.inputs, *passive, self.parameters) for s in a.symbols)

    @cached_property
    def expressions(self) -> tuple[Expression, ...]:
        """All elements of all outputs."""
        return tuple(_elements(self.outputs))

    @cached_property
    def operation_count(self) -> OperationCount:
        """What one evaluation costs, operations on parameters alone included."""
        return operation_count(self.expressions)

    @cached_property
    def parameter_operation_count(self) -> OperationCount:
        """What of it depends on parameters alone, and is needed once for all samples."""
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
        """What stands on top of generated code: title, cost, arguments, results, notes."""
        count, alone = self.operation_count, self.parameter_operation_count
        lines = [self.title, f"Operations: {count}."] if self.title else [f"Operations: {count}."]
        if alone != OperationCount():
            lines.append(f"Of these, on parameters alone: {alone}.")
        if self.closing:
            lines.append(f"Each step of Newton's method: {self.closing.step.operation_count}.")
            passive = ", ".join(s.name for s in self.closing.unknown.symbols)
            lines += [
                f"{passive}: {self.closing.unknown.meaning}, by Newton's method",
                "posture: where that starts, positions of the independent joints, then of these",
            ]
        lines += [
            f"{argument.name}: {argument.meaning}, {len(argument)} numbers"
            for argument in (*self.inputs, self.parameters)
            if argument.symbols
        ]
        for output in self.outputs:
            shape = " x ".join(map(str, output.shape))
            lines.append(f"{output.name}: {output.meaning}, {shape}")
        return tuple(map(one_line, (*lines, *self.notes)))


@dataclass(frozen=True, eq=False)
class LoopClosing:
    """Newton's method for the passive positions of a closed mechanism that have no closed form.

    Attributes:
        step: of ``q``, the passive positions and ``way``: what is left of the equations, and a step
            that also follows the independent joints along ``way``.
        unknown: the passive positions.
        posture: where the loops are closed: positions of the independent joints, then of these
            [rad or m].
    """

    step: Assignments
    unknown: Input
    posture: tuple[float, ...]

    @property
    def posture_text(self) -> str:
        """What the numbers of a posture are."""
        given = self.step.inputs[0].symbols
        names = ", ".join(s.name for s in (*given, *self.unknown.symbols))
        return f"Where the loops are closed: {names}."


def closings_of(programs: Iterable[Assignments]) -> list[LoopClosing]:
    """The methods that programs find passive positions with, each once."""
    return list(dict.fromkeys(p.closing for p in programs if p.closing is not None))


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

    What is used twice, what has a name of its own, sines and cosines, and parts of expressions
    that would become too long.
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
