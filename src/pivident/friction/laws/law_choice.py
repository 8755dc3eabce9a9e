"""Selection of a friction law for each joint by held-out error and information criteria.

A larger law always fits better, so goodness of fit cannot decide. Each law is fitted to all blocks
of the motion but one, and evaluated on that one. Of the laws tried

1. those with a negative friction level are excluded: they fit, but cannot be simulated;
2. a law is excluded if another has no more unknowns and a lower Schwarz criterion (with the
   effective number of rows), because the lowest of many held-out errors may be low by chance;
3. of the rest, the simplest law is chosen whose held-out error is within one standard error of the
   lowest one, the standard error being that of their difference over the blocks.

Laws grow by one change at a time from the best law so far, as long as the gain exceeds its
standard error and the Schwarz criterion falls.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pivident.dynamics.parameters import standard_parameters
from pivident.errors import IdentificationError
from pivident.estimation.identify import identify
from pivident.estimation.methods import (
    LeastSquares,
    Method,
    PrefilteredIV,
    RandomWalk,
    method_named,
)
from pivident.estimation.problem import Problem
from pivident.friction.laws.chosen_laws import (
    JointLawChoice,
    LawChoice,
    chosen_law,
    difference,
    with_criteria,
)
from pivident.friction.laws.filtered_rows import LastPass
from pivident.friction.laws.law_candidates import Change, Reach, changed, default_changes, key_of
from pivident.friction.laws.law_scores import JointJudge, LawScore
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionLaw
from pivident.robot.naming import find_joint
from pivident.validation.held_out.cross_validation import GAP_PERIODS
from pivident.validation.held_out.folds import moving_part
from pivident.validation.held_out.prediction import motion_band
from pivident.validation.held_out.segment_sums import Segments, SegmentSums, effective_rows

#: Maximum number of changes of a law.
DEPTH = 3


def choose_laws(
    problem: Problem,
    method: Method | str | None = None,
    *,
    changes: Mapping[str, Change] | None = None,
    more: Mapping[str, Mapping[str, Change]] | None = None,
    joints: Sequence[str] | None = None,
    folds: int = 10,
    gap: float | None = None,
    depth: int = DEPTH,
    progress: Callable[[str], None] | None = None,
) -> LawChoice:
    """Choose a friction law for each joint, beginning with the laws that the robot has.

    Args:
        problem: the identification problem, usually with viscous and Coulomb friction.
        method: estimator on whose equations the laws are compared; None: least squares at the
            full rate, which needs no control loop.
        changes: changes of a law by name; None: see ``law_candidates``.
        more: further changes by joint, such as ``{"joint1": {"ripple": adding(ripple(100))}}``.
        joints: which joints; None: all.
        folds: number of contiguous blocks.
        gap: gap between a held-out block and the fitted data [s]; None: two periods of the highest
            frequency of the motion.
        depth: maximum number of changes of a law.
        progress: called with one line at each stage.

    Returns:
        The candidates of each joint with their scores, and the problem with the chosen laws.

    Raises:
        IdentificationError: unknown method, or one without a measured observation matrix.
        ExperimentError: an unknown joint.
    """
    say = progress or (lambda line: None)
    method = _method(method)
    robot = problem.robot
    wanted = robot.joint_names if joints is None else joints
    numbers = [find_joint(robot.joint_names, name) for name in wanted]
    say("fitting the present laws")
    found = identify(problem, method)
    last = LastPass.of(problem, method, found)
    gap = GAP_PERIODS / motion_band(problem.recordings[0]) if gap is None else gap
    segments = _segments(problem, last, folds, gap)
    by_joint = [_own_sums(last, j, segments) for j in range(robot.size)]
    made, laws = [], {}
    for j in numbers:
        name = robot.joint_names[j]
        judge = JointJudge(last, robot, j, segments, by_joint, found.theta)
        kinematics = [r.kinematics for r in last.equations.records]
        own = default_changes(_reach(kinematics, j)) if changes is None else dict(changes)
        own |= (more or {}).get(name, {})
        unit = found.joints[j].noise_unit
        made.append(_grown(judge, name, unit, own, depth, say))
        laws[name] = made[-1].chosen.law
    return LawChoice(with_laws(problem, laws), tuple(made), found.method, folds, gap)


def with_laws(problem: Problem, laws: Mapping[str, FrictionLaw]) -> Problem:
    """The problem with other friction laws, by joint name.

    Chosen parameters and starting values of terms that are replaced are removed.
    """
    robot = problem.robot.with_friction(laws)
    changed_joints = {find_joint(robot.joint_names, name) for name in laws}

    def friction(of: Robot) -> list[str]:
        standard = standard_parameters(of)
        return [p.name for p in standard if p.friction and p.joint in changed_joints]

    new = friction(robot)
    gone = {name.lower() for name in friction(problem.robot)} - {name.lower() for name in new}
    initial = {k: v for k, v in problem.initial.items() if k.lower() not in gone}
    parameters = problem.parameters
    if parameters is not None:
        old = {name.lower() for name in friction(problem.robot)}
        parameters = (*(name for name in parameters if name.lower() not in old), *new)
    return replace(problem, robot=robot, parameters=parameters, initial=initial)


def _method(method: Method | str | None) -> Method:
    if method is None:
        return LeastSquares(signals=RandomWalk())
    method = method_named(method)
    if isinstance(method, PrefilteredIV) and method.regressor == "simulated":
        raise IdentificationError(
            "laws are compared on the measured motion, which DIDIM's observation matrix does not "
            "contain; choose the laws with 'ls', 'iv' or 'piv'"
        )
    return method


def _grown(
    judge: JointJudge,
    name: str,
    unit: str,
    changes: Mapping[str, Change],
    depth: int,
    say: Callable[[str], None],
) -> JointLawChoice:
    """Try changes on one joint, then changes of the best law so far, and choose."""
    base = judge.robot.joints[judge.joint].friction
    known = {key_of(base)}
    say(f"{name}: present law")
    scores = [judge.score("present law", base)]
    current = scores[0]
    for _ in range(depth):
        candidates = changed(current.law, changes, known)
        new = []
        for change, law in candidates.items():
            title = change if current is scores[0] else f"{current.name} + {change}"
            say(f"{name}: {title}")
            new.append(judge.score(title, law))
        if not new:
            break
        scores += new
        scores = _compared(judge, scores)
        current = next(s for s in scores if s.name == current.name)
        physical = [s for s in scores[-len(new) :] if s.physical]
        if not physical:
            break
        best = min(physical, key=lambda s: s.rms)
        gained, std = difference(current, best)
        if gained <= std or best.bic >= current.bic:
            break
        current = best
    scores = _compared(judge, scores)
    rows = float(sum(r.used.sum() for r in judge.rows))
    effective = effective_rows(judge.residual(min(scores, key=lambda s: s.rms)))
    return JointLawChoice(name, unit, tuple(scores), chosen_law(scores), rows, effective)


def _compared(judge: JointJudge, scores: Sequence[LawScore]) -> list[LawScore]:
    """Scores with criteria, the effective number of rows from the residual of the best law."""
    best = min(scores, key=lambda s: s.rms)
    rows = float(sum(r.used.sum() for r in judge.rows))
    return with_criteria(scores, rows, effective_rows(judge.residual(best)))


def _own_sums(last: LastPass, joint: int, segments: Segments) -> SegmentSums:
    """Sums of one joint's rows on its own columns."""
    every = np.arange(last.equations.regressor.columns_of(joint).size)
    rows = last.rows_of(joint, every)
    return SegmentSums.of([(r.phi, r.z, r.tau, r.used) for r in rows], segments)


def _segments(problem: Problem, last: LastPass, folds: int, gap: float) -> Segments:
    """Consecutive blocks of equal length of all recordings' motion, and their gaps."""
    if folds < 3:
        raise IdentificationError(f"folds is {folds}; laws are compared on at least 3 blocks")
    records = last.equations.records
    moving = [moving_part(problem, r.kinematics) for r in records]
    total = sum(stop - start for start, stop in moving)
    borders = np.linspace(0, total, folds + 1)
    labels, offset = [], 0
    for record, (start, stop) in zip(records, moving, strict=True):
        k = record.kinematics
        sample = record.sample_numbers
        place = sample - start + offset
        inside = (sample >= start) & (sample < stop)
        block = np.clip(np.searchsorted(borders, place, side="right") - 1, 0, folds - 1)
        label = 2 * block
        half = 0.5 * gap * k.recording.rate
        for number, border in enumerate(borders[1:-1]):
            label[np.abs(place - border) < half] = 2 * number + 1
        labels.append(np.where(inside, label, -1))
        offset += stop - start
    if any(not any((own == 2 * fold).any() for own in labels) for fold in range(folds)):
        raise IdentificationError(
            f"{folds} blocks with gaps of {gap:.2g} s leave no samples in some blocks; use fewer"
        )
    return Segments(tuple(labels), folds)


def _reach(kinematics, joint: int) -> Reach:
    """Travel and largest speed of a joint."""
    q = [k.q[joint, k.start : k.stop] for k in kinematics]
    dq = [k.dq[joint, k.start : k.stop] for k in kinematics]
    return Reach(max(float(np.ptp(x)) for x in q), max(float(np.abs(x).max()) for x in dq))
