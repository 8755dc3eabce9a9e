"""Statistical truth: estimators on fresh simulated TX40 records whose parameters are known.

    python -m benchmarks.statistical_truth [--runs 40] [--first 0] [--scenarios fine loop]
        [--estimators NAME]

For each estimator, as it is by default: how often the truth lies within two standard errors (95.4 %
is right), the median relative error, the largest bias of a parameter, the reported standard error
beside that over the runs (geometric means over the parameters), the latter over the Cramér-Rao
bound of the scenario (`torque_bound`), iterations, and seconds per run.

LS and IV appear twice. With all samples kept and thinned as ``scipy.signal.decimate`` does, what
the zero-phase filters make up at the ends decides the estimate; pivident drops five periods.
``--reference`` takes the reference motion from an .npz file (arrays q_ref, dq_ref), so that
figures can be compared with others' on the same motion.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
from benchmarks.torque_bound import bound

from pivident.estimation.identify import identify
from pivident.estimation.instrumental_variables import InstrumentalVariables
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.methods import METHODS
from pivident.estimation.signal_recipes import Bandpass
from pivident.experiment import simulated_tx40 as scenarios
from pivident.foundation.errors import PividentError

ENDS_KEPT = Bandpass(decimation=(10, 10), convention="scipy", edge=0)

ESTIMATORS = {
    "IDIM-LS, ends kept": LeastSquares(signals=ENDS_KEPT),
    "IDIM-IV, ends kept": InstrumentalVariables(signals=ENDS_KEPT),
    "IDIM-LS": METHODS["ls"],
    "IDIM-IV": METHODS["iv"],
    "IDIM-IV at full rate": METHODS["iv-full-rate"],
    "IDIM-PIV as printed": METHODS["piv-as-printed"],
    "IDIM-PIV": METHODS["piv"],
    "DIDIM": METHODS["didim"],
    "CLOE": METHODS["cloe"],
    "CLIE": METHODS["clie"],
    "ML": METHODS["ml"],
}


def run_scenario(scenario: str, seeds: range, names: list[str]) -> dict[str, dict[str, float]]:
    """Figures of some estimators over the records of some seeds."""
    found: dict[str, list] = {name: [] for name in names}
    for seed in seeds:
        problem, truth = scenarios.tx40_scenario(scenario, seed)
        for name in names:
            started = time.perf_counter()
            try:
                result = identify(problem, ESTIMATORS[name])
            except PividentError:  # the loop cannot be simulated with the estimate
                continue
            found[name].append((result, time.perf_counter() - started))
    expected = np.array([truth[p.name] for p in problem.regressor.parameters])
    least = bound(scenario)[1]
    return {name: figures(own, expected, least) for name, own in found.items() if len(own) > 1}


def figures(results: list, truth: np.ndarray, least: np.ndarray) -> dict[str, float]:
    """Coverage, errors and standard errors of one estimator; ``least``: their bound."""
    theta = np.array([r.theta for r, _ in results])
    std = np.array([r.method_std for r, _ in results])
    robust = np.array([r.robust_std for r, _ in results])
    error = theta - truth
    spread = theta.std(axis=0, ddof=1)

    def geometric(values: np.ndarray) -> float:
        return float(100 * np.exp(np.mean(np.log(values / np.abs(truth)))))

    return {
        "coverage": float(100 * np.mean(np.abs(error) < 2 * std)),
        "robust_coverage": float(100 * np.mean(np.abs(error) < 2 * robust)),
        "median_error": float(100 * np.median(np.abs(error / truth))),
        "worst_bias": float(100 * np.abs(error.mean(axis=0) / truth).max()),
        "reported_std": geometric(std.mean(axis=0)),
        "robust_std": geometric(robust.mean(axis=0)),
        "monte_carlo_std": geometric(spread),
        "over_bound": float(np.exp(np.mean(np.log(spread / least)))),
        "iterations": max(r.iterations for r, _ in results),
        "converged": sum(r.converged for r, _ in results),
        "seconds": float(np.median([s for _, s in results])),
    }


def print_table(scenario: str, runs: int, rows: dict[str, dict[str, float]]) -> None:
    print(f"\nscenario {scenario}, {runs} records of 6.9 s, 28 parameters; but three in %")
    print(
        f"{'estimator':30s} {'cover':>6s} {'robust':>6s} {'median':>8s} {'bias':>7s} "
        f"{'reported':>8s} {'robust':>8s} {'spread':>8s} {'/ bound':>8s} {'iter':>4s} {'s':>5s}"
    )
    for name, f in rows.items():
        print(
            f"{name:30s} {f['coverage']:6.1f} {f['robust_coverage']:6.1f} {f['median_error']:8.5f} "
            f"{f['worst_bias']:7.3f} {f['reported_std']:8.5f} {f['robust_std']:8.5f} "
            f"{f['monte_carlo_std']:8.5f} {f['over_bound']:8.3g} {f['iterations']:4d} "
            f"{f['seconds']:5.2f}"
            + ("" if f["converged"] == runs else f"  {f['converged']} converged")
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--scenarios", nargs="+", default=list(scenarios.NOISES))
    parser.add_argument("--estimators", nargs="+", default=list(ESTIMATORS))
    parser.add_argument("--reference", type=Path)
    options = parser.parse_args()
    if options.reference:
        data = np.load(options.reference)
        motion = data["q_ref"], data["dq_ref"], np.gradient(data["dq_ref"], 2e-4, axis=0)
        scenarios.tx40_reference = lambda samples: tuple(x[:samples] for x in motion)
    seeds = range(options.first, options.first + options.runs)
    results = {}
    for scenario in options.scenarios:
        results[scenario] = run_scenario(scenario, seeds, options.estimators)
        print_table(scenario, options.runs, results[scenario])
    target = Path(__file__).parent / "results"
    target.mkdir(exist_ok=True)
    name = "statistical_truth_reference.json" if options.reference else "statistical_truth.json"
    (target / name).write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
