"""A linear spring ks q in a joint."""

from __future__ import annotations

from pivident.robot.friction_column import FrictionColumn, TermKind
from pivident.robot.friction_term import FrictionTerm

SPRING = FrictionColumn(
    name="spring",
    code=11,
    expression="q",
    text="{stem} q",
    grows_with="position",
    carries_load=True,
    functions=lambda sign: {("q",): 1.0},
    element="spring",
)


def spring() -> FrictionTerm:
    """Torque ks q of a linear spring [N m/rad] or [N/m]; its rest position is in the offset."""
    return FrictionTerm("ks", SPRING)


SPRING_TERM = TermKind("spring", spring, (SPRING,))
