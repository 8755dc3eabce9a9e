"""Numbers as text, with a meaningful number of digits.

An estimate is written to the second digit of its interval, everything else to a few significant
digits; NaN is a dash.

Tables of numbers and words as plain text.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

#: Numbers of this many decimals, or as large as this, are written with an exponent …
_MANY_DECIMALS, _LARGE = 7, 1e6

#: … unless they are larger than this, where an exponent would obscure their size.
_SMALL = 1e-3


def format_significant(x: float, digits: int = 3) -> str:
    """A number with a few significant digits: ``0.0123``, ``1.23e-07``, ``–`` for NaN."""
    if not math.isfinite(x):
        return "–" if math.isnan(x) else "∞" if x > 0 else "-∞"
    if x == 0.0:
        return "0"
    decimals = max(0, digits - 1 - _exponent(x))
    return f"{x:.{decimals}f}" if _is_plain(abs(x), decimals) else f"{x:.{digits - 1}e}"


def format_exact(x: float) -> str:
    """An exact number with its own digits, at most six."""
    return f"{x:.6g}" if math.isfinite(x) else format_significant(x)


def with_spread(value: float, spread: float) -> tuple[str, str]:
    """A value and its ± spread, both to the second digit of the spread."""
    if not (math.isfinite(value) and math.isfinite(spread) and spread > 0.0):
        return format_significant(value, 5), format_significant(spread, 2)
    decimals = max(0, 1 - _exponent(spread))
    size = max(abs(value), spread)
    if _is_plain(size, decimals):
        return f"{round(value, decimals) + 0.0:.{decimals}f}", f"{spread:.{decimals}f}"  # no -0.0
    power = _exponent(size)
    digits = max(0, 1 - _exponent(spread) + power)
    mantissas = (f"{x / 10.0**power:.{digits}f}" for x in (value, spread))
    text, spread_text = (f"{mantissa}e{power:+03d}" for mantissa in mantissas)
    return text, spread_text


def plus_minus(value: float, spread: float, sign: bool = False) -> str:
    """``0.123 ± 0.045`` in matching digits; the value alone where the spread is zero or NaN."""
    text, spread_text = with_spread(value, spread)
    text = f"+{text}" if sign and not text.startswith("-") else text
    return f"{text} ± {spread_text}" if spread > 0.0 else text


def percent(x: float) -> str:
    """A percentage: ``1.2 %``."""
    return format_significant(x, 2) if math.isnan(x) else f"{format_significant(x, 2)} %"


def _is_plain(size: float, decimals: int) -> bool:
    """Whether a number of this size and so many decimals reads well without an exponent."""
    return size < _LARGE and (decimals < _MANY_DECIMALS or size >= _SMALL)


def _exponent(x: float) -> int:
    return math.floor(math.log10(abs(x)))


def time_in_words(seconds: float) -> str:
    """A rough time as people say it; seconds [s]."""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    return f"{round(seconds / 60)} min"


def bytes_in_words(size: int) -> str:
    """A size as people say it."""
    for unit, factor in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size >= factor:
            return f"{size / factor:.3g} {unit}"
    return f"{size} bytes"


def latex_number(text: str) -> str:
    r"""A printed number in math mode: ``1.2e-07`` as 1.2 · 10⁻⁷; a word in its place stays."""
    if text.isalpha():
        return text
    mantissa, _, exponent = text.replace("∞", r"\infty").replace("−", "-").partition("e")
    if mantissa == "–":
        return "--"
    return f"${mantissa}$" if not exponent else rf"${mantissa} \cdot 10^{{{int(exponent)}}}$"


def latex_unit(unit: str) -> str:
    r"""A unit in upright letters: ``kg m²`` as ``$\mathrm{kg\,m^{2}}$``."""
    text = unit.replace("²", "^{2}").replace("·", r" ")
    text = re.sub(r"\^([0-9.]+)", r"^{\1}", text)
    return rf"$\mathrm{{{text.replace(' ', chr(92) + ',')}}}$"


#: Between two columns.
GAP = "  "


def plain_table(columns: Sequence[tuple[str, str, Sequence[str]]]) -> str:
    """Columns (title, alignment ``<``, ``>`` or ``.`` for decimal points, cells) side by side."""
    return lines_of([column(title, cells, align) for title, align, cells in columns])


def column(title: str, cells: Sequence[str], align: str, top: str | None = None) -> list[str]:
    """Head and cells padded to one width; ``align`` is <, > or . for the decimal points."""
    body = _on_decimal_point(cells) if align == "." else list(cells)
    head = [title] if top is None else [top, title]
    width = max(map(len, head + body))
    side = "<" if align == "<" else ">"
    return [f"{cell:{side}{width}}" for cell in head + body]


def lines_of(columns: Sequence[Sequence[str]]) -> str:
    """Columns of equal height side by side, as lines."""
    return "\n".join(GAP.join(cells).rstrip() for cells in zip(*columns, strict=True))


def _on_decimal_point(cells: Sequence[str]) -> list[str]:
    """Numbers padded on the right so that their decimal points are aligned."""
    tails = [len(cell) - cell.find(".") if "." in cell else 0 for cell in cells]
    widest = max(tails, default=0)
    return [cell + " " * (widest - tail) for cell, tail in zip(cells, tails, strict=True)]
