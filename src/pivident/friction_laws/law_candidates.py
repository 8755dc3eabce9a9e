"""Candidate friction laws of a joint: changes of its present law.

A change adds a term or replaces one; it is skipped for a law that does not allow it (Dahl friction
has no Coulomb term to replace). Changes are applied one after the other, so a short list gives many
laws.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pivident.friction_laws.shape_constants import GAMMA
from pivident.robot.friction import (
    FrictionColumn,
    FrictionLaw,
    FrictionTerm,
    Smoothing,
    asymmetric_coulomb,
    asymmetric_viscous,
    dahl,
    load_dependent,
    lugre,
    maxwell_slip,
    power_viscous,
    stribeck,
)

#: The change to the sign itself.
SHARP_SIGN = "sharp sign"

#: Changes after which the slope of the smoothed signs is one of the unknowns.
FREE_STEEPNESS = ("free steepness", "other smoothing, free steepness")

#: Changes that add no term.
STEEPNESS = (SHARP_SIGN, *FREE_STEEPNESS)

#: A change of a law; None where the law does not allow it.
Change = Callable[[FrictionLaw], FrictionLaw | None]


@dataclass(frozen=True)
class Reach:
    """Travel and largest speed of a joint in the records."""

    travel: float  # between its ends [rad or m]
    fastest: float  # largest speed [rad/s or m/s]


#: Changes to friction that closed loops do not handle: of the load, and with a memory.
LOAD_AND_MEMORY = ("load", "Dahl", "LuGre", "Maxwell slip")


def default_changes(reach: Reach) -> dict[str, Change]:
    """The usual changes, with initial shape constants."""
    dry = (FrictionColumn.COULOMB,)
    speed, distance = 0.05 * reach.fastest, 1e-3 * reach.travel
    slips = [float(d) for d in np.geomspace(1e-3, 1e-1, 3) * reach.travel]

    def asymmetric(law: FrictionLaw) -> FrictionLaw | None:
        old = _term(law, FrictionColumn.COULOMB)
        # with an offset the law already has two levels: fc s + off
        if old is None or _has(law, FrictionColumn.OFFSET):
            return None
        return _replaced(law, dry, asymmetric_coulomb(old.smoothing, old.gamma))

    def with_stribeck(law: FrictionLaw) -> FrictionLaw | None:
        if _has(law, FrictionColumn.STRIBECK) or _excess(law):
            return None
        old = _term(law, FrictionColumn.COULOMB) or _term(law, FrictionColumn.COULOMB_POSITIVE)
        smoothing, gamma = (old.smoothing, old.gamma) if old else ("atan", None)
        return _replaced(law, (), (stribeck(speed, 2.0, smoothing, gamma),))

    def with_power(law: FrictionLaw) -> FrictionLaw | None:
        if _has(law, FrictionColumn.POWER):
            return None
        return _replaced(law, (), (power_viscous(2.0),))

    def power_only(law: FrictionLaw) -> FrictionLaw | None:
        if not _has(law, FrictionColumn.VISCOUS) or _has(law, FrictionColumn.POWER):
            return None
        return _replaced(law, (FrictionColumn.VISCOUS,), (power_viscous(2.0),))

    def two_slopes(law: FrictionLaw) -> FrictionLaw | None:
        if not _has(law, FrictionColumn.VISCOUS):
            return None
        return _replaced(law, (FrictionColumn.VISCOUS,), asymmetric_viscous())

    def with_load(law: FrictionLaw) -> FrictionLaw | None:
        if _has(law, FrictionColumn.LOAD):
            return None
        old = _term(law, FrictionColumn.COULOMB)
        smoothing, gamma = (old.smoothing, old.gamma) if old else ("atan", None)
        return _replaced(law, (), (load_dependent(smoothing, gamma),))

    return {
        SHARP_SIGN: sharp_sign,
        FREE_STEEPNESS[0]: free_steepness,
        FREE_STEEPNESS[1]: other_smoothing,
        "asymmetric Coulomb": asymmetric,
        "Stribeck": with_stribeck,
        "power": with_power,
        "power for viscous": power_only,
        "asymmetric viscous": two_slopes,
        "load": with_load,
        "Dahl": in_place_of_coulomb((dahl(distance),)),
        "LuGre": in_place_of_coulomb(lugre(distance, 0.3, speed)),
        "Maxwell slip": in_place_of_coulomb(maxwell_slip(slips)),
    }


def sharp_sign(law: FrictionLaw) -> FrictionLaw | None:
    """The law with the sign itself in place of smoothed ones; no unknown is added."""
    return _smoothed(law, "sign")


def free_steepness(law: FrictionLaw) -> FrictionLaw | None:
    """The law with its smoothing of the sign, or the arctangent, whose slope is to be found."""
    smoothing = _smoothing(law)
    if smoothing is None:
        return None
    return _smoothed(law, "atan") if smoothing == "sign" else law


def other_smoothing(law: FrictionLaw) -> FrictionLaw | None:
    """The law with the other smoothing of the sign, whose slope is to be found."""
    return _smoothed(law, "atan" if _smoothing(law) == "tanh" else "tanh")


def free_constants(name: str, law: FrictionLaw) -> tuple[str, ...]:
    """Constants that are to be found after a change of that name."""
    own = tuple(s.name for s in law.shapes if s.free)
    return (*own, GAMMA) if name in FREE_STEEPNESS else own


def adding(terms: tuple[FrictionTerm, ...]) -> Change:
    """The change that adds given terms, a ripple of a known order for example.

    Args:
        terms: friction terms, for example those of `pivident.robot.ripple`.

    Returns:
        A function from a law to the law with the terms, or to None where it has one already.
    """
    stems = {t.stem for t in terms}

    def change(law: FrictionLaw) -> FrictionLaw | None:
        if stems & {t.stem for t in law.terms}:
            return None
        return _replaced(law, (), terms)

    return change


def in_place_of_coulomb(terms: tuple[FrictionTerm, ...]) -> Change:
    """The change that replaces Coulomb and Stribeck friction by terms with memory."""

    def change(law: FrictionLaw) -> FrictionLaw | None:
        if not _has(law, FrictionColumn.COULOMB):
            return None
        return _replaced(law, (FrictionColumn.COULOMB, FrictionColumn.STRIBECK), terms)

    return change


def changed(
    law: FrictionLaw, changes: Mapping[str, Change], known: set[frozenset[str]]
) -> dict[str, FrictionLaw]:
    """Laws one change away that were not tried yet; adds their terms to ``known``."""
    found = {}
    for name, change in changes.items():
        try:
            new = change(law)
        except ValueError:  # terms that exclude each other
            continue
        if new is None:
            continue
        key = key_of(new) | ({GAMMA} if name in FREE_STEEPNESS else set())
        if key in known:
            continue
        known.add(key)
        found[name] = new
    return found


def key_of(law: FrictionLaw) -> frozenset[str]:
    """Identity of a law: its terms, their signs, and whether presliding has a Stribeck curve."""
    # whether a power of the speed has a sign depends on the exponent, which is to be found
    signs = [t.has_sign and t.column is not FrictionColumn.POWER for t in law.terms]
    return frozenset(
        f"{t.stem}{t.column.name}{len(t.shapes)}{t.smoothing * sign}"
        for t, sign in zip(law.terms, signs, strict=True)
    )


def _smoothing(law: FrictionLaw) -> Smoothing | None:
    """How the first sign of the law is smoothed; None without one."""
    return next((t.smoothing for t in law.terms if t.has_sign), None)


def _smoothed(law: FrictionLaw, smoothing: Smoothing) -> FrictionLaw | None:
    """The law with other signs; None where it has none, or these already."""
    if all(t.smoothing == smoothing for t in law.terms if t.has_sign):
        return None
    signed = [t.has_sign or t.column is FrictionColumn.POWER for t in law.terms]
    return FrictionLaw(
        tuple(
            replace(t, smoothing=smoothing) if own else t
            for t, own in zip(law.terms, signed, strict=True)
        )
    )


def _term(law: FrictionLaw, column: FrictionColumn) -> FrictionTerm | None:
    return next((t for t in law.terms if t.column is column), None)


def _has(law: FrictionLaw, column: FrictionColumn) -> bool:
    return _term(law, column) is not None


def _excess(law: FrictionLaw) -> bool:
    return any(s.name == "stribeck_speed" for s in law.shapes)


def _replaced(
    law: FrictionLaw, without: tuple[FrictionColumn, ...], new: tuple[FrictionTerm, ...]
) -> FrictionLaw:
    return FrictionLaw((*(t for t in law.terms if t.column not in without), *new))
