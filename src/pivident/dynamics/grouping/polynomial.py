"""Polynomials in lengths, sines and cosines: the coefficients of groups in one normal form.

Graph expressions share work but do not cancel d² - (d² + r²) + r². Here a coefficient is a sum of
products of powers with sin² replaced by 1 - cos², so that two coefficients are equal exactly where
their terms are.
"""

from __future__ import annotations

from dataclasses import dataclass

from pivident.dynamics.grouping.expression_graph import multiply
from pivident.dynamics.grouping.expressions import (
    ONE,
    ZERO,
    Add,
    Constant,
    Cosine,
    Expression,
    Negate,
    Sine,
    Symbol,
    constant,
    cosine,
    divide,
    power,
    sine,
)

#: Product of powers: (expression, exponent) in the order of the expressions.
Monomial = tuple[tuple[Expression, int], ...]

#: Fraction of the summands below which a sum is rounding.
_ROUNDING = 1e-14


@dataclass(frozen=True, slots=True)
class Polynomial:
    """A sum of terms, each a number (never 0) times a product of powers."""

    terms: dict[Monomial, float]

    @classmethod
    def of(cls, value: Expression | float) -> Polynomial:
        """A number, or an expression taken as an atom (a symbol, sine or cosine)."""
        if isinstance(value, Expression) and not isinstance(value, Constant):
            return cls({((value, 1),): 1.0})
        number = value.value if isinstance(value, Constant) else float(value)
        return cls({(): number} if number else {})

    @property
    def names(self) -> set[str]:
        """Names of the symbols in it."""
        atoms = {atom for monomial in self.terms for atom, _ in monomial}
        return {symbol.name for atom in atoms for symbol in atom.symbols}

    @property
    def is_fraction(self) -> bool:
        """Whether a sum is a divisor."""
        return any(
            exponent < 0 and isinstance(atom, Add)
            for monomial in self.terms
            for atom, exponent in monomial
        )

    def __add__(self, other: Polynomial) -> Polynomial:
        terms = dict(self.terms)
        for monomial, number in other.terms.items():
            _add(terms, monomial, number)
        return Polynomial(terms)

    def __neg__(self) -> Polynomial:
        return Polynomial({monomial: -number for monomial, number in self.terms.items()})

    def __mul__(self, other: Polynomial) -> Polynomial:
        terms: dict[Monomial, float] = {}
        for left, a in self.terms.items():
            for right, b in other.terms.items():
                if not left or not right:
                    _add(terms, left or right, a * b)
                    continue
                for monomial, sign in _product(left, right):
                    _add(terms, monomial, sign * a * b)
        return Polynomial(terms)

    def __truediv__(self, other: Polynomial) -> Polynomial:
        if len(other.terms) == 1:
            ((monomial, number),) = other.terms.items()
            inverse = tuple((atom, -exponent) for atom, exponent in monomial)
            return self * Polynomial({inverse: 1.0 / number})
        if other.terms == self.terms:
            return Polynomial.of(1.0)
        divisor = other.expression()
        if isinstance(divisor, Negate):
            return -self * Polynomial({((divisor.operands[0], -1),): 1.0})
        return self * Polynomial({((divisor, -1),): 1.0})

    def expression(self) -> Expression:
        """As an expression."""
        total: Expression = ZERO
        for monomial, number in self.written_terms():
            total = total + _written(monomial, number)
        return total

    def __str__(self) -> str:
        """``d3² + r3²``, ``2·r4·cos(alpha4)``."""
        text = ""
        for monomial, number in self.written_terms():
            sign = "-" if number < 0.0 else "+"
            text += f" {sign} {_plain(monomial, abs(number))}"
        return text[3:] if text.startswith(" +") else "-" + text[3:] if text else "0"

    def written_terms(self) -> list[tuple[Monomial, float]]:
        """Terms in the order that they are written in, with k - k cos² as k sin²."""
        terms = dict(self.terms)
        for monomial in sorted(self.terms, key=lambda m: _key(m, self.terms[m])):
            for place, (atom, exponent) in enumerate(monomial):
                if not isinstance(atom, Cosine) or exponent != 2 or monomial not in terms:
                    continue
                rest = monomial[:place] + monomial[place + 1 :]
                if terms.get(rest) == -terms[monomial]:
                    number, turn = terms.pop(rest), sine(atom.operands[0])
                    del terms[monomial]
                    powers = dict(rest)
                    powers[turn] = powers.get(turn, 0) + 2
                    _add(terms, _sorted(powers), number)
        return sorted(terms.items(), key=lambda item: _key(*item))


def _add(terms: dict[Monomial, float], monomial: Monomial, number: float) -> None:
    old = terms.pop(monomial, 0.0)
    total = old + number
    if abs(total) > _ROUNDING * (abs(old) + abs(number)):
        terms[monomial] = total


def _product(left: Monomial, right: Monomial) -> list[tuple[Monomial, float]]:
    """Product of two monomials as monomials with signs, with sin² = 1 - cos²."""
    powers = dict(left)
    for atom, exponent in right:
        powers[atom] = powers.get(atom, 0) + exponent
    done: list[tuple[dict[Expression, int], float]] = [(powers, 1.0)]
    for atom in powers:
        while isinstance(atom, Sine) and any(p.get(atom, 0) >= 2 for p, _ in done):
            other, split = cosine(atom.operands[0]), []
            for p, sign in done:
                if p.get(atom, 0) < 2:
                    split.append((p, sign))
                    continue
                less = {**p, atom: p[atom] - 2}
                split += [(less, sign), ({**less, other: less.get(other, 0) + 2}, -sign)]
            done = split
    return [(_sorted(p), sign) for p, sign in done]


def _sorted(powers: dict[Expression, int]) -> Monomial:
    present = ((atom, exponent) for atom, exponent in powers.items() if exponent)
    return tuple(sorted(present, key=lambda item: _place(item[0])))


def _place(atom: Expression) -> tuple:
    """Order of factors: lengths, then sines and cosines angle by angle."""
    if isinstance(atom, (Sine, Cosine)):
        return 1, atom.operands[0].order, isinstance(atom, Sine)
    return 2 * isinstance(atom, Add), atom.order, False


def _key(monomial: Monomial, number: float) -> tuple:
    """Order of terms: positive ones first, then by their factors."""
    return number < 0.0, tuple((_place(atom), -exponent) for atom, exponent in monomial)


def _written(monomial: Monomial, number: float) -> Expression:
    above: Expression = ONE
    below: Expression = ONE
    for atom, exponent in monomial:
        if exponent > 0:
            above = multiply(above, power(atom, exponent))
        else:
            below = multiply(below, power(atom, -exponent))
    return constant(number) * (divide(above, below) if below is not ONE else above)


def _plain(monomial: Monomial, number: float) -> str:
    """A product as text, numbers first."""
    factors = [] if number == 1.0 and any(n > 0 for _, n in monomial) else [f"{number:.6g}"]
    below = ""
    for atom, exponent in monomial:
        name = atom.name if isinstance(atom, Symbol) else atom.to_python(prefix="")
        if isinstance(atom, Add):
            name = f"({name})"
        size = abs(exponent)
        powered = name if size == 1 else f"{name}²" if size == 2 else f"{name}^{size}"
        if exponent > 0:
            factors.append(powered)
        else:
            below += f"/{powered}"
    return "·".join(factors) + below
