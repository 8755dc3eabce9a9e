"""Coulomb friction fc s(dq)."""

from __future__ import annotations

from pivident.robot.friction_column import FrictionColumn, Smoothing, TermKind
from pivident.robot.friction_term import FrictionTerm

COULOMB = FrictionColumn(
    name="coulomb",
    code=1,
    expression="s",
    text="{stem} {s}",
    dissipative=True,
    functions=lambda sign: {sign: 1.0},
    element="dry friction",
    words="Coulomb friction",
)


def coulomb(smoothing: Smoothing = "atan", gamma: float | None = None) -> FrictionTerm:
    """Friction fc s(dq), fc in [N m] or [N]; γ = 150 s/rad in the paper.

    Args:
        smoothing: of the sign s: ``"atan"``, ``"tanh"`` or ``"sign"``.
        gamma: slope γ of the smoothed sign [s/rad or s/m]; None: from the joint's rated speed.

    Returns:
        One term with the parameter fc.
    """
    return FrictionTerm("fc", COULOMB, smoothing, gamma)


COULOMB_TERM = TermKind("coulomb", coulomb, (COULOMB,))
