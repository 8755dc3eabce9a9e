"""Viscous friction fv dq."""

from __future__ import annotations

from pivident.robot.friction_column import FrictionColumn, TermKind
from pivident.robot.friction_term import FrictionTerm

VISCOUS = FrictionColumn(
    name="viscous",
    code=0,
    expression="dq",
    text="{stem} dq",
    speed_power=1.0,
    dissipative=True,
    functions=lambda sign: {("dq",): 1.0},
    element="damping",
    words="viscous friction",
)


def viscous() -> FrictionTerm:
    """Friction fv dq, fv in [N m s/rad] or [N s/m]."""
    return FrictionTerm("fv", VISCOUS)


VISCOUS_TERM = TermKind("viscous", viscous, (VISCOUS,))
