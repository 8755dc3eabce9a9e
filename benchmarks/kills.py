"""Kills at random moments: of studies, fleets, identifications, reports and workers, each resumed.

    python benchmarks/kills.py                     # 50 kills of each kind
    python benchmarks/kills.py study --kills 10

After every kill the folder must hold whole files only, and after the last, uninterrupted run the
same as if nothing had happened: every run of a study once, bit for bit those of an uninterrupted
one; one whole set of results of an identification; no hidden folder, no unfinished file.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]

SCENARIO = """
robot = "planar_2r"
[controller]
type = "pd"
kp = [6000, 2500]
kd = [180, 60]
[record]
rate = 500
[trajectory]
duration = 2.0
reach = 1.5
[noise]
encoder = 2e-6
torque = 0.05
[identify]
methods = ["ls", "iv"]
"""

#: What the latest command has said.
LOG = Path(tempfile.gettempdir()) / f"kills-{os.getpid()}.log"

#: Runs of the study that is killed.
RUNS = 150

#: Writes the same files again and again, each time with the next number in all of them.
WRITER = """
import itertools, sys
from pathlib import Path
from pivident.foundation.files import atomic_folder
for number in itertools.count():
    with atomic_folder(sys.argv[1]) as build:
        for name in "abcdefghij":
            (build / name).write_text(f"{number}\\n" * 50)
        (build / "deep").mkdir()
        (build / "deep" / "k").write_text(f"{number}\\n" * 50)
"""


def cli(*arguments: str) -> subprocess.Popen[bytes]:
    """The command line in a session of its own, so that it can be killed with its workers."""
    start = "import sys; from pivident.app.cli import main; sys.exit(main())"
    command = [sys.executable, "-c", start, *arguments]
    with LOG.open("wb") as log:
        return subprocess.Popen(command, stdout=log, stderr=log, start_new_session=True)


def kill_after(process: subprocess.Popen[bytes], seconds: float, group: bool) -> bool:
    """Kill a process, or all of its session, unless it has ended before; whether it was killed."""
    try:
        process.wait(seconds)
        return False
    except subprocess.TimeoutExpired:
        if group:
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
        process.wait()
        return True


def unfinished(folder: Path) -> list[str]:
    """Hidden folders and unfinished files below a folder."""
    return sorted(
        str(p.relative_to(folder))
        for p in folder.rglob(".*")
        if p.name.startswith((".pivident-", ".unfinished-"))
    )


def kill_studies(kills: int, rng: random.Random, place: Path) -> dict[str, object]:
    """A study killed with or without its workers, and resumed until it is whole."""
    import polars as pl

    scenario = place / "small.toml"
    scenario.write_text(SCENARIO)
    options = ("--runs", str(RUNS), "--workers", "1")
    begin = time.monotonic()
    whole = cli("study", str(scenario), *options, "--out", str(place / "whole"))
    assert whole.wait() == 0, "the uninterrupted study failed"
    lasting = time.monotonic() - begin
    expected = pl.read_parquet(place / "whole" / "runs" / "*.parquet").sort("run", "method")
    made, finished, progress = 0, 0, []
    while made < kills:
        folder = place / f"killed-{finished}"
        while made < kills:
            process = cli("study", str(scenario), *options, "--out", str(folder))
            begin = time.monotonic()
            if not kill_after(process, rng.uniform(0.1, 1.0) * lasting, rng.random() < 0.5):
                if time.monotonic() - begin > 0.5 * lasting:
                    lasting = time.monotonic() - begin
                break
            made += 1
            shards = sorted((folder / "runs").glob("*.parquet"))
            runs = [r for s in shards for r in set(pl.read_parquet(s)["run"].to_list())]
            assert len(runs) == len(set(runs)), "a run is there twice"
            progress.append(len(runs))
        assert cli("study", str(scenario), *options, "--out", str(folder)).wait() == 0
        found = pl.read_parquet(folder / "runs" / "*.parquet").sort("run", "method")
        numbers = [c for c in expected.columns if c != "seconds"]
        assert found.select(numbers).equals(expected.select(numbers)), "other numbers"
        assert not unfinished(folder), unfinished(folder)
        assert json.loads((folder / "summary.json").read_text())
        finished += 1
    return {"kills": made, "studies": finished, "runs_at_kills": progress}


def kill_workers(kills: int, rng: random.Random, place: Path, *how: str) -> dict[str, object]:
    """Worker processes of a running study killed; the study itself goes on."""
    import polars as pl
    import psutil

    scenario = place / "small.toml"
    scenario.write_text(SCENARIO)
    made, studies, lost = 0, 0, 0
    while made < kills:
        folder = place / f"study-{studies}"
        options = ("--runs", "400", "--workers", "2", *how, "--out", str(folder))
        process = cli("study", str(scenario), *options)
        while process.poll() is None:
            time.sleep(rng.uniform(1.0, 8.0))
            try:
                family = psutil.Process(process.pid).children(recursive=True)
                workers = [p for p in family if "spawn_main" in " ".join(p.cmdline())]
                if workers and made < kills:
                    rng.choice(workers).kill()
                    made += 1
            except psutil.Error:
                continue
        assert process.returncode == 0, LOG.read_text()[-2000:]
        rows = pl.read_parquet(folder / "runs" / "*.parquet")
        assert sorted(rows.filter(pl.col("method") == "ls")["run"]) == list(range(400))
        lost += rows.filter(pl.col("error").is_not_null())["run"].n_unique()
        assert not unfinished(folder)
        studies += 1
    return {"kills": made, "studies": studies, "runs_recorded_as_lost": lost}


def kill_dask_workers(kills: int, rng: random.Random, place: Path) -> dict[str, object]:
    """The same on a Dask cluster of this machine."""
    return kill_workers(kills, rng, place, "--dask")


def write_log(folder: Path) -> Path:
    """A log of the planar arm and its experiment file."""
    sys.path.insert(0, str(ROOT))
    from tests.planar_log import EXPERIMENT, write_experiment

    return write_experiment(folder, EXPERIMENT + "\n[validation]\nfolds = 0\n")


def kill_identifications(kills: int, rng: random.Random, place: Path) -> dict[str, object]:
    """``pivident identify`` killed; the folder is as before or whole, one more run clears up."""
    experiment = write_log(place)
    whole = place / "whole"
    begin = time.monotonic()
    assert cli("identify", str(experiment), "--out", str(whole)).wait() == 0
    lasting = time.monotonic() - begin
    names = sorted(p.name for p in whole.iterdir())
    out, made, left, there = place / "results" / "out", 0, 0, 0
    out.parent.mkdir()
    while made < kills:
        process, begin = cli("identify", str(experiment), "--out", str(out)), time.monotonic()
        was_killed = kill_after(process, rng.uniform(0.2, 1.05) * lasting, True)
        lasting = lasting if was_killed else time.monotonic() - begin
        made += was_killed
        left += len(unfinished(out.parent))
        if out.exists():
            there += 1
            assert sorted(p.name for p in out.iterdir() if p.name[0] != ".") == names
            json.loads((out / "identification.json").read_text())
    assert cli("identify", str(experiment), "--out", str(out)).wait() == 0
    assert sorted(p.name for p in out.iterdir()) == names, "something else is there"
    assert not unfinished(out.parent), unfinished(out.parent)
    text = (out / "identification.json").read_text(), (whole / "identification.json").read_text()
    assert text[0] == text[1], "other numbers"
    return {"kills": made, "hidden_folders_after_kills": left, "whole_at_kills": there}


def kill_fleets(kills: int, rng: random.Random, place: Path) -> dict[str, object]:
    """``pivident fleet`` killed with or without its workers, and resumed until it is whole."""
    import polars as pl

    sys.path.insert(0, str(ROOT))
    from tests.studies.many.fleet.planar_fleet import write_fleet

    logs = place / "logs"
    write_fleet(logs, robots=6, days=8)
    options = ("fleet", str(logs), "--workers", "2", "--out")
    begin = time.monotonic()
    assert cli(*options, str(place / "whole")).wait() == 0, LOG.read_text()[-2000:]
    lasting = time.monotonic() - begin

    def table(folder: Path) -> pl.DataFrame:
        found = pl.read_parquet(folder / "parameters.parquet")
        numbers = [c for c in found.columns if c not in ("seconds", "computed")]
        return found.select(numbers).sort("robot", "day", "parameter")

    expected, made, fleets, progress = table(place / "whole"), 0, 0, []
    while made < kills:
        folder = place / f"killed-{fleets}"
        while made < kills:
            process = cli(*options, str(folder))
            if not kill_after(process, rng.uniform(0.1, 1.0) * lasting, rng.random() < 0.5):
                break
            made += 1
            parts = [pl.read_parquet(f) for f in (folder / "logs").glob("*.parquet")]
            rows = pl.concat(parts).select("task", "parameter") if parts else pl.DataFrame()
            assert not parts or rows.is_unique().all(), "a log is there twice"
            progress.append(rows["task"].n_unique() if parts else 0)
        assert cli(*options, str(folder)).wait() == 0, LOG.read_text()[-2000:]
        assert table(folder).equals(expected), "other numbers"
        assert not unfinished(folder), unfinished(folder)
        assert (folder / "fleet.html").exists()
        fleets += 1
    return {"kills": made, "fleets": fleets, "logs_at_kills": progress}


def kill_writers(kills: int, rng: random.Random, place: Path) -> dict[str, object]:
    """A process that writes results all the time killed: the most exact aim at the moves."""
    from pivident.foundation.files import atomic_folder

    mixed = hidden = 0
    for k in range(kills):
        out = place / f"out-{k % 5}"
        process = subprocess.Popen([sys.executable, "-c", WRITER, str(out)])
        assert kill_after(process, rng.uniform(0.15, 0.6), False)
        hidden += len(unfinished(place))
        if out.exists():
            mixed += len(_numbers(out)) > 1
        with atomic_folder(out) as build:
            (build / "note").write_text("")
        assert len(_numbers(out)) <= 1, f"files of several runs: {_numbers(out)}"
        assert not unfinished(place), unfinished(place)
    return {"kills": kills, "hidden_folders_after_kills": hidden, "mixed_until_next_run": mixed}


def _numbers(out: Path) -> set[str]:
    """What stands in the files; each has to be whole."""
    texts = [p.read_text() for p in out.rglob("?") if p.is_file() and ".pivident" not in str(p)]
    assert all(text == f"{text.split()[0]}\n" * 50 for text in texts), "a file is half written"
    return {text.split()[0] for text in texts}


def write_together(kills: int, rng: random.Random, place: Path) -> dict[str, object]:
    """Two processes write to one folder, and one of them is killed in the end."""
    from pivident.foundation.files import atomic_folder

    out, rounds = place / "out", max(1, kills // 10)
    for _ in range(rounds):
        both = [subprocess.Popen([sys.executable, "-c", WRITER, str(out)]) for _ in range(2)]
        time.sleep(rng.uniform(0.5, 1.5))
        for process in both:
            assert process.poll() is None, "one of two writers failed"
            process.kill()
            process.wait()
        with atomic_folder(out) as build:
            (build / "note").write_text("")
        assert len(_numbers(out)) == 1, f"files of several runs: {_numbers(out)}"
        assert not unfinished(place), unfinished(place)
    return {"kills": 2 * rounds}


KINDS: dict[str, Callable[[int, random.Random, Path], dict[str, object]]] = {
    "study": kill_studies,
    "worker": kill_workers,
    "dask": kill_dask_workers,
    "identify": kill_identifications,
    "fleet": kill_fleets,
    "write": kill_writers,
    "together": write_together,
}


def main() -> None:
    """Run the chosen kinds and print what happened."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kinds", nargs="*", choices=[[], *KINDS], default=[])
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    for kind in chosen.kinds or KINDS:
        begin = time.monotonic()
        with tempfile.TemporaryDirectory(prefix=f"kills-{kind}-") as place:
            found = KINDS[kind](chosen.kills, random.Random(chosen.seed), Path(place))
        counts = {k: (v if np.ndim(v) == 0 else f"{min(v)} to {max(v)}") for k, v in found.items()}
        print(f"{kind:<9} fine  {counts}  {time.monotonic() - begin:.0f} s", flush=True)
    LOG.unlink(missing_ok=True)


if __name__ == "__main__":
    main()
