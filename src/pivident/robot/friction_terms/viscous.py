"""Viscous friction fv dq, the same for both directions or not."""

from __future__ import annotations

from pivident.robot.friction_column import FrictionColumn
from pivident.robot.friction_term import Candidate, FrictionTerm, TermKind

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


VISCOUS_POSITIVE = FrictionColumn(
    name="viscous_positive",
    code=7,
    expression="max(dq, 0)",
    text="{stem} max(dq, 0)",
    speed_power=1.0,
    dissipative=True,
    kinked=True,
    functions=lambda sign: {("dq",): 0.5, ("|dq|",): 0.5},
    element="damping",
    opposite="viscous_negative",
)
VISCOUS_NEGATIVE = FrictionColumn(
    name="viscous_negative",
    code=8,
    expression="min(dq, 0)",
    text="{stem} min(dq, 0)",
    speed_power=1.0,
    dissipative=True,
    kinked=True,
    functions=lambda sign: {("dq",): 0.5, ("|dq|",): -0.5},
    element="damping",
    opposite="viscous_positive",
    is_backwards=True,
)


def asymmetric_viscous() -> tuple[FrictionTerm, FrictionTerm]:
    """Friction fvp max(dq, 0) + fvn min(dq, 0): one slope for each direction."""
    return FrictionTerm("fvp", VISCOUS_POSITIVE), FrictionTerm("fvn", VISCOUS_NEGATIVE)


SLOPES_TERM = TermKind(
    "asymmetric_viscous",
    asymmetric_viscous,
    (VISCOUS_POSITIVE, VISCOUS_NEGATIVE),
    candidates=(
        Candidate(
            "asymmetric viscous",
            lambda travel, fastest, smoothing, gamma: asymmetric_viscous(),
            instead_of=("viscous",),
        ),
    ),
    causes={"other friction in one direction": "abs(dq)/fastest"},
)
