"""From a robot to the motion whose record tells most about it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pivident.errors import ExperimentError
from pivident.estimation.identification import Identification
from pivident.excitation.checked_motion import FineCheck, with_more_room
from pivident.excitation.constraints import Clearances, Constraints
from pivident.excitation.criteria import Criterion, condition_number, standard_errors
from pivident.excitation.descent import Best
from pivident.excitation.design import PAGE_RATE, ClearanceUse, Design, PredictedError
from pivident.excitation.information import Information, assumed_noise
from pivident.excitation.knowledge import Knowledge, knowledge
from pivident.excitation.limits import PLANNED_SHARE, JointLimits, joint_limits
from pivident.excitation.motions import ExcitingMotion, MotionFamily
from pivident.excitation.objective import Objective
from pivident.excitation.questions import Question, robot_question
from pivident.excitation.request import DesignRequest, chosen_parameters, motion_family
from pivident.excitation.search import Search
from pivident.excitation.torque_bound import TorqueModel
from pivident.robot.description import Robot
from pivident.text.lists import listed

#: Samples of the search in the shortest time in which a motion changes its course.
SAMPLES = 12

#: Room beyond the clearance that the search keeps, for what happens between its samples [m].
ROOM = 0.01

#: Rate at which standard errors are predicted in the end [Hz].
PREDICTION_RATE = 200.0

#: Durations between which a goal is looked for: no nearer than this share.
DURATION_SHARE = 0.1

#: Share of its range that a joint must be able to move over in half the time.
LEAST_TRAVEL = 0.01

#: Postures that are tried where no motion was found, and the share of them that says why.
TRIED_POSTURES, MOST_POSTURES = 500, 0.8

Say = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class DesignTask:
    """A robot, its limits, what is known of it, and what is asked."""

    robot: Robot
    request: DesignRequest
    limits: JointLimits
    known: Knowledge
    question: Question
    clearances: Clearances | None

    @property
    def criterion(self) -> Criterion:
        """The criterion in the units of the question."""
        sizes = self.known.sizes
        if self.question.size > sizes.size:  # further unknowns have the size of their values
            extra = np.abs(self.question.values[sizes.size :])
            extra = np.where(extra > 0.0, extra, np.median(extra[extra > 0.0]))
            sizes = np.concatenate([sizes, extra])
        all_asked = len(self.question.asked) == self.question.size
        chosen = None if all_asked else self.question.asked
        return Criterion(self.request.criterion_used, sizes, chosen)

    @property
    def torques(self) -> tuple[TorqueModel, ...]:
        """The present model in each run of the motion; none where no mass is known."""
        known = self.known
        if not known.has_masses:
            return ()
        return tuple(
            TorqueModel(known.regressor, known.model_values + load, known.covariance)
            for load in self.question.loads or (np.zeros(len(known.base)),)
        )

    def family(self, duration: float) -> MotionFamily:
        """Functions of a motion of that duration [s]."""
        return motion_family(self.request.motion, duration, self.limits)

    def constraints(self, family: MotionFamily) -> Constraints:
        """The user's limits, on the grid of the search."""
        rate = SAMPLES / family.time_scale
        return Constraints.of(family, rate, self.limits, self.torques, self.clearances)

    def information(self, rate: float, *, bare: bool = False) -> Information:
        """Information of motions sampled at a rate [Hz]; bare: of the unweighted matrix."""
        known, size = self.known, self.question.size
        if bare:
            noise = assumed_noise(np.ones(self.robot.size), rate)
            question = robot_question(known.base, known.values)
            size = question.size
            return Information(known.regressor, noise, rate, np.zeros((size, size)), question)
        earlier = np.zeros((size, size))
        earlier[: len(known.base), : len(known.base)] = known.earlier
        noise = known.noise
        if self.request.motion != "postures":
            # at rest a joint's speed is noise, and its friction any; one that turns round is not
            noise = replace(noise, standstill=np.zeros(self.robot.size))
        return Information(known.regressor, noise, rate, earlier, self.question)

    def objective(self, constraints: Constraints) -> Objective:
        """The criterion of motions under constraints."""
        samples = constraints.functions.shape[1]
        rate = (samples - 1) / constraints.family.duration
        bare = not self.criterion.weighted
        return Objective(self.criterion, self.information(rate, bare=bare), constraints)

    def predicted(self, motion: ExcitingMotion) -> tuple[np.ndarray, np.ndarray]:
        """Information of a motion at the rate of the prediction, and of its record alone."""
        rate = min(PREDICTION_RATE, self.known.noise.rate)
        rate = max(rate, 2.0 * SAMPLES / motion.family.time_scale)
        made = self.information(rate)
        alone = replace(made, earlier=np.zeros_like(made.earlier)).of(motion.sampled(rate))
        return made.earlier + alone, alone


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
        clearances: what bodies must keep from each other; None: nothing is looked at.
        question: makes what is asked from what is known; None: the parameters of ``request``.
        torque_noise: standard deviation of the torque where ``after`` does not tell it, shape
            (joints,) [N m or N]; None: a share of the largest torques.
        progress: called with one line at each improvement.

    Returns:
        The design. Ctrl-C ends the search with the best motion so far.

    Raises:
        ExperimentError: unknown parameters or joints, limits that contradict, a start in collision,
            a duration too short for the limits.
    """
    say = progress or (lambda line: None)
    request = request or DesignRequest()
    limits = limits or joint_limits(robot)
    known = knowledge(robot, limits, after, torque_noise)
    if question is None:
        asked = chosen_parameters(known.base, request.parameters)
        made = robot_question(known.base, known.values, asked)
    else:
        made = question(known)
    task = DesignTask(robot, request, limits, known, made, clearances)
    _check_start(task)
    _check_travel(task)
    if request.goal is None:
        return _designed(task, request.duration, request.seconds, say)
    return _shortest(task, request.goal, say)


def _shortest(task: DesignTask, goal: float, say: Say) -> Design:
    """The shortest motion that gives each chosen parameter a relative standard error.

    Standard errors fall with the root of the duration, which is what the next one is tried from.
    """
    longest, tries = task.request.duration, 5
    seconds = task.request.seconds / (tries + 1)
    design = _designed(task, longest, 2.0 * seconds, say)
    if _worst(design) > goal:  # whatever time is left goes into the longest motion
        left = task.request.seconds - 2.0 * seconds
        design = _designed(task, longest, left, say, design.motion.coefficients)
    best, low, high = design, 0.0, longest
    for _ in range(tries - 1):
        reached = _worst(design)
        if best is design and reached > goal and high == longest:
            note = _goal_missed(design, goal, longest)
            return replace(design, notes=(*design.notes, note))
        if reached <= goal:
            best, high = design, design.motion.duration
        else:
            low = design.motion.duration
        if high - low <= DURATION_SHARE * high:
            break
        likely = design.motion.duration * (reached / goal) ** 2
        wanted = float(np.clip(likely, low + 0.1 * (high - low), high - 0.1 * (high - low)))
        shortest = 2.0
        if wanted < shortest:
            break
        say(f"{100 * goal:.3g} % in {wanted:.3g} s?")
        try:
            design = _designed(task, wanted, seconds, say)
        except ExperimentError:  # too short for the limits
            low = wanted
            continue
    return best


def _worst(design: Design) -> float:
    """Largest relative standard error of the parameters that were asked for."""
    return max((p.relative for p in design.predicted if p.wanted), default=float("nan"))


def _goal_missed(design: Design, goal: float, longest: float) -> str:
    """What the best motion reaches, and what binds."""
    wanted = [p for p in design.predicted if p.wanted]
    reached = ", ".join(f"{p.name} to {100 * p.relative:.3g} %" for p in wanted)
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
) -> Design:
    """One search with one duration; ``first``: coefficients that it begins with."""
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
        raise ExperimentError(_why_none(task, allowed, duration)).about("duration")
    coefficients = _kept(search.objective, fine, best)
    if coefficients is None:
        raise ExperimentError(
            "every motion that was found breaks a limit between the samples of the search; give "
            "the search more time, or a larger clearance"
        )
    return _account(task, fine, ExcitingMotion(family, coefficients), best)


def _kept(objective: Objective, fine: FineCheck, best: Best) -> np.ndarray | None:
    """The best motion that keeps all limits on the fine grid, never worse than the first one."""
    tried = [best.coefficients, *reversed(best.earlier), best.first_coefficients]
    repaired = (fine.repaired(x) for x in tried if x is not None)
    found = next((x for x in repaired if x is not None), None)
    first = None if best.first_coefficients is None else fine.repaired(best.first_coefficients)
    if found is None or first is None:
        return found
    return found if objective.value(found) <= objective.value(first) else first


def _check_start(task: DesignTask) -> None:
    """Refuse a given posture that breaks a limit."""
    start = task.request.start
    if start is None:
        return
    posture, limits = np.array(start, dtype=float), task.limits
    if posture.shape != (task.robot.size,) or not np.isfinite(posture).all():
        raise ExperimentError(
            f"start has {posture.size} positions; one finite number for each of the "
            f"{task.robot.size} joints is needed"
        ).about("start")
    for j, joint in enumerate(task.robot.joints):
        if not limits.low[j] < posture[j] < limits.high[j]:
            raise ExperimentError(
                f"the start has {joint.name} at {posture[j]:g} {joint.position_unit}, outside of "
                f"its limits {limits.low[j]:g} to {limits.high[j]:g}; choose a posture inside"
            ).about("start")
    if task.clearances is not None:
        distances, needed = task.clearances.distances(posture[None])[:, 0], task.clearances.needed
        nearest = int(np.argmin(distances - needed)) if needed.size else 0
        if needed.size and distances[nearest] < needed[nearest]:
            raise ExperimentError(
                f"at the start, {task.clearances.names[nearest]}: the clearance is "
                f"{1e3 * distances[nearest]:.3g} mm, {1e3 * needed[nearest]:.3g} mm is needed; "
                "choose another start, or a smaller clearance"
            ).about("start")


def _check_travel(task: DesignTask) -> None:
    """Refuse a duration in which a joint hardly moves."""
    travel = 0.5 * task.limits.speed * task.request.duration / (2.0 * task.limits.half)
    slowest = int(np.argmin(travel))
    if travel[slowest] < LEAST_TRAVEL:
        joint = task.robot.joints[slowest]
        raise ExperimentError(
            f"in {task.request.duration:g} s {joint.name} moves over less than "
            f"{100 * LEAST_TRAVEL:g} % of its range at its largest speed, "
            f"{task.limits.speed[slowest]:g} {joint.position_unit}/s; give it more time, or a "
            "higher limit of the speed"
        ).about("duration")


def _why_none(task: DesignTask, allowed: Constraints, duration: float) -> str:
    """Why no motion was found."""
    rng = np.random.default_rng(task.request.seed)
    shape = (TRIED_POSTURES, task.robot.size)
    postures = task.limits.middle + rng.uniform(-0.9, 0.9, shape) * task.limits.half
    if task.clearances is not None:
        distances = task.clearances.distances(postures)
        near = distances < (task.clearances.needed + ROOM)[:, None]
        if near.any(axis=0).all():
            worst = task.clearances.names[int(np.argmax(near.mean(axis=1)))]
            return (
                f"no posture keeps all clearances: most often it is {worst}; check the bodies, "
                "obstacles, floor and tool box"
            )
    if task.torques:
        still = np.zeros_like(postures)
        torque, margin = task.torques[-1].torque_and_margin((postures, still, still))
        over = (np.abs(torque) + margin > task.limits.torque).mean(axis=0)
        if over.max() > MOST_POSTURES:
            joint = task.robot.joints[int(np.argmax(over))].name
            return (
                f"the torque limit of {joint} does not hold the arm against gravity in "
                f"{100 * over.max():.0f} % of its postures; check the limit and the masses"
            )
    return (
        f"no motion of {duration:g} s within the limits of position, speed, acceleration and "
        f"torque determines all {task.question.size} parameters ({allowed.family.size} functions "
        f"for each joint); give it more time, such as --duration {2 * duration:g}, or relax the "
        "limits"
    )


def _account(task: DesignTask, fine: FineCheck, motion: ExcitingMotion, best: Best) -> Design:
    """Everything that is known of a motion before the robot moves."""
    question, criterion = task.question, task.criterion
    first = ExcitingMotion(motion.family, _or(best.first_coefficients, motion.coefficients))
    information, of_record = task.predicted(motion)
    start, _ = task.predicted(first)
    rate = 2.0 * SAMPLES / motion.family.time_scale
    bare = task.information(rate, bare=True)
    bare_start, bare_end = bare.of(first.sampled(rate)), bare.of(motion.sampled(rate))
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
        notes=(*task.known.notes, *_notes(task), *(() if room is None else room.remarks)),
        settings=_settings(task),
        bodies=() if room is None else room.bodies,
        obstacles=() if room is None else room.obstacles,
        seconds=task.request.seconds,
        torque=torque,
        torque_margin=margin,
    )


def _settings(task: DesignTask) -> dict[str, Any]:
    """What was asked for, without what was left open."""
    given = {key: value for key, value in task.request.plain().items() if value not in (None, ())}
    return given | ({} if task.question.runs is None else {"about": task.question.words})


def _torques(
    task: DesignTask, motion: ExcitingMotion
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Torque of the present model along the motion with two standard errors, for its page."""
    if not task.torques:
        return None, None
    torque, margin = task.torques[-1].torque_and_margin(motion.sampled(PAGE_RATE))
    return torque, margin if task.known.covariance is not None else None


def _or(value: np.ndarray | None, other: np.ndarray) -> np.ndarray:
    return other if value is None else value


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
    text = "its torque stays within the noise in every motion that the limits allow"
    return f"{text}; what binds: {listed(binding)}" if binding else text


def _correlation(information: np.ndarray) -> np.ndarray:
    """Correlations of the estimates, shape (unknowns, unknowns)."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    inverse = np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-14, hermitian=True)
    std = np.sqrt(np.maximum(np.diag(inverse), 1e-300))
    return inverse / np.outer(std, std)


def _notes(task: DesignTask) -> list[str]:
    """Assumptions and what was not looked at."""
    notes = []
    assumed = task.limits.source.get("acceleration", ())
    if "assumed" in assumed:
        notes.append(
            "No largest accelerations are known: a joint is taken to reach its largest speed in "
            "0.25 s. Give those of your controller, [excite.joint.NAME] acceleration = 15."
        )
    if not task.torques:
        notes.append(
            "No masses are known, so that torques could not be told: their limits were not looked "
            "at. Run the motion at half the speed first, and watch the torques."
        )
    elif np.isinf(task.limits.torque).all():
        notes.append("No torque limits are known: torques were not limited.")
    elif not task.known.earlier.any():
        notes.append(
            "Torques are those of the description, without the uncertainty of its masses and "
            "without friction that it does not have. Run the motion at half the speed first."
        )
    if task.clearances is None:
        notes.append(
            "No bodies are known: collisions of the arm with itself and with what stands around it "
            "were not looked at."
        )
    if hidden := task.known.base.without_effect.size:
        names = [task.known.base.standard[i].name for i in task.known.base.without_effect]
        notes.append(
            f"{hidden} parameters have no effect on any torque, whatever the motion, and are not "
            f"part of the model: {listed(names)}."
        )
    return notes
