"""Friction fl |load| s(dq) that grows with the torque that the joint carries."""

from __future__ import annotations

from pivident.robot.friction_column import FrictionColumn, Smoothing
from pivident.robot.friction_term import Candidate, FrictionTerm, TermKind

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
