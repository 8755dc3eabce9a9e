"""A fleet of simulated TX40 on two workers: throughput, kills, and a planted wear that is found.

    python benchmarks/fleet.py [--robots 200] [--records 3] [--seconds 10] [--rate 1000]

Every robot has parameters of its own (inertias 2 %, friction 10 % about the nominal ones), and is
recorded on some days at temperatures of 30 ± 5 °C. Viscous friction falls by 1 % per kelvin, and
all friction scatters by 0.5 % from record to record. In five robots friction has risen by 10 % on
the last day.

Ideal throughput is that of two processes that do nothing but identify logs, warm, at the same time,
one thread each: so both cores are as busy as with the fleet. It is measured before and after. The
throughput of the fleet is that between its first and its last finished log, as it is told; with all
that comes before and after (reading hashes, starting workers, loading compiled code, judging, page)
it is given beside that. Where other programs share the cores, processor seconds tell more:
``cpu_efficiency`` is what identifying alone takes over what parent and workers take, their start
included. The robots of ``--killed`` are done again with the process killed twice on its way, and
must give the same rows bit for bit.
"""

from __future__ import annotations

import argparse
import json
import os
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "PIVIDENT_THREADS"):
    os.environ[_name] = "1"

import numpy as np  # noqa: E402
import psutil  # noqa: E402

WORKERS, PLANTED, RISE = 2, 5, 0.10
WARMTH, SCATTER, OWN_INERTIA, OWN_FRICTION = -0.01, 0.005, 0.02, 0.1

TEMPLATE = """
robot = "staubli_tx40"

[recording]
columns = {{q = "q", q_ref = "q_ref", dq_ref = "dq_ref", tau = "tau"}}
rate = {rate}
torque_timing = "held"

[controller]
type = "pd"
kp = {kp}
kd = {kd}

[identify]
parameters = {parameters}

[fleet]
pattern = "{{robot}}/{{day}}.npz"
method = "piv"
temperature = "celsius"
baseline_records = {baseline}
level = 0.05
"""


def bench_of(rate: float, seconds: float):
    from pivident.studies.many.study.bench import Bench
    from pivident.studies.many.study.scenario import load_scenario

    tables = {"record": {"rate": rate}, "trajectory": {"duration": seconds}}
    return Bench(load_scenario("fine").changed(**tables))


_benches: dict = {}


def write_robot(folder: str, number: int, records: int, rate: float, seconds: float, worn: bool):
    """All logs of one robot."""
    if (rate, seconds) not in _benches:
        _benches[rate, seconds] = bench_of(rate, seconds)
    bench = _benches[rate, seconds]
    heads, nominal = bench.heads, bench.true_values
    friction = np.array([p.friction is not None or p.stem in ("fvm", "fcm") for p in heads])
    viscous = np.array([p.stem in ("fv", "fvm") for p in heads])
    rng = np.random.default_rng(number)
    own = np.where(friction, OWN_FRICTION, OWN_INERTIA) * rng.standard_normal(len(heads))
    q_ref, dq_ref, _ = bench.reference
    for record in range(records):
        theta = nominal * (1.0 + own)
        celsius = 30.0 + 5.0 * rng.standard_normal()
        theta[friction] *= 1.0 + SCATTER * rng.standard_normal(friction.sum())
        theta[viscous] *= 1.0 + WARMTH * (celsius - 30.0)
        if worn and record == records - 1:
            theta[friction] *= 1.0 + RISE
        seed = (number * 1000 + record, 7)
        added = bench.noise.in_loop(seed, q_ref.shape)
        made = bench.simulated(heads, theta, bench.reference, added)
        place = Path(folder) / f"arm_{number:03d}"
        place.mkdir(parents=True, exist_ok=True)
        np.savez(
            place / f"2026-{record + 1:02d}-15.npz",
            q=made.q + added,
            tau=made.tau + bench.noise.of_torque(seed, made.tau.shape),
            q_ref=q_ref,
            dq_ref=dq_ref,
            celsius=celsius + 0.2 * rng.standard_normal(len(q_ref)),
        )


def write_logs(folder: Path, options: argparse.Namespace) -> set[str]:
    """Logs of all robots and the template; names of the worn ones."""
    rng = np.random.default_rng(1)
    worn = set(rng.choice(options.robots, min(PLANTED, options.robots), replace=False).tolist())
    with ProcessPoolExecutor(WORKERS, get_context("spawn")) as pool:
        jobs = [
            pool.submit(
                write_robot,
                str(folder),
                k,
                options.records,
                options.rate,
                options.seconds,
                k in worn,
            )
            for k in range(options.robots)
        ]
        for job in jobs:
            job.result()
    bench = bench_of(options.rate, options.seconds)
    controller = bench.scenario.content.controller
    text = TEMPLATE.format(
        rate=options.rate,
        kp=list(controller.kp),
        kd=list(controller.kd),
        parameters=json.dumps([p.name for p in bench.heads]),
        baseline=max(2, options.records - 1),
    )
    (folder / "fleet.toml").write_text(text, encoding="utf-8")
    return {f"arm_{k:03d}" for k in worn}


def busy(folder: str, first: int, count: int, barrier: str) -> tuple[float, float]:
    """Seconds and processor seconds of one process for so many logs, warm."""
    from pivident.studies.many.fleet.identify_fleet import Task, identify_log, template_of
    from pivident.studies.many.fleet.logs import find_logs

    template = template_of(Path(folder))
    logs, _ = find_logs(Path(folder), template.pattern)
    task = Task.of(template)
    mine = [logs[(first + k) % len(logs)] for k in range(count + 3)]
    for log in mine[:3]:
        identify_log(task, log)
    (Path(barrier) / secrets.token_hex(4)).touch()
    while len(os.listdir(barrier)) < WORKERS:  # both begin at once
        time.sleep(0.005)
    begin, cpu = time.perf_counter(), time.process_time()
    for log in mine[3:]:
        rows = identify_log(task, log)
        assert "error" not in rows[0], rows[0]
    return time.perf_counter() - begin, time.process_time() - cpu


def ideal(folder: Path, count: int) -> tuple[float, float]:
    """Logs per second of two busy processes, and processor seconds of one log."""
    with tempfile.TemporaryDirectory() as barrier:
        with ProcessPoolExecutor(WORKERS, get_context("spawn")) as pool:
            jobs = [pool.submit(busy, str(folder), 11 * k, count, barrier) for k in range(WORKERS)]
            found = [job.result() for job in jobs]
    return sum(count / s for s, _ in found), sum(cpu for _, cpu in found) / (WORKERS * count)


class Watch:
    """Progress lines with their times, and the memory of this process and its workers."""

    def __init__(self) -> None:
        self.done: list[tuple[float, int]] = []
        self.memory: list[float] = []
        self.cpu = 0.0
        self._begin = sum(psutil.Process().cpu_times()[:2])
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._sample, daemon=True)
        self._thread.start()

    def __call__(self, line: str) -> None:
        """A line of progress."""
        words = line.split()
        if "of" in words and words[words.index("of") - 1].isdigit():
            self.done.append((time.perf_counter(), int(words[words.index("of") - 1])))
            print(f"  {line}", flush=True)

    def _sample(self) -> None:
        here = psutil.Process()
        while not self._stop.wait(0.5):
            total, seconds = 0, 0.0
            for process in (here, *here.children(recursive=True)):
                try:
                    total += process.memory_info().rss
                    seconds += sum(process.cpu_times()[:2])
                except psutil.NoSuchProcess:
                    continue
            self.memory.append(total / 1e6)
            self.cpu = max(self.cpu, seconds - self._begin)

    def end(self) -> None:
        """No more samples of the memory."""
        self._stop.set()
        self._thread.join()

    def throughput(self) -> float:
        """Logs per second between the first line with a finished log and the last one."""
        (begin, first), *_ = [(t, n) for t, n in self.done if n > 0]
        end, last = self.done[-1]
        return (last - first) / (end - begin)


def killed(folder: Path, out: Path, kills: int) -> int:
    """The command, killed so often on its way, until it ends by itself; kills that hit it."""
    command = [
        sys.executable, "-m", "pivident", "fleet", str(folder), "--out", str(out),
        "--workers", str(WORKERS),
    ]  # fmt: skip
    hit, rng = 0, np.random.default_rng(5)
    environment = os.environ | {"PIVIDENT_THREADS": str(WORKERS)}
    for attempt in range(kills + 1):
        before = len(list(out.glob("logs/*.parquet")))
        process = subprocess.Popen(
            command, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            env=environment,
        )  # fmt: skip
        if attempt < kills:
            while len(list(out.glob("logs/*.parquet"))) <= before and process.poll() is None:
                time.sleep(0.02)
            time.sleep(float(rng.uniform(0.0, 3.0)))
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                hit += 1
        process.wait()
    assert process.returncode == 0, f"the resumed fleet ended with {process.returncode}"
    return hit


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", type=int, default=200)
    parser.add_argument("--records", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--rate", type=float, default=1000.0)
    parser.add_argument("--killed", type=int, default=20, help="robots of the part with kills")
    parser.add_argument("--ideal", type=int, default=40, help="logs of each process for the ideal")
    parser.add_argument("--folder", type=Path, default=None, help="keep logs and results here")
    options = parser.parse_args()
    place = options.folder or Path(tempfile.mkdtemp(prefix="fleet-"))
    logs = place / "fleet"
    try:
        report(place, logs, options)
    finally:
        if options.folder is None:
            shutil.rmtree(place, ignore_errors=True)


def report(place: Path, logs: Path, options: argparse.Namespace) -> None:
    import polars as pl

    from pivident.studies.many.batch.runner import Processes
    from pivident.studies.many.fleet.conclusion import conclude_fleet
    from pivident.studies.many.fleet.identify_fleet import identify_fleet

    begin = time.perf_counter()
    worn = write_logs(logs, options)
    count = options.robots * options.records
    print(f"{count} logs written in {time.perf_counter() - begin:.0f} s; worn: {sorted(worn)}")
    load = os.getloadavg()[0]
    before, cpu = ideal(logs, options.ideal)
    watch, begin = Watch(), time.perf_counter()
    fleet = identify_fleet(logs, out=place / "out", pool=Processes(WORKERS), say=watch)
    judged = time.perf_counter()
    watch.end()
    judgement = conclude_fleet(fleet)
    end = time.perf_counter()
    after, cpu_after = ideal(logs, options.ideal)
    best = 0.5 * (before + after)
    alarmed = {alarm.robot for alarm in judgement.alarms}

    part = place / "part"
    names = sorted(p.name for p in logs.iterdir() if p.is_dir())[: options.killed]
    for file in [logs / "fleet.toml", *(f for n in names for f in (logs / n).iterdir())]:
        target = part / file.relative_to(logs)
        target.parent.mkdir(parents=True, exist_ok=True)
        os.link(file, target)
    kills = killed(part, place / "killed", 2)
    columns = ["robot", "day", "parameter", "value", "std", "sha256", "error"]
    resumed = pl.read_parquet(place / "killed" / "parameters.parquet").select(columns)
    whole = pl.read_parquet(place / "out" / "parameters.parquet").select(columns)
    alike = resumed.equals(whole.filter(pl.col("robot").is_in(names)))
    shards = pl.concat([pl.read_parquet(f) for f in (place / "killed" / "logs").glob("*.parquet")])
    once = shards.select("task", "parameter").is_unique().all()

    quarter = len(watch.memory) // 4
    figures = {
        "robots": options.robots,
        "logs": count,
        "rate_hz": options.rate,
        "seconds": options.seconds,
        "load_before": load,
        "ideal_before_per_s": before,
        "ideal_after_per_s": after,
        "fleet_per_s": watch.throughput(),
        "efficiency": watch.throughput() / best,
        "whole_per_s": count / (judged - begin),
        "whole_efficiency": count / (judged - begin) / best,
        "ideal_cpu_s_per_log": 0.5 * (cpu + cpu_after),
        "fleet_cpu_s_per_log": watch.cpu / count,
        "cpu_efficiency": 0.5 * (cpu + cpu_after) * count / watch.cpu,
        "judging_s": end - judged,
        "memory_quarter_mb": max(watch.memory[: quarter + 1], default=0.0),
        "memory_end_mb": max(watch.memory[quarter:], default=0.0),
        "failed": len(fleet.failures),
        "worn": sorted(worn),
        "worn_found": sorted(worn & alarmed),
        "false_alarms": sorted(alarmed - worn),
        "tests": judgement.tests,
        "limit": judgement.charts[0].limit,
        "kills": kills,
        "resumed_alike": alike,
        "every_log_once": bool(once),
    }
    for name, value in figures.items():
        print(f"{name:22s} {value:.4g}" if isinstance(value, float) else f"{name:22s} {value}")
    target = Path(__file__).parent / "results"
    target.mkdir(exist_ok=True)
    (target / "fleet.json").write_text(json.dumps(figures, indent=1))
    assert alike and once, "the resumed fleet differs from the one that was not killed"


if __name__ == "__main__":
    main()
