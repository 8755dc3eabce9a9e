"""An example to begin with: the textbook arm in its loop, with the log of its controller."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pivident.app.studio.drafting import draft
from pivident.foundation.files import atomic_folder
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.simulated_record import simulate
from pivident.robot.gallery import load_robot

#: The robot of the gallery, its gains [N m per rad, N m s per rad], and the log [Hz, s].
ROBOT, KP, KD = "planar_2r", (6000.0, 2500.0), (180.0, 60.0)
RATE, DURATION = 1000.0, 12.0

#: Noise of encoders in the loop [rad] and of the torque sensors [N m].
ENCODER, TORQUE = 2e-5, 0.15

HEADER = ("time", "q1", "q2", "q1_ref", "q2_ref", "tau1", "tau2")


def draft_example(folder: Path, say: Callable[[str], None], seed: int = 0) -> None:
    """Simulate the arm, write its ``log.csv``, and draft the experiment file.

    Args:
        folder: of the new project.
        say: called with one line at each stage.
        seed: of motion and noise.
    """
    say("simulating the log of the example (the first time this compiles, for a minute)")
    write_log(folder, seed)
    draft(folder, ["log.csv"], ROBOT, {}, (), (), say)


def write_log(folder: Path, seed: int = 0) -> None:
    """The log of the arm, positions in degrees."""
    record = simulate(
        load_robot(ROBOT),
        Loop(PD(kp=KP, kd=KD)),
        rate=RATE,
        duration=DURATION,
        encoder=ENCODER,
        torque=TORQUE,
        seed=seed,
    ).recording
    time = np.arange(record.samples) / record.rate
    assert record.q_ref is not None  # a simulated loop follows one
    degrees = np.rad2deg(np.hstack([record.q, record.q_ref]))
    with atomic_folder(folder) as build:
        with (build / "log.csv").open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(HEADER)
            rows = np.column_stack([time, degrees, record.tau])
            writer.writerows([f"{x:.9g}" for x in row] for row in rows)
