"""Speed and size of everything, with the peers run beside us: tables, JSON and plots.

    PIVIDENT_DATA=FOLDER python benchmarks/bench.py [--quick] [--repeats 7] [--parts rows,starts]

Parts: ``rows`` (the table beside Pinocchio, MuJoCo, FIGAROH, statsmodels and simdkalman),
``command`` (`pivident identify` with five folds, verdict and report over its estimators, and an
audit), ``samples`` (30,000 to 3 million), ``joints`` (arms of 2 to 12, a tree of 12),
``parameters``, ``threads``, ``workers`` (processes and a Dask cluster), ``starts`` (of processes,
cold and warm).
Works that are compared take turns in one process, medians count, and the load of the machine
stands with each table: above the number of cores, times on the clock say little, and processor
times beside them are what can be compared.
Results go to ``benchmarks/results/bench.json`` and PNG files beside it.

Peers that are not at hand are named with the reason. FIGAROH: ``pip install figaroh``. Pinocchio
in C++ needs a compiler and Eigen's headers (``CPPFLAGS=-I/usr/include/eigen3``).
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy is imported

import study_throughput
from speed import command, plots, rows, scaling, startup
from speed.report import RESULTS, machine, write_json
from speed.timing import load

from pivident.studies.many.study.scenario import load_scenario

PARTS = ("rows", "command", "joints", "starts", "threads", "workers", "parameters", "samples")


def main() -> None:
    """Run the parts asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--parts", default=",".join(PARTS))
    parser.add_argument(
        "--quick", action="store_true", help="300,000 samples at most, no compiling"
    )
    options = parser.parse_args()
    chosen = options.parts.split(",")
    if unknown := set(chosen) - set(PARTS):
        parser.error(f"no such part: {', '.join(sorted(unknown))}; parts are {', '.join(PARTS)}")
    here = machine()
    print(
        f"{here['processor']}, {here['cores']} cores, {here['memory_gib']:.1f} GiB, {here['date']}"
    )
    found: dict[str, object] = {}
    for part in PARTS:
        if part in chosen:
            print(f"\n{part}, load {load():.1f}", flush=True)
            found[part] = _RUN[part](options)
    path = write_json("bench", found)
    print(f"\nResults: {path}")


def _rows(options: argparse.Namespace) -> list[dict[str, object]]:
    print(f"{'work':74s} {'ours ms':>8s} {'cpu ms':>7s} {'asked':>9s}  peer")
    made = []
    for row in rows.all_rows(options.repeats):
        made.append(row)
        beside = row.peer
        if row.theirs:
            beside += f": {row.theirs.ms:.1f} ms, ratio {row.ratio:.2f}"
            beside += f", of processor times {row.work_ratio:.2f}"
        beside += f" ({row.note})" if row.note else ""
        print(
            f"{row.work:74.74s} {row.ours.ms:8.1f} {row.ours.cpu_ms:7.1f} {row.goal:>9s}  {beside}",
            flush=True,
        )
    plots.ratios(made, RESULTS)
    return [vars(r) | {"ratio": r.ratio, "work_ratio": r.work_ratio} for r in made]


def _command(options: argparse.Namespace) -> dict[str, object]:
    print(f"{'processor time of the command [s]':44s} {'methods':24s} {'estim.':>7s} {'folds':>6s} "
          f"{'files':>6s} {'ratio':>6s} asked")  # fmt: skip
    made = []
    for row in command.command_rows(min(options.repeats, 5)):
        made.append(vars(row) | {"ratio": row.ratio})
        print(
            f"{row.work:44s} {','.join(row.methods):24s} {row.estimators:7.2f} {row.judging:6.2f} "
            f"{row.writing:6.2f} {row.ratio:6.2f} <= {command.COMMAND_GOAL:g}",
            flush=True,
        )
    audit, seconds = command.audit_seconds(options.repeats)
    print(f"{audit}: processor time {seconds:.2f} s, asked <= {command.AUDIT_GOAL:g} s")
    return {"rows": made, "audit": seconds}


def _lengths(points: list[scaling.LengthPoint]) -> list[dict[str, object]]:
    print(f"{'samples':>9s} {'par.':>4s} {'threads':>7s} {'s':>7s} {'cpu s':>7s} {'iter.':>5s} "
          f"{'µs/sample/iter':>14s} {'peak MiB':>9s} {'before':>7s} {'record':>7s}")  # fmt: skip
    for p in points:
        print(
            f"{p.samples:9,d} {p.parameters:4d} {p.threads:7d} {p.seconds:7.2f} "
            f"{p.cpu_seconds:7.2f} {p.iterations:5d} {p.microseconds:14.2f} {p.peak_mib:9.0f} "
            f"{p.before_mib:7.0f} {p.raw_mib:7.1f}"
        )
    return [vars(p) | {"microseconds": p.microseconds} for p in points]


def _samples(options: argparse.Namespace) -> list[dict[str, object]]:
    if not options.quick:
        print(f"first touch of the memory: {scaling.touch_memory():.2f} s/GiB")
    points = scaling.over_samples(300_000 if options.quick else 3_000_000, threads=2)
    made = _lengths(points)
    for what, each in (
        ("clock", [p.seconds / p.samples for p in points]),
        ("processor time", [p.cpu_seconds / p.samples for p in points]),
    ):
        print(f"{what} per sample: {100 * (max(each) / min(each) - 1):.0f} % apart")
    plots.samples(points, RESULTS)
    return made


def _parameters(options: argparse.Namespace) -> list[dict[str, object]]:
    return _lengths(scaling.over_parameters())


def _threads(options: argparse.Namespace) -> list[dict[str, object]]:
    return _lengths(scaling.over_threads())


def _workers(options: argparse.Namespace) -> dict[str, dict]:
    scenario = load_scenario("fine").conditions[0]
    figures, alike = study_throughput.throughput(scenario, 16 if options.quick else 60, 2)
    study_throughput.print_table(figures)
    assert alike, "workers have computed different numbers"
    return figures


def _joints(options: argparse.Namespace) -> dict[str, object]:
    points = scaling.over_joints(options.repeats)
    print(f"{'joints':>6s} {'branches':>8s} {'columns':>7s} {'entries':>7s} "
          f"{'matrix µs':>9s} {'loop µs':>8s} {'base ms':>8s}")  # fmt: skip
    for p in points:
        print(f"{p.joints:6d} {p.branches:8d} {p.columns:7d} {p.entries:7d} "
              f"{p.matrix_us:9.3f} {p.simulation_us:8.2f} {p.base_ms:8.1f}")  # fmt: skip
    slopes = {
        what: scaling.exponent(points, what) for what in ("matrix_us", "simulation_us", "base_ms")
    }
    print("power of the joints (4 to 12): " + ", ".join(f"{k} {v:.2f}" for k, v in slopes.items()))
    plots.joints(points, RESULTS)
    return {"points": points, "powers": slopes}


def _starts(options: argparse.Namespace) -> list[startup.Start]:
    made = startup.all_starts(min(options.repeats, 5), not options.quick)
    for s in made:
        asked = f"<= {s.goal} s" if s.goal == s.goal else ""
        print(f"{s.what:52s} {s.seconds:7.2f} s, processor {s.cpu_seconds:7.2f} s {asked}")
    return made


_RUN = {
    "rows": _rows,
    "command": _command,
    "samples": _samples,
    "parameters": _parameters,
    "threads": _threads,
    "workers": _workers,
    "joints": _joints,
    "starts": _starts,
}


if __name__ == "__main__":
    main()
