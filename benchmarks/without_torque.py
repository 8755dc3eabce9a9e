"""Estimates from logs without torque: errors and coverage over encoder noise and rate of the log.

    python benchmarks/without_torque.py [SEEDS]

A planar arm under its PD law at 1 kHz, 6 s of random moves, encoder noise in the loop. The log has
positions, reference and speed of the reference, at 1 kHz or every fourth sample; the torque is that
of the law with its true gains. The first row has the torque of the motors beside it.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.foundation.errors import IdentificationError
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.simulated_record import SimulatedRecord, simulate
from pivident.robot.gallery import load_robot

LOOP = Loop(PD([6000.0, 2500.0], [180.0, 60.0]))
RATE = 1000.0
METHODS = ("ls", "piv", "cloe")

#: Standard deviation of the encoders' noise [rad], keep every so many samples, torque logged.
CASES = (
    (2e-6, 1, True), (2e-6, 1, False), (2e-6, 4, False), (2e-5, 1, False), (2e-5, 4, False),
    (2e-4, 1, False), (2e-4, 4, False),
)  # fmt: skip


def logged(made: SimulatedRecord, step: int, torque: bool) -> Recording:
    """What the log of a record holds."""
    own = made.recording
    assert own.q_ref is not None and own.dq_ref is not None
    return Recording.from_arrays(
        own.q[::step],
        own.tau[::step] if torque else None,
        RATE / step,
        joint_names=own.joint_names,
        q_ref=own.q_ref[::step],
        dq_ref=own.dq_ref[::step],
        control_rate=RATE,
    )


def scores(made: SimulatedRecord, recording: Recording, method: str) -> tuple[float, float]:
    """Median relative error of parameters that are not zero, and share of truths within 2σ."""
    found = identify(Problem(load_robot("planar_2r"), recording, LOOP), method)
    truth = np.array([made.truth[name] for name in found.names])
    error = np.abs(found.theta - truth)
    known = truth != 0.0
    return (
        float(np.median(error[known] / np.abs(truth[known]))),
        float(np.mean(error < 2.0 * found.std)),
    )


def row(case: tuple[float, int, bool], records: Sequence[int]) -> str:
    """One line: error and coverage of each method, in per cent."""
    noise, step, torque = case
    cells = []
    for method in METHODS:
        found = []
        for seed in records:
            made = simulate(
                load_robot("planar_2r"), LOOP, encoder=noise, duration=6.0, rate=RATE, seed=seed
            )
            try:
                found.append(scores(made, logged(made, step, torque), method))
            except IdentificationError as error:
                print(f"{method}, seed {seed}: {error}", file=sys.stderr)
        error, inside = 100.0 * np.mean(found, axis=0)
        cells.append(f"{error:.2g} % ({inside:.0f} %)")
    channel = "with torque" if torque else "positions only"
    return f"| {1e6 * noise:g} µrad | {RATE / step:g} Hz, {channel} | {' | '.join(cells)} |"


def main(seeds: int) -> None:
    """Print the table."""
    print(f"| encoder noise | log | {' | '.join(METHODS)} |")
    print("|" + "---|" * (2 + len(METHODS)))
    for case in CASES:
        print(row(case, range(seeds)), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
