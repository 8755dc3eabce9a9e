"""How often verdicts have reservations about right records, and about records with one fault.

    python -m benchmarks.reservations OUT [--right 30] [--wrong 3] [--jobs 2]
    python -m benchmarks.reservations OUT --right 3 --wrong 0 --families scara telescope

Right records: the TX40 of `tx40_scenario`, moved by Pinocchio, and four arms that MuJoCo moves, one
of them under a cascade that is not declared. Wrong ones: the faults of `benchmarks.model_faults`,
one each, on these four arms. Each is identified by LS, IV and PIV as in a file of `pivident init`,
and the verdict's findings, uses and repairs are kept beside the errors of PIV over their standard
errors: a JSON file a record in OUT, which is not made again, and tables.md.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from .judged import judge, reservations
from .records import FAMILIES, PLANTED, Wanted, wanted
from .tables import tables


def run(records: Sequence[Wanted], out: Path, jobs: int) -> None:
    """Judge the records that OUT does not hold yet."""
    missing = [record for record in records if not _file(record, out).exists()]
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
        waiting = {pool.submit(judge, record): record for record in missing}
        for done in as_completed(waiting):
            record, row = waiting[done], done.result()
            path = _file(record, out)
            path.write_text(json.dumps(row, ensure_ascii=False), encoding="utf-8")
            print(f"{record.name}: {line(row)}", flush=True)


def line(row: dict[str, Any]) -> str:
    """A record in one line."""
    if "refused" in row:
        return f"refused: {row['refused']}"
    said = [f"{one['topic']}: {one['kind']}" for one in reservations(row)]
    offered = [f"repair: {one['cause']}" for one in row["repairs"]]
    return f"{max(map(abs, row['z'])):.1f} σ, {'; '.join([*offered, *said]) or 'no reservations'}"


def stored(records: Sequence[Wanted], out: Path) -> Iterator[dict[str, Any]]:
    """Records that OUT holds."""
    for record in records:
        if (path := _file(record, out)).exists():
            yield json.loads(path.read_text(encoding="utf-8"))


def _file(record: Wanted, out: Path) -> Path:
    return out / f"{record.name}.json"


def main() -> None:
    """Run as a script."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--right", type=int, default=30, help="right records a family")
    parser.add_argument("--wrong", type=int, default=3, help="records a fault and arm")
    parser.add_argument("--families", nargs="+", choices=FAMILIES, default=list(FAMILIES))
    parser.add_argument("--faults", nargs="*", choices=PLANTED, default=PLANTED)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--tables", action="store_true", help="of what OUT holds, nothing is made")
    parser.add_argument("--jobs", type=int, default=2, help="records at a time")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    records = list(
        wanted(options.families, options.faults, options.right, options.wrong, options.first)
    )
    if not options.tables:
        run(records, options.out, options.jobs)
    lines = tables(list(stored(records, options.out)))
    (options.out / "tables.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
