"""Processor time of a simulation with its tangents over that of the simulation alone.

The TX40 in its closed loop, 34,500 samples at 5 kHz (the motion of the scenario *fine*), one
process, one thread. Directions: none but one, the 28 essential parameters with the six position
gains, and all 61 base parameters. Central differences would take two simulations for each.

    python -m benchmarks.simulation_tangents
"""

from __future__ import annotations

from time import process_time

import numpy as np

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.experiment.simulated_tx40 import RATE, TX40_ESSENTIAL, tx40_reference
from pivident.loop.simulation.closed_loop import LoopSignals, simulate_blocks
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.direction import Direction, ParametrisedLoop
from pivident.loop.simulation.tangents import tangent_blocks
from pivident.robot.gallery import load_robot

SAMPLES = 34_500
REPEATS = 5

#: Position and speed gains in joint torque (Leboutet et al., 2021).
TORQUE_GAIN = np.array([35.24, 32.04, 23.94, 9.05, 15.5, 6.56])
KP = TORQUE_GAIN * np.array([341.86905, 375.0, 190.343925, 150.16365, 183.24195, 358.858725])
KD = TORQUE_GAIN * np.array([2.5361, 4.1174, 1.1793, 0.5462, 0.5714, 0.1954])


def tx40_loop() -> ParametrisedLoop:
    """The TX40 with its 61 base parameters in its position loop."""
    robot = load_robot("staubli_tx40")
    base = base_parameters(robot)
    theta = base.values(nominal_values(robot, base.standard))
    q_ref, dq_ref, _ = tx40_reference(SAMPLES)
    n = robot.size
    signals = LoopSignals(
        RATE, q_ref, dq_ref, None, None, np.ones(n), np.full(n, np.inf), np.full(n, 0.5),
        np.full(n, 50.0),
    )  # fmt: skip
    return ParametrisedLoop(robot, base.parameters, theta, PD(KP, KD), signals)


def cases(loop: ParametrisedLoop) -> dict[str, list[Direction]]:
    """Directions of each case by its name."""
    base = [Direction("parameter", p.name) for p in loop.parameters]
    essential = [Direction("parameter", name) for name in TX40_ESSENTIAL]
    gains = [Direction("law", "kp", j) for j in range(loop.robot.size)]
    return {
        "1 parameter": essential[:1],
        "28 essential parameters, 6 gains": essential + gains,
        f"{len(base)} base parameters": base,
    }


def simulated(loop: ParametrisedLoop, directions: list[Direction]) -> float:
    """Processor time of one run [s]."""
    start = process_time()
    if directions:
        for block in tangent_blocks(loop, directions):
            assert np.isfinite(block.q[-1]).all()
    else:
        for _ in simulate_blocks(
            loop.model, loop.controller, loop.signals, loop.robot.joint_names, loop.begin
        ):
            pass
    return process_time() - start


def main() -> None:
    """Print the time of every case beside that of the simulation, medians of interleaved runs."""
    loop = tx40_loop()
    every = {"simulation": []} | cases(loop)
    for directions in every.values():
        simulated(loop, directions)  # compiled, and in the caches
    times = {name: [] for name in every}
    for _ in range(REPEATS):
        for name, directions in every.items():
            times[name].append(simulated(loop, directions))
    plain = float(np.median(times["simulation"]))
    for name, own in times.items():
        seconds = float(np.median(own))
        print(f"{name:34} {1e3 * seconds:8.1f} ms {seconds / plain:8.2f} simulations")


if __name__ == "__main__":
    main()
