"""A soak: mixed work in one process for as long as asked; memory flat, results the same.

    PIVIDENT_DATA=FOLDER python benchmarks/soak.py [--seconds 3600] [--samples 20000]

A round simulates records, identifies them with least squares, IV and PIV, tries friction laws, and
writes a report. The inputs of every round are the same, so its results must be too, to the last
bit, in the first round and in the last. Resident memory is read after each round. Caches fill in
the first rounds and the allocator breathes; so the slope is that of a line through the second half
of the rounds, with its deviation, and it fails where growth is more than the deviation explains and
more than ``--growth`` MiB an hour.

Exit code 1: memory grows or results differ. Figures go to ``benchmarks/results/soak.json``.
"""

from __future__ import annotations

import argparse
import gc
import hashlib
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from speed.report import write_json
from speed.timing import load
from speed.workloads import simulated_record, whole_job

import pivident as pv
from pivident.experiment import simulated_tx40 as scenarios
from pivident.loop.simulation.simulated_record import Noise
from pivident.robot.friction import FrictionLaw, coulomb, offset, stribeck, viscous

#: Fewest rounds whose memory makes a slope.
MIN_ROUNDS = 6


@dataclass(frozen=True)
class Round:
    """One round.

    Attributes:
        seconds: since the start [s].
        memory_mib: resident memory after it [MiB].
        prints: fingerprint of each work's result.
    """

    seconds: float
    memory_mib: float
    prints: dict[str, str]


def works(samples: int) -> dict[str, Callable[[], np.ndarray]]:
    """What a round does, by name: each returns the numbers that must not change."""
    problem = simulated_record(samples)
    law = FrictionLaw((viscous(), coulomb(), stribeck(0.05, 2.0), offset()))
    other = pv.Problem(
        problem.robot.with_friction(law), problem.recordings, problem.loop, initial=problem.initial
    )

    def estimates(method: str, of: pv.Problem = problem) -> Callable[[], np.ndarray]:
        def work() -> np.ndarray:
            found = pv.identify(of, method)
            return np.r_[found.theta, np.diag(found.robust_covariance)]

        return work

    def report() -> np.ndarray:
        results = [pv.identify(problem, method) for method in ("ls", "iv-full-rate")]
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "report.html"
            pv.write_report(results, path)
            return np.array([path.stat().st_size > 10_000], dtype=float)

    def simulation() -> np.ndarray:
        return scenarios.simulate_tx40(Noise(), 3, samples).q[-100:]

    made = {
        "simulation": simulation,
        "ls": estimates("ls"),
        "iv": estimates("iv"),
        "iv-full-rate": estimates("iv-full-rate"),
        "piv": estimates("piv"),
        "ls with another friction law": estimates("ls", other),
        "report": report,
    }
    label, real = whole_job()
    if label.startswith("TX40 record"):
        made["piv of the TX40 record"] = estimates("piv", real)
    return made


def resident() -> float:
    """Resident memory of this process [MiB]."""
    import psutil

    return psutil.Process().memory_info().rss / 2**20


def soak(seconds: float, samples: int) -> list[Round]:
    """Rounds until the time is over, two at least."""
    chosen = works(samples)
    started, rounds = time.monotonic(), []
    while len(rounds) < 2 or time.monotonic() - started < seconds:
        prints = {name: _print(work()) for name, work in chosen.items()}
        gc.collect()
        rounds.append(Round(time.monotonic() - started, resident(), prints))
        last = rounds[-1]
        print(f"round {len(rounds)}: {last.seconds:.0f} s, {last.memory_mib:.0f} MiB", flush=True)
    return rounds


def _print(numbers: np.ndarray) -> str:
    return hashlib.sha256(np.ascontiguousarray(numbers, dtype=float).tobytes()).hexdigest()[:16]


def slope(rounds: list[Round]) -> tuple[float, float]:
    """Growth of the memory in the second half and its deviation [MiB/h]; NaN: too few rounds."""
    half = rounds[len(rounds) // 2 :]
    if len(half) < MIN_ROUNDS // 2:
        return float("nan"), float("nan")
    t = np.array([r.seconds for r in half]) / 3600.0
    m = np.array([r.memory_mib for r in half])
    design = np.column_stack([t - t.mean(), np.ones_like(t)])
    found, *_ = np.linalg.lstsq(design, m, rcond=None)
    rest = m - design @ found
    spread = np.sqrt(rest @ rest / max(len(m) - 2, 1) / ((t - t.mean()) @ (t - t.mean())))
    return float(found[0]), float(spread)


def main() -> int:
    """Soak, judge, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--samples", type=int, default=20_000)
    parser.add_argument("--growth", type=float, default=20.0, help="allowed [MiB/h]")
    options = parser.parse_args()
    rounds = soak(options.seconds, options.samples)
    changed = [n for n, p in rounds[0].prints.items() if any(r.prints[n] != p for r in rounds)]
    growth, spread = slope(rounds)
    grows = growth - 2.0 * spread > options.growth
    print(f"{len(rounds)} rounds, load {load():.1f}")
    print(f"results that changed: {', '.join(changed) or 'none'}")
    print(f"memory: {growth:+.1f} ± {2 * spread:.1f} MiB/h (2σ) in the second half of the rounds")
    write_json(
        "soak",
        {
            "rounds": [asdict(r) for r in rounds],
            "growth_mib_per_hour": growth,
            "deviation": spread,
            "changed": changed,
        },
    )
    return int(bool(changed) or grows)


if __name__ == "__main__":
    sys.exit(main())
