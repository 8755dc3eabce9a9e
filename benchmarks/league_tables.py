"""Tables of the page "Which method for which record" from the figures of the league.

    python benchmarks/league_tables.py [PAGE]

``docs/_static/league.csv`` is what ``league.py`` found on simulated records, ``records.csv`` beside
it what ``methods_on_records.py`` found on real ones. Without a page the tables are printed; in a
page they are put between ``% table NAME`` and ``% end``.
"""

from __future__ import annotations

import csv
import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import median

RESULTS = Path(__file__).resolve().parents[1] / "docs" / "_static"

Row = dict[str, str]

LEVELS = ("n1", "n2", "n3", "n4", "n5")


def rows(name: str) -> list[Row]:
    """Rows of a file of results."""
    with (RESULTS / f"{name}.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def percent(text: str, share: float = 100.0) -> str:
    """A share as percentage with two digits, or a dash."""
    value = share * float(text or "nan")
    if not math.isfinite(value):
        return "–"
    return f"{value:.0f}" if abs(value) >= 10.0 else f"{value:.2g}"


def coverage(text: str) -> str:
    """A coverage as percentage with one decimal, or a dash."""
    value = 100.0 * float(text or "nan")
    return f"{value:.1f}" if math.isfinite(value) else "–"


def table(headings: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table of a page."""
    ruler = ["---"] + ["---:"] * (len(headings) - 1)
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (headings, ruler, *lines))


def by_condition(
    found: Sequence[Row],
    scenario: str,
    conditions: Sequence[str],
    headings: Sequence[str],
    show: Callable[[Row], str],
) -> str:
    """A row for each method, a column for each condition."""
    own = {(r["condition"], r["method"]): r for r in found if r["scenario"] == scenario}
    methods = dict.fromkeys(method for condition, method in own if condition in conditions)
    lines = []
    for method in methods:
        cells = [own.get((condition, method)) for condition in conditions]
        if any(cells):
            lines.append([f"`{method}`", *("–" if r is None else show(r) for r in cells)])
    return table(("", *headings), lines)


def cost(found: Sequence[Row]) -> str:
    """Time, simulations and what went wrong, over the conditions of BIRDy's with decimation 1."""
    own = [r for r in found if r["scenario"] == "birdy" and r["condition"].endswith("-d1")]
    lines = []
    for method in dict.fromkeys(r["method"] for r in own):
        mine = [r for r in own if r["method"] == method]
        times = [float(r["seconds"]) for r in mine if r["seconds"] not in ("", "nan")]
        simulated = [float(r["simulations"]) for r in mine if r["simulations"] not in ("", "nan")]
        sums = [
            sum(int(r[key]) for r in mine)
            for key in ("runs", "failed", "not_converged", "not_simulated")
        ]
        lines.append(
            [
                f"`{method}`",
                f"{median(times):.2g}" if times else "–",
                f"{median(simulated):.2g}" if simulated else "–",
                *map(str, sums),
            ]
        )
    headings = ("", "time [s]", "simulations", "runs", "failed", "not converged", "not simulated")
    return table(headings, lines)


def scenarios(found: Sequence[Row]) -> str:
    """*fine*, *loop* and *coarse*: error of a run and coverage."""
    names = ("fine", "loop", "coarse")
    own = {(r["scenario"], r["method"]): r for r in found if r["scenario"] in names}
    lines = []
    for method in dict.fromkeys(method for _, method in own):
        cells = [f"`{method}`"]
        for name in names:
            r = own.get((name, method))
            cells += ["–", "–"] if r is None else [percent(r["error"]), coverage(r["coverage"])]
        lines.append(cells)
    headings = [f"{name}: {what} [%]" for name in names for what in ("error", "covered")]
    return table(("", *headings), lines)


def records(found: Sequence[Row]) -> str:
    """Held-out torque errors of real records."""
    names = list(dict.fromkeys(r["record"] for r in found))
    own = {(r["record"], r["method"]): r["error"] for r in found}
    lines = [
        [f"`{method}`", *(own.get((name, method)) or "–" for name in names)]
        for method in dict.fromkeys(r["method"] for r in found)
    ]
    return table(("", *(f"{name} [%]" for name in names)), lines)


def tables() -> dict[str, str]:
    """All tables of the page by name."""
    found = rows("league")
    made = {}
    for robot in ("tx40", "rv2sq"):
        for thinned in ("d1", "d4"):
            names = [f"{robot}-{level}-{thinned}" for level in LEVELS]
            made[f"error {robot} {thinned}"] = by_condition(
                found, "birdy", names, LEVELS, lambda r: percent(r["error"])
            )
        names = [f"{robot}-{level}-d1" for level in LEVELS]
        made[f"coverage {robot}"] = by_condition(
            found, "birdy", names, LEVELS, lambda r: coverage(r["coverage"])
        )
        made[f"at the mean {robot}"] = by_condition(
            found,
            "birdy",
            names,
            LEVELS,
            lambda r: f"{percent(r['d_beta'], 1.0)} / {percent(r['d_beta_of_mean'], 1.0)}",
        )
    made["cost"] = cost(found)
    made["scenarios"] = scenarios(found)
    made["records"] = records(rows("records"))
    return made


def filled(page: str, made: Mapping[str, str]) -> str:
    """A page with its tables."""

    def put(match: re.Match[str]) -> str:
        return f"% table {match[1]}\n\n{made[match[1]]}\n\n% end"

    return re.sub(r"% table ([^\n]+)\n.*?% end", put, page, flags=re.DOTALL)


def main(page: str = "") -> None:
    """Print the tables, or write them into a page."""
    if page:
        text = Path(page).read_text(encoding="utf-8")
        Path(page).write_text(filled(text, tables()), encoding="utf-8")
        return
    for name, text in tables().items():
        print(f"% {name}\n\n{text}\n")


if __name__ == "__main__":
    main(*sys.argv[1:2])
