"""Candidate friction laws of a joint: changes of its present law.

A change adds a term or replaces one; it is skipped for a law that does not allow it (Dahl friction
has no Coulomb term to replace). Changes are applied one after the other, so a short list gives many
laws.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from pivident.robot.friction import FrictionLaw
from pivident.robot.friction_column import Smoothing
from pivident.robot.friction_term import Candidate, FrictionTerm
from pivident.robot.friction_terms import TERM_KINDS
from pivident.studies.friction_laws.shape_constants import GAMMA

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


def load_and_memory() -> tuple[str, ...]:
    """Changes to friction that closed loops do not handle: of the load, and with a memory."""
    kinds = [k for k in TERM_KINDS.usable().values() if k.columns[0].needs_more_than_a_sample]
    return tuple(candidate.name for kind in kinds for candidate in kind.candidates)


def default_changes(reach: Reach) -> dict[str, Change]:
    """The usual changes, with initial shape constants."""
    found: dict[str, Change] = {
        SHARP_SIGN: sharp_sign,
        FREE_STEEPNESS[0]: free_steepness,
        FREE_STEEPNESS[1]: other_smoothing,
    }
    for kind in TERM_KINDS.usable().values():
        found |= {candidate.name: change_of(candidate, reach) for candidate in kind.candidates}
    return found


def change_of(candidate: Candidate, reach: Reach) -> Change:
    """A candidate that the declaration of a term names, as a change of laws."""

    def change(law: FrictionLaw) -> FrictionLaw | None:
        names = {t.column.name for t in law.terms} | {s.name for s in law.shapes}
        if not names.isdisjoint(candidate.unless):
            return None
        if candidate.instead_of and candidate.instead_of[0] not in names:
            return None
        signed = [t for name in candidate.sign_of for t in law.terms if t.column.name == name]
        smoothing, gamma = (signed[0].smoothing, signed[0].gamma) if signed else ("atan", None)
        terms = candidate.terms(reach.travel, reach.fastest, smoothing, gamma)
        return _replaced(law, candidate.instead_of, terms)

    return change


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
        return None if stems & {t.stem for t in law.terms} else _replaced(law, (), terms)

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
    signs = [t.has_sign and t.column.sharp is None for t in law.terms]
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
    signed = [t.has_sign or t.column.sharp is not None for t in law.terms]
    return FrictionLaw(
        tuple(
            replace(t, smoothing=smoothing) if own else t
            for t, own in zip(law.terms, signed, strict=True)
        )
    )


def _replaced(
    law: FrictionLaw, without: tuple[str, ...], new: tuple[FrictionTerm, ...]
) -> FrictionLaw:
    return FrictionLaw((*(t for t in law.terms if t.column.name not in without), *new))
