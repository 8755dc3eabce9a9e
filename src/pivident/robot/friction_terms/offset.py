"""A constant torque off."""

from __future__ import annotations

from pivident.robot.friction_column import FrictionColumn
from pivident.robot.friction_term import FrictionTerm, TermKind

OFFSET = FrictionColumn(
    name="offset",
    code=2,
    expression="1",
    text="{stem}",
    functions=lambda sign: {("1",): 1.0},
    element="offset",
    words="constant torque",
)


def offset() -> FrictionTerm:
    """Constant torque off in [N m] or [N]."""
    return FrictionTerm("off", OFFSET)


OFFSET_TERM = TermKind("offset", offset, (OFFSET,), causes={"constant torque": "1"})
