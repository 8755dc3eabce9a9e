"""Flexible joints: do the intervals of stiffness, damping and inertias hold?

    [PIVIDENT_DATA=FOLDER] python benchmarks/two_mass.py [RUNS]

A joint with 60 and 90 kg m², 2e5 N m/rad (antiresonance 7.5 Hz, resonance 11.9 Hz), viscous and
Coulomb friction on both sides, in a PD loop at 1 kHz, 10 s. Encoders count and have noise; the loop
reads the noisy one. Printed are coverage of the 95 % intervals, bias and spread in deviations, and
the median deviation in per cent. Last, the predicted error of a rigid model beside that of a rigid
identification, and with the public record the KR300's axes 1 to 3.
"""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from pivident.data.recording.public_records import load_kuka_kr300
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.robot.gallery import load_robot
from pivident.studies.flexibility.compliance import identify_compliances
from pivident.studies.flexibility.joint_study import rigid_validity
from pivident.studies.flexibility.resonance import find_resonance
from pivident.studies.flexibility.simulated_joint import (
    MotorLoop,
    Sensors,
    TwoMassJoint,
    simulate_joint,
)
from pivident.studies.flexibility.two_mass import identify_two_mass

EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "kuka_kr300"
RATE, DURATION = 1000.0, 10.0

JOINT = TwoMassJoint(
    60.0, 90.0, 2e5, 150.0, 40.0, 60.0, load_viscous=20.0, load_coulomb=30.0, gamma=150.0
)

#: Motor encoder's step, link encoder's step, their noise [rad], and the torque's [N m].
SENSORS = {
    "fine": Sensors(2e-6, 2e-5, 2e-6, 1e-5, 5.0),
    "coarse": Sensors(2e-5, 1e-4, 2e-5, 5e-5, 30.0),
    "rough": Sensors(1e-4, 1e-4, 1e-4, 2e-4, 30.0),
}

LOOPS = {"PD": MotorLoop(6e4, 4e3), "filtered, feed-forward": MotorLoop(6e4, 4e3, 120.0, 2e-3)}


def reference(top: float) -> np.ndarray:
    """Two slow sines from rest to rest, and a multisine up to a frequency."""
    t = np.arange(int(DURATION * RATE)) / RATE
    ramp = np.clip(np.minimum(t, DURATION - t) / 2.0, 0, 1)
    ramp = ramp**4 * (35 - 84 * ramp + 70 * ramp**2 - 20 * ramp**3)
    slow = 0.6 * np.sin(2 * np.pi * 0.2 * t) + 0.3 * np.sin(2 * np.pi * 0.5 * t + 1)
    lines = np.arange(0.1, top, 0.1)
    phases = np.random.default_rng(0).uniform(0, 2 * np.pi, len(lines))
    sines = 2e-3 / (1 + lines / 3) * np.sin(2 * np.pi * np.outer(t, lines) + phases)
    return ramp * (slow + sines.sum(axis=1))


def both_encoders(runs: int, sensors: Sensors, loop: MotorLoop, top: float) -> None:
    q_ref, scores, relative = reference(top), [], []
    for seed in range(runs):
        made = simulate_joint(JOINT, loop, q_ref, RATE, sensors=sensors, seed=1000 + seed)
        found = identify_two_mass(made)
        truth = np.array([getattr(JOINT, name) for name in found.names])
        scores.append((found.theta - truth) / found.std)
        relative.append(found.std / np.where(truth, np.abs(truth), np.nan))
    _scores(found.names, np.array(scores), 100 * np.median(relative, axis=0))


def without_instruments(runs: int, sensors: Sensors, loop: MotorLoop) -> None:
    """Least squares on the same equations: errors in per cent."""
    q_ref, errors = reference(30.0), []
    for seed in range(runs):
        made = simulate_joint(JOINT, loop, q_ref, RATE, sensors=sensors, seed=1000 + seed)
        found = identify_two_mass(replace(made, q_ref=None))
        errors.append([found.theta[found.names.index(n)] / getattr(JOINT, n) - 1 for n in MAIN])
    listed = zip(MAIN, 100 * np.mean(errors, axis=0), strict=True)
    print("   mean error " + ", ".join(f"{name} {error:+.3g} %" for name, error in listed))


MAIN = ("motor_inertia", "load_inertia", "stiffness", "damping")


def motor_encoder(runs: int, sensors: Sensors, loop: MotorLoop) -> None:
    names = (*MAIN, "antiresonance", "resonance")
    q_ref, scores, relative, seen = reference(30.0), [], [], 0
    for seed in range(runs):
        made = simulate_joint(JOINT, loop, q_ref, RATE, sensors=sensors, seed=1000 + seed)
        found = find_resonance(replace(made, q_link=None))
        seen += found.seen
        if found.seen:
            values = [getattr(found, name) for name in names]
            stds = np.array([np.log(v.high / v.low) / (2 * 1.96) for v in values])
            away = [np.log(v.value / getattr(JOINT, n)) for v, n in zip(values, names, strict=True)]
            scores.append(away / stds)
            relative.append(stds)
    print(f"   seen in {seen} of {runs}")
    _scores(names, np.array(scores), 100 * np.median(relative, axis=0))


def _scores(names: tuple[str, ...], scores: np.ndarray, deviation: np.ndarray) -> None:
    covered = np.abs(scores) < 1.96
    for i, name in enumerate(names):
        print(
            f"   {name:16s} covered {100 * covered[:, i].mean():5.1f} %  bias "
            f"{scores[:, i].mean():+.2f}  spread {scores[:, i].std():.2f}  σ {deviation[i]:.2g} %"
        )
    print(f"   {'all':16s} covered {100 * covered.mean():5.1f} %")


def rigid_models() -> None:
    """Predicted and measured error of a rigid model's inertia."""
    robot = load_robot("emps")
    t = np.arange(8000) / RATE
    ramp = np.clip(np.minimum(t, 8 - t) / 0.5, 0, 1)
    ramp = ramp**3 * (10 - 15 * ramp + 6 * ramp**2)
    for antiresonance in (4, 6, 8, 12, 20, 40):
        stiffness = 90.0 * (2 * np.pi * antiresonance) ** 2
        joint = TwoMassJoint(60.0, 90.0, stiffness, 0.02 * np.sqrt(stiffness * 90.0), 40.0, 20.0)
        for top in (1.0, 2.0, 3.0):
            lines = zip(np.linspace(0.2, top, 6), (0, 1, 2.5, 4, 5, 3), strict=True)
            q_ref = ramp * sum(0.5 / f * np.sin(2 * np.pi * f * t + phase) for f, phase in lines)
            made = simulate_joint(
                joint, MotorLoop(2e4, 2e3), q_ref, RATE, sensors=Sensors(1e-6, 0, 1e-6)
            )
            made = replace(made, joint_names=robot.joint_names)
            rigid = identify(Problem(robot, (made,)), "ls")
            measured = 100 * (rigid.theta[list(rigid.names).index("m1r")] / 150.0 - 1)
            judged = rigid_validity(
                made, stiffness=stiffness, motor_inertia=60.0, load_inertia=90.0
            )
            print(
                f"   antiresonance {antiresonance:2d} Hz, motion to {top:g} Hz: predicted "
                f"{judged.inertia_error:6.2f} %, measured {measured:6.2f} %   {judged.severity}"
            )


def kuka() -> None:
    robot = load_robot(EXAMPLE / "kuka_kr300_axes_1_3.toml")
    ratio = np.diag(robot.transmission.reduction)
    for motion in ("A", "B"):
        made = load_kuka_kr300(motion, robot=robot)
        for found in identify_compliances(made, robot.rotor_inertia, ratio):
            print(f"   {motion} {found.joint}: stiffness {found.stiffness}")
            print(f"      hysteresis {found.hysteresis.times(1e3, 'mrad')}")
            print(f"      link encoder later by {found.encoder_lag.times(1e3, 'ms')}")
            for line in found.lines[:2]:
                print(f"      order {line.order:.3f}: {line.amplitude.times(1e3, 'mrad')}")


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    for label, loop in LOOPS.items():
        for sensors in SENSORS:
            print(f"Both encoders, {sensors} sensors, {label}, multisine to 30 Hz")
            both_encoders(runs, SENSORS[sensors], loop, 30.0)
    print("Both encoders, coarse sensors, PD, slow motion only")
    both_encoders(runs, SENSORS["coarse"], LOOPS["PD"], 0.0)
    print("Least squares, rough sensors, PD")
    without_instruments(max(1, runs // 10), SENSORS["rough"], LOOPS["PD"])
    for sensors in ("fine", "coarse"):
        print(f"Motor encoder alone, {sensors} sensors")
        motor_encoder(runs, SENSORS[sensors], LOOPS["filtered, feed-forward"])
    print("Error of a rigid model's inertia")
    rigid_models()
    if os.environ.get("PIVIDENT_DATA"):
        print("KUKA KR300, axes 1 to 3")
        kuka()


if __name__ == "__main__":
    main()
