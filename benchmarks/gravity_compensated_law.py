"""Robots whose law compensates gravity, and robots whose law does not: is the law found?

    python benchmarks/gravity_compensated_law.py [--runs 20]

The planar arm, simulated with fresh noise of encoders and torque sensor, under laws with gravity
(the true model or one with 10 % less, at the measured position or at the reference) and under laws
without; some of the latter are of a structure that the identification does not know. Then PIV with
the law identified and with the law known.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.control_law.identified_law import identify_controller
from pivident.estimation.control_law.unknown_loop import reconstruct_loop
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD, PID, Cascade, Controller
from pivident.loop.simulation.gravity_compensation import GravityCompensated, GravityModel
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.gallery import load_robot

RATE, SAMPLES = 1000.0, 8000

#: Gains, and deviations of the encoders [rad] and of the torque sensors [N m].
KP, KD, KI = (6000.0, 2500.0), (180.0, 60.0), (20000.0, 8000.0)
ENCODER, TORQUE = 2e-6, 0.05

#: Coulomb friction that a law feeds forward [N m].
FRICTION = (3.0, 1.5)

ROBOT = load_robot("planar_2r")
BASE = base_parameters(ROBOT)
THETA = BASE.values(nominal_values(ROBOT, BASE.standard))


def compensated(law: Controller, scale: float, place: str) -> GravityCompensated:
    """The law with so many times the robot's gravity added."""
    return GravityCompensated(
        law, **{place: GravityModel.of(ROBOT, BASE.parameters, scale * THETA)}
    )


#: Laws with gravity: how many times that of the robot, and where.
WITH: dict[str, tuple[Controller, float]] = {
    "PD + g(q)": (compensated(PD(KP, KD), 1.0, "measured"), 1.0),
    "PD + 0.9 g(q)": (compensated(PD(KP, KD), 0.9, "measured"), 0.9),
    "PD + 0.9 g(q_ref)": (compensated(PD(KP, KD), 0.9, "reference"), 0.9),
    "PID + 0.9 g(q)": (compensated(PID(KP, KD, KI), 0.9, "measured"), 0.9),
}

#: Laws without gravity, and what is done to the record that the identification does not know.
WITHOUT: dict[str, tuple[Controller, str]] = {
    "PD": (PD(KP, KD), ""),
    "PID": (PID(KP, KD, KI), ""),
    "cascade": (Cascade((33.0, 42.0), KD, (5.0, 5.0)), ""),
    "PD with friction fed forward": (PD(KP, KD), "friction"),
    "PD, torque a sample late": (PD(KP, KD), "late"),
    "PD, torque of gain 0.95 above 10 N m": (PD(KP, KD), "curved"),
}


def record(law: Controller, seed: int, unknown: str = "") -> Recording:
    """A run of the arm under a law, with noise of its own."""
    postures = np.random.default_rng(2).uniform(-1.5, 1.5, (30, 2))
    q_ref, dq_ref, _ = point_to_point(postures, 0.8 * ROBOT.rated_speeds, RATE, SAMPLES)
    rng = np.random.default_rng(seed)
    noise = ENCODER * rng.standard_normal(q_ref.shape)
    fed = FRICTION * np.tanh(50.0 * dq_ref) if unknown == "friction" else None
    signals = LoopSignals(
        RATE, q_ref, dq_ref, fed, noise, np.ones(2), np.full(2, np.inf), np.full(2, 0.5),
        np.full(2, 50.0),
    )  # fmt: skip
    made = simulate(make_model(ROBOT, BASE.parameters, THETA), law, signals, ROBOT.joint_names)
    tau = made.tau
    if unknown == "late":
        tau = np.concatenate([tau[:1], tau[:-1]])
    if unknown == "curved":
        tau = np.clip(tau, -10.0, 10.0) + 0.95 * (tau - np.clip(tau, -10.0, 10.0))
    tau = tau + TORQUE * rng.standard_normal(tau.shape)
    return Recording(
        f"run {seed}", ROBOT.joint_names, made.q + noise, tau, RATE, q_ref=q_ref, dq_ref=dq_ref,
    )  # fmt: skip


def found_law(law: Controller, scale: float, runs: int) -> dict[str, float]:
    """Errors and coverage of gains and gravity, and how often the structure is the right one."""
    place = "gravity" if law.measured is not None else "gravity_reference"
    right, errors, covered = 0, [], []
    for seed in range(runs):
        for j, own in enumerate(identify_controller([record(law, seed)], robot=ROBOT).joints):
            truth = {"kp": KP[j], "kd": KD[j], "speed_reference": KD[j]}
            if law.feedback.ki is not None:
                truth["ki"] = KI[j]
            known = own.gravity is not None and own.gravity.place == place
            right += known and set(own.terms) == set(truth)
            if not known:
                continue
            values = dict(zip([p.name for p in BASE.parameters], scale * THETA, strict=True))
            wanted = [truth.get(t, 0.0) for t in own.terms]
            wanted += [values[p.name] for p in own.gravity.parameters]
            got = np.concatenate([own.gains, own.gravity.values])
            std = np.concatenate([own.std, own.gravity.std])
            errors.append(np.abs(got / np.where(np.array(wanted) == 0, np.nan, wanted) - 1.0))
            covered.append(np.abs(got - wanted) < 2.0 * std)
    return {
        "right_structure": right / (2 * runs),
        "median_error_percent": 100.0 * float(np.nanmedian(np.concatenate(errors))),
        "worst_error_percent": 100.0 * float(np.nanmax(np.concatenate(errors))),
        "coverage_percent": 100.0 * float(np.mean(np.concatenate(covered))),
    }


def given_gravity(law: Controller, unknown: str, runs: int) -> int:
    """How many records of a law without gravity are given one."""
    count = 0
    for seed in range(runs):
        found = identify_controller([record(law, seed, unknown)], robot=ROBOT)
        count += any(own.gravity is not None for own in found.joints)
    return count


def precision(law: Controller, runs: int) -> dict[str, dict[str, float]]:
    """PIV with the law known and with the law identified."""
    rows: dict[str, list] = {"law known": [], "law identified": []}
    for seed in range(runs):
        own = record(law, seed)
        recordings, loop = reconstruct_loop(ROBOT, [own])
        for name, problem in (
            ("law known", Problem(ROBOT, (own,), Loop(law))),
            ("law identified", Problem(ROBOT, recordings, loop)),
        ):
            result = identify(problem, "piv")
            rows[name].append((result.theta - THETA, result.std))
    figures = {}
    for name, own in rows.items():
        error, std = (np.array(x) for x in zip(*own, strict=True))
        figures[name] = {
            "coverage_percent": 100.0 * float(np.mean(np.abs(error) < 2.0 * std)),
            "rms_error_over_known_deviation": float(
                np.sqrt(np.mean((error / np.array([s for _, s in rows["law known"]])) ** 2))
            ),
        }
    return figures


def measure(runs: int, say: Callable[[str], None] = print) -> dict[str, dict]:
    """All figures; ``say`` gets a line for each."""
    figures: dict[str, dict] = {"found": {}, "given_gravity": {}, "piv": {}}
    for name, (law, scale) in WITH.items():
        own = figures["found"][name] = found_law(law, scale, runs)
        say(
            f"{name:40s} right structure {100 * own['right_structure']:.0f} %, median error "
            f"{own['median_error_percent']:.3g} %, worst {own['worst_error_percent']:.3g} %, "
            f"2σ cover {own['coverage_percent']:.1f} %"
        )
    for name, (law, unknown) in WITHOUT.items():
        count = figures["given_gravity"][name] = given_gravity(law, unknown, runs)
        say(f"{name:40s} given a gravity model: {count} of {runs}")
    for name, (law, _) in WITH.items():
        own = figures["piv"][name] = precision(law, runs)
        text = "; ".join(
            f"{key}: 2σ cover {x['coverage_percent']:.1f} %, error "
            f"{x['rms_error_over_known_deviation']:.4f} σ (rms)"
            for key, x in own.items()
        )
        say(f"{name:40s} PIV, {text}")
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=20)
    figures = measure(parser.parse_args().runs)
    target = Path(__file__).parent / "results"
    target.mkdir(exist_ok=True)
    (target / "gravity_compensated_law.json").write_text(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
