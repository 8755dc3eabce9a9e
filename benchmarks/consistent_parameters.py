"""Physically consistent parameters: time, distance, torque cost on held-out motion, coverage.

    [PIVIDENT_DATA=FOLDER] python benchmarks/consistent_parameters.py [--runs 20] [--part NAME]

Four parts. ``record``: the real TX40, LS, IV and PIV, each fitted without a block, made consistent,
and judged on that block. ``simulated``: the same on a simulated TX40 with its CAD inertias.
``coverage``: how often the truth lies inside the intervals of the consistent parameters, CAD
inertias, all base parameters. ``essential``: is the truth of the scenario *fine*, 28 parameters and
no others, a machine that could exist?
"""

from __future__ import annotations

import argparse
import statistics
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from tests.load_scenario import tx40_with_load

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.experiment.experiment import load_experiment
from pivident.experiment.simulated_tx40 import tx40_fine
from pivident.foundation.errors import IdentificationError
from pivident.judgement.diagnostics.consistent_estimate import consistent_prediction
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from pivident.models.consistency.consistent_model import make_consistent

EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "staubli_tx40" / "experiment.toml"

METHODS = ("ls", "iv", "iv-full-rate", "piv")


def judged(title: str, problem: Problem, methods: dict) -> None:
    """Time, distance and torque cost of each method on a problem."""
    print(f"\n{title}: {len(problem.names)} parameters, 5 held-out blocks")
    for name, method in methods.items():
        try:
            validation = cross_validate(problem, method)
        except IdentificationError as error:
            print(f"  {name}: {error}")
            continue
        free = validation.identification
        summed = replace(free, torque_sums=make_consistent(free, accept_far=True).sums)
        models, processor = [], []
        for _ in range(7):
            began = time.process_time()
            models.append(make_consistent(summed, accept_far=True))
            processor.append(time.process_time() - began)
        model = models[0]
        print(
            f"  {free.method}: {1e3 * min(m.seconds for m in models):.0f} ms at best, "
            f"{1e3 * statistics.median(processor):.0f} ms of processor time, "
            f"least distance {model.least_distance:.2f} σ, "
            f"p = {model.p_value:.2g}; fitted motion {100 * model.torque_error_free:.3f} % free, "
            f"{100 * model.torque_error:.3f} % consistent"
        )
        print(f"    {consistent_prediction(validation, problem.recordings, make_consistent)}")


def coverage(runs: int) -> None:
    """Share of true parameters inside 95 % intervals, free and consistent."""
    base = base_parameters(tx40_with_load(0, samples=3000).problem.robot)
    nominal = nominal_values(base.robot, base.standard)
    truth = base.values(nominal)
    print(f"\nsimulated TX40, CAD inertias, {len(truth)} base parameters, {runs} runs")
    for method in ("ls", "iv-full-rate", "piv"):
        inside, inside_free, lengths, errors, costs = [], [], [], [], []
        for seed in range(runs):
            problem = tx40_with_load(seed).problem
            free = identify(problem, method)
            model = make_consistent(free, accept_far=True)
            own = model.intervals()
            inside.append((own.low <= truth) & (truth <= own.high))
            inside_free.append(np.abs(free.theta - truth) <= 1.96 * free.std)
            lengths.append((own.high - own.low) / (2 * 1.96 * free.std))
            scale = np.maximum(np.abs(truth), 1e-3)
            errors.append((np.abs(free.theta - truth) / scale, np.abs(model.theta - truth) / scale))
            costs.append((model.least_distance, model.torque_cost))
        median = 100 * np.median(np.array(errors), axis=(0, 2))
        distance, cost = np.median(np.array(costs), axis=0)
        print(
            f"  {free.method}: covered {100 * np.mean(inside):.1f} % (free "
            f"{100 * np.mean(inside_free):.1f} %), interval length {np.median(lengths):.2f} of the "
            f"free one, median error {median[1]:.3g} % (free {median[0]:.3g} %), "
            f"least distance {distance:.2f} σ, torque cost {100 * cost:+.3f} %"
        )


def essential(seed: int = 0) -> None:
    """Distance of the truth of *fine* from the machines that exist, and of an estimate."""
    problem, truth = tx40_fine(seed)
    free = identify(problem, "piv")
    theta = np.array([truth[p.name] for p in free.parameters])
    exact = replace(free, theta=theta, method="the truth of fine")
    for one in (exact, free):
        for prior in ("entropic",):
            model = make_consistent(one, prior=prior, accept_far=True)
            print(f"\n{model.headline()}")
            for a in model.active[:6]:
                print(f"  {a}")


def simulated_problem(seed: int = 0) -> Problem:
    """The TX40 with CAD inertias, all parameters unknown."""
    return tx40_with_load(seed).problem


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--part", choices=("record", "simulated", "coverage", "essential"))
    options = parser.parse_args()
    began = time.perf_counter()
    if options.part in (None, "record"):
        experiment = load_experiment(EXAMPLE)
        judged("TX40 record", experiment.problem(), experiment.methods())
        everything = replace(experiment.problem(), parameters=None)
        judged("TX40 record, all parameters", everything, experiment.methods())
    if options.part in (None, "simulated"):
        judged("simulated TX40", simulated_problem(), {m: m for m in METHODS})
    if options.part in (None, "essential"):
        essential()
    if options.part in (None, "coverage"):
        coverage(options.runs)
    print(f"\n{time.perf_counter() - began:.0f} s")


if __name__ == "__main__":
    main()
