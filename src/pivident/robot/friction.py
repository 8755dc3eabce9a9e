"""Friction laws: one object that regressor, simulator and export share, and its lines in a file.

A law is a sum of terms. Each term is one column of the observation matrix times one estimated
parameter; the constants that shape the column, such as the Stribeck speed, are given or identified
in an outer loop. Terms that belong together have one constructor, in the module that declares them.

A friction law as lines of an experiment or robot file, to be read in again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from pivident.foundation.errors import UnusableValue, require_kind, require_known
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.toml import toml_value
from pivident.robot.friction_column import Shape
from pivident.robot.friction_term import FrictionTerm, TermKind
from pivident.robot.friction_terms import OWN_COLUMNS, TERM_KINDS
from pivident.robot.friction_terms.coulomb import (
    asymmetric_coulomb as asymmetric_coulomb,
    coulomb as coulomb,
    load_dependent as load_dependent,
)
from pivident.robot.friction_terms.offset import offset as offset
from pivident.robot.friction_terms.position import (
    counterbalance as counterbalance,
    ripple as ripple,
    spring as spring,
)
from pivident.robot.friction_terms.presliding import (
    dahl as dahl,
    lugre as lugre,
    maxwell_slip as maxwell_slip,
)
from pivident.robot.friction_terms.stribeck import stribeck as stribeck
from pivident.robot.friction_terms.viscous import (
    asymmetric_viscous as asymmetric_viscous,
    power_viscous as power_viscous,
    viscous as viscous,
)


@dataclass(frozen=True)
class FrictionLaw(Displayed):
    """A sum of friction terms, one for each parameter.

    Attributes:
        terms: the friction terms; no two have the same stem.
    """

    terms: tuple[FrictionTerm, ...] = ()

    def __post_init__(self) -> None:
        for term in self.terms:
            require_kind("a friction term", term, FrictionTerm, "make it by its name, coulomb()")
        stems = [term.stem for term in self.terms]
        repeated = {stem for stem in stems if stems.count(stem) > 1}
        if repeated:
            advice = ""
            if "fc" in repeated and any(t.has_memory for t in self.terms):
                advice = "'dahl' and 'lugre' take the place of 'coulomb': drop that term"
            raise UnusableValue(
                f"friction terms named twice: {', '.join(sorted(repeated))}", advice=advice
            )
        if {"fc", "fcp"} <= set(stems) or {"off", "fcp"} <= set(stems):
            raise UnusableValue(
                "asymmetric Coulomb friction (fcp, fcn) already contains fc and off",
                advice="drop the terms 'coulomb' and 'offset'",
            )
        if {"fv", "fvp"} <= set(stems):
            raise UnusableValue(
                "asymmetric viscous friction (fvp, fvn) already contains fv",
                advice="drop the term 'viscous'",
            )

        values: dict[str, float] = {}
        for shape in (s for term in self.terms for s in term.shapes):
            if values.setdefault(shape.name, shape.value) != shape.value:
                raise UnusableValue(
                    f"{shape.name} is {values[shape.name]:g} in one term and {shape.value:g} in "
                    "another",
                    advice="terms of a law share it, give them the same value",
                )

    def __str__(self) -> str:
        """The law as a formula in dq, ``fv dq + fc (2/π) atan(γ dq) + off``."""
        return " + ".join(map(str, self.terms)).replace("+ -", "- ") or "none"

    @property
    def slopes(self) -> tuple[float, ...]:
        """The γ of its smoothed signs [s/rad or s/m], each value once; none for a hard sign."""
        smoothed = (t for t in self.terms if t.has_sign and t.smoothing != "sign")
        return tuple(dict.fromkeys(t.encoded()[2][0] for t in smoothed))

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """Its constants of shape, each once, in the order of its terms."""
        return tuple({s.name: s for term in self.terms for s in term.shapes}.values())

    def with_shapes(self, values: Mapping[str, float]) -> FrictionLaw:
        """The same law with other constants of shape; ``gamma`` is that of all smoothed signs.

        Args:
            values: by the names of ``shapes``, or ``gamma``.

        Raises:
            UnusableValue: names an unknown constant, or one outside its range.
        """
        known = [s.name for s in self.shapes] + ["gamma"] * any(t.has_sign for t in self.terms)
        for name in values:
            require_known(name, known, f"the law {self} has no constant {name!r}", UnusableValue)
        return FrictionLaw(tuple(t.with_shapes(dict(values)) for t in self.terms))

    def with_default_gamma(self, gamma: float) -> FrictionLaw:
        """The same law with every γ that was left open set to ``gamma`` [s/rad or s/m]."""
        return FrictionLaw(
            tuple(t if t.gamma is not None else replace(t, gamma=gamma) for t in self.terms)
        )


#: Friction of a joint whose description names no law.
DEFAULT_FRICTION = FrictionLaw((viscous(), coulomb(), offset()))


def law_toml(law: FrictionLaw) -> str:
    """The law as a TOML list, ``[{term = "viscous"}, {term = "stribeck", speed = 0.1}]``."""
    return toml_value(list(_tables(law)))


def _tables(law: FrictionLaw) -> Iterator[dict[str, Any]]:
    """One table for each term that begins one; the terms that follow from it have none."""
    for term in law.terms:
        if term.column.name in OWN_COLUMNS:
            raise UnusableValue(
                f"the term {term.column.name!r} is a function of a program, which no file names",
                advice="keep the law in Python, or make a distribution that declares the term",
            )
        for kind in TERM_KINDS.usable().values():
            if kind.begins_with(term) and (keys := _keys(kind, law, term)) is not None:
                yield {"term": kind.name} | {key: _rounded(x) for key, x in keys.items()}


def _keys(kind: TermKind, law: FrictionLaw, term: FrictionTerm) -> dict[str, Any] | None:
    """Keys of a table with their values; None for a term that another one's table holds."""
    keys: dict[str, Any] = {c.key: x for c, x in zip(kind.constants, term.values, strict=False)}
    if kind.written is not None:
        written = kind.written(term, law.terms)
        if written is None:
            return None
        keys |= written
    return keys | ({"smoothing": term.smoothing, "gamma": term.gamma} if term.has_sign else {})


def _rounded(value: Any) -> Any:
    if isinstance(value, list):
        return [_rounded(x) for x in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value
