"""Every reader, fuzzed: an answer or a named error within a second, whatever the file.

    python benchmarks/fuzz_readers.py                        # all readers, 100,000 inputs each
    python benchmarks/fuzz_readers.py urdf csv --inputs 5000
    python benchmarks/fuzz_readers.py --show npz FILE        # one input again, with its traceback

Each reader is fed in a process of its own, whose memory is limited. A process that dies or hangs
is replaced, and the input that did it is kept. Findings lie under --out, by reader. With atheris
installed (pip install atheris) the search is guided by the branches that inputs reach.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from fuzzing.readers import READERS

CHILD = Path(__file__).parent / "fuzzing" / "child.py"

#: Seconds without progress after which a child is killed; on a busy machine it may starve a while.
STUCK = 300.0

#: Inputs of one child: a fresh process now and then shows memory that is not given back.
PORTION = 25_000

STATE = "<3Q2d"


def fuzz(name: str, wanted: int, engine: str, seed: int, out: Path) -> dict[str, object]:
    """Feed one reader, replacing children that die.

    Returns:
        What the table shows.
    """
    folder = Path(tempfile.mkdtemp(prefix=f"fuzz-{name}-", dir=_memory_disk()))
    (folder / "tmp").mkdir()
    begin, inputs, answers, refused, deaths = time.monotonic(), 0, 0, 0, 0
    slowest = peak = 0.0
    while inputs < wanted:
        (folder / "state").write_bytes(b"")
        portion = min(PORTION, wanted - inputs)
        own = engine if READERS[name].guided else "plain"
        how = _run_child(name, folder, own, portion, seed + inputs)
        state = (folder / "state").read_bytes()
        done = struct.unpack(STATE, state) if len(state) == struct.calcsize(STATE) else (0,) * 5
        inputs, answers, refused = inputs + done[0], answers + done[1], refused + done[2]
        slowest, peak = max(slowest, done[3]), max(peak, done[4])
        if how:
            deaths += 1
            _keep_killer(name, folder, how)
        print(f"{name}: {inputs} inputs, {time.monotonic() - begin:.0f} s {how}", flush=True)
        if not done[0] or deaths > 200:
            break
    findings = _findings(folder)
    kept = out / name
    shutil.rmtree(kept, ignore_errors=True)
    if findings:
        shutil.copytree(folder / "findings", kept)
        (kept / "findings.json").write_text(json.dumps(findings, indent=1))
    shutil.rmtree(folder)
    return {
        "reader": name, "inputs": inputs, "answers": answers, "refused": refused,
        "findings": len(findings), "deaths": deaths, "slowest_s": round(slowest, 3),
        "peak_mb": round(peak / 2**20), "seconds": round(time.monotonic() - begin),
        "kinds": sorted(findings),
    }  # fmt: skip


def _memory_disk() -> str | None:
    """A file system in memory, where there is one: every input is written to a file."""
    return "/dev/shm" if os.access("/dev/shm", os.W_OK) else None


def _run_child(name: str, folder: Path, engine: str, count: int, seed: int) -> str:
    """Run a child to its end; how it died, or empty."""
    arguments = [sys.executable, str(CHILD), name, str(folder), engine, str(count), str(seed)]
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "POLARS_MAX_THREADS"), "1")
    quiet = os.environ | threads | {"PIVIDENT_DATA": "/nonexistent", "TMPDIR": str(folder / "tmp")}
    with (folder / "log").open("wb") as log:
        child = subprocess.Popen(arguments, stdout=log, stderr=log, env=quiet, cwd=folder)
        before, since = b"", time.monotonic()
        while child.poll() is None:
            time.sleep(0.5)
            state = (folder / "state").read_bytes()
            if state != before:
                before, since = state, time.monotonic()
            elif time.monotonic() - since > STUCK:
                child.kill()
                child.wait()
                return "hang"
    if child.returncode == 0:
        return ""
    tail = (folder / "log").read_bytes()[-3000:].decode(errors="replace")
    if "ALARM" in tail or child.returncode in (70, -14):
        return "hang"
    return f"crash (exit {child.returncode})"


def _keep_killer(name: str, folder: Path, how: str) -> None:
    """Keep the input that a child died of, with what it said at last."""
    file = folder / "input" / READERS[name].file
    data = file.read_bytes() if file.exists() else b""
    digest = hashlib.sha256(data).hexdigest()[:12]
    (folder / "findings").mkdir(exist_ok=True)
    kind = how.split()[0]
    (folder / "findings" / f"{kind}-{digest}").write_bytes(data)
    tail = (folder / "log").read_bytes()[-6000:].decode(errors="replace")
    (folder / "findings" / f"{kind}-{digest}.log").write_text(tail)
    entry = {"kind": kind, "text": f"{how}: {tail[-300:]}", "input": digest, "mark": f"{how}"}
    with (folder / "findings.jsonl").open("a") as lines:
        lines.write(json.dumps(entry) + "\n")


def _findings(folder: Path) -> dict[str, dict[str, str]]:
    """One finding of each mark."""
    file = folder / "findings.jsonl"
    lines = file.read_text().splitlines() if file.exists() else []
    return {entry["mark"]: entry for entry in map(json.loads, lines)}


def main() -> int:
    """Fuzz the chosen readers and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("readers", nargs="*", choices=[[], *READERS], default=[])
    parser.add_argument("--inputs", type=int, default=100_000)
    parser.add_argument("--engine", choices=["atheris", "plain"])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("benchmarks/results/fuzz"))
    parser.add_argument("--show", nargs=2, metavar=("READER", "FILE"))
    chosen = parser.parse_args()
    if chosen.show:
        name, data = chosen.show[0], Path(chosen.show[1]).read_bytes()
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / READERS[name].file
            file.write_bytes(data)
            print(READERS[name].read(file))
        return 0
    has_atheris = importlib.util.find_spec("atheris") is not None
    engine = chosen.engine or ("atheris" if has_atheris else "plain")
    chosen.out.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(chosen.workers) as pool:
        names = chosen.readers or list(READERS)
        rows = list(
            pool.map(lambda n: fuzz(n, chosen.inputs, engine, chosen.seed, chosen.out), names)
        )
    (chosen.out / "table.json").write_text(json.dumps({"engine": engine, "rows": rows}, indent=1))
    print(f"\nengine: {engine}")
    print(
        f"{'reader':<12}{'inputs':>9}{'answers':>9}{'refused':>9}{'findings':>9}{'slowest':>9}{'MB':>6}{'s':>7}"
    )
    for row in rows:
        print(
            f"{row['reader']:<12}{row['inputs']:>9}{row['answers']:>9}{row['refused']:>9}"
            f"{row['findings']:>9}{row['slowest_s']:>8}s{row['peak_mb']:>6}{row['seconds']:>7}"
        )
    return int(any(row["findings"] or row["inputs"] < chosen.inputs for row in rows))


if __name__ == "__main__":
    sys.exit(main())
