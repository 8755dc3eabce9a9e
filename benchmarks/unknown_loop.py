"""What it costs not to know the loop: PIV on fresh simulated TX40 records.

    python benchmarks/unknown_loop.py [--runs 40] [--scenarios fine loop]

The same records four times: law and reference known, the law identified from the reference, the
reference reconstructed under the known law, and neither known.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from pathlib import Path

import numpy as np

from pivident.estimation.control_law.unknown_loop import reconstruct_loop
from pivident.estimation.identify import identify
from pivident.experiment import simulated_tx40 as scenarios


def variants(problem):
    """The problem with less and less known about its loop."""
    blind = [
        dataclasses.replace(r, q_ref=None, dq_ref=None, ddq_ref=None) for r in problem.recordings
    ]
    known = problem.loop.controller
    for name, recordings, law, reconstruct in (
        ("law identified", problem.recordings, None, False),
        ("reference reconstructed", blind, known, True),
        ("neither known", blind, None, True),
    ):
        made, loop = reconstruct_loop(problem.robot, recordings, law, reconstruct)
        yield name, dataclasses.replace(problem, recordings=made, loop=loop)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--scenarios", nargs="+", default=["fine", "loop"])
    options = parser.parse_args()
    results = {}
    for scenario in options.scenarios:
        found: dict[str, list] = {}
        for seed in range(options.runs):
            problem, truth = scenarios.tx40_scenario(scenario, seed)
            expected = np.array([truth[p.name] for p in problem.regressor.parameters])
            for name, own in (("both known", problem), *variants(problem)):
                result = identify(own, "piv")
                found.setdefault(name, []).append((result.theta, result.std, result.iterations))
        print(f"\nscenario {scenario}, {options.runs} records, PIV; all but the last in %")
        print(f"{'':26s} {'cover':>6s} {'median':>9s} {'bias':>7s} {'reported':>9s} {'iter':>5s}")
        for name, rows in found.items():
            theta, std, iterations = (np.array(x) for x in zip(*rows, strict=True))
            error = theta - expected
            figures = {
                "coverage": float(100 * np.mean(np.abs(error) < 2 * std)),
                "median_error": float(100 * np.median(np.abs(error / expected))),
                "worst_bias": float(100 * np.abs(error.mean(axis=0) / expected).max()),
                "reported": float(
                    100 * np.exp(np.mean(np.log(std.mean(axis=0) / np.abs(expected))))
                ),
                "iterations": int(iterations.max()),
            }
            results.setdefault(scenario, {})[name] = figures
            print(
                f"{name:26s} {figures['coverage']:6.1f} {figures['median_error']:9.5f} "
                f"{figures['worst_bias']:7.3f} {figures['reported']:9.5f} "
                f"{figures['iterations']:5d}"
            )
    target = Path(__file__).parent / "results"
    target.mkdir(exist_ok=True)
    (target / "unknown_loop.json").write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
