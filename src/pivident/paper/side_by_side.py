"""Tables of estimates beside those of the paper's Table 1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pivident.estimation.identification import Identification
from pivident.many.study.summary import geometric_mean
from pivident.paper.claims import IV, LS, PIV, PRINTED, percent
from pivident.paper.experiment import FORMS, IDENTIFIED
from pivident.paper.public_record import PublicRecord
from pivident.paper.published import COLUMNS, published_table
from pivident.text.numbers import format_significant


def all_forms() -> list[str]:
    """All forms in the order of the page."""
    return [
        *FORMS.values(),
        *(FORMS[name] + IDENTIFIED for name in ("iv", "piv-as-printed", "piv")),
    ]


def beside_table_1(
    results: Mapping[str, Identification],
    forms: Sequence[str],
    columns: Sequence[str] = tuple(COLUMNS),
) -> list[list[str]]:
    """A row for each parameter: the paper's columns, then our estimates by form."""
    rows = []
    for row in published_table():
        published = [f"{row.value[key]:g} ({row.relative_std[key]:g} %)" for key in columns]
        rows.append([row.name, *published, *(_estimate(results.get(f), row.name) for f in forms)])
    return rows


def head_of(forms: Sequence[str], columns: Sequence[str] = tuple(COLUMNS)) -> list[str]:
    """Head of that table."""
    return ["parameter", *(f"paper: {COLUMNS[key]}" for key in columns), *forms]


def _estimate(found: Identification | None, name: str) -> str:
    if found is None:
        return "–"
    k = found.names.index(name)
    relative = 100.0 * found.std[k] / abs(found.theta[k])
    return f"{format_significant(found.theta[k])} ({format_significant(relative, 2)} %)"


def public_tables(record: PublicRecord | None) -> dict[str, Any]:
    """What the page says of the public record."""
    if record is None:
        return {
            "public_lead": "The public record of a Stäubli TX40 goes through the same forms where "
            "it is on the machine: `pivident datasets fetch staubli_tx40`, and without `--quick`.",
            "public_rows": [],
            "public_head": [],
            "public_lines": [],
        }
    forms, columns = list(record.results), ("ls", "iv", "piv")
    return {
        "public_lead": "The public record of a Stäubli TX40 is another motion of such an arm, with "
        "encoders as they are and neither reference nor gains: a virtual law follows the smoothed "
        "measurement. Its truth is unknown.",
        "public_rows": beside_table_1(record.results, forms, columns),
        "public_head": head_of(forms, columns),
        "public_lines": _public_lines(record),
    }


def _public_lines(record: PublicRecord) -> list[str]:
    """What of the pattern shows."""
    lines = [f"{form}: no estimate; {text}." for form, text in record.failures.items()]
    found = record.results
    for form in (PRINTED, PIV):
        if form in found and IV in found:
            ratio = found[form].relative_std / found[IV].relative_std
            names = [found[form].names.index(row.name) for row in published_table()]
            own = ratio[names]
            lines.append(
                f"Relative standard errors fall from IDIM-IV to {form} for {np.sum(own < 1)} of "
                f"{own.size} parameters (geometric mean of the ratios {geometric_mean(own):.2g})."
            )
    shares = [f"{form} {percent(record.correlated(form))}" for form in found]
    lines.append(f"Autocorrelations beyond ±2/√n: {', '.join(shares)}.")
    steps = [f"{form} {own.iterations}" for form, own in found.items() if own.iterations > 1]
    lines.append(f"Iterations: {', '.join(steps)}.")
    if LS in found and PIV in found:
        pairs = [
            f"{name} {100 * (found[LS].value(name) / found[PIV].value(name) - 1):+.2g} %"
            for name in ("zz1r", "zz3r", "fv1", "fc1")
        ]
        lines.append(f"IDIM-LS differs from {PIV} by {', '.join(pairs)}.")
    return lines
