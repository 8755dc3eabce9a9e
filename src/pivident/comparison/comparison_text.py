"""A comparison on the terminal: tables that fit into 80 columns."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from pivident.comparison.compared_results import (
    ComparedParameter,
    ComparedResults,
    Difference,
    Estimate,
)
from pivident.comparison.remarks import MAX_PERCENT, findings, level_sentence, share_text
from pivident.text.numbers import format_significant, with_spread
from pivident.text.printable import escaped

if TYPE_CHECKING:
    from pivident.comparison.entry import Entry

#: Width where there is no terminal.
WIDTH = 80

#: Characters between two columns.
_GAP = 2

#: Significant differences that are listed beneath three results or more.
_MAX_LISTED = 40

#: Digits of a hash that are shown.
HASH = 10


def comparison_text(comparison: ComparedResults, width: int = WIDTH) -> str:
    """The comparison as plain text."""
    stream = io.StringIO()
    console = Console(file=stream, width=width, color_system=None, highlight=False)
    console.print(comparison_tables(comparison, width))
    return "\n".join(line.rstrip() for line in stream.getvalue().splitlines())


def comparison_tables(comparison: ComparedResults, width: int = WIDTH) -> RenderableType:
    """The comparison for a terminal."""
    parts: list[RenderableType] = [_fit_table(comparison), Text()]
    if len(comparison.entries) == 2:
        parts.append(_pair_table(comparison, width))
    else:
        parts += _value_tables(comparison, width)
        if listed := _difference_table(comparison):
            parts += [Text(), listed]
    parts.append(Text(level_sentence(comparison)))
    parts.append(Text())
    parts += [Text(escaped(f"· {sentence}")) for sentence in findings(comparison)]
    if comparison.torques:
        parts += [Text(), *_torque_tables(comparison, width)]
    parts += [Text(), _source_table(comparison)]
    if comparison.notes:
        parts.append(Text())
    parts += [Text(escaped(f"Note: {note}")) for note in comparison.notes]
    return Group(*parts)


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


def condition_text(entry: Entry) -> str:
    """Condition number of the observation matrix."""
    return format_significant(entry.condition)


def ending_text(entry: Entry) -> str:
    """Whether the iteration converged, in a word."""
    return {None: "–", True: "yes", False: "NO"}[entry.converged]


def record_text(entry: Entry) -> str:
    """The record by the hashes of its files."""
    return " ".join(digest[:HASH] for digest in entry.inputs.values()) or "not known"


def _titled(title: str, table: Table) -> RenderableType:
    """A table under its title, which may be wider."""
    return Group(Text(escaped(title), style="bold"), table)


def _table(columns: Sequence[tuple[str, str]]) -> Table:
    """An empty table: titles, and ``left`` or ``right``; numbers, names and units do not wrap."""
    table = Table(
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        show_edge=False,
        padding=(0, 1, 0, 0),
    )
    for name, side in columns:
        table.add_column(
            Text(escaped(name)), justify="right" if side == "right" else "left",
            no_wrap=side == "right" or name in ("", "unit"), overflow="fold",
        )  # fmt: skip
    return table


def _add(table: Table, cells: Sequence[str], style: str = "") -> None:
    table.add_row(*(Text(escaped(cell)) for cell in cells), style=style or None)


def _fit_table(comparison: ComparedResults) -> RenderableType:
    """How well each result fits its own record."""
    titles = ("parameters", "torque error", "condition", "rows", "converged")
    table = _table([("result", "left"), *((t, "right") for t in titles)])
    for entry in comparison.entries:
        rows = "–" if entry.samples is None else f"{entry.samples:,}".replace(",", " ")
        cells = [
            entry.label,
            str(len(entry.names)),
            share_text(entry.relative_error),
            condition_text(entry),
            rows,
            ending_text(entry),
        ]
        _add(table, cells, "red" if entry.converged is False else "")
    return _titled("Results", table)


def _source_table(comparison: ComparedResults) -> RenderableType:
    """What each result came from."""
    titles = ("result", "method", "record", "pivident", "file", "written")
    table = _table([(t, "left") for t in titles])
    for e in comparison.entries:
        source = ("–", "–")
        if e.source is not None:
            source = (e.source.sha256[:HASH], e.source.modified.split("T")[0])
        _add(table, [e.label, e.method, record_text(e), e.version or "–", *source])
    return _titled("Where they come from (hashes shortened)", table)


def _pair_table(comparison: ComparedResults, width: int) -> RenderableType:
    """Two results: values, their difference where there is room for it, and how sure it is."""
    heads = ["", "unit", *comparison.labels, "difference", "z"]
    lines = []
    for p in comparison.parameters:
        found = p.differences[1]
        values = [_narrow(estimate_text(e)) for e in p.estimates]
        last = [_narrow(difference_text(found)), z_text(comparison, found)]
        lines.append([p.name, p.unit, *values, *last])
    widths = [max(map(len, column)) for column in zip(heads, *lines, strict=True)]
    columns = list(range(len(heads)))
    if sum(widths) + _GAP * (len(heads) - 1) > width:
        columns.remove(heads.index("difference"))
    sides = ("left", "left", "right", "right", "right", "right")
    table = _table([(heads[k], sides[k]) for k in columns])
    for p, cells in zip(comparison.parameters, lines, strict=True):
        marked = comparison.is_marked(p.differences[1])
        _add(table, [cells[k] for k in columns], "bold" if marked else "")
    return _titled("Parameters ± 2σ", table)


def _narrow(text: str) -> str:
    return text.replace(" ± ", "±")


def _value_tables(comparison: ComparedResults, width: int) -> list[RenderableType]:
    """Three results or more: values with marks, in as many tables as the width needs."""
    cells = [_value_cells(comparison, p) for p in comparison.parameters]
    widths = [
        max([len(label), *(len(row[k]) for row in cells)])
        for k, label in enumerate(comparison.labels)
    ]
    fixed = max(map(len, ["", *(p.name for p in comparison.parameters)])) + _GAP
    fixed += max(map(len, ["unit", *(p.unit for p in comparison.parameters)])) + _GAP
    tables: list[RenderableType] = []
    for others in _chunks(widths[1:], width - fixed - widths[0]):
        chosen = [0, *(k + 1 for k in others)]  # the first result in every table
        title = "Parameters ± 2σ" if not tables else "Parameters ± 2σ, continued"
        columns = [("", "left"), ("unit", "left")]
        table = _table(columns + [(comparison.labels[k], "right") for k in chosen])
        for p, row in zip(comparison.parameters, cells, strict=True):
            marked = any(comparison.is_marked(p.differences[k]) for k in chosen)
            _add(table, [p.name, p.unit, *(row[k] for k in chosen)], "bold" if marked else "")
        tables += [_titled(title, table), Text()]
    return tables[:-1]


def _value_cells(comparison: ComparedResults, p: ComparedParameter) -> list[str]:
    """The estimates of one parameter, marked where they differ from the first."""
    return [
        f"{_narrow(estimate_text(e))}{' *' if comparison.is_marked(d) else '  '}"
        for e, d in zip(p.estimates, p.differences, strict=True)
    ]


def _difference_table(comparison: ComparedResults) -> RenderableType | None:
    """The significant differences of three results or more, the clearest first."""
    found = [
        (abs(d.z), k, p, d)
        for p in comparison.parameters
        for k, d in enumerate(p.differences)
        if d is not None and comparison.is_marked(d)
    ]
    if not found:
        return None
    found.sort(key=lambda f: -f[0])
    title = f"Significant differences from {comparison.labels[0]} ± 2σ"
    if len(found) > _MAX_LISTED:
        title += f", the {_MAX_LISTED} clearest of {len(found)}"
    names = (("parameter", "left"), ("result", "left"), ("difference", "right"))
    further = (("unit", "left"), ("%", "right"), ("z", "right"))
    table = _table([*names, *further])
    for _, k, p, d in found[:_MAX_LISTED]:
        percent = format_significant(d.relative, 2) if abs(d.relative) < MAX_PERCENT else "–"
        z = format_z(d.z)
        _add(table, [p.name, comparison.labels[k], _narrow(difference_text(d)), p.unit, percent, z])
    return _titled(title, table)


def _torque_tables(comparison: ComparedResults, width: int) -> list[RenderableType]:
    """Torque errors of all results on the records of those that hold them."""
    records = comparison.torques
    names = [comparison.labels[t.record] for t in records]
    widths = [max(len(name), 7) for name in names]
    room = width - max(map(len, ["parameters of", *comparison.labels])) - _GAP
    tables: list[RenderableType] = []
    for chosen in _chunks(widths, room):
        title = "Torque error on the record of …" + (", continued" if tables else "")
        heads = [("parameters of", "left"), *((names[k], "right") for k in chosen)]
        table = _table(heads)
        for j, label in enumerate(comparison.labels):
            _add(table, [label, *(share_text(float(records[k].error[j])) for k in chosen)])
        tables += [_titled(title, table), Text()]
    return tables[:-1]


def _chunks(widths: Sequence[int], room: int) -> list[list[int]]:
    """Columns that stand side by side."""
    groups: list[list[int]] = [[]]
    taken = 0
    for k, width in enumerate(widths):
        if groups[-1] and taken + width + _GAP > room:
            groups.append([])
            taken = 0
        groups[-1].append(k)
        taken += width + _GAP
    return groups
