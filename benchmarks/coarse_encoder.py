"""Coarse encoders: what PIV loses by them, and what DIDIM keeps.

    [PIVIDENT_DATA=FOLDER] python benchmarks/coarse_encoder.py [--runs 40] [--counts 3600]

Simulated TX40, the positions of the record rounded to so many counts per joint revolution after
the loop has run (the scenario *coarse*). Four tables: the same motion with fresh noise in each
run; another motion in each run; control gains declared 2 % too large; friction with a Stribeck
term that the model does not have. In each the median relative error, coverage of two deviations,
the mean error of the friction parameters, iterations and seconds.

With the public EMPS record, its positions rounded to coarser and coarser steps: estimates, and the
force error of the closed loop on the file that was not fitted.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from pivident.data.recording.public_records import load_emps, load_emps_pulses
from pivident.data.recording.recording import Recording
from pivident.dynamics.forward import make_model
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.experiment import simulated_tx40 as scenarios
from pivident.foundation.errors import PividentError
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD, Cascade
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.friction import FrictionLaw, coulomb, stribeck, viscous
from pivident.robot.gallery import load_robot

METHODS = ("iv-full-rate", "piv", "didim")

SAMPLES = 34500

Case = tuple[Problem, dict[str, float]]


def same_motion(seed: int) -> Case:
    """The scenario itself."""
    return scenarios.tx40_scenario("coarse", seed)


def other_motions(seed: int) -> Case:
    """Another set of postures in each run."""
    kept = scenarios.tx40_reference
    robot = load_robot("staubli_tx40")
    reach = np.array([2.0, 1.2, 1.2, 2.4, 1.2, 2.4])
    postures = np.random.default_rng(1000 + seed).uniform(-reach, reach, (24, robot.size))
    motion = point_to_point(postures, 0.8 * robot.rated_speeds, scenarios.RATE, SAMPLES)
    scenarios.tx40_reference = lambda samples: tuple(x[:samples] for x in motion)
    try:
        return scenarios.tx40_scenario("coarse", seed)
    finally:
        scenarios.tx40_reference = kept


def wrong_gains(seed: int) -> Case:
    """The control law is declared with gains 2 % above those that the record was taken with."""
    problem, truth = scenarios.tx40_scenario("coarse", seed)
    law = problem.loop.controller
    declared = Loop(PD(1.02 * np.asarray(law.kp), 1.02 * np.asarray(law.kd)))
    return dataclasses.replace(problem, loop=declared), truth


def unmodelled_friction(seed: int) -> Case:
    """Sticking friction, 20 % of Coulomb's within 0.1 rad/s, that the model does not have.

    With model error in it the record is taken for a measured one: slow rows do not vote.
    """
    problem, truth = scenarios.tx40_scenario("coarse", seed)
    law = FrictionLaw((viscous(), coulomb(gamma=150.0), stribeck(0.1, gamma=150.0)))
    robot = problem.robot.with_friction(law)
    wide = Problem(robot, problem.recordings).regressor.parameters
    sticking = {f"fs{j}": 0.2 * truth[f"fc{j}"] for j in range(1, robot.size + 1)}
    values = [(truth | sticking).get(p.name, 0.0) for p in wide]
    recording, noise = problem.recordings[0], scenarios.NOISES["coarse"]
    encoder = noise.in_loop(seed, recording.q.shape)
    n = robot.size
    signals = LoopSignals(
        scenarios.RATE, recording.q_ref, recording.dq_ref, None, encoder, np.ones(n),
        np.full(n, np.inf), np.full(n, 0.5), np.full(n, 50.0),
    )  # fmt: skip
    made = simulate(
        make_model(robot, wide, np.array(values)), problem.loop.controller, signals,
        robot.joint_names,
    )  # fmt: skip
    sensor = noise.torque * np.random.default_rng((seed, 1)).standard_normal(made.tau.shape)
    changed = dataclasses.replace(
        recording,
        q=noise.quantised(made.q + encoder),
        tau=made.tau + sensor,
    )
    return dataclasses.replace(problem, recordings=(changed,)), truth


CASES: dict[str, Callable[[int], Case]] = {
    "same motion": same_motion,
    "other motions": other_motions,
    "gains 2 % off": wrong_gains,
    "unmodelled friction": unmodelled_friction,
}


def figures(results: list, truth: np.ndarray, names: tuple[str, ...]) -> dict[str, float]:
    """One row: errors, coverage, bias of friction, iterations and time of one method."""
    theta = np.array([r.theta for r, _ in results])
    std = np.array([r.method_std for r, _ in results])
    robust = np.array([r.robust_std for r, _ in results])
    error = theta - truth
    friction = [k for k, name in enumerate(names) if name.startswith(("fv", "fc"))]
    bias = np.abs(error.mean(axis=0) / truth)
    own = error.std(axis=0, ddof=1)
    return {
        "median_relative_error": float(np.median(np.abs(error / truth))),
        "coverage": float(np.mean(np.abs(error) < 2 * std)),
        "friction_bias_median": float(np.median(bias[friction])),
        "friction_bias_largest": float(bias[friction].max()),
        "largest_bias_over_spread": float(np.abs(error.mean(axis=0) / own).max()),
        "reported_over_monte_carlo": float(np.exp(np.mean(np.log(std.mean(axis=0) / own)))),
        "robust_over_monte_carlo": float(np.exp(np.mean(np.log(robust.mean(axis=0) / own)))),
        "iterations": max(r.iterations for r, _ in results),
        "converged": sum(r.converged for r, _ in results),
        "runs": len(results),
        "seconds": float(np.median([s for _, s in results])),
    }


def table(case: str, runs: int) -> dict[str, dict[str, float]]:
    """Figures of all methods on the same records, printed."""
    found: dict[str, list] = {name: [] for name in METHODS}
    for seed in range(runs):
        problem, truth = CASES[case](seed)
        for name in METHODS:
            started = time.perf_counter()
            try:
                result = identify(problem, name)
            except PividentError:
                continue  # a loop that cannot be simulated: counted as not converged
            found[name].append((result, time.perf_counter() - started))
    expected = np.array([truth[p.name] for p in problem.regressor.parameters])
    rows = {name: figures(r, expected, problem.names) for name, r in found.items() if len(r) > 1}
    print(f"\n{case}, {runs} runs, 28 parameters")
    print("method         median error   covered   friction bias: median, largest   "
          "bias/spread   reported/spread   iterations   converged       s")  # fmt: skip
    for name, f in rows.items():
        print(
            f"{name:14s} {100 * f['median_relative_error']:9.4f} %   {100 * f['coverage']:5.1f} %"
            f"   {100 * f['friction_bias_median']:14.4f} %, {100 * f['friction_bias_largest']:8.3f}"
            f" %   {f['largest_bias_over_spread']:11.1f}   {f['reported_over_monte_carlo']:15.2f}"
            f"   {f['iterations']:10d}   {f['converged']:4d} of {runs:2d}   {f['seconds']:5.2f}",
            flush=True,
        )
    return rows


def emps() -> Iterator[dict[str, object]]:
    """The real drive, its positions rounded after the fact."""
    robot, fitted, unseen = load_robot("emps"), load_emps(), load_emps_pulses()
    controller = Cascade(np.array([160.18]), np.array([243.45]), averaged=True)
    loop = Loop(controller, 35.15065188248547, 10.0)
    print("\nEMPS, positions rounded after the fact; force error on the pulses file")
    for step in (0.0, 1e-5, 1e-4, 5e-4):
        record: Recording = fitted
        if step:
            record = dataclasses.replace(fitted, q=step * np.round(fitted.q / step))
        for name in METHODS:
            found = identify(Problem(robot, (record,), loop), name)
            auxiliary = AuxiliaryModel(Problem(robot, (unseen,), loop), differences=False)
            (motion,) = auxiliary.simulate(found.theta)
            force = np.linalg.norm(motion.tau[0] - unseen.tau[:, 0]) / np.linalg.norm(unseen.tau)
            values = "  ".join(
                f"{v:8.3f} ± {2 * s:6.3f}" for v, s in zip(found.theta, found.std, strict=True)
            )
            print(f"  step {1e6 * step:4.0f} µm  {name:14s} {values}   force {100 * force:6.2f} %")
            yield {"step": step, "method": name, "theta": found.theta.tolist(), "force": force}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--counts", type=int, default=3600)
    parser.add_argument("--cases", nargs="+", default=list(CASES), choices=list(CASES))
    options = parser.parse_args()
    scenarios.NOISES["coarse"] = scenarios.Noise(count=2.0 * np.pi / options.counts)
    results: dict[str, object] = {case: table(case, options.runs) for case in options.cases}
    if "PIVIDENT_DATA" in os.environ:
        results["emps"] = list(emps())
    target = Path(__file__).parent / "results"
    target.mkdir(exist_ok=True)
    (target / "coarse_encoder.json").write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
