"""Do the intervals hold? 50 simulated records, identified on all cores, and their coverage."""

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

import numpy as np

import pivident as pv

LOOP = pv.Loop(pv.PD(kp=[6000.0, 2500.0], kd=[180.0, 60.0]))
ENCODER, TORQUE = 5e-6, 0.05  # standard deviations of the noise [rad and N m]


def held(seed: int, duration: float, level: float) -> list[bool]:
    """Whether the interval of each parameter holds its true value, on one record."""
    robot = pv.load_robot("planar_2r")
    made = pv.simulate(robot, LOOP, duration=duration, encoder=ENCODER, torque=TORQUE, seed=seed)
    result = pv.identify(pv.Problem(robot, (made.recording,), LOOP), "piv")
    truth = np.array([made.truth[name] for name in result.names])
    low, high = result.conf_int(level).T
    return [bool(inside) for inside in (low <= truth) & (truth <= high)]


def coverage(seeds: Sequence[int], duration: float = 10.0, level: float = 0.95) -> float:
    """Share of all intervals that hold the true value; an error of a run names its joint."""
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        runs = pool.map(partial(held, duration=duration, level=level), seeds)
        return float(np.mean(list(runs)))


if __name__ == "__main__":
    print(f"{100 * coverage(range(50)):.1f} % of the 95 % intervals hold the true value")
