"""Statistical truth of the linear estimators on published benchmark systems.

    python -m benchmarks.linear_truth [--runs 100] [--systems RG CAP ...]

For every system and estimator: bias of the mean in its own deviations, the deviation over the
runs beside the bound (C4) at the true parameters, the reported deviation beside both, failures
and the time per run. Under coloured noise SRIVC is listed for comparison and not judged: it is
consistent, not efficient, and its formula assumes white noise. Last, how often the order search
finds the published orders of the Rao-Garnier system.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from tests.linear import published_systems
from tests.linear.published_systems import Benchmark
from tests.linear.two_impulses import TWO_IMPULSES, DiscreteBenchmark

from pivident.foundation.errors import IdentificationError
from pivident.linear.arx import arx
from pivident.linear.estimate import LinearEstimate
from pivident.linear.order_selection import select_orders
from pivident.linear.sriv import riv, sriv
from pivident.linear.srivc import rivc, srivc

#: Bias of the mean and ratio of the deviation to its bound that are accepted.
BIAS = 4.0
RATIO = (0.75, 1.35)

Estimator = Callable[..., LinearEstimate]

AnyBenchmark = Benchmark | DiscreteBenchmark

#: System, estimator's name, estimator, whether it is judged.
CASES: tuple[tuple[AnyBenchmark, str, Estimator, bool], ...] = (
    (published_systems.RAO_GARNIER, "SRIVC", srivc, True),
    (published_systems.RAO_GARNIER, "RIVC, AR by AIC", rivc, True),
    (published_systems.DELAYED_LAG, "SRIVC", srivc, True),
    (published_systems.NON_MINIMUM_PHASE, "SRIVC", srivc, True),
    (published_systems.CLOSED_LOOP, "CLSRIVC", srivc, True),
    (published_systems.RIVBJ, "SRIVC", srivc, False),
    (published_systems.RIVBJ, "RIVC, AR by AIC", rivc, True),
    (published_systems.RIVBJ, "RIVC, ARMA(2, 1)", partial(rivc, noise_order=(2, 1)), True),
    (published_systems.COLOURED, "SRIVC", srivc, False),
    (published_systems.COLOURED, "RIVC, AR by AIC", rivc, True),
    (published_systems.COLOURED, "RIVC, ARMA(2, 1)", partial(rivc, noise_order=(2, 1)), True),
    (TWO_IMPULSES, "ARX", arx, False),
    (TWO_IMPULSES, "SRIV", sriv, False),
    (TWO_IMPULSES, "RIV, AR by AIC", riv, True),
    (TWO_IMPULSES, "RIV, AR(2)", partial(riv, noise_order=(2, 0)), True),
)

#: Runs of the discrete-time system for each of the others: it takes a millisecond.
DISCRETE_RUNS = 10


def run_case(system: AnyBenchmark, estimator: Estimator, runs: int) -> dict:
    """Figures of one estimator on one system."""
    found, seconds, failures = [], [], []
    for seed in range(runs):
        record = system.record(seed)
        started = time.perf_counter()
        try:
            model = estimator(
                record.u,
                record.y,
                system.dt,
                *system.orders,
                delay=system.delay,
                **({} if record.external is None else {"external": record.external}),
            )
        except IdentificationError as error:
            failures.append(f"seed {seed}: {error}")
            continue
        seconds.append(time.perf_counter() - started)
        if model.converged:
            found.append(model)
        else:
            failures.append(f"seed {seed}: not converged")
    theta = np.array([model.theta for model in found])
    spread, bound = theta.std(axis=0, ddof=1), system.bound()
    return {
        "names": found[0].names,
        "true": system.theta.tolist(),
        "mean": theta.mean(axis=0).tolist(),
        "spread": spread.tolist(),
        "bound": bound.tolist(),
        "reported": np.mean([model.std for model in found], axis=0).tolist(),
        "bias": ((theta.mean(axis=0) - system.theta) / spread * np.sqrt(len(found))).tolist(),
        "ratio": (spread / bound).tolist(),
        "failures": failures,
        "iterations": max(model.iterations for model in found),
        "milliseconds": 1e3 * float(np.median(seconds)),
    }


def passes(figures: dict) -> bool:
    bias, ratio = np.abs(figures["bias"]), np.array(figures["ratio"])
    good = bias.max() < BIAS and ratio.min() >= RATIO[0] and ratio.max() <= RATIO[1]
    return bool(good) and not figures["failures"]


def print_case(system: AnyBenchmark, name: str, figures: dict, judged: bool) -> None:
    verdict = ("passes" if passes(figures) else "FAILS") if judged else "for comparison"
    print(
        f"\n{system.name} {name}: {verdict}; {len(figures['failures'])} failures, "
        f"at most {figures['iterations']} iterations, {figures['milliseconds']:.0f} ms"
    )
    print(f"  {'':3s} {'true':>10s} {'mean':>10s} {'std':>9s} {'bound':>9s} {'reported':>9s} bias")
    columns = ("names", "true", "mean", "spread", "bound", "reported", "bias")
    for n, true, mean, std, bound, said, z in zip(*(figures[c] for c in columns), strict=True):
        print(f"  {n:3s} {true:10.5g} {mean:10.5g} {std:9.4g} {bound:9.4g} {said:9.4g} {z:+5.1f}")
    for failure in figures["failures"]:
        print("  ", failure)


def order_search(runs: int, samples: int) -> float:
    """Part of the runs in which [2 4] is chosen on the Rao-Garnier system."""
    system, hits = published_systems.RAO_GARNIER, 0
    for seed in range(runs):
        record = system.record(seed)
        table = select_orders(record.u[:samples], record.y[:samples], system.dt, (0, 1), (3, 4, 5))
        hits += (table.rows[0].numerator_order, table.rows[0].denominator_order) == (1, 4)
    return hits / runs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--systems", nargs="+")
    options = parser.parse_args()
    results: dict[str, dict] = {}
    for system, name, estimator, judged in CASES:
        if options.systems and system.name not in options.systems:
            continue
        times = DISCRETE_RUNS if system is TWO_IMPULSES else 1
        figures = run_case(system, estimator, times * options.runs)
        print_case(system, name, figures, judged)
        results[f"{system.name} {name}"] = figures
    if not options.systems or "RG" in options.systems:
        for samples in (1000, published_systems.RAO_GARNIER.samples):
            part = order_search(options.runs, samples)
            print(
                f"\nRG order search on {samples} samples: [2 4] in {100 * part:.0f} % of the runs"
            )
            results[f"RG orders {samples}"] = {"found": part}
    target = Path(__file__).parent / "results"
    target.mkdir(exist_ok=True)
    (target / "linear_truth.json").write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
