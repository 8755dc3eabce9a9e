"""Speed of this working tree beside that of another one, in processor time of the same minutes.

    git worktree add ../before REVISION
    python benchmarks/compare_speed.py ../before [--rounds 6] [--only "simulation or packed"]

The benchmarks `bench_*.py` of both trees take turns, one process each, as often as there are
rounds; each has the shortest of its times, which other work on the machine has disturbed least.
A ratio below 1 means that this tree is faster. Peers are left out.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]

#: Benchmarks of other packages.
PEERS = "not statsmodels and not simdkalman and not pinocchio and not scipy"


def shortest(tree: Path, only: str) -> dict[str, float]:
    """Shortest processor time [s] of each benchmark of a tree, by its name."""
    with tempfile.TemporaryDirectory() as folder:
        results = Path(folder) / "times.json"
        command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-k", only]
        command += ["--benchmark-enable", "--benchmark-only", f"--benchmark-json={results}"]
        command += ["--benchmark-timer=time.process_time"]
        command += [str(path) for path in sorted((tree / "benchmarks").glob("bench_*.py"))]
        environment = {**os.environ, "PYTHONPATH": str(tree / "src")}
        subprocess.run(command, cwd=tree, env=environment, check=True, stdout=subprocess.DEVNULL)
        found = json.loads(results.read_text())["benchmarks"]
    return {entry["name"]: entry["stats"]["min"] for entry in found}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("before", type=Path)
    parser.add_argument("--rounds", type=int, default=6)
    parser.add_argument("--only", default="", help="as of pytest -k")
    options = parser.parse_args()
    only = f"({options.only}) and {PEERS}" if options.only else PEERS
    times: dict[Path, dict[str, float]] = {options.before.resolve(): {}, HERE: {}}
    for turn in range(2 * options.rounds):
        tree = list(times)[turn % 2]
        for name, seconds in shortest(tree, only).items():
            times[tree][name] = min(seconds, times[tree].get(name, seconds))
    before, now = times.values()
    print(f"{'benchmark':50s} {'before ms':>10s} {'now ms':>10s} {'ratio':>6s}")
    for name in before:
        if name in now:
            ratio = now[name] / before[name]
            print(f"{name:50s} {1e3 * before[name]:10.3f} {1e3 * now[name]:10.3f} {ratio:6.3f}")


if __name__ == "__main__":
    main()
