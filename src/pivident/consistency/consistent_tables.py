"""Links of a consistent model as a table of bodies."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal

import numpy as np

from pivident.consistency.pseudo_inertia import LinkBody
from pivident.text.numbers import format_significant
from pivident.text.plain_table import plain_table

#: Fewest and most digits of printed moments of inertia.
LEAST_DIGITS, MOST_DIGITS = 3, 17


def link_table(bodies: Sequence[LinkBody], *further: tuple[str, str, Sequence[str]]) -> str:
    """Links as bodies: mass, centre of mass, principal moments."""
    columns: list[tuple[str, str, Sequence[str]]] = [
        ("link", "<", [b.name for b in bodies]),
        ("mass [kg]", ".", [format_significant(b.mass) for b in bodies]),
        *further,
    ]
    for k, title in enumerate(("centre x [mm]", "y", "z")):
        columns.append((title, ".", [millimetres(b.center_of_mass[k]) for b in bodies]))
    moments = [moments_text(b.principal_moments) for b in bodies]
    for k, title in enumerate(("I1 [kg m²]", "I2", "I3")):
        columns.append((title, ".", [own[k] for own in moments]))
    return plain_table(columns)


def moments_text(moments: np.ndarray) -> list[str]:
    """Principal moments with as many digits as make the printed ones those of a body.

    Rounding may not make the largest exceed the sum of the two others, as that of 0.1234, 1.004,
    1.127 to three digits would. Moments that no body has are written to three digits.
    """
    values = sorted(float(m) for m in moments)
    digits = LEAST_DIGITS
    if values[0] > 0.0 and values[2] < values[0] + values[1]:
        while digits < MOST_DIGITS and not _belong_to_a_body(moments, digits):
            digits += 1
    return [format_significant(m, digits) for m in moments]


def _belong_to_a_body(moments: np.ndarray, digits: int) -> bool:
    """Whether moments as printed are positive and satisfy the triangle inequality, exactly."""
    a, b, c = sorted(Decimal(format_significant(m, digits)) for m in moments)
    return a > 0 and c <= a + b


def millimetres(metres: float) -> str:
    """A length in millimetres, to a tenth."""
    return f"{round(1e3 * metres, 1) + 0.0:.1f}"
