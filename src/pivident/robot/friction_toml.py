"""A friction law as lines of an experiment or robot file, to be read in again."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pivident.robot.friction import FrictionLaw
from pivident.robot.friction_term import FrictionTerm
from pivident.robot.friction_terms import TERM_KINDS
from pivident.robot.term_kind import TermKind
from pivident.text.toml import toml_value


def law_toml(law: FrictionLaw) -> str:
    """The law as a TOML list, ``[{term = "viscous"}, {term = "stribeck", speed = 0.1}]``."""
    return toml_value(list(_tables(law)))


def _tables(law: FrictionLaw) -> Iterator[dict[str, Any]]:
    """One table for each term that begins one; the terms that follow from it have none."""
    for term in law.terms:
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
