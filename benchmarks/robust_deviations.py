"""Robust deviations of IV at full rate beside Monte Carlo, on simulated TX40 records.

    python -m benchmarks.robust_deviations [--runs 30] [--scenarios fine loop coloured coarse]
                                           [--masks 0 0.03]

A sandwich adds up all of the residual, the part that repeats from run to run (standstill, where
the friction law is steep; a coarse encoder) as well as the part that is new in each. The first
makes bias, the second spread. So the deviations are set beside both: the spread of the estimates,
and their root mean square distance from the truth. ``new part`` is what the windows give for the
scores less their mean over the runs; it shows whether the windows themselves are right. All are
geometric means over the parameters. ``--masks`` are shares of the rated speed below which a
joint's samples do not vote.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np
from benchmarks.score_covariances import (
    Scores,
    long_run_sum,
    newey_west,
    scores_of,
    window_lags,
)

from pivident.estimation.identify import identify
from pivident.experiment.simulated_tx40 import tx40_scenario

COLUMNS = ("formula", "White", "Newey-West", "smooth", "windows")


def deviations(scores: Scores, identification) -> np.ndarray:
    """Standard deviations by each covariance, shape (covariances, parameters)."""
    lags = window_lags(scores)
    smooth = scores.covariance(long_run_sum(scores.records, lags + 1, "raised cosine"))
    white = scores.covariance(scores.white)
    return np.sqrt(
        [
            np.diag(identification.formula_covariance),
            np.diag(white),
            np.diag(newey_west(scores, lags)),
            np.diag(smooth),
            np.diag(identification.robust_covariance),
        ]
    )


def run(scenario: str, mask: float, runs: int) -> dict[str, np.ndarray | float]:
    """Figures of one scenario."""
    theta, found, kept = [], [], []
    for seed in range(runs):
        problem, truth = tx40_scenario(scenario, seed)
        result = identify(replace(problem, mask=mask), "iv-full-rate")
        scores = scores_of(result)
        theta.append(result.theta)
        found.append(deviations(scores, result))
        kept.append(scores)
    expected = np.array([truth[p.name] for p in problem.regressor.parameters])
    error = np.array(theta) - expected
    spread, distance = error.std(axis=0, ddof=1), np.sqrt(np.mean(error**2, axis=0))
    mean = np.mean([s.records[0] for s in kept], axis=0)
    new = np.mean(
        [
            np.diag(
                s.covariance(
                    long_run_sum([s.records[0] - mean], window_lags(s) + 1, "raised cosine")
                )
            )
            for s in kept
        ],
        axis=0,
    )
    average = np.mean(found, axis=0)
    return {
        "spread": geometric(average / spread),
        "distance": geometric(average / distance),
        "new": float(geometric(np.sqrt(new * runs / (runs - 1)) / spread)),
        "coverage": float(100 * np.mean(np.abs(error) < 2 * np.array(found)[:, -1])),
        "error": float(100 * np.median(np.abs(error / expected))),
    }


def geometric(ratios: np.ndarray) -> np.ndarray:
    """Geometric mean over the parameters, the last axis."""
    return np.exp(np.mean(np.log(ratios), axis=-1))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--scenarios", nargs="+", default=["fine", "loop", "coloured", "coarse"])
    parser.add_argument("--masks", nargs="+", type=float, default=[0.0, 0.03])
    arguments = parser.parse_args()
    for scenario in arguments.scenarios:
        for mask in arguments.masks:
            row = run(scenario, mask, arguments.runs)
            print(
                f"\n{scenario}, mask {mask:g}, {arguments.runs} records: median error "
                f"{row['error']:.5f} %, covered by the windows {row['coverage']:.1f} %, new part "
                f"{row['new']:.2f}"
            )
            print(f"{'':27s}" + "".join(f"{name:>12s}" for name in COLUMNS))
            for label in ("spread", "distance"):
                values = "".join(f"{v:12.2f}" for v in np.atleast_1d(row[label]))
                print(f"over Monte Carlo {label:10s}" + values, flush=True)


if __name__ == "__main__":
    main()
