"""Which parameters an estimator's intervals miss, and why: bias, or intervals that are too small.

    python -m benchmarks.coverage_of_parameters [clie] [--scenario fine] [--first 0] [--runs 60]
        [--criterion bic] [--fixed zz3r ia3 fv1]

Coverages of one run are correlated, since its parameters share the noise: the standard error of the
mean coverage is that over runs. Below it, for each parameter: coverage of 2σ, bias in standard
errors with its t value, reported standard error over the spread of the runs. Then the runs in
quarters by the orders of their noise models, from the lowest to the highest.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.estimation.identify import identify
from pivident.estimation.method import Method
from pivident.estimation.methods import METHODS
from pivident.experiment.simulated_tx40 import tx40_scenario


@dataclass(frozen=True, eq=False)
class Runs:
    """Estimates over records of one scenario."""

    names: list[str]
    errors: np.ndarray  # estimate minus truth, shape (runs, parameters)
    std: np.ndarray  # reported, likewise
    orders: np.ndarray  # sum of the orders of all noise models, shape (runs,)

    @property
    def covered(self) -> np.ndarray:
        """Whether 2σ contain the truth, shape (runs, parameters)."""
        return np.abs(self.errors) <= 2.0 * self.std


def runs_of(method: Method, scenario: str, seeds: range, fixed: Sequence[str] = ()) -> Runs:
    """Identify the records of some seeds; ``fixed``: parameters whose true values are known."""
    errors, std, orders = [], [], []
    names: list[str] = []
    for seed in seeds:
        problem, truth = tx40_scenario(scenario, seed)
        # the regrouping is marked by an r that either of the names may have
        by_stem = {name.removesuffix("r"): value for name, value in truth.items()}
        known = {name: by_stem[name.removesuffix("r")] for name in fixed}
        problem = replace(problem, fixed=known)
        found, free = identify(problem, method), np.flatnonzero(problem.varying)
        names = [problem.names[k] for k in free]
        errors.append(found.theta[free] - [by_stem[name.removesuffix("r")] for name in names])
        std.append(np.sqrt(np.diag(found.covariance))[free])
        simulation = found.simulation
        orders.append(sum(simulation.noise_orders) if simulation else 0)
    return Runs(names, np.array(errors), np.array(std), np.array(orders))


def show(runs: Runs) -> None:
    """Print the tables."""
    count, covered = len(runs.errors), runs.covered
    of_runs = covered.mean(axis=1)
    spread = runs.errors.std(axis=0, ddof=1)
    print(
        f"{count} runs: {100 * of_runs.mean():.1f} ± "
        f"{100 * of_runs.std(ddof=1) / np.sqrt(count):.1f} % covered; standard errors "
        f"{np.mean(runs.std.mean(axis=0) / spread):.3f} times the spread"
    )
    print("parameter  covered   bias/σ     t   σ/spread")
    for k, name in enumerate(runs.names):
        bias, std = runs.errors[:, k].mean(), runs.std[:, k].mean()
        print(
            f"{name:9} {100 * covered[:, k].mean():7.1f} % {bias / std:8.2f} "
            f"{bias * np.sqrt(count) / spread[k]:5.1f} {std / spread[k]:8.2f}"
        )
    print("orders  covered   rms error/σ")
    for own in np.array_split(np.argsort(runs.orders, kind="stable"), 4):
        scaled = runs.errors[own] / runs.std[own]
        print(
            f"{runs.orders[own].mean():6.0f} {100 * covered[own].mean():7.1f} % "
            f"{np.sqrt(np.mean(scaled**2)):8.2f}"
        )


def main() -> None:
    """Run as a script."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("method", nargs="?", default="clie")
    parser.add_argument("--scenario", default="fine")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--criterion", choices=("aic", "aicc", "bic"))
    parser.add_argument("--fixed", nargs="*", default=(), help="parameters that are known")
    given = parser.parse_args()
    method = METHODS[given.method]
    if given.criterion:
        method = replace(method, noise=replace(method.noise, criterion=given.criterion))
    seeds = range(given.first, given.first + given.runs)
    show(runs_of(method, given.scenario, seeds, given.fixed))


if __name__ == "__main__":
    main()
