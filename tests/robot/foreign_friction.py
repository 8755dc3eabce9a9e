"""Friction terms of another distribution, as its one module; used by test_foreign_friction."""

from pivident.robot.friction_column import Constant, FrictionColumn, Key, Smoothing
from pivident.robot.friction_term import Candidate, FrictionTerm, TermKind

BUMP = FrictionColumn(
    name="bump",
    expression="s/(1 + (dq/speed)**2)",
    text="{stem} {s}/(1 + (dq/{speed})²)",
    constants=("speed",),
    compiled="foreign_compiled:bump",
    never_negative=True,
)
WELL = FrictionColumn(
    name="well",
    expression="sin(q - angle)**3",
    text="{stem} sin³(q - {angle})",
    constants=("angle",),
    compiled="foreign_compiled:well",
)
SPEED = Constant("speed", "its speed", name="bump_speed", unit="speed", low=1e-6)
ANGLE = Constant("angle", "its angle", "number", name="well_angle", unit="angle", low=-9, high=9)


def bump(speed: float, smoothing: Smoothing = "atan", gamma: float | None = None) -> FrictionTerm:
    """Friction fb s(dq)/(1 + (dq/v)²)."""
    return FrictionTerm("fb", BUMP, smoothing, gamma, (SPEED.at(speed),))


def well(angle: float, name: str = "") -> FrictionTerm:
    """Torque w sin³(q - φ)."""
    return FrictionTerm(f"w{name}", WELL, shapes=(ANGLE.at(angle),))


BUMP_TERM = TermKind(
    "bump",
    bump,
    (BUMP,),
    keys=(SPEED,),
    candidates=(
        Candidate("bump", lambda travel, fastest, smoothing, gamma: (bump(0.1 * fastest),)),
    ),
    causes={"a bump": "s/(1 + (dq/(0.1*fastest))**2)"},
)
WELL_TERM = TermKind("well", well, (WELL,), keys=(ANGLE, Key("name", values="name")))
