"""A friction term as robot files name it: one table of the file, one column or more.

Keys of robot files and how a law is written into one follow from the declaration, the candidates of
``pivident laws``, and the causes of model error.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from pivident.robot.friction_column import Constant, FrictionColumn, Key, Smoothing
from pivident.robot.friction_term import FrictionTerm


@dataclass(frozen=True)
class Candidate:
    """A change of a law that ``pivident laws`` tries: terms that are added or take a place.

    Attributes:
        name: of the change.
        terms: the terms, from travel and largest speed of the joint, and the smoothing and γ of
            the sign that the law has.
        instead_of: columns that are replaced; the first one has to be there.
        unless: columns and constants with which it makes no sense.
        sign_of: columns whose sign is taken over.
    """

    name: str
    terms: Callable[[float, float, Smoothing, float | None], tuple[FrictionTerm, ...]]
    instead_of: tuple[str, ...] = ()
    unless: tuple[str, ...] = ()
    sign_of: tuple[str, ...] = ("coulomb",)


@dataclass(frozen=True)
class TermKind:
    """A friction term as the table of a robot file names it.

    Attributes:
        name: ``term = "stribeck"``.
        make: constructor of the terms; its arguments are the keys, needed where they have no
            default. They are called as the constants are in expressions.
        columns: the columns of its terms; a law's term with the first one stands for the table.
        keys: what the keys mean; the constants of the first column among them, in their order.
        written: keys and values for the robot file that no constant holds, from the term with the
            first column and all terms of the law, None for keys that are left out; None: the table
            of another term holds it.
        candidates: changes of laws that ``pivident laws`` tries.
        causes: shapes of model error, expressions by name: of ``dq``, the sign ``s``, ``load``, and
            of the joint's ``fastest`` and ``heaviest``.
    """

    name: str
    make: Callable[..., FrictionTerm | tuple[FrictionTerm, ...]]
    columns: tuple[FrictionColumn, ...]
    keys: tuple[Key, ...] = ()
    written: Callable[[FrictionTerm, Sequence[FrictionTerm]], Mapping[str, Any] | None] | None = (
        None
    )
    candidates: tuple[Candidate, ...] = ()
    causes: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def arguments(self) -> tuple[frozenset[str], frozenset[str]]:
        """Keys that a table needs, and those that it may have."""
        found = inspect.signature(self.make).parameters.values()
        needed = frozenset(p.name for p in found if p.default is p.empty)
        return needed, frozenset(p.name for p in found) - needed

    @property
    def constants(self) -> tuple[Constant, ...]:
        """The constants among its keys."""
        return tuple(key for key in self.keys if isinstance(key, Constant))

    def begins_with(self, term: FrictionTerm) -> bool:
        """Whether a term of a law is the first one of a table of this kind."""
        count = len(self.constants)
        return term.column == self.columns[0] and count in (0, len(term.shapes))
