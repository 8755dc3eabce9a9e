"""Torques of the position: springs, struts that carry part of an arm's weight, and ripple.

Ripple A cos(n q) + B sin(n q): gear teeth, cogging.
"""

from __future__ import annotations

import math
from dataclasses import replace

from pivident.robot.friction_column import NAME_MEANING, Constant, FrictionColumn, Key
from pivident.robot.friction_term import FrictionTerm, TermKind

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


STRUT = FrictionColumn(
    name="strut",
    code=12,
    expression="sin(q - angle)/sqrt(1 + ratio**2 - 2*ratio*cos(q - angle))",
    text="{stem} sin(q - {angle})/√(1 + {ratio}² - 2·{ratio} cos(q - {angle}))",
    constants=("ratio", "angle"),
    carries_load=True,
    functions=lambda sign, ratio, angle: {("strut", ratio, angle): 1.0},
)
STRUT_STIFFNESS = FrictionColumn(
    name="strut_stiffness",
    code=13,
    expression="sin(q - angle)",
    text="{stem} sin(q - {angle})",
    constants=("ratio", "angle"),
    carries_load=True,
    functions=lambda sign, ratio, angle: {
        ("cos", 1.0): -math.sin(angle),
        ("sin", 1.0): math.cos(angle),
    },
)
RATIO = Constant(
    "ratio", "its ratio of lever arms, between 0 and 1", name="strut_ratio", low=0.01, high=0.99
)
ANGLE = Constant(
    "angle",
    "its angle in rad",
    "number",
    name="strut_angle",
    unit="angle",
    low=-4.0 * math.pi,
    high=4.0 * math.pi,
)


def counterbalance(ratio: float, angle: float) -> tuple[FrictionTerm, FrictionTerm]:
    """Torque of a strut or cylinder between two links, force F0 + k l along its length l.

    With b the distance of its fixed end from the joint's axis, a = ρ b that of the moving end
    (0 < ρ < 1: exchange the ends where ρ is larger), and q = φ [rad] where both are in line on the
    same side,

        l = b √(1 + ρ² - 2ρ cos(q - φ)),    torque = (F0 + k l) dl/dq
          = cbf sin(q - φ)/√(1 + ρ² - 2ρ cos(q - φ)) + cbk sin(q - φ)

    cbf = F0 a and cbk = k a b [N m]. A spring of no preload, cbk alone, cannot be separated from
    the weight of an arm; the first term can.

    Args:
        ratio: ρ = a/b, between 0 and 1 (exchange the ends where it is larger).
        angle: φ [rad].

    Returns:
        Two terms with the parameters cbf and cbk [N m].
    """
    shapes = (RATIO.at(ratio), ANGLE.at(angle))
    return (
        FrictionTerm("cbf", STRUT, shapes=shapes),
        FrictionTerm("cbk", STRUT_STIFFNESS, shapes=shapes),
    )


STRUT_TERM = TermKind(
    "counterbalance", counterbalance, (STRUT, STRUT_STIFFNESS), keys=(RATIO, ANGLE)
)


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
