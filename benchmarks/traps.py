"""Traps in six recorded logs, and what `pivident identify` says of each.

    PIVIDENT_DATA=FOLDER python benchmarks/traps.py OUT [--only LOG:TRAP …] [--jobs 2]

A trap is what goes wrong with logs: a clock of another unit, a reversed or exchanged torque, a zero
or a unit of one joint, gravity in another direction, late torques, repeated rows, a wrong gain, a
load that is not there, standstill. Each is planted in logs that were recorded (`trapped_logs.logs`)
or in the experiment file, one at a time, and the program has to say what it is: as the first of the
repairs that it offers or, where it offers none, as the first reservation that it does not have
about the log without the trap. What a trap can be seen by is a table (`trapped_logs.visible`),
beside figures that do not come from a verdict. Written into OUT: a folder for each trap, the tables
as markdown and all figures as JSON.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.trapped_logs.evidence import evidence
from benchmarks.trapped_logs.judging import is_as_good, judge
from benchmarks.trapped_logs.logs import LOGS, original_experiment, plain_log
from benchmarks.trapped_logs.plain_log import PlainLog
from benchmarks.trapped_logs.planting import NAMES, apply_trap
from benchmarks.trapped_logs.running import Outcome, identify, pivident
from benchmarks.trapped_logs.tables import Row, evidence_table, summary, verdict_table
from benchmarks.trapped_logs.visible import INAPPLICABLE

from pivident.data.recording.datasets import ENVIRONMENT

#: Largest relative difference of the least-squares error between a log and its plain columns.
SAME = 0.005


def traps_of(log: str, only: Sequence[str]) -> list[str]:
    """Names of the traps of a log that are wanted, the log without one first."""
    wanted = [
        trap
        for trap in NAMES[1:]
        if trap not in INAPPLICABLE.get(log, {})
        and (not only or any(one in (log, f"{log}:{trap}", f":{trap}") for one in only))
    ]
    return [NAMES[0], *wanted] if wanted or log in only or f"{log}:{NAMES[0]}" in only else []


def prepare(log: str, traps: Sequence[str], data: Path, out: Path) -> PlainLog:
    """Write the folders of a log: as it was, as plain columns, and with each trap."""
    folder, source = out / log, LOGS[log]
    shutil.rmtree(folder, ignore_errors=True)
    plain = plain_log(source, original_experiment(source, data, folder / "original"))
    for trap in traps:
        apply_trap(trap, plain, source, folder / _folder(NAMES[0])).write(folder / _folder(trap))
    return plain


def joints_of(log: str, trap: str, names: Sequence[str]) -> list[str]:
    """Names of the joints that a trap is about."""
    source = LOGS[log]
    if trap == "torques exchanged":
        return [names[j] for j in source.pair]
    return [names[source.pair[0] if trap == "torque x1.5" else source.joint]]


def repaired(folder: Path, clean: Outcome) -> bool | None:
    """Whether the first repair brings the error back; None where there is no such command."""
    copied = folder.with_name(f"{folder.name}-repaired")
    shutil.copytree(folder, copied)
    code, *_, said = pivident(["apply", "experiment.toml", "1"], copied)
    if 'Unknown command "apply"' in said:
        return None
    return code == 0 and is_as_good(identify(copied), clean)


def rows_of(log: str, traps: Sequence[str], plain: PlainLog, out: Path, jobs: int) -> list[Row]:
    """All rows of a log; a note where its plain columns are not the log."""
    folders = [out / log / "original", *(out / log / _folder(trap) for trap in traps)]
    with ThreadPoolExecutor(jobs) as pool:
        original, clean, *spoilt = pool.map(identify, folders)
    if abs(clean.least_squares / original.least_squares - 1.0) > SAME:
        print(f"{log}: {clean.least_squares} % as plain columns, {original.least_squares} % as log")
    seen = [evidence(folder) for folder in folders[1:]]
    rows = [Row(log, traps[0], [], clean, clean, None, seen[0], seen[0])]
    for trap, outcome, own in zip(traps[1:], spoilt, seen[1:], strict=True):
        joints = joints_of(log, trap, plain.joints)
        judged = judge(trap, joints, outcome, clean)
        if outcome.repairs:
            judged = replace(judged, repaired=repaired(out / log / _folder(trap), clean))
        rows.append(Row(log, trap, joints, outcome, clean, judged, own, seen[0]))
    return rows


def _folder(trap: str) -> str:
    return trap.replace(" ", "-")


def main() -> None:
    """Plant, run, judge; print and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, help="folder for logs, tables and figures")
    parser.add_argument("--only", nargs="*", default=[], metavar="LOG:TRAP",
                        help="also LOG for all its traps, :TRAP for all logs")  # fmt: skip
    parser.add_argument("--jobs", type=int, default=2, help="commands at a time")
    parser.add_argument("--data", type=Path, help=f"folder of the data; else {ENVIRONMENT}")
    parser.add_argument("--again", action="store_true", help="judge what OUT holds once more")
    options = parser.parse_args()
    if options.data:
        os.environ[ENVIRONMENT] = str(options.data)
    data, out = Path(os.environ[ENVIRONMENT]), options.out.resolve()
    rows: list[Row] = []
    for log in LOGS:
        traps = traps_of(log, options.only)
        if traps and not options.again:
            plain = prepare(log, traps, data, out)
            own = rows_of(log, traps, plain, out, options.jobs)
            print("\n".join(verdict_table(own)[2 if rows else 0 :]), flush=True)
            rows += own
            write(rows, out)
    if options.again:
        rows = judged_again(out)
        write(rows, out)
        print("\n".join(verdict_table(rows)))
    print("\n".join(["", *evidence_table(rows), "", *summary(rows)]))


def write(rows: Sequence[Row], out: Path) -> None:
    """Write tables and figures."""
    tables = [*verdict_table(rows), "", *evidence_table(rows), "", *summary(rows)]
    (out / "traps.md").write_text("\n".join(tables) + "\n", encoding="utf-8")
    text = json.dumps([asdict(row) for row in rows], indent=1, default=str)
    (out / "traps.json").write_text(text, encoding="utf-8")


def judged_again(out: Path) -> list[Row]:
    """The rows of an earlier run, judged once more."""
    rows = []
    for stored in json.loads((out / "traps.json").read_text(encoding="utf-8")):
        outcome, clean = Outcome(**stored["outcome"]), Outcome(**stored["clean"])
        row = Row(**{**stored, "outcome": outcome, "clean": clean, "judgement": None})
        if row.trap != NAMES[0]:
            fixed = stored["judgement"]["repaired"]
            judged = judge(row.trap, row.joints, outcome, clean)
            row = replace(row, judgement=replace(judged, repaired=fixed))
        rows.append(row)
    return rows


if __name__ == "__main__":
    main()
