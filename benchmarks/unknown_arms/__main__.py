"""Records of arms that pivident has never seen, and what a new user gets from them.

    python -m benchmarks.unknown_arms --arm cobot6 --records 30 --out FOLDER

For each seed: logs, URDF and data sheet are written, `pivident init`, `check` and `identify` run on
them as a new user runs them, and the results are put beside the truth. Folders of earlier runs are
used again; `--fresh` makes new ones.
"""

from __future__ import annotations

import argparse
import json
import shutil
from pathlib import Path

from .arms import ARMS
from .judge import Judged, judge
from .record import RUNS, write_record
from .summary import record_lines, summary_lines, write_table
from .truth import machine
from .user import Session, use


def run_record(folder: Path, seed: int, options: argparse.Namespace) -> tuple[Session, list]:
    """One record from its seed to its judged estimates."""
    if options.fresh and folder.exists():
        shutil.rmtree(folder)
    runs = [*options.runs, "held_out"]
    if not all((folder / f"truth_{run}.npz").exists() for run in runs):
        write_record(
            folder,
            options.arm,
            seed,
            runs,
            references=options.references,
            exact_sheet=options.exact_sheet,
            noise=options.noise,
        )
    shutil.rmtree(folder / "experiment-results", ignore_errors=True)
    session = use(
        folder, options.arm, options.runs, edit=not options.as_written, hard_sign=options.hard_sign
    )
    made = machine(options.arm, seed, options.exact_sheet)
    judged = [
        judge(folder, made, options.runs, method, seconds)
        for method, seconds in session.reached.items()
    ]
    return session, judged


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--arm", choices=sorted(ARMS), required=True)
    parser.add_argument("--records", type=int, default=3)
    parser.add_argument("--first", type=int, default=1, help="first seed")
    parser.add_argument("--out", type=Path, default=Path("benchmarks/results/unknown_arms"))
    parser.add_argument("--runs", nargs="+", choices=RUNS[:-1], default=["sines", "moves"])
    parser.add_argument("--references", choices=("speed", "position", "both"), default="speed")
    parser.add_argument("--exact-sheet", action="store_true", help="true torque constants")
    parser.add_argument("--noise", type=float, default=1.0, help="factor of the encoders' noise")
    parser.add_argument("--as-written", action="store_true", help="run the file of init unchanged")
    parser.add_argument("--hard-sign", action="store_true", help="sharp sign in the user's law")
    parser.add_argument("--fresh", action="store_true", help="simulate again")
    options = parser.parse_args()
    rows: list[tuple[int, Session, list[Judged]]] = []
    for seed in range(options.first, options.first + options.records):
        folder = options.out / options.arm / f"seed-{seed}"
        session, judged = run_record(folder, seed, options)
        rows.append((seed, session, judged))
        print("\n".join(record_lines(seed, session, judged)), flush=True)
    print("\n".join(summary_lines(options.arm, rows)))
    settings = {key: str(value) for key, value in vars(options).items()}
    (options.out / options.arm / "settings.json").write_text(json.dumps(settings, indent=1))
    write_table(options.out / options.arm / "parameters.csv", rows)


if __name__ == "__main__":
    main()
