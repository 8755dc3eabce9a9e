"""KUKA KR300, axes 1 to 3: torque error on blocks of motion that were not fitted.

    PIVIDENT_DATA=FOLDER python benchmarks/kuka_kr300_blocks.py

Each of the motions A and B is cut into five contiguous blocks between 1.8 and 8.2 s. Block k of
both is predicted from all others. Error of an axis: ‖τ - Φθ‖/‖τ‖ over all blocks, both sides below
4 Hz. Loops: the law identified from the recorded reference (on both motions as a whole), the law of
the records' authors with the recorded feed-forward, and virtual PD laws. How far each simulated
arm is from the record, with the parameters of least squares, comes first.
The parameters are all 25; or those without the moments of inertia that least squares on both
motions cannot tell to 30 %; or those that it tells to 30 % on the fitted blocks. Last, each motion
alone, judged on the other one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from pivident.data.recording.public_records import load_kuka_kr300
from pivident.data.recording.recording import Recording
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.control_law.unknown_loop import reconstruct_loop
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.method import Method
from pivident.estimation.methods import METHODS
from pivident.estimation.prefiltered_iv import PrefilteredIV
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import IdentificationError
from pivident.loop.motion.motion import Kinematics
from pivident.loop.simulation.control_loop import Loop, virtual_pd
from pivident.loop.simulation.controllers import PD
from pivident.robot.description import Robot
from pivident.robot.gallery import load_robot
from pivident.signals.bandpass import butterworth

EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "kuka_kr300"
NAMES = ("ls", "iv", "iv-full-rate", "piv")

#: Moving part of both motions [s], number of blocks, and the cut-off of the judgement [Hz].
START, STOP, BLOCKS, CUTOFF = 1.8, 8.2, 5, 4.0

#: The shortest run that is worth fitting [s].
SHORTEST = 0.3

#: Names of moments of inertia begin so.
INERTIAS = ("xx", "xy", "xz", "yy", "yz", "zz")

#: Rate at which the records' authors sent setpoints to the drives [Hz].
CONTROL_RATE = 1250.0

METHOD: dict[str, Method] = {name: METHODS[name] for name in NAMES} | {
    "piv": PrefilteredIV(prefilter="direct"),
    "piv, controller": PrefilteredIV(),
}

Runs = tuple[Recording, ...]

#: Parameters to estimate, given robot and fitted blocks; None: all.
Choice = Callable[[Robot, Runs], tuple[str, ...] | None]


def loops(robot: Robot, runs: Runs) -> dict[str, tuple[Runs, Loop]]:
    """Recordings and loop by name; a virtual law has no part in the recorded feed-forward."""
    nominal = PD(np.full(3, 572.96), np.array([1046.4, 1137.6, 1073.4]))
    posture = np.mean([run.q.mean(axis=0) for run in runs], axis=0)
    bare = tuple(replace(run, inputs={}) for run in runs)
    gain = np.diag(robot.transmission.reduction)
    moving = tuple(run.slice(START, STOP) for run in runs)
    found = reconstruct_loop(robot, moving, drive_gain=gain)[1]
    assert found.identified is not None
    print(found.identified)
    faster = tuple(replace(run, control_rate=CONTROL_RATE) for run in runs)
    return {
        "identified": (found.identified.seen(faster), found),
        "authors' PD": (runs, Loop(nominal, gain)),
        "virtual 5 Hz, recorded": (bare, Loop(virtual_pd(robot, posture, 5.0))),
        "virtual 10 Hz, smoothed": (
            bare,
            Loop(virtual_pd(robot, posture, 10.0), reference="smoothed"),
        ),
    }


def tracking(robot: Robot, runs: Runs, loop: Loop) -> np.ndarray:
    """Rms of simulated less recorded positions with the parameters of least squares [mrad]."""
    moving = tuple(run.slice(START, STOP) for run in runs)
    problem = Problem(robot, moving, loop)
    theta = identify(Problem(robot, moving), "ls").theta
    motions = AuxiliaryModel(problem, differences=False).simulate(theta)
    away = [motion.q.T - run.q for motion, run in zip(motions, moving, strict=True)]
    return 1e3 * np.sqrt(np.mean(np.concatenate(away) ** 2, axis=0))


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


def without_vague_inertias(robot: Robot, runs: Runs, percent: float = 30.0) -> tuple[str, ...]:
    """All but the moments of inertia whose deviation is above a share of their value."""
    moving = tuple(run.slice(START, STOP) for run in runs)
    told = well_told(robot, moving, percent)
    names = Problem(robot, moving).names
    return tuple(name for name in names if name in told or name[:2] not in INERTIAS)


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
    robot: Robot, runs: Runs, loop: Loop | None, method: Method, choice: Choice
) -> np.ndarray:
    """Error of each axis over all blocks [%], shape (joints,)."""
    motions = [estimate_kinematics(run, RandomWalk()) for run in runs]
    error, torque = np.zeros(robot.size), np.zeros(robot.size)
    for start, stop in blocks():
        fitted = others(runs, start, stop)
        found = identify(Problem(robot, fitted, loop, choice(robot, fitted)), method)
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
    known = loops(robot, runs)
    print("Simulated less recorded positions of axes 1, 2, 3, rms [mrad]")
    for label, (recordings, loop) in known.items():
        if loop.reference == "recorded":
            _row(label, tracking(robot, recordings, loop))
    fewer = without_vague_inertias(robot, runs)
    choices: dict[str, Choice] = {
        "all 25": lambda robot, fitted: None,
        f"{len(fewer)}, without vague moments of inertia": lambda robot, fitted: fewer,
        "those told to 30 % by the fitted blocks": well_told,
    }
    for which, choice in choices.items():
        print(f"Held-out torque error of axes 1, 2, 3 below {CUTOFF:g} Hz [%], parameters: {which}")
        _row("ls", held_out(robot, runs, None, METHOD["ls"], choice))
        for label, (recordings, loop) in known.items():
            for name in list(METHOD)[1:]:
                try:
                    _row(
                        f"{name:16s} {label}",
                        held_out(robot, recordings, loop, METHOD[name], choice),
                    )
                except IdentificationError as error:
                    print(f"  {name:16s} {label}: {str(error)[:90]} …")
    print("One motion alone, judged on the other one [%]")
    for fitted, other in ((0, "A, judged on B"), (1, "B, judged on A")):
        condition, errors = alone(robot, runs, METHOD["ls"], fitted)
        _row(f"ls on {other}, condition {condition:.0f}", errors)


if __name__ == "__main__":
    main()
