"""Compiled code for the next method, made beside the present one on a second core.

Numba compiles under one lock, so that threads do not help. A process of its own does: it simulates
and identifies a planar arm, which compiles the kernels that every robot shares, and leaves them in
the cache on disk. Where this process comes to need one of them, it finds it there. It begins with
the observation matrix and goes on to least squares; so the other one begins with the simulated
loop, the longest of all, and goes on from the end, with the noise models.
"""

from __future__ import annotations

import atexit
import subprocess
import sys

import numpy as np

from pivident.app.cli.console import note
from pivident.foundation.compiled import is_compiled


def compile_ahead(simulated: bool = True) -> None:
    """Start a process that compiles, unless the longest kernels are in the cache already.

    ``simulated``: whether that of the simulated loop is needed, which is long to import, too.
    """
    there = not is_first_run()
    if there and simulated:
        from pivident.loop.simulation.loop_kernel import run_loop

        there = is_compiled(run_loop)
    if there:
        return
    process = subprocess.Popen(
        [sys.executable, "-m", __name__],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    atexit.register(_end, process)


def is_first_run() -> bool:
    """Whether not even the observation matrix is in the cache, which every command needs."""
    from pivident.dynamics.regressor_kernels import observe

    return not is_compiled(observe)


def compile_in_first_run() -> None:
    """Let the first command of all compile what the next one needs, beside its own work."""
    if is_first_run():
        from pivident.experiment.check.plan import COMPILING
        from pivident.foundation.text.numbers import time_in_words

        note(
            f"Compiling for this computer takes about {time_in_words(COMPILING[0])}, in this first "
            "run only."
        )
        compile_ahead()


def _end(process: subprocess.Popen) -> None:
    """Leave no process behind; the cache is written file by file, each of them whole."""
    process.kill()
    process.wait()


def compile_shared() -> None:
    """Run, on two seconds of a planar arm and on noise, what every robot needs."""
    from pivident.dynamics.forward import mass_matrix
    from pivident.dynamics.parameters import nominal_values, standard_parameters
    from pivident.estimation.identify import identify
    from pivident.estimation.methods import METHODS
    from pivident.estimation.problem import Loop, Problem
    from pivident.loop.simulation.controllers import PD
    from pivident.loop.simulation.simulated_record import loop_motion, simulate
    from pivident.robot.gallery import load_robot
    from pivident.signals.noise_models import fit_ar
    from pivident.signals.prefilter import Prefilter

    robot, loop, rate = load_robot("planar_2r"), Loop(PD(2000.0, 100.0)), 1000.0
    standard = standard_parameters(robot)
    values = nominal_values(robot, standard)
    loop_motion(robot, loop, rate, (np.zeros((10, 2)),) * 3, standard, values)
    noise = np.random.default_rng(0).standard_normal((8, 30000))
    model = fit_ar(noise[0])
    for rows in (1, 8):  # one by one and side by side
        part = noise[:rows].copy()
        Prefilter((1.0, -0.9), (1.0,), model.coefficients, 1.0).stream(rows).process(part, part)
    mass_matrix(robot, standard, values, np.zeros((1, 2)))
    made = simulate(robot, loop, rate=rate, duration=2.0, encoder=1e-5, torque=0.1)
    identify(Problem(robot, (made.recording,), loop), METHODS["piv"])


if __name__ == "__main__":
    compile_shared()
