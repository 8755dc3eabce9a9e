"""Expected time of `pivident identify` beside what it takes, stage by stage.

    PIVIDENT_DATA=FOLDER python benchmarks/expected_time.py [LOGS …]

Each log is identified once to fill the caches, then ``--repeats`` times. A row gives what the first
line of progress announces, what the run takes from there to its end, and the ratio; then the same
for each stage, with its processor time. Time is that of the wall, which is what a user waits for:
run it on a quiet machine. Medians of the repeats.

Logs: those of `latency` (planar, ur10, tx40, seven), and ``emps`` and ``kr300`` by their examples.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
from latency import EXAMPLES, files_of, run

#: Experiments that are examples, by log.
EXAMPLE = {"emps": "emps", "kr300": "kuka_kr300", "tx40": "staubli_tx40"}

LOGS = ("planar", "ur10", "emps", "kr300", "tx40", "seven")


def prepare(name: str, folder: Path) -> None:
    """An experiment file and what it needs."""
    if name in EXAMPLE:
        shutil.copytree(EXAMPLES / EXAMPLE[name], folder, dirs_exist_ok=True)
        return
    init = files_of(name, folder).commands()["init"]
    run(("-m", "pivident", *init[:-1], "experiment.toml"), folder)


def processor_time(process: int) -> float:
    """What a running process has used by now [s]."""
    fields = Path(f"/proc/{process}/stat").read_text("utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def measured(folder: Path) -> tuple[float, dict[str, np.ndarray]]:
    """What a run announces [s], and seconds of each stage: expected, taken, of the processor."""
    channel = folder / "progress.jsonl"
    channel.unlink(missing_ok=True)
    environment = os.environ | {"PIVIDENT_PROGRESS": str(channel)}
    started = subprocess.Popen(
        [sys.executable, "-m", "pivident", "identify", "experiment.toml"], cwd=folder,
        env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    expected: dict[str, float] = {}
    begins: dict[str, tuple[float, float]] = {}
    now, seen, announced = (0.0, 0.0), 0, np.nan
    while started.poll() is None:
        time.sleep(0.005)
        with suppress(OSError, IndexError):  # it may have ended since
            now = time.perf_counter(), processor_time(started.pid)
        lines = channel.read_text("utf-8").split("\n")[:-1] if channel.exists() else []
        for line in lines[seen:]:
            entry = json.loads(line)
            if "stages" in entry:
                expected, announced = entry["stages"], entry["left_s"]
            if "stage" in entry:
                begins[entry["stage"]] = now
        seen = len(lines)
    taken = np.diff([*begins.values(), now], axis=0)
    own = zip(begins, taken, strict=True)
    return announced, {n: np.array([expected[n], *seconds]) for n, seconds in own}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("logs", nargs="*", default=LOGS)
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    print(
        "| log | announced [s] | taken [s] | taken over announced | stages: taken (processor) of "
        "expected at the pace of reference [s] |"
    )
    print("|---|---:|---:|---:|---|")
    for name in arguments.logs:
        with tempfile.TemporaryDirectory() as made:
            folder = Path(made)
            prepare(name, folder)
            measured(folder)
            runs = [measured(folder) for _ in range(arguments.repeats)]
        announced = float(np.median([first for first, _ in runs]))
        stages = {n: np.median([own[n] for _, own in runs], axis=0) for n in runs[0][1]}
        taken = sum(own[1] for own in stages.values())
        words = ", ".join(
            f"{n} {t:.2f} ({own:.2f}) of {e:.2f}" for n, (e, t, own) in stages.items()
        )
        row = f"| {name} | {announced:.1f} | {taken:.1f} | {taken / announced:.2f} | {words} |"
        print(row, flush=True)


if __name__ == "__main__":
    main()
