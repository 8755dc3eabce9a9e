"""From a robot to the motion whose record determines most of its parameters."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pivident.collision.clearances import Clearances
from pivident.errors import ExperimentError
from pivident.estimation.identification import Identification
from pivident.excitation.checked_motion import FineCheck, with_more_room
from pivident.excitation.criteria import Objective
from pivident.excitation.design import ClearanceUse, Design
from pivident.excitation.design_account import account
from pivident.excitation.design_task import DesignTask
from pivident.excitation.design_text import share_words
from pivident.excitation.feasibility import check_ranges, check_start, check_travel, why_none
from pivident.excitation.knowledge import Knowledge, knowledge
from pivident.excitation.limits import PLANNED_SHARE, ROOM, JointLimits, joint_limits
from pivident.excitation.motions import ExcitingMotion
from pivident.excitation.questions import Question, robot_question
from pivident.excitation.request import MIN_DURATION, DesignRequest, chosen_parameters
from pivident.excitation.search import Best, Search
from pivident.robot.description import Robot
from pivident.robot.refusals import without_loops
from pivident.text.lists import listed

#: Durations between which a goal is looked for: no nearer than this share.
DURATION_SHARE = 0.1

#: Durations that are tried are multiples of this [s].
DURATION_STEP = 0.1

#: What there is for a robot with closed loops.
DESIGNED_ELSEWHERE = "record a motion of your own, and look at it with pivident audit"

Say = Callable[[str], None]


def design_motion(
    robot: Robot,
    request: DesignRequest | None = None,
    *,
    limits: JointLimits | None = None,
    after: Sequence[Identification] = (),
    clearances: Clearances | None = None,
    question: Callable[[Knowledge], Question] | None = None,
    torque_noise: np.ndarray | None = None,
    progress: Say | None = None,
) -> Design:
    """Find the motion whose record determines the parameters best, within all limits.

    Args:
        robot: the robot.
        request: what is asked; None: all parameters, in a motion of 20 s.
        limits: of the joints; None: those of the description.
        after: earlier results, the last one first: their noise and information count.
        clearances: what bodies must keep from each other in these limits, made of
            ``limits.of_robot(robot)`` where they are wider than the description's; None: nothing
            is checked.
        question: makes what is asked from what is known; None: the parameters of ``request``.
        torque_noise: standard deviation of the torque where ``after`` does not give it, shape
            (joints,) [N m or N]; None: a share of the largest torques.
        progress: called with one line at each improvement.

    Returns:
        The design. Ctrl-C ends the search with the best motion so far.

    Raises:
        ExperimentError: unknown parameters or joints, limits that contradict, a start in collision,
            a duration too short for the limits.
        RobotDescriptionError: a robot with closed loops.
    """
    without_loops(robot, "the design of motions", DESIGNED_ELSEWHERE)
    say = progress or (lambda line: None)
    request = request or DesignRequest()
    limits = limits or joint_limits(robot)
    known = knowledge(robot, limits, after, torque_noise)
    if question is not None and request.parameters:
        raise ExperimentError(
            f"{listed(list(request.parameters))} cannot be chosen where the question is about a "
            "load or drive gains: all of its unknowns count",
            advice="leave the parameters out",
        ).about("parameters")
    if request.goal is not None and question is None and not request.parameters:
        raise ExperimentError(
            "a goal needs the parameters that must reach it, such as --for zz3r,fc5 --to 2%"
        ).about("to")
    if question is None:
        asked = chosen_parameters(known.base, request.parameters)
        made = robot_question(known.base, known.values, asked)
    else:
        made = question(known)
    task = DesignTask(robot, request, limits, known, made, clearances)
    check_ranges(task)
    check_start(task)
    check_travel(task)
    say(f"searching for {request.seconds:g} s (Ctrl-C keeps the best motion so far)")
    begin = time.perf_counter()
    if request.goal is None:
        design, _ = _designed(task, request.duration, request.seconds, say)
    else:
        design = _shortest(task, request.goal, say)
    return replace(design, seconds=time.perf_counter() - begin)


def _shortest(task: DesignTask, goal: float, say: Say) -> Design:
    """The shortest motion that gives each parameter that is asked for a standard error.

    Standard errors fall with the root of the duration, which is what the next one is tried from.
    """
    longest, tries = task.request.duration, 5
    seconds = task.request.seconds / (tries + 1)
    best, ended = _designed(task, longest, 2.0 * seconds, say)
    if _worst(best) > goal and not ended:  # whatever time is left goes into the longest motion
        left = task.request.seconds - 2.0 * seconds
        best, ended = _designed(task, longest, left, say, best.motion.coefficients)
    if _worst(best) > goal:
        return replace(best, notes=(_goal_missed(best, goal, longest), *best.notes))
    low, tried, reached = 0.0, longest, _worst(best)
    for _ in range(tries - 1):
        high = best.motion.duration
        if ended or high - low <= DURATION_SHARE * high:
            break
        likely = tried * (reached / goal) ** 2
        wanted = float(np.clip(likely, low + 0.1 * (high - low), high - 0.1 * (high - low)))
        wanted = round(wanted / DURATION_STEP) * DURATION_STEP
        if wanted < MIN_DURATION or not low < wanted < high:
            break
        say(f"{100 * goal:.3g} % in {wanted:.3g} s?")
        try:
            found, ended = _designed(task, wanted, seconds, say)
        except ExperimentError:  # too short for the limits
            low = tried = wanted
            reached = goal
            continue
        tried, reached = wanted, _worst(found)
        if reached <= goal:
            best = found
        else:
            low = wanted
    if low > 0.0:
        note = (
            f"This is the shortest motion that was found to reach {100 * goal:g} %: none of "
            f"{low:g} s did."
        )
        best = replace(best, notes=(*best.notes, note))
    return best


def _worst(design: Design) -> float:
    """Largest standard error over its size of the parameters that were asked for."""
    return max(p.share for p in design.predicted if p.wanted)


def _goal_missed(design: Design, goal: float, longest: float) -> str:
    """What the best motion reaches, and what binds."""
    wanted = [p for p in design.predicted if p.wanted]
    reached = ", ".join(f"{p.name} to {share_words(p)}" for p in wanted)
    text = (
        f"No motion of up to {longest:g} s reaches {100 * goal:g} %: the best one gives {reached}"
    )
    binding = dict.fromkeys(
        b.name if isinstance(b, ClearanceUse) else f"{b.quantity} of {b.joint}"
        for b in design.binding
    )
    if binding:
        text += f". What binds: {listed(list(binding))}"
    return f"{text}. A longer motion, other limits or less noise would give more."


def _designed(
    task: DesignTask,
    duration: float,
    seconds: float,
    say: Say,
    first: np.ndarray | None = None,
) -> tuple[Design, bool]:
    """One search with one duration, and whether the user has ended it.

    ``first``: coefficients that it begins with.
    """
    family = task.family(duration)
    allowed = task.constraints(family)
    fine = FineCheck.of(allowed)
    search = Search(
        task.objective(with_more_room(allowed, PLANNED_SHARE, ROOM)),
        None if task.request.start is None else np.array(task.request.start, dtype=float),
        task.request.seed,
        seconds,
        say,
    )
    best = search.run(first)
    if best.coefficients is None:
        raise ExperimentError(why_none(task, allowed, duration)).about("duration")
    coefficients = _kept(search.objective, fine, best)
    if coefficients is None:
        raise ExperimentError(
            "every motion that was found breaks a limit between the samples of the search",
            advice="give the search more time, or a larger clearance",
        )
    return account(task, fine, ExcitingMotion(family, coefficients), best), best.interrupted


def _kept(objective: Objective, fine: FineCheck, best: Best) -> np.ndarray | None:
    """The best motion that keeps all limits on the fine grid, never worse than the first one."""
    tried = [best.coefficients, *reversed(best.earlier), best.first_coefficients]
    repaired = (fine.repaired(x) for x in tried if x is not None)
    found = next((x for x in repaired if x is not None), None)
    first = None if best.first_coefficients is None else fine.repaired(best.first_coefficients)
    if found is None or first is None:
        return found
    return found if objective.value(found) <= objective.value(first) else first
