"""Straight-line programs that write themselves in C99, Python, LaTeX and SymPy."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from pivident.models.symbolic.assignments import Assignments
from pivident.models.symbolic.print_c import c_source
from pivident.models.symbolic.print_latex import latex_document
from pivident.models.symbolic.print_python import python_function, python_module, sympy_program

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
