"""Viscous friction fv dq, the same for both directions or not, or with a power of the speed."""

from __future__ import annotations

from dataclasses import replace

from pivident.robot.friction_column import NAME_MEANING, Constant, FrictionColumn, Key, Smoothing
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


POWER = FrictionColumn(
    name="power",
    code=6,
    expression="s*power(abs(dq), exponent)",
    text="{stem} {s} |dq|^{exponent}",
    constants=("exponent",),
    sharp=lambda exponent: exponent >= 1.0,
    speed_power="exponent",
    never_negative=True,
    kinked=True,
)
EXPONENT = Constant(
    "exponent", "its exponent of the speed", name="viscous_exponent", low=0.02, high=5.0
)


def power_viscous(
    exponent: float,
    stem: str = "fvx",
    smoothing: Smoothing = "atan",
    gamma: float | None = None,
    free: bool = True,
) -> FrictionTerm:
    """Friction fvx sign(dq) |dq|^p [N m (s/rad)^p]: polynomials (2, 3), harmonic drives (1/3).

    Below p = 1 the slope at rest would be infinite, and the smoothed sign is taken.

    Args:
        exponent: p.
        stem: of the parameter's name, where a law has several such terms.
        smoothing: of the sign, for p < 1.
        gamma: slope of the smoothed sign [s/rad or s/m].
        free: whether p is identified where shapes are.

    Returns:
        One term with the parameter fvx.
    """
    name = EXPONENT.name if stem == "fvx" else f"{stem}_exponent"
    shape = replace(EXPONENT, name=name, free=free).at(exponent)
    return FrictionTerm(stem, POWER, smoothing, gamma, (shape,))


def _named_power(
    exponent: float, name: str = "", smoothing: Smoothing = "atan", gamma: float | None = None
) -> FrictionTerm:
    """The term of a robot file, where a name sets several of one law apart."""
    return power_viscous(exponent, f"fvx{name}", smoothing, gamma)


POWER_TERM = TermKind(
    "power",
    _named_power,
    (POWER,),
    keys=(EXPONENT, Key("name", NAME_MEANING, "name")),
    written=lambda term, law: {"name": term.stem.removeprefix("fvx") or None},
    candidates=(
        Candidate(
            "power",
            lambda travel, fastest, smoothing, gamma: (power_viscous(2.0),),
            unless=("power",),
        ),
        Candidate(
            "power for viscous",
            lambda travel, fastest, smoothing, gamma: (power_viscous(2.0),),
            instead_of=("viscous",),
            unless=("power",),
        ),
    ),
    causes={
        "square of the speed": "dq*abs(dq)/fastest**2",
        "root of the speed": "s*sqrt(abs(dq)/fastest)",
    },
)
