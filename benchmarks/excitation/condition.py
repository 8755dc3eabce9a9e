"""Condition number of a TX40's observation matrix, from a poor start to the design.

    python -m benchmarks.excitation.condition [--seconds 25]

The start is a random motion so small that cond(W) is above 1000, W the observation matrix of all
base parameters in SI units. Self-collision counts. Printed: cond at start and end, time, and the
largest share of a limit on a grid ten times finer than that of the search, by constraints that are
made anew. The motion of Brunot et al. (2018) has cond = 200.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from pivident.experiment.excite_keys import ExciteEntry
from pivident.robot.gallery import load_robot
from pivident.studies.collision.room import clearances_of_room
from pivident.studies.excitation.checked_motion import FineCheck, with_more_room
from pivident.studies.excitation.criteria import condition_number
from pivident.studies.excitation.design_motion import _designed
from pivident.studies.excitation.design_task import DesignTask
from pivident.studies.excitation.knowledge import knowledge
from pivident.studies.excitation.limits import PLANNED_SHARE, ROOM, joint_limits
from pivident.studies.excitation.questions import robot_question
from pivident.studies.excitation.request import DesignRequest
from pivident.studies.excitation.search import random_coefficients

POOR = 1000.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=25.0)
    options = parser.parse_args()
    robot = load_robot("staubli_tx40")
    room = clearances_of_room(robot, ExciteEntry.model_validate({}))
    limits = joint_limits(robot)
    known = knowledge(robot, limits)
    question = robot_question(known.base, known.values)
    for motion in ("fourier", "splines", "postures"):
        request = DesignRequest(
            duration=10.0, motion=motion, criterion="cond", seconds=options.seconds
        )
        task = DesignTask(robot, request, limits, known, question, room)
        constraints = with_more_room(task.constraints(task.family(10.0)), PLANNED_SHARE, ROOM)
        start = poor_start(task, constraints)
        begin = time.perf_counter()
        design, _ = _designed(task, 10.0, options.seconds, lambda line: None, start)
        seconds = time.perf_counter() - begin
        fine = FineCheck.of(task.constraints(design.motion.family))
        share = fine.constraints.largest_ratio(design.motion.coefficients)
        before, after = bare(task, constraints, start), design.condition[1]
        nearest = min(c.least - c.needed for c in design.clearances)
        print(
            f"{motion:9} {len(known.base)} base parameters, 10 s: cond {before:.0f} -> {after:.1f} "
            f"in {seconds:.1f} s; largest share of a limit {share:.3f}, nearest bodies "
            f"{1e3 * nearest:.1f} mm beyond the clearance",
            flush=True,
        )


def bare(task: DesignTask, constraints, coefficients: np.ndarray) -> float:
    """cond(W) of a motion."""
    rate = (constraints.functions.shape[1] - 1) / constraints.family.duration
    q, dq, ddq, _ = constraints.motion(coefficients)
    return condition_number(task.information(rate, bare=True).of((q, dq, ddq)))


def poor_start(task: DesignTask, constraints) -> np.ndarray:
    """A random motion, made smaller until cond(W) is above 1000."""
    rng = np.random.default_rng(40)
    drawn = None
    while drawn is None:
        drawn = random_coefficients(constraints, rng, None)
    while bare(task, constraints, drawn) < POOR:
        drawn[1:] *= 0.9
    return drawn


if __name__ == "__main__":
    main()
