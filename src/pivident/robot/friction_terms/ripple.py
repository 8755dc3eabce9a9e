"""Ripple A cos(n q) + B sin(n q): gear teeth, cogging."""

from __future__ import annotations

from dataclasses import replace

from pivident.robot.friction_column import NAME_MEANING, Constant, FrictionColumn, Key
from pivident.robot.friction_term import FrictionTerm, TermKind

COSINE = FrictionColumn(
    name="cosine",
    code=9,
    expression="cos(order*q)",
    text="{stem} cos({order} q)",
    constants=("order",),
    functions=lambda sign, order: {("cos", order): 1.0},
)
SINE = FrictionColumn(
    name="sine",
    code=10,
    expression="sin(order*q)",
    text="{stem} sin({order} q)",
    constants=("order",),
    functions=lambda sign, order: {("sin", order): 1.0},
)
ORDER = Constant(
    "order",
    "its order, periods per revolution (per 2π m of a prismatic joint)",
    name="order",
    unit="1/position",
    low=1e-6,
    high=1e6,
    free=False,
)


def ripple(order: float, name: str | None = None) -> tuple[FrictionTerm, FrictionTerm]:
    """Torque A cos(n q) + B sin(n q) that repeats with the position: gear teeth, cogging.

    Args:
        order: n, periods per 2π of joint position (per revolution); of a prismatic joint 2π
            times the periods per metre.
        name: what follows ``rc`` and ``rs`` in the parameters' names, such as ``a``; None: the
            order between underscores.

    Returns:
        Two terms with the parameters rc and rs [N m or N].
    """
    label = f"_{order:.6g}_" if name is None else name
    shape = (replace(ORDER, name=f"order{label}").at(order),)
    return (
        FrictionTerm(f"rc{label}", COSINE, shapes=shape),
        FrictionTerm(f"rs{label}", SINE, shapes=shape),
    )


RIPPLE_TERM = TermKind(
    "ripple",
    ripple,
    (COSINE, SINE),
    keys=(ORDER, Key("name", NAME_MEANING, "name")),
    written=lambda term, law: {"name": term.stem.removeprefix("rc")},
)
