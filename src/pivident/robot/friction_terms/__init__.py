"""Friction terms, one module for each: the built-in ones and those of other distributions.

Another distribution declares a term as the modules here do, lets ``python -m
pivident.dynamics.generate_friction my_package.my_term:MY_TERM`` write the module of its compiled
functions, and names the term in its entry points:

    [project.entry-points."pivident.friction"]
    my_term = "my_package.my_term:MY_TERM"
"""

from __future__ import annotations

import copyreg
from functools import cache

from pivident.foundation.errors import UnusableValue
from pivident.foundation.registry import Registry
from pivident.foundation.text.plain_values import BY_NAME
from pivident.robot.friction_column import FrictionColumn
from pivident.robot.friction_term import TermKind
from pivident.robot.naming import nearest

#: Terms by the name that robot files give them.
TERM_KINDS: Registry[TermKind] = Registry(
    "pivident.friction",
    TermKind,
    {
        "viscous": "pivident.robot.friction_terms.viscous:VISCOUS_TERM",
        "coulomb": "pivident.robot.friction_terms.coulomb:COULOMB_TERM",
        "offset": "pivident.robot.friction_terms.offset:OFFSET_TERM",
        "asymmetric": "pivident.robot.friction_terms.coulomb:ASYMMETRIC_TERM",
        "stribeck": "pivident.robot.friction_terms.stribeck:STRIBECK_TERM",
        "power": "pivident.robot.friction_terms.viscous:POWER_TERM",
        "asymmetric_viscous": "pivident.robot.friction_terms.viscous:SLOPES_TERM",
        "load": "pivident.robot.friction_terms.coulomb:LOAD_TERM",
        "ripple": "pivident.robot.friction_terms.position:RIPPLE_TERM",
        "spring": "pivident.robot.friction_terms.position:SPRING_TERM",
        "counterbalance": "pivident.robot.friction_terms.position:STRUT_TERM",
        "dahl": "pivident.robot.friction_terms.presliding:DAHL_TERM",
        "lugre": "pivident.robot.friction_terms.presliding:LUGRE_TERM",
        "maxwell_slip": "pivident.robot.friction_terms.presliding:MAXWELL_TERM",
    },
)


#: Columns that a program has declared for itself, by name; see ``dynamics.own_friction``.
OWN_COLUMNS: dict[str, FrictionColumn] = {}


@cache
def declared_columns() -> dict[str, FrictionColumn]:
    """Columns of pivident and of other distributions by name."""
    kinds = TERM_KINDS.usable().values()
    return {column.name: column for kind in kinds for column in kind.columns}


def friction_columns() -> dict[str, FrictionColumn]:
    """All columns of friction by name."""
    return declared_columns() | OWN_COLUMNS


def column_named(name: str) -> FrictionColumn:
    """The column of friction of that name.

    Raises:
        UnusableValue: there is none; names the nearest ones.
    """
    known = friction_columns()
    if name not in known:
        own = f"if it is a function of your own, declare it first: own_friction({name!r}, …)"
        raise UnusableValue("there is no such friction", advice=f"{nearest(name, known)}; {own}")
    return known[name]


# A column is the same object wherever it comes from, another process or a file.
copyreg.pickle(FrictionColumn, lambda column: (column_named, (column.name,)))
BY_NAME[FrictionColumn] = column_named
