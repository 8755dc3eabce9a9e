"""Results of methods that fit a simulation, on a simulated record of the planar arm."""

from dataclasses import replace
from functools import cache

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.method import Method
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.judgement.diagnostics.diagnostics import Diagnostics, diagnose
from pivident.loop.simulation.control_loop import Loop
from pivident.robot.gallery import load_robot
from tests.planar_log import RATE, planar_log
from tests.planar_results import LAW

#: CLOE finds the delay, of which there is none, and the gains with the model.
SIMULATIONS: dict[str, Method] = {
    "piv": METHODS["piv"],
    "cloe": replace(METHODS["cloe"], free=("delay", "kp")),
    "ml": METHODS["ml"],
    "oloe": replace(METHODS["oloe"], horizon=1.0),
}


@cache
def planar_problem(law=LAW) -> Problem:
    """6 s at 1 kHz, in the loop of a law."""
    table = planar_log()[:6000]
    q, q_ref = np.deg2rad(table[:, 1:3]), np.deg2rad(table[:, 3:5])
    recording = Recording("run1", ("shoulder", "elbow"), q, table[:, 5:7], RATE, q_ref=q_ref)
    return Problem(load_robot("planar_2r"), (recording,), Loop(law))


@cache
def simulated_results() -> dict[str, Identification]:
    """Estimates by short name."""
    return {name: identify(planar_problem(), method) for name, method in SIMULATIONS.items()}


@cache
def simulated_diagnostics() -> Diagnostics:
    """Everything that is asked of them."""
    return diagnose(planar_problem(), simulated_results(), SIMULATIONS, folds=4)
