"""The summary of a study as plain text, for terminals."""

from __future__ import annotations

import math

from pivident.many.study.summary import NOMINAL_COVERAGE, Summary
from pivident.text.plain_table import plain_table

HEADINGS = (
    "method", "runs", "covered", "interval", "median error", "predicted/found", "efficiency",
    "iterations", "simulations", "time",
)  # fmt: skip


def summary_text(summary: Summary) -> str:
    """A table with one line per method, errors, and a note on the intervals."""
    rows = []
    for name, m in summary.methods.items():
        low, high = m.coverage_interval
        rows.append(
            (
                name,
                str(m.runs),
                percent(m.coverage, 1),
                f"{percent(low, 1, '')}–{percent(high, 1)}" if math.isfinite(low) else "–",
                percent(m.median_relative_error, 5),
                number(m.predicted_over_empirical),
                number(m.efficiency),
                number(m.iterations[0]),
                number(m.simulations),
                "–" if math.isnan(m.seconds) else f"{m.seconds:.2f} s",
            )
        )
    table = [
        (heading, ">" if k else "<", [row[k] for row in rows]) for k, heading in enumerate(HEADINGS)
    ]
    lines = [plain_table(table)]
    for name, m in summary.methods.items():
        for error, count in m.errors.items():
            lines.append(f"{name}: {count} run(s) ended with {error}: {m.messages[error]}")
        if m.not_converged:
            lines.append(f"{name}: {m.not_converged} estimate(s) did not converge")
    note = (
        f"A 2σ interval should cover the truth in {100 * NOMINAL_COVERAGE:.1f} % of the cases; "
        "the interval of the coverage is a 95 % interval over the runs."
    )
    return "\n".join([f"{summary.scenario}: {summary.description}".rstrip(": "), *lines, note])


def percent(share: float, digits: int, unit: str = " %") -> str:
    """A fraction as percentage, with this many decimals; more if it is small."""
    if not math.isfinite(share):
        return "–"
    value = 100.0 * share
    if 0 < abs(value) < 10.0**-digits:
        return f"{value:.2g}{unit}"
    return f"{value:.{digits}f}{unit}"


def number(value: float) -> str:
    """Three digits, or a dash."""
    return f"{value:.3g}" if math.isfinite(value) else "–"
