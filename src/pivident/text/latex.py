"""Numbers and units in LaTeX math mode."""

from __future__ import annotations

import re


def latex_number(text: str) -> str:
    r"""A printed number in math mode: ``1.2e-07`` as 1.2 · 10⁻⁷."""
    mantissa, _, exponent = text.replace("∞", r"\infty").replace("−", "-").partition("e")
    if mantissa == "–":
        return "--"
    return f"${mantissa}$" if not exponent else rf"${mantissa} \cdot 10^{{{int(exponent)}}}$"


def latex_unit(unit: str) -> str:
    r"""A unit in upright letters: ``kg m²`` as ``$\mathrm{kg\,m^{2}}$``."""
    text = unit.replace("²", "^{2}").replace("·", r" ")
    text = re.sub(r"\^([0-9.]+)", r"^{\1}", text)
    return rf"$\mathrm{{{text.replace(' ', chr(92) + ',')}}}$"
