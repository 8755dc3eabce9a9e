"""Everything that is known of a motion before the robot moves."""

from __future__ import annotations

from typing import Any

import numpy as np

from pivident.excitation.checked_motion import FineCheck
from pivident.excitation.criteria import condition_number, standard_errors
from pivident.excitation.design import PAGE_RATE, Design, PredictedError
from pivident.excitation.design_task import SAMPLES, DesignTask
from pivident.excitation.limits import wider_than_described
from pivident.excitation.motions import ExcitingMotion
from pivident.excitation.search import Best
from pivident.motion.wanted_motion import RISE
from pivident.text.lists import listed


def account(task: DesignTask, fine: FineCheck, motion: ExcitingMotion, best: Best) -> Design:
    """Everything that is known of a motion before the robot moves."""
    question, criterion = task.question, task.criterion
    first = ExcitingMotion(motion.family, _or(best.first_coefficients, motion.coefficients))
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
    asked = task.request.plain()
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
    assumed = task.limits.source.get("acceleration", ())
    if "assumed" in assumed:
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
