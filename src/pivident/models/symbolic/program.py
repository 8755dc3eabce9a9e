"""Straight-line programs that write themselves in C99, Python, LaTeX and SymPy.

Programs as LaTeX documents.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.dynamics.grouping.expressions import Expression
from pivident.dynamics.grouping.notation import LATEX, expression_texts
from pivident.foundation.text.identifiers import identifiers, latex_name, latex_text
from pivident.models.symbolic.assignments import Assignments, Output, closings_of
from pivident.models.symbolic.print_c import c_source
from pivident.models.symbolic.print_python import (
    python_function,
    python_module,
    scalar_names,
    sympy_program,
)

if TYPE_CHECKING:
    import sympy


class Program(Assignments):
    """Expressions in the order of their evaluation, as a function and as text.

    Attributes:
        name: name of the function that it becomes.
        title: what it computes, one line.
        inputs: arguments that change from sample to sample.
        parameters: arguments that stay; without symbols where they are numbers.
        outputs: results.
        variables: expressions that are assigned to a variable and its name, in their order.
        notes: what one must know, sentences.
    """

    def function(self) -> Callable[..., Any]:
        """The program as a function of NumPy arrays, compiled from `to_python`.

        Its arguments are the inputs, each of shape ``(..., elements)``, and the parameters, shape
        (parameters,); it returns the outputs, each of shape ``(..., *shape)``, a tuple if several.
        """
        return python_function(self)

    def to_python(self) -> str:
        """Text of a Python module with one function of NumPy arrays."""
        return python_module([self])

    def to_c(self) -> str:
        """Text of a C99 file with one function, and one for many samples."""
        return c_source([self])

    def to_latex(self) -> str:
        """Assignments and outputs as a LaTeX document."""
        return latex_document([self])

    def to_sympy(self) -> tuple[list[tuple[sympy.Symbol, sympy.Expr]], dict[str, sympy.Array]]:
        """Assignments and outputs for SymPy, as ``sympy.cse`` returns them."""
        return sympy_program(self)


#: Equations in one block; long blocks of `align` take TeX more than linear time.
_BLOCK = 40


def latex_document(programs: Sequence[Assignments]) -> str:
    """Text of a document with the assignments and outputs of each program."""
    lines = [
        r"\documentclass[10pt,a4paper]{article}",
        r"\usepackage[utf8]{inputenc}",
        r"\usepackage[T1]{fontenc}",
        r"\usepackage{amsmath}",
        r"\usepackage[margin=15mm]{geometry}",
        r"\allowdisplaybreaks",
        r"\begin{document}",
    ]
    for program in (*(closing.step for closing in closings_of(programs)), *programs):
        lines += latex_section(program)
    return "\n".join([*lines, r"\end{document}", ""])


def latex_section(program: Assignments) -> list[str]:
    """Lines of one program: title, cost, assignments, outputs."""
    names = _latex_names(program)
    texts = expression_texts(program.variables, LATEX, names)
    equations = [f"{names[v]} &= {text}" for v, text in zip(program.variables, texts, strict=True)]
    for output in program.outputs:
        values = [
            names.get(e) or expression_texts([e], LATEX, names)[0] for e in output.elements.ravel()
        ]
        equations += [
            f"{left} &= {value}"
            for left, value, element in zip(
                _element_names(output), values, output.elements.ravel(), strict=True
            )
            if not element.is_zero or output.elements.ndim == 1
        ]
    title, *rest = program.header
    notes = [f"{latex_text(line)}\\par" for line in rest]
    if any(e.is_zero for output in program.outputs for e in output.elements.ravel()):
        notes.append("Elements of a matrix that are not listed are zero.\\par")
    lines = [f"\\section*{{{latex_text(title)}}}", *notes]
    for start in range(0, len(equations), _BLOCK):
        block = equations[start : start + _BLOCK]
        lines += [r"\begin{align*}", " \\\\\n".join(block), r"\end{align*}"]
    return lines


def _latex_names(program: Assignments) -> dict[Expression, str]:
    """Distinct names of all symbols and variables."""
    texts = scalar_names(program)
    own: dict[Expression, str] = {s: s.name for s in program.symbols}
    return dict(zip(texts, _distinct(own.get(e, t) for e, t in texts.items()), strict=True))


def _distinct(names: Iterable[str]) -> list[str]:
    used: dict[str, int] = {}
    result = []
    for name in names:
        text = latex_name(name)
        used[text] = used.get(text, 0) + 1
        result.append(text if used[text] == 1 else f"{text}^{{({used[text]})}}")
    return result


def _element_names(output: Output) -> list[str]:
    head = latex_name(identifiers([output.name])[0])
    return [
        f"{head}_{{{','.join(str(k + 1) for k in place)}}}" for place in np.ndindex(output.shape)
    ]
