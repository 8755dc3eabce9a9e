"""How long `pivident init` and `pivident check` take on 20,000 samples of seven axes.

    python benchmarks/first_look.py [REPEATS]

Three logs of the arm of `tests/seven_axis_arm.py`, 20 s at 1 kHz as CSV: torques of its motors with
the reference of its loop; the same with a reference that no law of the machine follows, for which
`init` searches longest; and torques of sensors behind the gears. Each command is a process of its
own, started once before to fill the caches of compiled kernels. Wall time and processor time [s],
the smallest of the repeats.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.seven_axis_arm import RATE, seven_axis_log, write_log

SEED, SECONDS, BOUND = 11, 20.0, 30.0

COMMANDS = {
    "init": ["init", "log.csv", "--robot", "arm.urdf", "--yes", "--force"],
    "check": ["check", "experiment.toml"],
}


def timed(folder: Path, words: list[str]) -> tuple[float, float]:
    """Wall and processor time of one command [s]."""
    begin, before = time.perf_counter(), os.times()
    command = [sys.executable, "-m", "pivident", *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 4):
        raise SystemExit(done.stderr)
    wall, after = time.perf_counter() - begin, os.times()
    used = after.children_user + after.children_system
    return wall, used - before.children_user - before.children_system


def main(repeats: int) -> None:
    """Print the times of both commands on each log."""
    log = seven_axis_log(SEED, seconds=SECONDS, bearings=0.05)
    late = 3e-4 * RATE * np.gradient(log.q, axis=0)
    logs = {
        "motors, reference of the loop": (log, log.tau_motor),
        "motors, reference of no loop": (replace(log, q_ref=log.q + late), log.tau_motor),
        "sensors behind the gears": (log, log.tau_link),
    }
    print(f"{len(log.t)} samples, 7 axes; at most {BOUND:g} s are wanted")
    for name, (own, tau) in logs.items():
        with tempfile.TemporaryDirectory() as made:
            folder = Path(made)
            write_log(folder, own, tau)
            for command, words in COMMANDS.items():
                timed(folder, words)
                wall, used = min(timed(folder, words) for _ in range(repeats))
                print(f"{name:30} {command:5} {wall:6.1f} s, processor {used:6.1f} s")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2)
