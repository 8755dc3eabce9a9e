"""From a robot to the motion whose record determines most of its parameters, and its account.

Everything that is known of a motion before the robot moves.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from pivident.estimation.identification import Identification
from pivident.foundation.errors import ExperimentError
from pivident.foundation.progress import Say
from pivident.foundation.text.sentences import listed
from pivident.loop.motion.wanted_motion import RISE
from pivident.robot.description import Robot
from pivident.robot.refusals import without_loops
from pivident.studies.collision.clearances import Clearances
from pivident.studies.excitation.account import percentage
from pivident.studies.excitation.checked_motion import FineCheck, with_more_room
from pivident.studies.excitation.criteria import Objective, condition_number, standard_errors
from pivident.studies.excitation.design import PAGE_RATE, ClearanceUse, Design, PredictedError
from pivident.studies.excitation.design_task import (
    SAMPLES,
    DesignTask,
    check_ranges,
    check_start,
    check_travel,
    why_none,
)
from pivident.studies.excitation.knowledge import Knowledge, knowledge
from pivident.studies.excitation.limits import (
    PLANNED_SHARE,
    ROOM,
    JointLimits,
    joint_limits,
    wider_than_described,
)
from pivident.studies.excitation.motions import ExcitingMotion
from pivident.studies.excitation.questions import Question, robot_question
from pivident.studies.excitation.request import MIN_DURATION, DesignRequest, chosen_parameters
from pivident.studies.excitation.search import Best, Search

#: Durations between which a goal is looked for: no nearer than this share.
DURATION_SHARE = 0.1
#: Durations that are tried are multiples of this [s].
DURATION_STEP = 0.1
#: What there is for a robot with closed loops.
DESIGNED_ELSEWHERE = "record a motion of your own, and look at it with pivident audit"


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
    reached = ", ".join(f"{p.name} to {percentage(p.share)}" for p in wanted)
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


def account(task: DesignTask, fine: FineCheck, motion: ExcitingMotion, best: Best) -> Design:
    """Everything that is known of a motion before the robot moves."""
    question, criterion = task.question, task.criterion
    found = motion.coefficients if best.first_coefficients is None else best.first_coefficients
    first = ExcitingMotion(motion.family, found)
    information, of_record = task.predicted(motion)
    start, _ = task.predicted(first)
    rate = 2.0 * SAMPLES / motion.family.time_scale
    bare = task.information(rate, bare=True)
    bare_start, bare_end = (bare.of(m.one_round.sampled(rate)) for m in (first, motion))
    cost = [
        criterion.reached(i if criterion.weighted else b)
        for i, b in ((start, bare_start), (information, bare_end))
    ]
    std, alone = standard_errors(information), standard_errors(of_record)
    limits = fine.limit_uses(task.robot, motion.coefficients)
    asked = set(question.asked.tolist()) if task.request.parameters or question.runs else set()
    earlier = np.full(question.size, np.inf)
    if task.known.earlier.any():
        earlier[: len(task.known.base)] = standard_errors(task.known.earlier)
    sizes = criterion.sizes
    predicted = tuple(
        PredictedError(
            name=question.names[k],
            unit=question.units[k],
            value=float(question.values[k]),
            std=float(std[k]),
            before=float(earlier[k]),
            wanted=k in asked,
            remark=_remark(task, k, std[k], sizes[k], limits),
            alone=float(alone[k]),
            size=float(sizes[k]),
        )
        for k in range(question.size)
    )
    torque, margin = _torques(task, motion)
    room = task.clearances
    return Design(
        robot=task.robot,
        motion=motion,
        criterion=_criterion_words(task),
        cost=(cost[0], cost[1]),
        cost_words=criterion.words,
        condition=(condition_number(bare_start), condition_number(bare_end)),
        predicted=predicted,
        correlation=_correlation(information),
        limits=limits,
        clearances=fine.clearance_uses(motion.coefficients),
        noise=task.known.noise_words,
        notes=tuple(_notes(task)),
        settings=_settings(task),
        bodies=() if room is None else room.bodies,
        obstacles=() if room is None else room.surroundings,
        seconds=task.request.seconds,
        torque=torque,
        torque_margin=margin,
    )


def _settings(task: DesignTask) -> dict[str, Any]:
    """What was asked for, without what was left open."""
    asked = asdict(task.request)
    given = {
        k: x for k, x in asked.items() if x is not None and not (isinstance(x, tuple) and not x)
    }
    return given | ({} if task.question.runs is None else {"about": task.question.about})


def _torques(
    task: DesignTask, motion: ExcitingMotion
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Torque of the present model along the motion with two standard errors, for its page."""
    if not task.torques:
        return None, None
    torque, margin = task.torques[-1].torque_and_margin(motion.sampled(PAGE_RATE))
    return torque, margin if task.known.covariance is not None else None


def _criterion_words(task: DesignTask) -> str:
    """The criterion and the parameters that count."""
    name = task.request.criterion_used
    if task.request.parameters:
        return f"{name} of {listed(list(task.request.parameters))}"
    return name if task.question.runs is None else f"{name} of {task.question.words}"


def _remark(task: DesignTask, k: int, std: float, size: float, limits: tuple) -> str:
    """Why a parameter remains undetermined; empty where it does not."""
    if std <= size:
        return ""
    base = task.known.base
    if k >= len(base):
        return "not determined within the limits"
    joints = {task.robot.joints[j].name for j in task.robot.ancestors(base.parameters[k].joint)}
    binding = [f"{u.quantity} of {u.joint}" for u in limits if u.joint in joints and u.share > 0.9]
    text = "its torque stays within the noise in all motions that were found"
    return f"{text}; what binds: {listed(binding)}" if binding else text


def _correlation(information: np.ndarray) -> np.ndarray:
    """Correlations of the estimates, shape (unknowns, unknowns)."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    inverse = np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-14, hermitian=True)
    std = np.sqrt(np.maximum(np.diag(inverse), 1e-300))
    return inverse / np.outer(std, std)


def _notes(task: DesignTask) -> list[str]:
    """Assumptions and what was not checked."""
    notes = [*task.known.notes, *task.question.notes]
    if "assumed" in task.limits.source.get("acceleration", ()):
        notes.append(
            f"No largest accelerations are known: a joint is taken to reach its largest speed in "
            f"{RISE:g} s. Give those of your controller: acceleration = 15 (rad/s² or m/s²) in the "
            "table [excite]."
        )
    if not task.torques:
        notes.append(
            "No masses are known, so that torques cannot be computed and their limits were not "
            "checked. Run the slow programs first, and watch the torques."
        )
    elif np.isinf(task.limits.torque).all():
        notes.append("No torque limits are known: torques were not limited.")
    elif not task.known.earlier.any():
        notes.append(
            "Torques are those of the description, without the uncertainty of its masses and "
            "without friction that it does not have. Run the slow programs first."
        )
    if len(task.question.loads) > 1:
        notes.append(
            "The motion is run twice, without and with the load. The clearances are those of the "
            "bodies that are given: give one for the load, too, [[excite.body]]."
        )
    notes += wider_than_described(task.robot, task.limits)
    if task.clearances is None:
        notes.append(
            "No bodies are known: collisions of the arm with itself and with what stands around it "
            "were not checked."
        )
    if hidden := task.known.base.without_effect.size:
        names = [task.known.base.standard[i].name for i in task.known.base.without_effect]
        notes.append(
            f"{hidden} parameters have no effect on any torque, whatever the motion, and are not "
            f"part of the model: {listed(names)}."
        )
    if task.clearances is not None:
        notes += task.clearances.remarks
    return notes


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
        raise why_none(task, allowed, duration).about("duration")
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
