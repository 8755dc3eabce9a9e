"""Parameters of a friction law with signs that no friction has.

A law may fit one motion with two terms of opposite sign that nearly cancel; outside of its range
they do not, and a simulated machine gains energy. So each term that takes energy has to take it
alone: viscous slopes, Coulomb levels, powers of the speed, the share of the load, elements that
stick and slip. Stribeck friction is the excess of the level at rest over that of sliding.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.robot.friction import FrictionLaw
from pivident.robot.friction_term import FrictionTerm
from pivident.text.numbers import plus_minus


def has_definite_sign(term: FrictionTerm) -> bool:
    """Whether the parameter of a term must not be negative."""
    return term.is_dissipative or term.column.never_negative


def impossible_terms(law: FrictionLaw, theta: Sequence[float] | np.ndarray) -> set[str]:
    """Stems of the terms with negative parameters that must not be; ``theta``: shape (terms,)."""
    return {
        term.stem
        for term, value in zip(law.terms, theta, strict=True)
        if value < 0.0 and has_definite_sign(term)
    }


def impossible_signs(
    law: FrictionLaw, theta: Sequence[float] | np.ndarray, std: Sequence[float] | np.ndarray
) -> tuple[str, ...]:
    """Terms with negative parameters, each with its estimate ± 2σ.

    Args:
        law: the friction law.
        theta: parameters of its terms, shape (terms,).
        std: their standard errors, likewise.
    """
    impossible = impossible_terms(law, theta)
    return tuple(
        f"{term.stem} = {plus_minus(float(value), 2.0 * float(s))}"
        for term, value, s in zip(law.terms, theta, std, strict=True)
        if term.stem in impossible
    )
