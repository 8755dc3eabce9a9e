"""Digest of results on serial arms, and their time: two versions of the program side by side.

    PYTHONPATH=VERSION_A/src python benchmarks/serial_arms.py
    PYTHONPATH=VERSION_B/src python benchmarks/serial_arms.py

Simulated records of the gallery's arms and their estimates by LS, IV, PIV and DIDIM, to the last
bit (one thread), with the least processor time of the simulation and of PIV.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable

import numpy as np

import pivident as pv
from pivident.loop import virtual_pd

ROBOTS = ("staubli_tx40", "mitsubishi_rv2sq", "planar_2r", "emps")

TIMES = 20


def least(run: Callable[[], object]) -> float:
    """The least processor time of a call [ms]."""
    found = []
    for _ in range(TIMES):
        start = time.process_time()
        run()
        found.append(time.process_time() - start)
    return 1e3 * min(found)


def main() -> None:
    """Run as a script."""
    for name in ROBOTS:
        robot = pv.load_robot(name)
        loop = pv.Loop(virtual_pd(robot, np.zeros(robot.size)))
        options = {"duration": 4.0, "rate": 1000, "encoder": 1e-6, "torque": 0.05, "seed": 1}
        made = pv.simulate(robot, loop, **options)
        problem = pv.Problem(robot, (made.recording,), loop)
        digest = hashlib.sha256(made.motion.q.tobytes() + made.motion.ddq.tobytes())
        for method in ("ls", "iv", "piv", "didim"):
            result = pv.identify(problem, method)
            digest.update(result.theta.tobytes() + result.covariance.tobytes())
        simulated = least(lambda r=robot, c=loop, o=options: pv.simulate(r, c, **o))
        solved = least(lambda p=problem: pv.identify(p, "piv"))
        print(f"{name:18} {digest.hexdigest()[:16]}  {simulated:7.1f} ms  {solved:7.1f} ms")


if __name__ == "__main__":
    main()
