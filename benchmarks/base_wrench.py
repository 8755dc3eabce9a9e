"""Coverage of estimates from force sensors under a base, on a cable and at feet; MuJoCo's records.

python benchmarks/base_wrench.py [arm] [gains] [hanging] [standing] [foot_missing] [--runs 20]
[--seconds 12] [--workers 2]

arm, gains      a TX40 on a force sensor: parameters; gains of its drives from commands
hanging         a quadruped on a cable whose force is measured
standing        the same on four measured feet
foot_missing    the same where one foot has no sensor: what the verdict says
"""

from __future__ import annotations

import argparse
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
from benchmarks.mujoco_base import (
    Accuracy,
    Push,
    mujoco_base_record,
    truth_of,
    with_drawn_masses,
)
from benchmarks.quadruped import hanging_record, quadruped, standing_record

from pivident.data.recording.measured_wrenches import with_wrenches
from pivident.data.recording.recording import Recording
from pivident.estimation.drives.drive_gains import identify_drive_gains
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.experiment.simulated_tx40 import _KD, _KP, _KTAU
from pivident.foundation.errors import PividentError
from pivident.judgement.diagnostics.diagnostics import diagnose
from pivident.judgement.diagnostics.verdict import verdict
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.description import Robot
from pivident.robot.frames import Pose, rotation_from_rpy
from pivident.robot.gallery import load_robot
from pivident.robot.measured_base import with_held_base, with_wrench_sensors
from pivident.robot.transmission import Transmission
from pivident.robot.wrench_sensor import WrenchSensor

#: Sensor under the arm, and gains of its law.
FLOOR = WrenchSensor("floor", "base", Pose(rotation_from_rpy(0.3, -0.2, 1.0), [0.1, 0.05, -0.2]))
ARM_GAINS = 0.2 * _KP * _KTAU, 0.5 * _KD * _KTAU

#: Drive gains of the arm where commands are logged [N m per unit].
DRIVE_GAINS = np.array([12.0, 10.0, 8.0, 3.0, 5.0, 2.0])

METHODS_OF = {
    "arm": ("ls", "iv", "piv"),
    "hanging": ("ls", "iv-full-rate", "piv"),
    "standing": ("ls", "iv-full-rate", "piv"),
}


def arm_on_sensor(seed: int = 5) -> Robot:
    """A TX40 without couplings, its masses drawn, on a base that nothing is known of."""
    arm = replace(load_robot("staubli_tx40"), couplings=(), transmission=Transmission.direct(6))
    return with_drawn_masses(with_held_base(arm), [8, 12, 9, 6, 3, 2, 1], 0.3, seed)


def arm_record(robot: Robot, seed: int, seconds: float) -> Recording:
    """The arm's record with the wrench of the sensor."""
    rng, reach = np.random.default_rng(40), np.array([2.0, 1.2, 1.2, 2.4, 1.2, 2.4])
    places = rng.uniform(-reach, reach, (round(1.25 * seconds), 6))
    speeds = 0.6 * load_robot("staubli_tx40").rated_speeds
    q_ref, _, _ = point_to_point(places, speeds, 1000.0, round(1000.0 * seconds))
    return mujoco_base_record(robot, q_ref, 1000.0, ARM_GAINS, [Push(FLOOR)], seed, Accuracy())


def problem_of(scene: str, seed: int, seconds: float) -> tuple[Robot, Problem]:
    """One record of a scene."""
    if scene == "arm":
        robot = arm_on_sensor()
        return robot, Problem(robot, (arm_record(robot, seed, seconds),), Loop(PD(*ARM_GAINS)))
    robot = quadruped()
    made = hanging_record if scene == "hanging" else standing_record
    recording = made(robot, seed, seconds)
    sensors = [wrench.sensor for wrench in recording.wrenches]
    return robot, Problem(with_wrench_sensors(robot, sensors), (recording,))


def without_a_sensor(problem: Problem, name: str) -> Problem:
    """The same records, but one sensor is not there."""
    sensors = [sensor for sensor in problem.robot.sensors if sensor.name != name]
    robot = with_wrench_sensors(replace(problem.robot, sensors=()), sensors)
    recordings = []
    for recording in problem.recordings:
        torque = recording.wrench_torque
        left = {w.sensor.name: w.values for w in recording.wrenches if w.sensor.name != name}
        driven = replace(recording.behind(6), wrenches=(), wrench_torque=None)
        fixed = replace(robot, sensors=tuple(sensors))
        assert torque is not None
        again = with_wrenches(driven, fixed, left, pose=pose_of(recording))
        recordings.append(again)
    return Problem(robot, tuple(recordings))


def pose_of(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Origin and axes of a floating base from the positions of its joints."""
    turns = [
        rotation_from_rpy(roll, 0.0, 0.0)
        @ rotation_from_rpy(0.0, pitch, 0.0)
        @ rotation_from_rpy(0.0, 0.0, yaw)
        for roll, pitch, yaw in recording.q[:, 3:6]
    ]
    return recording.q[:, :3], np.array(turns)


def run(scene: str, seconds: float, seed: int) -> dict[str, tuple]:
    """One record, each method: errors, standard errors, converged, seconds."""
    robot, problem = problem_of(scene, seed, seconds)
    truth = truth_of(robot)
    found: dict[str, tuple] = {}
    for name in METHODS_OF[scene]:
        start = time.process_time()
        try:
            result = identify(problem, METHODS[name])
        except PividentError as error:
            found[name] = (None, None, str(error), 0.0, ())
            continue
        off = result.theta - [truth[own] for own in result.names]
        spent = time.process_time() - start
        found[name] = (off, result.std, result.converged, spent, result.names)
    return found


def run_gains(seconds: float, seed: int) -> tuple:
    """Drive gains from commands and the sensor: relative errors and standard errors, method."""
    robot = arm_on_sensor()
    recording = arm_record(robot, seed, seconds)
    commands = np.hstack([recording.tau[:, :6], recording.tau[:, 6:] / DRIVE_GAINS])
    loop = Loop(PD(*(gain / DRIVE_GAINS for gain in ARM_GAINS)))
    made = identify_drive_gains(Problem(robot, (replace(recording, tau=commands),), loop))
    return made.kappa / DRIVE_GAINS - 1.0, made.std / DRIVE_GAINS, made.method


def run_missing(seconds: float, seed: int) -> list[str]:
    """What the verdict says where one foot is not measured."""
    _, problem = problem_of("standing", seed, seconds)
    said = []
    for what, own in (
        ("all feet", problem),
        ("one missing", without_a_sensor(problem, "front_left")),
    ):
        found = {"piv": identify(own, METHODS["piv"])}
        judged = verdict(diagnose(own, found, {"piv": METHODS["piv"]}, folds=2))
        said.append(f"{what}, seed {seed}: {judged.headline}")
        said += [str(s) for s in judged.statements if s.severity == "error"]
    return said


def summary(name: str, found: list[tuple], of: int) -> str:
    """Coverage, bias and time of one method."""
    good = [own for own in found if own[0] is not None]
    if not good:
        return f"  {name}: {found[0][2]}"
    off, std = (np.array([own[k] for own in good]) for k in (0, 1))
    covered = np.abs(off / std) < 1.96
    by_run = covered.mean(axis=1)
    error = 2.0 * by_run.std(ddof=1) / np.sqrt(len(good)) if len(good) > 1 else np.nan
    bias = off.mean(axis=0) / std.mean(axis=0)
    worst, names = np.argsort(covered.mean(axis=0))[:4], good[0][4]
    return (
        f"  {name:12} covered {100 * covered.mean():.1f} ± {100 * error:.1f} %, rms "
        f"{np.sqrt(np.mean((off / std) ** 2)):.2f} σ, bias up to {np.abs(bias).max():.2f} σ "
        f"({names[int(np.abs(bias).argmax())]}), {np.median([own[3] for own in good]):.1f} s, "
        f"converged {sum(bool(own[2]) for own in good)} of {of}; least covered "
        + ", ".join(f"{names[k]} {100 * covered[:, k].mean():.0f}" for k in worst)
    )


def main() -> None:
    """Run as a script."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    scenes = [*METHODS_OF, "gains", "foot_missing"]
    parser.add_argument("scenes", nargs="*", help=f"of {', '.join(scenes)}; default: all")
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=12.0)
    parser.add_argument("--workers", type=int, default=2)
    chosen = parser.parse_args()
    for scene in chosen.scenes or scenes:
        with ProcessPoolExecutor(chosen.workers) as pool:
            if scene == "foot_missing":
                for said in pool.map(
                    partial(run_missing, chosen.seconds), range(min(chosen.runs, 3))
                ):
                    print(*said, sep="\n", flush=True)
                continue
            if scene == "gains":
                made = list(pool.map(partial(run_gains, chosen.seconds), range(chosen.runs)))
                off, std = (np.array([own[k] for own in made]) for k in (0, 1))
                covered = 100 * np.mean(np.abs(off / std) < 1.96, axis=0)
                print(
                    f"gains of {chosen.runs} records by {made[0][2]}: largest error of each "
                    f"{np.round(100 * np.abs(off).max(axis=0), 3)} %, mean "
                    f"{np.round(100 * off.mean(axis=0), 3)} %, standard error "
                    f"{np.round(100 * std.mean(axis=0), 3)} %, covered {covered} %, "
                    f"in all {covered.mean():.1f} %",
                    flush=True,
                )
                continue
            made = list(pool.map(partial(run, scene, chosen.seconds), range(chosen.runs)))
        print(f"{scene}: {chosen.runs} records of {chosen.seconds:g} s")
        for name in METHODS_OF[scene]:
            print(summary(name, [own[name] for own in made], chosen.runs), flush=True)


if __name__ == "__main__":
    main()
