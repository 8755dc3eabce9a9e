"""Results of several methods on a simulated record of the planar arm, in its own loop."""

from functools import cache

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.robot.gallery import load_robot
from tests.planar_log import RATE, planar_log

LAW = PD(kp=[6000, 2500], kd=[180, 60])


@cache
def planar_results(*methods: str) -> tuple[Identification, ...]:
    """Estimates by the names of the methods, from 6 s at 1 kHz."""
    table = planar_log()[:6000]
    q, q_ref = np.deg2rad(table[:, 1:3]), np.deg2rad(table[:, 3:5])
    robot = load_robot("planar_2r")
    names = ("shoulder", "elbow")
    recording = Recording("run1", names, q, table[:, 5:7], RATE, q_ref=q_ref)
    problem = Problem(robot, (recording,), Loop(LAW))
    return tuple(identify(problem, method) for method in methods)
