"""Coulomb friction fc s(dq), the same for both directions or not, or growing with the load."""

from __future__ import annotations

from pivident.robot.friction_column import FrictionColumn, Smoothing
from pivident.robot.friction_term import Candidate, FrictionTerm, TermKind

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


COULOMB_POSITIVE = FrictionColumn(
    name="coulomb_positive",
    code=3,
    expression="0.5*(1 + s)",
    text="{stem} (1 + {s})/2",
    dissipative=True,
    functions=lambda sign: {("1",): 0.5, sign: 0.5},
    element="dry friction",
    opposite="coulomb_negative",
)
COULOMB_NEGATIVE = FrictionColumn(
    name="coulomb_negative",
    code=4,
    expression="-0.5*(1 - s)",
    text="-{stem} (1 - {s})/2",
    dissipative=True,
    functions=lambda sign: {("1",): -0.5, sign: 0.5},
    element="dry friction",
    opposite="coulomb_positive",
    is_backwards=True,
)


def asymmetric_coulomb(
    smoothing: Smoothing = "atan", gamma: float | None = None
) -> tuple[FrictionTerm, FrictionTerm]:
    """Friction fcp (1 + s)/2 - fcn (1 - s)/2: one Coulomb level for each direction.

    Args:
        smoothing: of the sign s: ``"atan"``, ``"tanh"`` or ``"sign"``.
        gamma: slope γ of the smoothed sign [s/rad or s/m]; None: from the joint's rated speed.

    Returns:
        Two terms with the parameters fcp and fcn [N m or N].
    """
    return (
        FrictionTerm("fcp", COULOMB_POSITIVE, smoothing, gamma),
        FrictionTerm("fcn", COULOMB_NEGATIVE, smoothing, gamma),
    )


ASYMMETRIC_TERM = TermKind(
    "asymmetric",
    asymmetric_coulomb,
    (COULOMB_POSITIVE, COULOMB_NEGATIVE),
    candidates=(
        # with an offset the law already has two levels: fc s + off
        Candidate(
            "asymmetric Coulomb",
            lambda travel, fastest, smoothing, gamma: asymmetric_coulomb(smoothing, gamma),
            instead_of=("coulomb",),
            unless=("offset",),
        ),
    ),
)


LOAD = FrictionColumn(
    name="load",
    code=14,
    expression="abs(load)*s",
    text="{stem} |load| {s}",
    grows_with="load",
    dissipative=True,
)


def load_dependent(smoothing: Smoothing = "atan", gamma: float | None = None) -> FrictionTerm:
    """Friction fl |load| s(dq): grows with the torque that the joint carries, fl without unit.

    The load is the torque of inertia, gravity and rotor, M ddq + h, without friction. It depends
    on the other parameters, so estimators take it from their last estimate.

    Args:
        smoothing: of the sign s: ``"atan"``, ``"tanh"`` or ``"sign"``.
        gamma: slope γ of the smoothed sign [s/rad or s/m]; None: from the joint's rated speed.

    Returns:
        One term with the parameter fl.
    """
    return FrictionTerm("fl", LOAD, smoothing, gamma)


LOAD_TERM = TermKind(
    "load",
    load_dependent,
    (LOAD,),
    candidates=(
        Candidate(
            "load",
            lambda travel, fastest, smoothing, gamma: (load_dependent(smoothing, gamma),),
            unless=("load",),
        ),
    ),
    causes={"friction by load": "s*abs(load)/heaviest"},
)
