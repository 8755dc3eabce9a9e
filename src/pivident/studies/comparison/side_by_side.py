"""A comparison on the terminal: tables that fit into 80 columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from textwrap import fill

from pivident.foundation.text.identifiers import escaped
from pivident.foundation.text.numbers import GAP, column, format_significant, lines_of, with_spread
from pivident.studies.comparison.compared_results import (
    ComparedParameter,
    ComparedResults,
    Difference,
    Estimate,
)
from pivident.studies.comparison.entry import Entry
from pivident.studies.comparison.remarks import MAX_PERCENT, findings, level_sentence, share_text

#: Width where there is no terminal.
WIDTH = 80

#: Significant differences that are listed beneath three results or more.
_MAX_LISTED = 40

#: Digits of a hash that are shown.
HASH = 10

#: Title, alignment and cells.
Column = tuple[str, str, Sequence[str]]


def comparison_text(comparison: ComparedResults, width: int = WIDTH) -> str:
    """The comparison as plain text."""
    return "\n\n".join(escaped(part) for part in _parts(comparison, width))


def _parts(comparison: ComparedResults, width: int) -> Iterator[str]:
    """Tables, and sentences of which each begins a line."""
    yield from _tables("Results", _fit_columns(comparison), width)
    names = [p.name for p in comparison.parameters]
    first: list[Column] = [("", "<", names), ("unit", "<", [p.unit for p in comparison.parameters])]
    values, level = "Parameters ± 2σ", fill(level_sentence(comparison), width)
    if len(comparison.entries) == 2:
        pair = [*first, *pair_columns(comparison)]
        taken = sum(max(map(len, [name, *cells])) + len(GAP) for name, _, cells in pair)
        if taken - len(GAP) > width:  # no room for the difference
            del pair[-2]
        tables = _tables(values, pair, width)
    else:  # the first result is in every table
        columns = value_columns(comparison)
        tables = _tables(values, [*first, columns[0]], width, columns[1:])
        tables += _tables(*_differences(comparison), width)
    yield from tables[:-1]
    yield "\n".join([*tables[-1:], level])
    yield _lines([f"· {sentence}" for sentence in findings(comparison)], width)
    if comparison.torques:
        labels: Column = ("parameters of", "<", comparison.labels)
        shares: list[Column] = [
            (comparison.labels[t.record], ">", [share_text(float(x)) for x in t.error])
            for t in comparison.torques
        ]
        yield from _tables("Torque error on the record of …", [labels], width, shares)
    yield from _tables(
        "Where they come from (hashes shortened)", _source_columns(comparison), width
    )
    if comparison.notes:
        yield _lines([f"Note: {note}" for note in comparison.notes], width)


def _lines(sentences: Sequence[str], width: int) -> str:
    return "\n".join(fill(sentence, width, break_on_hyphens=False) for sentence in sentences)


def _tables(
    title: str, fixed: Sequence[Column], width: int, others: Sequence[Column] = ()
) -> list[str]:
    """Columns under a title and over a line, in as many tables as the width needs.

    Args:
        title: of the tables.
        fixed: columns that stand in each of them; without cells there is no table.
        width: of the page [characters].
        others: columns that are shared out.
    """
    groups: list[list[list[str]]] = []
    begin = [column(name, cells, align) for name, align, cells in fixed]
    for name, align, cells in others:
        own = column(name, cells, align)
        if not groups or len(GAP.join(c[0] for c in [*begin, *groups[-1], own])) > width:
            groups.append([])
        groups[-1].append(own)
    made: list[str] = []
    for group in groups or [[]]:
        columns = [*begin, *group]
        head, *rows = lines_of(columns).split("\n")
        rule = "─" * len(GAP.join(cells[0] for cells in columns))
        named = f"{title}, continued" if made else title
        made.append("\n".join([named, head, rule, *rows]))
    return made if fixed and len(fixed[0][2]) else []


def estimate_text(estimate: Estimate | None) -> str:
    """A value with its spread, both to the second digit of the spread."""
    if estimate is None:
        return "–"
    value, spread = with_spread(estimate.value, estimate.spread)
    return value if spread == "–" else f"{value} ± {spread}"


def difference_text(found: Difference | None) -> str:
    """A difference with sign and spread."""
    if found is None:
        return "–"
    value, spread = with_spread(found.value, found.spread)
    signed = value if value.startswith("-") else f"+{value}"
    return signed if spread == "–" else f"{signed} ± {spread}"


def format_z(z: float) -> str:
    """A difference in standard errors, with one decimal."""
    return f"{round(z, 1) + 0.0:.1f}" if abs(z) < 1e4 else format_significant(z, 2)


def z_text(comparison: ComparedResults, found: Difference | None) -> str:
    """The difference in standard errors, with a mark where it is significant."""
    if found is None or found.z != found.z:
        return "–"
    return f"{format_z(found.z)}{' *' if comparison.is_marked(found) else '  '}"


def record_text(entry: Entry) -> str:
    """The record by the hashes of its files."""
    return " ".join(digest[:HASH] for digest in entry.inputs.values()) or "not known"


def _fit_columns(comparison: ComparedResults) -> list[Column]:
    """How well each result fits its own record."""
    entries = comparison.entries
    rows = ["–" if e.samples is None else f"{e.samples:,}".replace(",", " ") for e in entries]
    return [
        ("result", "<", [e.label for e in entries]),
        ("parameters", ">", [str(len(e.names)) for e in entries]),
        ("torque error", ">", [share_text(e.relative_error) for e in entries]),
        ("condition", ">", [format_significant(e.condition) for e in entries]),
        ("rows", ">", rows),
        ("converged", ">", [{None: "–", True: "yes", False: "NO"}[e.converged] for e in entries]),
    ]


def _source_columns(comparison: ComparedResults) -> list[Column]:
    """What each result came from."""
    entries = comparison.entries
    sources = [e.source for e in entries]
    return [
        ("result", "<", [e.label for e in entries]),
        ("method", "<", [e.method for e in entries]),
        ("record", "<", [record_text(e) for e in entries]),
        ("pivident", "<", [e.version or "–" for e in entries]),
        ("file", "<", ["–" if s is None else s.sha256[:HASH] for s in sources]),
        ("written", "<", ["–" if s is None else s.modified.split("T")[0] for s in sources]),
    ]


def pair_columns(comparison: ComparedResults) -> list[Column]:
    """Two results: values, their difference, and how sure it is."""
    found = [p.differences[1] for p in comparison.parameters]
    return [
        *(
            (label, ">", [_narrow(estimate_text(p.estimates[k])) for p in comparison.parameters])
            for k, label in enumerate(comparison.labels)
        ),
        ("difference", ">", [_narrow(difference_text(d)) for d in found]),
        ("z", ">", [z_text(comparison, d) for d in found]),
    ]


def _narrow(text: str) -> str:
    return text.replace(" ± ", "±")


def value_columns(comparison: ComparedResults) -> list[Column]:
    """Three results or more: values, marked where they differ from those of the first."""

    def cell(p: ComparedParameter, k: int) -> str:
        mark = " *" if comparison.is_marked(p.differences[k]) else "  "
        return f"{_narrow(estimate_text(p.estimates[k]))}{mark}"

    return [
        (label, ">", [cell(p, k) for p in comparison.parameters])
        for k, label in enumerate(comparison.labels)
    ]


def _differences(comparison: ComparedResults) -> tuple[str, list[Column]]:
    """Title and columns of the significant differences of three results, the clearest first."""
    found = [
        (p, comparison.labels[k], d)
        for p in comparison.parameters
        for k, d in enumerate(p.differences)
        if d is not None and comparison.is_marked(d)
    ]
    found.sort(key=lambda f: -abs(f[2].z))
    title = f"Significant differences from {comparison.labels[0]} ± 2σ"
    if len(found) > _MAX_LISTED:
        title += f", the {_MAX_LISTED} clearest of {len(found)}"
    shown = found[:_MAX_LISTED]
    shares = [
        format_significant(d.relative, 2) if abs(d.relative) < MAX_PERCENT else "–"
        for *_, d in shown
    ]
    return title, [
        ("parameter", "<", [p.name for p, *_ in shown]),
        ("result", "<", [label for _, label, _ in shown]),
        ("difference", ">", [_narrow(difference_text(d)) for *_, d in shown]),
        ("unit", "<", [p.unit for p, *_ in shown]),
        ("%", ">", shares),
        ("z", ">", [format_z(d.z) for *_, d in shown]),
    ]
