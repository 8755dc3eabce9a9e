"""Presliding friction with a state, by Dahl and LuGre, and generalised Maxwell slip.

Kernels in ``dynamics.friction_kernels`` and, of elements that stick and slip, in ``dynamics``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pivident.foundation.errors import UnusableValue
from pivident.robot.friction_column import Constant, FrictionColumn, Key
from pivident.robot.friction_term import Candidate, FrictionTerm, TermKind
from pivident.robot.friction_terms.stribeck import EXCESS, EXPONENT, SPEED, weakening

PRESLIDING = FrictionColumn(
    name="presliding",
    code=15,
    expression="",
    text="{stem} z({shapes})",
    constants=("distance", "excess", "speed", "exponent"),
    fewest=1,
    dissipative=True,
    memory=True,
    element="dry friction",
)
PRESLIDING_RATE = FrictionColumn(
    name="presliding_rate",
    code=16,
    expression="",
    text="{stem} {distance} dz/dt",
    constants=("distance", "excess", "speed", "exponent"),
    speed_power=1.0,
    dissipative=True,
    memory=True,
)
DISTANCE = Constant(
    "distance",
    "its presliding distance in rad or m",
    name="presliding_distance",
    unit="position",
    low=1e-12,
    high=1e3,
)


def dahl(distance: float) -> FrictionTerm:
    """Dahl's presliding friction fc z with dz/dt = (dq - |dq| z)/d: Coulomb friction with a state.

    After a reversal it needs some times d of travel to come to its new level.

    Args:
        distance: d, presliding distance [rad or m]; stiffness at rest is fc/d.

    Returns:
        One term with the parameter fc [N m or N].
    """
    return FrictionTerm("fc", PRESLIDING, shapes=(DISTANCE.at(distance),))


def lugre(
    distance: float, excess: float, speed: float, exponent: float = 2.0, damped: bool = True
) -> tuple[FrictionTerm, ...]:
    """LuGre friction (Canudas de Wit et al. 1995): presliding with a Stribeck curve.

        dz/dt = (dq - |dq| z/g)/d,    g = 1 + ρ exp(-|dq/v_s|^δ),    friction fc z + fd d dz/dt

    with distance d [rad or m], excess ρ, speed v_s and exponent δ; fd is a term where it is damped.
    In the usual symbols σ0 = fc/d, σ1 = fd, and g fc is the curve from static to Coulomb level.

    Args:
        distance: d [rad or m].
        excess: ρ, static level over Coulomb level less one.
        speed: v_s [rad/s or m/s].
        exponent: δ.
        damped: whether the micro-damping fd is a term.

    Returns:
        Terms with the parameters fc and, if damped, fd.
    """
    shapes = (DISTANCE.at(distance), *weakening(excess, speed, exponent))
    terms = (FrictionTerm("fc", PRESLIDING, shapes=shapes),)
    return (*terms, FrictionTerm("fd", PRESLIDING_RATE, shapes=shapes)) if damped else terms


DAHL_TERM = TermKind(
    "dahl",
    dahl,
    (PRESLIDING,),
    keys=(DISTANCE,),
    candidates=(
        Candidate(
            "Dahl",
            lambda travel, fastest, smoothing, gamma: (dahl(1e-3 * travel),),
            instead_of=("coulomb", "stribeck"),
        ),
    ),
)
LUGRE_TERM = TermKind(
    "lugre",
    lugre,
    (PRESLIDING, PRESLIDING_RATE),
    keys=(
        DISTANCE,
        EXCESS,
        SPEED,
        EXPONENT,
        Key("damped", "whether presliding is damped, with a parameter fd", "flag"),
    ),
    written=lambda term, law: {"damped": any(t.column is PRESLIDING_RATE for t in law)},
    candidates=(
        Candidate(
            "LuGre",
            lambda travel, fastest, smoothing, gamma: lugre(1e-3 * travel, 0.3, 0.05 * fastest),
            instead_of=("coulomb", "stribeck"),
        ),
    ),
)


MAXWELL = FrictionColumn(
    name="maxwell",
    code=17,
    expression="",
    text="{stem} slip({shapes})",
    constants=("distance", "excess", "speed", "exponent"),
    fewest=1,
    dissipative=True,
    memory=True,
    element="dry friction",
)
SLIP_DISTANCE = Constant(
    "distance", name="slip_distance", unit="position", low=1e-12, high=1e3, free=False
)


def maxwell_slip(
    distances: Sequence[float],
    excess: float = 0.0,
    speed: float = 1.0,
    exponent: float = 2.0,
) -> tuple[FrictionTerm, ...]:
    """Generalised Maxwell slip: Σ fm_i z_i of elements that stick for d_i and then slip.

        z_i ← min(max(z_i + Δq/d_i, -g), g),    g = 1 + ρ exp(-|dq/v_s|^δ)

    Its hysteresis remembers every reversal that has not been passed. An element that slips is at
    its level at once (the attraction of Al-Bender et al. 2005 in the limit of no delay).

    Args:
        distances: d_i [rad or m], a grid; not identified unless asked for.
        excess: ρ.
        speed: v_s [rad/s or m/s].
        exponent: δ.

    Returns:
        One term with a parameter fm_i [N m or N] for each distance.

    Raises:
        UnusableValue: two elements are alike, or a constant is outside its range.
    """
    if len(set(distances)) < len(distances):
        raise UnusableValue(f"slip distances must differ from each other, not {list(distances)}")
    curve = weakening(excess, speed, exponent) if excess != 0.0 else ()
    return tuple(
        FrictionTerm(
            f"fm{chr(ord('a') + i)}",
            MAXWELL,
            shapes=(replace(SLIP_DISTANCE, name=f"slip_distance{i + 1}").at(d), *curve),
        )
        for i, d in enumerate(distances)
    )


def _written(term: FrictionTerm, law: Sequence[FrictionTerm]) -> dict[str, Any] | None:
    """Keys of the one table that all elements of a law share; None for those but the first."""
    elements = [t for t in law if t.column == MAXWELL]
    if term is not elements[0]:
        return None
    curve = dict(zip(("excess", "speed", "exponent"), term.values[1:], strict=False))
    return {"distances": [t.values[0] for t in elements], **curve}


MAXWELL_TERM = TermKind(
    "maxwell_slip",
    maxwell_slip,
    (MAXWELL,),
    keys=(
        Key(
            "distances",
            "its slip distances in rad or m, such as [1e-4, 1e-3]",
            "positive list",
        ),
        *(Key(one.key, one.meaning, one.values) for one in (EXCESS, SPEED, EXPONENT)),
    ),
    written=_written,
    candidates=(
        Candidate(
            "Maxwell slip",
            lambda travel, fastest, smoothing, gamma: maxwell_slip(
                [float(d) for d in np.geomspace(1e-3, 1e-1, 3) * travel]
            ),
            instead_of=("coulomb", "stribeck"),
        ),
    ),
)
