"""Compiled code for the next method, made beside the present one on a second core.

Numba compiles under one lock, so that threads do not help. A process of its own does: it runs what
is named on a tiny record of a planar arm, which compiles the kernels that every robot shares, and
leaves them in the cache on disk. Where this process comes to need one of them, it finds it there.
"""

from __future__ import annotations

import atexit
import subprocess
import sys
from typing import Any

#: What can be compiled ahead: the kernels of the estimators, and those of the simulated loop.
ESTIMATORS, LOOP = "estimators", "loop"


def compile_ahead(*parts: str) -> None:
    """Start a process that compiles, unless everything is in the cache already."""
    if _is_compiled():
        return
    process = subprocess.Popen(
        [sys.executable, "-m", __name__, *parts],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    atexit.register(_end, process)


def _end(process: subprocess.Popen) -> None:
    """Leave no process behind; the cache is written file by file, each of them whole."""
    process.kill()
    process.wait()


def _is_compiled() -> bool:
    """Whether the cache holds the observation matrix and the loop, the longest of all."""
    from pivident.dynamics.regressor_kernels import observe
    from pivident.simulation.loop_kernel import run_loop

    kernels: tuple[Any, ...] = (observe, run_loop)
    return all(kernel._cache._cache_file._load_index() for kernel in kernels)


def _estimators() -> None:
    """Smoother, observation matrix, prefilters and noise models, on two seconds of noise."""
    import numpy as np

    from pivident.estimation.identify import identify
    from pivident.estimation.methods import LeastSquares, RandomWalk
    from pivident.estimation.problem import Problem
    from pivident.recording.recording import Recording
    from pivident.robot.gallery import load_robot
    from pivident.signals.noise_models import fit_ar
    from pivident.signals.prefilter import Prefilter

    robot, rate = load_robot("planar_2r"), 1000.0
    t = np.arange(2000) / rate
    noise = np.random.default_rng(0).standard_normal((t.size, 2))
    q = np.stack([np.sin(9.0 * t), np.cos(7.0 * t)], axis=1)
    recording = Recording("tiny", robot.joint_names, q + 1e-5 * noise, 10.0 * q + noise, rate)
    identify(Problem(robot, (recording,)), LeastSquares(signals=RandomWalk()))
    model = fit_ar(noise[:, 0])
    stack = np.ascontiguousarray(np.repeat(noise.T, 8, axis=0))
    for poles in ((1.0,), (1.0, -0.5)):
        Prefilter((1.0, -0.9), poles, model.coefficients, 1.0).stream(len(stack)).process(
            stack, stack
        )


def _loop() -> None:
    """The simulated loop of a planar arm that holds its position."""
    import numpy as np

    from pivident.estimation.problem import Loop
    from pivident.robot.gallery import load_robot
    from pivident.simulation.controllers import PD
    from pivident.simulation.simulated_record import simulate

    simulate(load_robot("planar_2r"), Loop(PD(100.0, 10.0)), np.zeros((100, 2)))


if __name__ == "__main__":
    for part in sys.argv[1:]:
        {ESTIMATORS: _estimators, LOOP: _loop}[part]()
