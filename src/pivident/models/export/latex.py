r"""Tables of parameters for LaTeX (booktabs, longtable), to be read in with ``\input``.

One table has the base parameters with the free estimate, its ±2σ and, for a consistent model, the
consistent value; the other the standard parameters of every link. Names are set in math mode,
``zz1r`` as ``$\mathit{zz}_{1r}$``, and all external text is escaped.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters
from pivident.foundation.text.identifiers import latex_name, latex_text, one_line
from pivident.foundation.text.numbers import (
    format_significant,
    latex_number,
    latex_unit,
    with_spread,
)
from pivident.models.export_format import Format
from pivident.models.exported import ExportedText
from pivident.models.runnable_model import RunnableModel

#: Digits of a value whose standard error is unknown.
DIGITS = 5

#: Smaller values are rounding errors of zero, in any unit of the table.
NOTHING = 1e-12


def to_latex(model: RunnableModel) -> ExportedText:
    """Two tables: base parameters with ±2σ, standard parameters of every link."""
    robot = one_line(model.robot.name)
    parts = [
        "% Dynamic parameters of " + robot + ", " + one_line(model.origin.method) + ".",
        r"% In the preamble: \usepackage{amsmath,booktabs,longtable}",
        *(f"% {one_line(note)}" for note in model.notes),
        *_base_table(model),
        *_standard_table(model),
    ]
    return ExportedText(("\n".join(parts) + "\n").encode("utf-8", errors="backslashreplace"))


def latex_group(base: BaseParameters, index: int) -> str:
    r"""A base parameter as the sum of standard ones, in math mode."""
    text = _name(base.parameters[index].name)
    for i, coefficient in zip(base.dropped, base.regrouping[index], strict=True):
        if coefficient == 0.0:
            continue
        size = latex_number(f"{abs(coefficient):.6g}").strip("$")
        factor = "" if size == "1" else rf"{size} \, "
        text += f" {'-' if coefficient < 0 else '+'} {factor}{_name(base.standard[i].name)}"
    return f"${text}$"


def _name(name: str) -> str:
    return latex_name(one_line(name))


def _base_table(model: RunnableModel) -> list[str]:
    """Free estimate with ±2σ, consistent value, unit, group."""
    free = model.estimate
    spread = {}
    if free is not None:
        estimates = zip(free.names, free.theta, free.std, strict=True)
        spread = {n: (float(v), 2.0 * float(s)) for n, v, s in estimates}
    head = ["Parameter", r"Estimate", r"$\pm 2\sigma$", "Unit", "Group"]
    if model.consistent:
        head.insert(3, "Consistent")
    rows = []
    columns = (model.base.names, model.base.parameters, model.base_values)
    for k, (name, p, value) in enumerate(zip(*columns, strict=True)):
        if free is not None and name not in spread and not model.consistent:
            continue  # left out of the model: essential parameters only
        estimate, twice = spread.get(name, (math.nan, math.nan))
        texts = with_spread(estimate, twice)
        if free is None:
            texts = (format_significant(value, DIGITS), format_significant(math.nan))
        row = [f"${_name(name)}$", *map(latex_number, texts)]
        if model.consistent:
            row.append(latex_number(_like(value, twice)))
        rows.append([*row, latex_unit(p.unit), latex_group(model.base, k)])
    columns_text = "l" + "r" * (len(head) - 3) + r"lp{0.4\linewidth}"
    return _table(
        f"Base parameters of {latex_text(one_line(model.robot.name))}, "
        f"{latex_text(one_line(model.origin.method))}.",
        columns_text,
        head,
        rows,
    )


def _standard_table(model: RunnableModel) -> list[str]:
    """Values of all standard parameters, with intervals where there are any."""
    head, intervals = ["Link", "Parameter", "Value"], model.intervals
    if intervals is not None:
        head.append(r"95\,\% interval")
    rows, before = [], ""
    for k, (p, value) in enumerate(zip(model.parameters, model.values, strict=True)):
        link = model.robot.tree.links[p.joint].name
        shown = latex_text(one_line(link)) if link != before else ""
        value = 0.0 if abs(value) < NOTHING else value
        row = [shown, f"${_name(p.name)}$", latex_number(format_significant(value, DIGITS))]
        if intervals is not None:
            row.append(_interval(intervals[k]))
        rows.append([*row, latex_unit(p.unit)])
        before = link
    kind = "consistent values" if model.consistent else "not physical link by link"
    return _table(
        f"Standard parameters of {latex_text(one_line(model.robot.name))}, {kind}.",
        "ll" + "r" * (len(head) - 2) + "l",
        [*head, "Unit"],
        rows,
    )


def _interval(ends: np.ndarray) -> str:
    low, high = (latex_number(format_significant(float(end), 4)) for end in ends)
    return f"{low} \\ldots\\ {high}"


def _like(value: float, spread: float) -> str:
    """A value to the digits of a spread."""
    return (
        with_spread(value, spread)[0]
        if math.isfinite(spread)
        else format_significant(value, DIGITS)
    )


def _table(
    caption: str, columns: str, head: Sequence[str], rows: Iterable[Sequence[str]]
) -> list[str]:
    """A long table whose head is repeated on every page."""
    title = " & ".join(head) + r" \\"
    return [
        "",
        rf"\begin{{longtable}}{{{columns}}}",
        rf"\caption{{{caption}}}\\",
        r"\toprule",
        title,
        r"\midrule",
        r"\endfirsthead",
        r"\toprule",
        title,
        r"\midrule",
        r"\endhead",
        r"\bottomrule",
        r"\endfoot",
        *(" & ".join(row) + r" \\" for row in rows),
        r"\end{longtable}",
    ]


#: Tables of a paper.
LATEX = Format(
    "LaTeX",
    ".tex",
    lambda model, _: to_latex(model),
    not_loaded="a table computes no torques",
    shows_intervals=True,
)
