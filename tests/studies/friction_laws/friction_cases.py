"""Friction laws with known truth on the axis of ``friction_axis``."""

from dataclasses import dataclass

from pivident.robot.friction import (
    FrictionLaw,
    asymmetric_coulomb,
    coulomb,
    counterbalance,
    dahl,
    load_dependent,
    lugre,
    maxwell_slip,
    offset,
    power_viscous,
    ripple,
    stribeck,
    viscous,
)
from tests.studies.friction_laws.friction_axis import INERTIA, Truth


@dataclass(frozen=True)
class Case:
    """One law.

    Attributes:
        truth: friction that is simulated.
        law: the same law with other constants of shape, from which the search starts.
        parameters: true values by parameter name.
        shapes: true constants by name.
    """

    truth: Truth
    law: FrictionLaw
    parameters: dict[str, float]
    shapes: dict[str, float]


_RIGID = {"zz1": INERTIA, "fv1": 2.5, "off1": 0.3}

CASES = {
    "Coulomb": Case(
        Truth(fcp=4, fcn=4),
        FrictionLaw((viscous(), coulomb(), offset())),
        _RIGID | {"fc1": 4},
        {},
    ),
    "asymmetric Coulomb": Case(
        Truth(fcp=5, fcn=3, off=0),
        FrictionLaw((viscous(), *asymmetric_coulomb())),
        {"zz1": INERTIA, "fv1": 2.5, "fcp1": 5, "fcn1": 3},
        {},
    ),
    "Stribeck": Case(
        Truth(fcp=4, fcn=4, fs=2, stribeck_speed=0.1),
        FrictionLaw((viscous(), coulomb(), stribeck(0.5), offset())),
        _RIGID | {"fc1": 4, "fs1": 2},
        {"stribeck_speed": 0.1},
    ),
    "power": Case(
        Truth(fcp=4, fcn=4, fv=0, fvx=3, viscous_exponent=0.6),
        FrictionLaw((coulomb(), power_viscous(1.5), offset())),
        {"zz1": INERTIA, "off1": 0.3, "fc1": 4, "fvx1": 3},
        {"viscous_exponent": 0.6},
    ),
    "load": Case(
        Truth(fcp=4, fcn=4, fl=0.15),
        FrictionLaw((viscous(), coulomb(), load_dependent(), offset())),
        _RIGID | {"fc1": 4, "fl1": 0.15},
        {},
    ),
    "ripple": Case(
        Truth(fcp=4, fcn=4, rc=0.5, rs=0.3, order=20),
        FrictionLaw((viscous(), coulomb(), offset(), *ripple(19, "a"))),
        _RIGID | {"fc1": 4, "rca1": 0.5, "rsa1": 0.3},
        {"ordera": 20},
    ),
    "counterbalance": Case(
        Truth(fcp=4, fcn=4, cbf=6, strut_ratio=0.6, strut_angle=0.3),
        FrictionLaw((viscous(), coulomb(), offset(), counterbalance(0.3, 0.0)[0])),
        _RIGID | {"fc1": 4, "cbf1": 6},
        {"strut_ratio": 0.6, "strut_angle": 0.3},
    ),
    "Dahl": Case(
        Truth(fc_state=4, presliding_distance=0.01),
        FrictionLaw((viscous(), dahl(0.1), offset())),
        _RIGID | {"fc1": 4},
        {"presliding_distance": 0.01},
    ),
    "LuGre": Case(
        Truth(fc_state=4, presliding_distance=0.01, stribeck_excess=0.5, stribeck_speed=0.1, fd=10),
        FrictionLaw((viscous(), *lugre(0.05, 0.2, 0.3), offset())),
        _RIGID | {"fc1": 4, "fd1": 10},
        {"presliding_distance": 0.01, "stribeck_excess": 0.5, "stribeck_speed": 0.1},
    ),
    "Maxwell slip": Case(
        Truth(fm=(2.0, 1.5, 1.0), distances=(0.003, 0.01, 0.04)),
        FrictionLaw((viscous(), *maxwell_slip([0.003, 0.01, 0.04]), offset())),
        _RIGID | {"fma1": 2, "fmb1": 1.5, "fmc1": 1},
        {},
    ),
}
