"""Stribeck friction fs s(dq) exp(-|dq/v_s|^δ)."""

from __future__ import annotations

from pivident.robot.friction_column import Constant, FrictionColumn, Shape, Smoothing
from pivident.robot.friction_term import Candidate, FrictionTerm, TermKind

STRIBECK = FrictionColumn(
    name="stribeck",
    code=5,
    expression="s*exp(-power(abs(dq/speed), exponent))",
    text="{stem} {s} exp(-|dq/{speed}|^{exponent})",
    constants=("speed", "exponent"),
    never_negative=True,
)
SPEED = Constant(
    "speed", "its speed in rad/s or m/s", name="stribeck_speed", unit="speed", low=1e-9
)
EXPONENT = Constant(
    "exponent",
    "its exponent of the speed",
    name="stribeck_exponent",
    low=0.1,
    high=10.0,
    free=False,
)
EXCESS = Constant(
    "excess",
    "its excess, the static level over the Coulomb level less one",
    "not negative",
    name="stribeck_excess",
    high=10.0,
)


def stribeck(
    speed: float,
    exponent: float = 2.0,
    smoothing: Smoothing = "atan",
    gamma: float | None = None,
) -> FrictionTerm:
    """Friction fs s(dq) exp(-|dq/v_s|^δ): excess of the break-away level over Coulomb friction.

    Args:
        speed: v_s, Stribeck speed [rad/s or m/s].
        exponent: δ.
        smoothing: of the sign s: ``"atan"``, ``"tanh"`` or ``"sign"``.
        gamma: slope γ of the smoothed sign [s/rad or s/m]; None: from the joint's rated speed.

    Returns:
        One term with the parameter fs [N m or N].
    """
    return FrictionTerm("fs", STRIBECK, smoothing, gamma, (SPEED.at(speed), EXPONENT.at(exponent)))


def weakening(excess: float, speed: float, exponent: float) -> tuple[Shape, Shape, Shape]:
    """Constants of the level g = 1 + ρ exp(-|dq/v_s|^δ) of friction with a state."""
    return EXCESS.at(excess), SPEED.at(speed), EXPONENT.at(exponent)


#: Stribeck speeds that are tried as causes of model error, as shares of the largest speed.
SPEEDS_TRIED = (0.01, 0.03, 0.1)

STRIBECK_TERM = TermKind(
    "stribeck",
    stribeck,
    (STRIBECK,),
    keys=(SPEED, EXPONENT),
    candidates=(
        Candidate(
            "Stribeck",
            lambda travel, fastest, smoothing, gamma: (
                stribeck(0.05 * fastest, 2.0, smoothing, gamma),
            ),
            unless=("stribeck", "stribeck_speed"),
            sign_of=("coulomb", "coulomb_positive"),
        ),
    ),
    causes={
        f"Stribeck peak below {share:g} of the largest speed": f"s*exp(-(dq/({share}*fastest))**2)"
        for share in SPEEDS_TRIED
    },
)
