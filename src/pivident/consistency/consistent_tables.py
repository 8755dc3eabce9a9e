"""Links of a consistent model as a table of bodies."""

from __future__ import annotations

from collections.abc import Sequence

from pivident.consistency.pseudo_inertia import LinkBody
from pivident.text.numbers import format_significant
from pivident.text.plain_table import plain_table


def link_table(bodies: Sequence[LinkBody], *further: tuple[str, str, Sequence[str]]) -> str:
    """Links as bodies: mass, centre of mass, principal moments."""
    columns: list[tuple[str, str, Sequence[str]]] = [
        ("link", "<", [b.name for b in bodies]),
        ("mass [kg]", ".", [format_significant(b.mass) for b in bodies]),
        *further,
    ]
    for k, title in enumerate(("centre x [mm]", "y", "z")):
        columns.append((title, ".", [millimetres(b.center_of_mass[k]) for b in bodies]))
    for k, title in enumerate(("I1 [kg m²]", "I2", "I3")):
        columns.append((title, ".", [format_significant(b.principal_moments[k]) for b in bodies]))
    return plain_table(columns)


def millimetres(metres: float) -> str:
    """A length in millimetres, to a tenth."""
    return f"{round(1e3 * metres, 1) + 0.0:.1f}"
