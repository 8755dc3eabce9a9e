"""Numbers and units in the mathematics of LaTeX."""

from __future__ import annotations

import re


def latex_number(text: str) -> str:
    r"""A number as it is printed elsewhere, in mathematics: ``1.2e-07`` as 1.2 · 10⁻⁷.

    Args:
        text: such as ``0.0123``, ``1.2e-07``, ``∞`` or ``–``.
    """
    mantissa, _, exponent = text.replace("∞", r"\infty").partition("e")
    if mantissa == "–":
        return "--"
    return f"${mantissa}$" if not exponent else rf"${mantissa} \cdot 10^{{{int(exponent)}}}$"


def latex_unit(unit: str) -> str:
    r"""A unit in upright letters: ``kg m²`` as ``$\mathrm{kg\,m^{2}}$``.

    Args:
        unit: as parameters have it.
    """
    text = unit.replace("²", "^{2}").replace("·", r" ")
    text = re.sub(r"\^([0-9.]+)", r"^{\1}", text)
    return rf"$\mathrm{{{text.replace(' ', chr(92) + ',')}}}$"
