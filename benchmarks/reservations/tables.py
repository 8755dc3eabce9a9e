"""Tables of what verdicts say, as markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from pivident.studies.many.study.summary import wilson_interval

from .judged import names_fault, reservations
from .records import FAMILIES, NONE, PLANTED

#: An estimate whose largest error is above this is wrong, in standard errors.
WRONG = 5.0

#: Half width of the intervals, in standard errors.
COVERED = 1.96

#: What a use may be answered with.
ANSWERS = ("yes", "care", "no")

Rows = Sequence[dict[str, Any]]


def tables(rows: Rows) -> list[str]:
    """All tables, line by line."""
    judged = [row for row in rows if "refused" not in row]
    right = [row for row in judged if row["fault"] == NONE]
    wrong = [row for row in judged if row["fault"] != NONE]
    refused = len(rows) - len(judged)
    return [
        f"{len(right)} right records, {len(wrong)} wrong ones, {refused} refused.",
        "", "## Right records", "", *families(right),
        "", "## What is said of right and of wrong records", "", *kinds(right, wrong),
        "", "## Wrong records", "", *faults(wrong),
        "", "## Reservations and repairs about right records", "", *alarms(right),
        "", f"## An error above {WRONG:g} σ and no reservation", "", *silent(wrong),
    ]  # fmt: skip


def table(head: Sequence[str], lines: Iterable[Sequence[object]]) -> list[str]:
    """A table as markdown."""
    rows = [head, ["---"] * len(head), *lines]
    return [f"| {' | '.join(map(str, row))} |" for row in rows]


def share(rows: Sequence[object], of: Rows) -> str:
    """``3 of 30 (3 to 26 %)``, with Wilson's interval."""
    if not of:
        return "–"
    low, high = wilson_interval(len(rows) / len(of), len(of))
    return f"{len(rows)} of {len(of)} ({100 * low:.0f} to {100 * high:.0f} %)"


def coverage(rows: Rows, draws: int = 2000) -> str:
    """Share of the truths in the 95 % intervals, with its interval over records."""
    hits = np.array([np.sum(np.abs(row["z"]) <= COVERED) for row in rows], dtype=float)
    sizes = np.array([len(row["z"]) for row in rows], dtype=float)
    if not len(rows):
        return "–"
    again = np.random.default_rng(0).integers(len(rows), size=(draws, len(rows)))
    low, high = np.percentile(hits[again].sum(axis=1) / sizes[again].sum(axis=1), (2.5, 97.5))
    return f"{100 * hits.sum() / sizes.sum():.1f} % ({100 * low:.1f} to {100 * high:.1f} %)"


def families(right: Rows) -> list[str]:
    """Right records by family."""

    def line(name: str, own: Rows) -> list[object]:
        largest = np.median([np.abs(row["z"]).max() for row in own])
        uses = [
            "/".join(str(sum(row["uses"][use] == answer for row in own)) for answer in ANSWERS)
            for use in ("torque", "simulation", "parameters")
        ]
        return [
            name,
            share([row for row in own if reservations(row)], own),
            sum(bool(row["repairs"]) for row in own),
            coverage(own),
            f"{largest:.1f}",
            *uses,
        ]

    head = [
        "family", "a reservation", "repairs", "95 % cover", "largest error, σ (median)",
        "torque yes/care/no", "simulation", "parameters",
    ]  # fmt: skip
    lines = [line(f, own) for f in FAMILIES if (own := [r for r in right if r["family"] == f])]
    return table(head, [*lines, line("all", right)] if right else [])


def kinds(right: Rows, wrong: Rows) -> list[str]:
    """How often each kind of finding is said, each severity apart; reservations first."""
    order = {"error": 0, "warning": 1, "note": 2}

    def said(rows: Rows) -> list[set[tuple[str, str, str]]]:
        return [{(f["severity"], f["topic"], f["kind"]) for f in row["findings"]} for row in rows]

    of_right, of_wrong = said(right), said(wrong)
    every = {own for sets in (*of_right, *of_wrong) for own in sets if own[0] in order}
    lines = []
    for own in sorted(every, key=lambda own: (order[own[0]], own)):
        a, b = ([x for x in sets if own in x] for sets in (of_right, of_wrong))
        lines.append([own[0], f"{own[1]}: {own[2]}", share(a, right), share(b, wrong)])
    return table(["weight", "finding", "right", "wrong"], lines)


def faults(wrong: Rows) -> list[str]:
    """Wrong records by fault."""

    def line(name: str, own: Rows) -> list[object]:
        bad = [row for row in own if largest(row) > WRONG]
        return [
            name,
            len(own),
            sum(bool(reservations(row) or row["repairs"]) for row in own),
            sum(bool(row["repairs"]) for row in own),
            share([row for row in own if names_fault(row)], own),
            len(bad),
            sum(names_fault(row) for row in bad),
            sum(not reservations(row) for row in bad),
            f"{np.median([largest(row) for row in own]):.1f}",
        ]

    head = [
        "fault", "records", "a reservation", "a repair", "the first names it", f"above {WRONG:g} σ",
        "named", "silent", "largest error, σ (median)",
    ]  # fmt: skip
    lines = [line(f, own) for f in PLANTED if (own := [r for r in wrong if r["fault"] == f])]
    return table(head, [*lines, line("all", wrong)] if wrong else [])


def largest(row: dict[str, Any]) -> float:
    """Largest error of a parameter [σ]."""
    return float(np.abs(row["z"]).max())


def alarms(right: Rows) -> list[str]:
    """Each reservation and repair about a right record."""
    lines = [
        [row["family"], row["seed"], f"{f['topic']}: {f['kind']}", f["message"]]
        for row in right
        for f in reservations(row)
    ]
    lines += [
        [row["family"], row["seed"], "repair", f"{own['cause']} {own['effect']}"]
        for row in right
        for own in row["repairs"]
    ]
    return table(["family", "seed", "finding", "message"], lines)


def silent(wrong: Rows) -> list[str]:
    """Wrong estimates that nothing is said against."""
    lines = []
    for row in wrong:
        if largest(row) > WRONG and not reservations(row):
            worst = int(np.argmax(np.abs(row["z"])))
            size = f"{row['size']:.3g} {row['unit']}"
            lines.append([row["family"], row["fault"], size, row["seed"],
                          f"{largest(row):.1f}", row["names"][worst]])  # fmt: skip
    return table(["family", "fault", "size", "seed", "error, σ", "parameter"], lines)
