"""KUKA KR300, axes 1 to 3: torque error on blocks of motion that were not fitted.

    PIVIDENT_DATA=FOLDER python benchmarks/kuka_kr300_blocks.py

Each of the motions A and B is cut into five contiguous blocks between 1.8 and 8.2 s. Block k of
both is predicted from all others. Error of an axis: ‖τ - Φθ‖/‖τ‖ over all blocks, both sides below
4 Hz. Loops: the law of the records' authors with the recorded feed-forward, and virtual PD laws.
The parameters are all 25, or those that least squares on the fitted blocks tells to 30 %. Last,
each motion alone, judged on the other one.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from pivident.errors import IdentificationError
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.kinematics import Kinematics, estimate_kinematics
from pivident.estimation.methods import METHODS, Method, PrefilteredIV, RandomWalk
from pivident.estimation.problem import Loop, Problem
from pivident.recording.public_records import load_kuka_kr300
from pivident.recording.recording import Recording
from pivident.robot import Robot, load_robot
from pivident.signals.bandpass import butterworth
from pivident.simulation.controllers import PD
from pivident.simulation.virtual_pd import virtual_pd

EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "kuka_kr300"
NAMES = ("ls", "iv", "iv-full-rate", "piv")

#: Moving part of both motions [s], number of blocks, and the cut-off of the judgement [Hz].
START, STOP, BLOCKS, CUTOFF = 1.8, 8.2, 5, 4.0

#: The shortest run that is worth fitting [s].
SHORTEST = 0.3

METHOD: dict[str, Method] = {name: METHODS[name] for name in NAMES} | {
    "piv": PrefilteredIV(prefilter="direct"),
    "piv, controller": PrefilteredIV(),
}

Runs = tuple[Recording, ...]


def loops(robot: Robot, runs: Runs) -> dict[str, tuple[Runs, Loop]]:
    """Recordings and loop by name; a virtual law has no part in the recorded feed-forward."""
    nominal = PD(np.full(3, 572.96), np.array([1046.4, 1137.6, 1073.4]))
    posture = np.mean([run.q.mean(axis=0) for run in runs], axis=0)
    bare = tuple(replace(run, inputs={}) for run in runs)
    return {
        "authors' PD": (runs, Loop(nominal, np.diag(robot.transmission.reduction))),
        "virtual 5 Hz, recorded": (bare, Loop(virtual_pd(robot, posture, 5.0))),
        "virtual 10 Hz, smoothed": (
            bare,
            Loop(virtual_pd(robot, posture, 10.0), reference="smoothed"),
        ),
    }


def blocks() -> list[tuple[float, float]]:
    """Start and stop of each block [s]."""
    return list(pairwise(np.linspace(START, STOP, BLOCKS + 1).tolist()))


def others(runs: Runs, start: float, stop: float) -> Runs:
    """What is left of the runs without a block."""
    before = [r.slice(START, start) for r in runs if start - START > SHORTEST]
    return (*before, *(r.slice(stop, STOP) for r in runs if STOP - stop > SHORTEST))


def well_told(robot: Robot, runs: Runs, percent: float = 30.0) -> tuple[str, ...]:
    """Parameters whose deviation by least squares is below a share of their value."""
    found = identify(Problem(robot, runs), "ls")
    return tuple(
        name
        for name, value, std in zip(found.names, found.theta, found.std, strict=True)
        if std < percent / 100 * abs(value)
    )


def squares(
    found: Identification, motion: Kinematics, start: float, stop: float
) -> tuple[np.ndarray, np.ndarray]:
    """Sums of squares of error and torque on a block, each of shape (joints,)."""
    rate = motion.recording.rate
    predicted = found.predict(motion.q.T, motion.dq.T, motion.ddq.T)
    block = slice(int(start * rate), int(stop * rate))
    left = butterworth(motion.tau.T - predicted, rate, CUTOFF)[block]
    return np.sum(left**2, axis=0), np.sum(butterworth(motion.tau.T, rate, CUTOFF)[block] ** 2, 0)


def held_out(
    robot: Robot, runs: Runs, loop: Loop | None, method: Method, choose: bool
) -> np.ndarray:
    """Error of each axis over all blocks [%], shape (joints,)."""
    motions = [estimate_kinematics(run, RandomWalk()) for run in runs]
    error, torque = np.zeros(robot.size), np.zeros(robot.size)
    for start, stop in blocks():
        fitted = others(runs, start, stop)
        chosen = well_told(robot, fitted) if choose else None
        found = identify(Problem(robot, fitted, loop, chosen), method)
        for motion in motions:
            own, all_of_it = squares(found, motion, start, stop)
            error, torque = error + own, torque + all_of_it
    return 100 * np.sqrt(error / torque)


def alone(robot: Robot, runs: Runs, method: Method, fitted: int) -> tuple[float, np.ndarray]:
    """Condition number of one motion, and the error of each axis on the other one [%]."""
    found = identify(Problem(robot, (runs[fitted].slice(START, STOP),)), method)
    motion = estimate_kinematics(runs[1 - fitted], RandomWalk())
    error, torque = squares(found, motion, START, STOP)
    return found.condition, 100 * np.sqrt(error / torque)


def _row(label: str, values: np.ndarray) -> None:
    listed = "  ".join(f"{value:6.2f}" for value in values)
    print(f"  {label:40s} {listed}   mean {np.mean(values):.2f}")


def main() -> None:
    robot = load_robot(EXAMPLE / "kuka_kr300_axes_1_3.toml")
    runs = tuple(load_kuka_kr300(motion, robot=robot) for motion in ("A", "B"))
    for choose in (False, True):
        which = "those told to 30 % by the fitted blocks" if choose else "all 25"
        print(f"Held-out torque error of axes 1, 2, 3 below {CUTOFF:g} Hz [%], parameters: {which}")
        _row("ls", held_out(robot, runs, None, METHOD["ls"], choose))
        for label, (recordings, loop) in loops(robot, runs).items():
            for name in list(METHOD)[1:]:
                try:
                    _row(
                        f"{name:16s} {label}",
                        held_out(robot, recordings, loop, METHOD[name], choose),
                    )
                except IdentificationError as error:
                    print(f"  {name:16s} {label}: {error}")
    print("One motion alone, judged on the other one [%]")
    for fitted, other in ((0, "A, judged on B"), (1, "B, judged on A")):
        condition, errors = alone(robot, runs, METHOD["ls"], fitted)
        _row(f"ls on {other}, condition {condition:.0f}", errors)


if __name__ == "__main__":
    main()
