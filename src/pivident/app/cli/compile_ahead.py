"""Compiled code for the next method, made beside the present one on a second core.

Numba compiles under one lock, so that threads do not help. A process of its own does: it simulates
and identifies a planar arm, which compiles the kernels that every robot shares, and leaves them in
the cache on disk. Where this process comes to need one of them, it finds it there. It begins with
the observation matrix and goes on to least squares; so the other one begins with the simulated
loop, the longest of all, and goes on from the end, with the noise models.

Designs beside the records of an experiment: what they predicted, and what was reached.
"""

from __future__ import annotations

import atexit
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pivident.app.cli.console import Progress, missing_package
from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification
from pivident.experiment.experiment import Experiment
from pivident.experiment.recording_tables import design_file
from pivident.foundation.compiled import is_compiled
from pivident.foundation.errors import PividentError

if TYPE_CHECKING:
    from pivident.studies.excitation.reached import ReachedErrors


def compile_ahead() -> None:
    """Start a process that compiles, unless the longest kernels are in the cache already."""
    from pivident.dynamics.regressor_kernels import observe
    from pivident.loop.simulation.loop_kernel import run_loop

    if is_compiled(observe) and is_compiled(run_loop):
        return
    process = subprocess.Popen(
        [sys.executable, "-m", __name__],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    atexit.register(_end, process)


def _end(process: subprocess.Popen) -> None:
    """Leave no process behind; the cache is written file by file, each of them whole."""
    process.kill()
    process.wait()


def compile_shared() -> None:
    """Run, on two seconds of a planar arm and on noise, what every robot needs."""
    import numpy as np

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


#: Files of the comparison in a folder of results.
TEXT_FILE, JSON_FILE = "design_check.txt", "design_check.json"


def designs_beside(
    experiment: Experiment,
    recordings: Sequence[Recording],
    result: Identification,
    progress: Progress,
) -> tuple[ReachedErrors, ...]:
    """What designs predicted of the records that follow them, beside what a result reached.

    A design that cannot be read is reported and ends nothing. Without any, the package that designs
    motions is not needed.
    """
    folder = experiment.path.parent
    files = [design_file(entry, folder) for entry in experiment.content.recording]
    if not any(files):
        return ()
    found: list[ReachedErrors] = []
    try:
        from pivident.studies.excitation.reached import reached_errors
    except ModuleNotFoundError as error:
        if missing_package(error) is None:
            raise
        progress.keep("the design beside the log is not compared: this installation has no "
                      "'excitation'")  # fmt: skip
        return ()
    for file in dict.fromkeys(f for f in files if f is not None):
        own = [f if f == file else None for f in files]
        try:
            found += reached_errors(own, recordings, result)
        except PividentError as error:
            progress.keep(f"the design is not compared: {error}")
    return tuple(found)


def write_designs(found: Sequence[ReachedErrors], build: Path) -> None:
    """The comparisons as text and as JSON; nothing where there is none."""
    if not found:
        return
    from pivident.foundation.text.plain_values import write_json

    text = "\n\n".join(map(str, found))
    (build / TEXT_FILE).write_text(f"{text}\n", encoding="utf-8", errors="backslashreplace")
    write_json(build / JSON_FILE, {"schema": 1, "designs": [own.to_values() for own in found]})
