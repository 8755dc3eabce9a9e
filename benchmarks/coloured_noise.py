"""Coloured encoder noise: PIV and full-rate IV with a smoother that knows the lines, and without.

    python benchmarks/coloured_noise.py [--runs 20] [--frequencies 100 200 600] [--radius 0.998]

Records are the scenario *coloured* of ``experiment.simulated_tx40`` (AR(2) noise of 3e-6 rad in the
loop beside the white one, applied torque logged), its peak moved to each of the frequencies [Hz].
For each method and smoother: how often the truth lies within two reported deviations (95.4 % is
right), the median relative error, reported and Monte Carlo deviation (geometric means over the
parameters), half-power frequency of the smoother (median joint), seconds per run. Below each
frequency: variance with lines over variance without, and PIV's over that of full-rate IV.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.experiment import simulated_tx40 as scenarios

NAMES = ("iv-full-rate", "piv")
SMOOTHERS = ("white", "auto")


def run(frequency: float, radius: float, runs: int) -> dict[str, dict[str, float]]:
    """Figures of each method with each smoother over so many records."""
    name = f"coloured-{frequency:g}"
    noise = scenarios.Noise(torque=0.0, coloured=3e-6, frequency=frequency, radius=radius)
    scenarios.NOISES[name] = noise
    found: dict[str, list] = {f"{m} {s}": [] for m in NAMES for s in SMOOTHERS}
    for seed in range(runs):
        problem, truth = scenarios.tx40_scenario(name, seed)
        for key, results in found.items():
            method, smoother = key.split()
            ready = METHODS[method]
            ready = replace(ready, signals=replace(ready.signals, measurement_noise=smoother))
            started = time.perf_counter()
            results.append((identify(problem, ready), time.perf_counter() - started))
    expected = np.array([truth[p.name] for p in problem.regressor.parameters])
    return {key: figures(results, expected) for key, results in found.items()}


def figures(results: list, truth: np.ndarray) -> dict[str, float]:
    """Coverage, errors and deviations of one method."""
    theta = np.array([r.theta for r, _ in results])
    std = np.array([r.method_std for r, _ in results])
    robust = np.array([r.robust_std for r, _ in results])
    error = theta - truth
    return {
        "coverage": float(100 * np.mean(np.abs(error) < 2 * std)),
        "robust_coverage": float(100 * np.mean(np.abs(error) < 2 * robust)),
        "median_error": float(100 * np.median(np.abs(error / truth))),
        "reported_std": geometric(std.mean(axis=0) / np.abs(truth)),
        "monte_carlo_std": geometric(theta.std(axis=0, ddof=1) / np.abs(truth)),
        "f50": float(np.median([[j.f50 for j in r.joints] for r, _ in results])),
        "seconds": float(np.median([s for _, s in results])),
        "converged": all(r.converged for r, _ in results),
    }


def geometric(values: np.ndarray) -> float:
    """Geometric mean in per cent."""
    return float(100 * np.exp(np.mean(np.log(values))))


def variance_ratio(rows: dict[str, dict[str, float]], one: str, other: str) -> float:
    """Monte Carlo variance of one method over another's."""
    return (rows[one]["monte_carlo_std"] / rows[other]["monte_carlo_std"]) ** 2


def print_table(frequency: float, runs: int, rows: dict[str, dict[str, float]]) -> None:
    print(f"\nline at {frequency:g} Hz, {runs} records; in %")
    print(
        f"{'method and smoother':20s} {'cover':>6s} {'robust':>6s} {'median':>8s} "
        f"{'reported':>8s} {'spread':>8s} {'f50 Hz':>7s} {'s':>5s}"
    )
    for key, f in rows.items():
        print(
            f"{key:20s} {f['coverage']:6.1f} {f['robust_coverage']:6.1f} {f['median_error']:8.5f} "
            f"{f['reported_std']:8.5f} {f['monte_carlo_std']:8.5f} {f['f50']:7.0f} "
            f"{f['seconds']:5.2f}" + ("" if f["converged"] else "  not all converged")
        )
    for name in NAMES:
        ratio = variance_ratio(rows, f"{name} auto", f"{name} white")
        print(f"variance of {name} with lines over without: {ratio:.3g}")
    ratio = variance_ratio(rows, "piv auto", "iv-full-rate auto")
    print(f"variance of piv over iv-full-rate, both with lines: {ratio:.3g}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--frequencies", type=float, nargs="+", default=[100.0, 200.0, 600.0])
    parser.add_argument("--radius", type=float, default=0.998)
    options = parser.parse_args()
    results = {}
    for frequency in options.frequencies:
        rows = run(frequency, options.radius, options.runs)
        print_table(frequency, options.runs, rows)
        results[f"{frequency:g} Hz, radius {options.radius:g}"] = rows
    target = Path(__file__).parent / "results"
    target.mkdir(exist_ok=True)
    (target / "coloured_noise.json").write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
