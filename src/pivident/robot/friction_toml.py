"""A friction law as lines of an experiment or robot file, to be read in again."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pivident.robot.friction import FrictionLaw
from pivident.robot.friction_column import TermKind
from pivident.robot.friction_term import FrictionTerm
from pivident.robot.friction_terms import TERM_KINDS


def law_toml(law: FrictionLaw) -> str:
    """The law as a TOML list, ``[{term = "viscous"}, {term = "stribeck", speed = 0.1}]``."""
    return f"[{', '.join(_tables(law))}]"


def _tables(law: FrictionLaw) -> Iterator[str]:
    """One table for each term that begins one; the terms that follow from it have none."""
    for term in law.terms:
        for kind in TERM_KINDS.usable().values():
            if kind.begins_with(term) and (keys := _keys(kind, law, term)) is not None:
                pairs = {"term": kind.name} | keys
                yield f"{{{', '.join(f'{key} = {_toml(x)}' for key, x in pairs.items())}}}"


def _keys(kind: TermKind, law: FrictionLaw, term: FrictionTerm) -> dict[str, Any] | None:
    """Keys of a table with their values; None for a term that another one's table holds."""
    keys: dict[str, Any] = {c.key: x for c, x in zip(kind.constants, term.values, strict=False)}
    if kind.written is not None:
        written = kind.written(term, law.terms)
        if written is None:
            return None
        keys |= {key: value for key, value in written.items() if value != ""}
    if term.has_sign:
        keys |= {"smoothing": term.smoothing}
        keys |= {} if term.gamma is None else {"gamma": term.gamma}
    return keys


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    return f"{value:.6g}" if float(f"{value:.6g}") != int(value) else f"{value:.1f}"
