"""How long `pivident paper` takes: quick, as it is, and with the whole repetition.

    python benchmarks/paper_page.py [--repetition]

Wall and processor seconds on the cores that there are. The repetition takes about half an hour on
two; its conditions are timed one by one.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from pathlib import Path

from pivident.studies import make_page
from pivident.studies.many.study.run import run_study
from pivident.studies.many.study.scenario import load_scenario


def timed(label: str, work) -> float:
    """Do it, print how long it took, and return the wall time [s]."""
    begin, before = time.perf_counter(), os.times()
    work()
    wall, after = time.perf_counter() - begin, os.times()
    used = sum(after[:4]) - sum(before[:4])
    print(f"{label:24s} {wall:7.0f} s, {used:7.0f} s of processor time", flush=True)
    return wall


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repetition", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        timed("quick page", lambda: make_page(folder / "quick", quick=True))
        timed("page from scratch", lambda: make_page(folder / "page"))
        if options.repetition:
            whole = sum(
                timed(c.condition, lambda c=c: run_study(c, folder / "study" / c.condition))
                for c in load_scenario("paper").conditions
            )
            print(f"{'repetition':24s} {whole:7.0f} s")


if __name__ == "__main__":
    main()
