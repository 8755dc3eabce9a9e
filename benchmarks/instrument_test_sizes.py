"""Size and power of the tests on instruments, over short simulated records.

    python benchmarks/instrument_test_sizes.py [--runs 1000] [--samples 2000] [--robot-runs 200]

Each record is one joint on a random motion: inertia, viscous and Coulomb friction, offset. Its
regressors come from the motion and noise, its instruments from the motion alone. Under the null
5 % of the records should be rejected, whatever colour the residual has; the textbook's forms
suppose that it is white. Beside them, violations: noise shared by regressor and residual, an
instrument that knows the residual, and how weak instruments are found.

The second table goes through the whole estimator: a planar arm in closed loop, identified by IV at
full rate, whose true instruments further ones should not contradict, and contradict with a delay
that nobody declared.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter
from scipy.stats import f as f_distribution
from tests.judgement.validation.simulated_moments import sums_of

from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.judgement.validation.instrument_tests import (
    instrument_tests,
    relevance_test,
)
from pivident.judgement.validation.moment_sums import MomentSums
from pivident.judgement.validation.overidentification import (
    exogeneity_test,
    overidentification_test,
)
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.gallery import load_robot

NAMES = ("ia1", "fv1", "fc1", "off1")
THETA = np.array([1.2, 5.0, 3.0, 0.5])
LEVEL = 0.05


def motion(rng: np.random.Generator, samples: int) -> np.ndarray:
    """Acceleration, speed, its sign and one, of a random motion, (samples, 4)."""
    pole = 0.9 * np.exp(0.15j)
    shape = np.real(np.poly([pole, pole.conjugate()]))
    dq = lfilter([0.2], shape, rng.standard_normal(samples + 101))[100:]
    return np.column_stack(
        [10 * np.diff(dq), dq[1:], 2 / np.pi * np.arctan(10 * dq[1:]), np.ones(samples)]
    )


def residual(rng: np.random.Generator, samples: int, colour: str) -> np.ndarray:
    """White, slowly correlated, differentiated, or bursting noise."""
    white = rng.standard_normal(samples + 2)
    if colour == "correlated":
        return lfilter([1.0], [1.0, -0.9], white)[2:]
    if colour == "differentiated":
        return np.diff(white, 2)
    if colour == "bursts":
        return white[2:] * (1 + 3 * (np.sin(np.arange(samples) / 100) > 0.5))
    return white[2:]


def record(
    rng: np.random.Generator, samples: int, colour: str, shared: float = 0.0, invalid: float = 0.0,
    relevant: bool = True,
) -> MomentSums:  # fmt: skip
    """Sums of one record.

    Args:
        rng: source of randomness.
        samples: length.
        colour: of the residual.
        shared: how much of the residual the regressors carry.
        invalid: how much of it a further instrument carries.
        relevant: whether the instruments come from this motion, or from another one.
    """
    z = motion(rng, samples)
    error = residual(rng, samples, colour)
    phi = z.copy()
    phi[:, :3] += 0.3 * rng.standard_normal((samples, 3)) + shared * error[:, None]
    tau = phi @ THETA + error
    extra = np.roll(z[:, :2], 5, axis=0) + 0.2 * rng.standard_normal((samples, 2))
    extra[:, 0] += invalid * error
    return sums_of(phi, z if relevant else motion(rng, samples), tau, extra)


def p_values(sums: MomentSums) -> dict[str, float]:
    """Of every test, robust and as in the textbook."""
    hausman, hansen = exogeneity_test(sums, NAMES), overidentification_test(sums, NAMES)
    relevance = relevance_test(sums, NAMES)
    return {
        "DWH": hausman.p_value,
        "DWH white": hausman.white_p_value,
        "J": hansen.p_value,
        "J white": hansen.j_p_value,
        "relevance": relevance.p_values[1],
        "F white": float(f_distribution.sf(relevance.white_f[1], 3, sums.rows - 4)),
    }


def rejections(runs: int, samples: int, seed: int, **case) -> dict[str, float]:
    """Share of records on which each test rejects [%]."""
    rng = np.random.default_rng(seed)
    found = [p_values(record(rng, samples, **case)) for _ in range(runs)]
    return {name: 100 * float(np.mean([f[name] < LEVEL for f in found])) for name in found[0]}


def planar_record(seed: int, samples: int = 6000, rate: float = 1000.0) -> Problem:
    """A planar arm in closed loop: encoder noise in the loop, torque sensor noise."""
    robot = load_robot("planar_2r")
    base = base_parameters(robot)
    theta = base.values(nominal_values(robot, base.standard))
    rng = np.random.default_rng(seed)
    postures = np.random.default_rng(2).uniform(-1.0, 1.0, (30, 2))
    q_ref, _, _ = point_to_point(postures, 0.8 * robot.rated_speeds, rate, samples)
    noise = 2e-6 * rng.standard_normal(q_ref.shape)
    controller = PD([6000.0, 2500.0], [180.0, 60.0])
    wide = np.ones(2)
    signals = LoopSignals(
        rate, q_ref, None, None, noise, wide, np.inf * wide, 0.5 * wide, 50.0 * wide
    )
    made = simulate(make_model(robot, base.parameters, theta), controller, signals, ("a", "b"))
    tau = made.tau + 0.02 * lfilter([1.0], [1.0, -0.8], rng.standard_normal(made.tau.shape), axis=0)
    recording = Recording(
        f"planar-{seed}", robot.joint_names, made.q + noise, tau, rate, q_ref=q_ref
    )
    return Problem(robot, (recording,), Loop(controller))


def through_the_estimator(runs: int, late: int = 0) -> dict[str, float]:
    """Rejections of J on the planar arm [%], with a torque that is late by so many samples."""
    rejected = {"reference": 0, "delayed": 0}
    for seed in range(runs):
        problem = planar_record(seed)
        (recording,) = problem.recordings
        tau = np.concatenate([recording.tau[:1].repeat(late, axis=0), recording.tau])
        moved = replace(recording, tau=tau[: recording.samples])
        found = identify(replace(problem, recordings=(moved,)), "iv-full-rate")
        for kind in ("reference", "delayed"):
            rejected[kind] += instrument_tests(found, kind).overidentification.rejects
    return {kind: 100 * count / runs for kind, count in rejected.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--samples", type=int, default=2000)
    parser.add_argument("--robot-runs", type=int, default=200)
    arguments = parser.parse_args()
    runs, samples = arguments.runs, arguments.samples
    print(f"rejections at 5 % in {runs} records of {samples} samples [%]")
    names = ("DWH", "DWH white", "J", "J white", "relevance", "F white")
    print(f"{'':42s}" + "".join(f"{n:>11s}" for n in names))
    colours = ("white", "correlated", "differentiated", "bursts")
    cases = [(f"null, {c} residual", {"colour": c}) for c in colours]
    cases += [
        ("regressors share noise, white", {"colour": "white", "shared": 0.1}),
        ("regressors share noise, correlated", {"colour": "correlated", "shared": 0.1}),
        ("further instrument invalid, white", {"colour": "white", "invalid": 0.05}),
        ("further instrument invalid, correlated", {"colour": "correlated", "invalid": 0.05}),
        ("irrelevant instruments, white", {"colour": "white", "relevant": False}),
    ]
    for seed, (label, case) in enumerate(cases):
        row = rejections(runs, samples, seed, **case)
        print(f"{label:42s}" + "".join(f"{row[n]:11.1f}" for n in names), flush=True)
    print(f"\nplanar arm, {arguments.robot_runs} records: rejections of J [%]")
    for label, late in (("valid", 0), ("torque late by 3 ms", 3)):
        row = through_the_estimator(arguments.robot_runs, late)
        print(f"{label:30s} q_ref {row['reference']:5.1f}   delayed {row['delayed']:5.1f}")


if __name__ == "__main__":
    main()
