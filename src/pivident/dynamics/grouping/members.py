"""A base parameter: a group of standard parameters of which only the sum is felt."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from pivident.dynamics.grouping.expression_graph import symbol
from pivident.dynamics.grouping.expressions import ONE, ZERO, Add, Expression
from pivident.dynamics.grouping.polynomial import Polynomial
from pivident.dynamics.parameters import Parameter
from pivident.text.identifiers import latex_name

if TYPE_CHECKING:
    import sympy


@dataclass(frozen=True)
class Member:
    """A standard parameter in a group, with its factor."""

    parameter: Parameter
    polynomial: Polynomial  # the factor in the names of the geometry, in normal form
    value: float  # the factor as a number

    @cached_property
    def coefficient(self) -> Expression:
        """Its factor as an expression."""
        return self.polynomial.expression()


@dataclass(frozen=True)
class Group:
    """A base parameter: its head, with factor 1, plus the standard parameters regrouped into it."""

    name: str  # ``zz1r``
    head: Parameter
    members: tuple[Member, ...]

    @property
    def expression(self) -> Expression:
        """The group as an expression in standard parameters and geometry."""
        total: Expression = symbol(self.head.name)
        for members in self._collected():
            common: Expression = ZERO
            for member in members:
                common = common + symbol(member.parameter.name)
            total = total + members[0].coefficient * common
        return total

    def __str__(self) -> str:
        """``zz1r = zz1 + ia1 + yy2 + … + (d3² + r3²)·(m3 + m4 + m5 + m6)``."""
        text = f"{self.name} = {self.head.name}"
        for members in self._collected():
            polynomial = members[0].polynomial
            sign, factor = "+", str(polynomial)
            if factor.startswith("-"):
                sign, factor = "-", str(-polynomial)
            names = [member.parameter.name for member in members]
            if factor == "1":
                text += "".join(f" {sign} {name}" for name in names)
                continue
            factor = f"({factor})" if len(polynomial.written_terms()) > 1 else factor
            total = f"({' + '.join(names)})" if len(names) > 1 else names[0]
            text += f" {sign} {factor}·{total}"
        return text

    def to_latex(self) -> str:
        """One line of an ``align`` environment, without line break."""
        text = f"{latex_name(self.name)} &= {latex_name(self.head.name)}"
        for members in self._collected():
            sign, factor = "+", members[0].coefficient
            if factor.to_latex().startswith("-"):
                sign, factor = "-", -factor
            names = [latex_name(member.parameter.name) for member in members]
            if factor is ONE:
                text += "".join(f" {sign} {name}" for name in names)
                continue
            written = factor.to_latex()
            written = rf"\left({written}\right)" if isinstance(factor, Add) else written
            total = rf"\left({' + '.join(names)}\right)" if len(names) > 1 else names[0]
            text += rf" {sign} {written} \, {total}"
        return text

    def to_sympy(self) -> sympy.Expr:
        """The group for SymPy."""
        return self.expression.to_sympy()

    def _collected(self) -> list[list[Member]]:
        """Members with the same factor together, in the order of the first of each."""
        found: dict[frozenset, list[Member]] = {}
        for member in self.members:
            found.setdefault(frozenset(member.polynomial.terms.items()), []).append(member)
        return list(found.values())
