"""Selection of friction laws: for each joint the one that fits the next motion, then all together.

A larger law always fits better, so goodness of fit cannot decide. Laws are judged on motion to
which they were not fitted and that differs from it: another recording, or the fastest, most loaded,
last part of a single one. Laws grow by one change at a time. A change is taken if

1. no parameter has an impossible sign: such laws fit, but gain energy elsewhere;
2. its gain is significant although many changes were tried, and the Schwarz criterion falls;
3. it is not worse by more than a standard error in any direction in which motion was held out;
4. it is the simplest within one standard error of the best change.

Laws chosen joint by joint are fitted to the whole robot once more; one that comes out impossible
there, or no better, goes one change back.

The chosen laws of all joints together: their errors and signs in the fit of the whole robot.

Laws are chosen joint by joint while the others keep theirs. Together they share the rigid-body
parameters, and a law that was right alone may come out with an impossible sign, or make another
joint worse. Then the joint with that law goes one change back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from pivident.dynamics.parameters import standard_parameters
from pivident.estimation.identify import identify, narrowed
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.method import Method
from pivident.estimation.methods import method_named
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import IdentificationError
from pivident.judgement.validation.held_out.folds import GAP_PERIODS
from pivident.judgement.validation.held_out.prediction import motion_band
from pivident.judgement.validation.held_out.segment_sums import SegmentSums
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionLaw
from pivident.robot.naming import find_joint
from pivident.studies.friction_laws.chosen_laws import (
    Difference,
    JointLawChoice,
    LawChoice,
    TriedRange,
    judged,
    simplest,
    with_criterion,
)
from pivident.studies.friction_laws.filtered_rows import LastPass
from pivident.studies.friction_laws.held_out_cells import Cells, weighted_sums
from pivident.studies.friction_laws.law_candidates import (
    FREE_STEEPNESS,
    SHARP_SIGN,
    STEEPNESS,
    Change,
    Reach,
    changed,
    default_changes,
    free_constants,
    key_of,
    load_and_memory,
)
from pivident.studies.friction_laws.law_scores import JointJudge, LawScore, impossible_signs
from pivident.studies.friction_laws.shape_constants import GAMMA
from pivident.studies.friction_laws.variable_projection import least_norm_solution

#: Maximum number of changes of a law.
DEPTH = 3
_RCOND = 1e-12


class AllJoints:
    """Fits of the whole robot with laws of several joints; ``by_joint`` as for `JointJudge`."""

    def __init__(self, judges: Sequence[JointJudge], by_joint: Sequence[SegmentSums]) -> None:
        self.judges = judges
        last, segments = judges[0].last, judges[0].segments
        staying = [set(judge.rest.tolist()) for judge in judges]
        self.kept = np.array(sorted(set.intersection(*staying)), int)
        numbers = {judge.joint for judge in judges}
        self.others = weighted_sums(last, numbers, segments.count, self.kept, by_joint)
        place = {int(k): i for i, k in enumerate(self.kept)}
        self.columns = [
            np.array([place[int(k)] for k in judge.rest[judge.columns]], int) for judge in judges
        ]

    def held_out(self, laws: Sequence[FrictionLaw]) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Mean square error of each joint in each held-out cell, and parameters of its law."""
        sums = [judge.sums(law) for judge, law in zip(self.judges, laws, strict=True)]
        ends = self.kept.size + np.cumsum([0, *[len(law.terms) for law in laws]])
        own = [
            np.r_[columns, np.arange(a, b)]
            for columns, a, b in zip(self.columns, ends[:-1], ends[1:], strict=True)
        ]
        solved: dict[bytes, np.ndarray] = {}
        errors = []
        for number, judge in enumerate(self.judges):
            total = np.zeros(judge.segments.cells)
            for d in judge.divisions:
                key = d.held_out.tobytes()
                if key not in solved:
                    solved[key] = self._solve(sums, own, judge.segments.training(d.held_out))
                squares = judge.squares_by_cell(laws[number], solved[key][own[number]])
                total += squares * d.held_out
            errors.append(total)
        whole = self._solve(sums, own, np.arange(self.judges[0].segments.count))
        return errors, [whole[a:b] for a, b in pairwise(ends)]

    def _solve(
        self, sums: Sequence[SegmentSums], own: Sequence[np.ndarray], which: np.ndarray
    ) -> np.ndarray:
        n, size = self.kept.size, int(max(columns.max() for columns in own)) + 1
        gram, right = np.zeros((size, size)), np.zeros(size)
        gram[:n, :n] = self.others.zf[which].sum(axis=0)
        right[:n] = self.others.zt[which].sum(axis=0)
        for judge, law_sums, columns in zip(self.judges, sums, own, strict=True):
            weight = judge.whole.weight
            gram[np.ix_(columns, columns)] += law_sums.zf[which].sum(axis=0) / weight
            right[columns] += law_sums.zt[which].sum(axis=0) / weight
        return least_norm_solution(gram, right, _RCOND)


def settled_together(
    robot: AllJoints, paths: Sequence[Sequence[LawScore]]
) -> tuple[list[LawScore], list[tuple[int, LawScore]]]:
    """The last law of each joint's path that also holds in the fit of the whole robot.

    Args:
        robot: the joints whose laws were chosen.
        paths: laws of each joint, its present one first, each a change of the one before.

    Returns:
        The law of each joint, and the laws that were dropped with joint and reason.
    """
    at = [len(path) - 1 for path in paths]
    dropped: list[tuple[int, LawScore]] = []
    present, _ = robot.held_out([path[0].law for path in paths])
    while any(at):
        laws = [path[k] for path, k in zip(paths, at, strict=True)]
        errors, theta = robot.held_out([s.law for s in laws])
        found = _own_reason(laws, at, present, errors, theta)
        found = found or _reason_beside(robot, paths, at, present, errors)
        if found is None:
            break
        number, reason = found
        dropped.append((robot.judges[number].joint, replace(laws[number], verdict=reason)))
        at[number] -= 1
    return [path[k] for path, k in zip(paths, at, strict=True)], dropped


def _own_reason(
    laws: Sequence[LawScore],
    at: Sequence[int],
    present: Sequence[np.ndarray],
    errors: Sequence[np.ndarray],
    theta: Sequence[np.ndarray],
) -> tuple[int, str] | None:
    """A joint whose changed law does not hold, and why; None where all do."""
    changed = [k for k, steps in enumerate(at) if steps]
    for k in changed:
        if found := impossible_signs(laws[k].law, theta[k], laws[k].std):
            return k, f"impossible sign with the other joints' laws: {', '.join(found)}"
    for k in changed:
        if float(np.mean(errors[k] - present[k])) > 0.0:
            return k, "no gain with the other joints' laws"
    return None


def _reason_beside(
    robot: AllJoints,
    paths: Sequence[Sequence[LawScore]],
    at: Sequence[int],
    present: Sequence[np.ndarray],
    errors: Sequence[np.ndarray],
) -> tuple[int, str] | None:
    """The joint whose change makes one that keeps its law worse, if a single one does."""
    worse = [k for k, steps in enumerate(at) if not steps and _is_worse(errors[k], present[k])]
    if not worse:
        return None
    for c in (c for c, steps in enumerate(at) if steps):
        back = [path[k - (i == c)] for i, (path, k) in enumerate(zip(paths, at, strict=True))]
        without, _ = robot.held_out([s.law for s in back])
        if not any(_is_worse(without[k], present[k]) for k in worse):
            return c, "makes another joint worse"
    return None


def _is_worse(errors: np.ndarray, present: np.ndarray) -> bool:
    d = Difference.of(errors - present)
    return d.mean > d.std


def choose_laws(
    problem: Problem,
    method: Method | str | None = None,
    *,
    changes: Mapping[str, Change] | None = None,
    more: Mapping[str, Mapping[str, Change]] | None = None,
    joints: Sequence[str] | None = None,
    folds: int = 10,
    gap: float | None = None,
    band: float | None = None,
    depth: int = DEPTH,
    progress: Callable[[str], None] | None = None,
) -> LawChoice:
    """Choose a friction law for each joint, beginning with the laws that the robot has.

    Args:
        problem: the identification problem, usually with viscous and Coulomb friction. With
            several recordings each is held out as a whole, so give motions of different speed,
            posture and temperature.
        method: estimator on whose equations the laws are fitted; None: least squares at the
            full rate, which needs no control loop.
        changes: changes of a law by name; None: see ``law_candidates``.
        more: further changes by joint, such as ``{"elbow": {"ripple": adding(ripple(100))}}``.
        joints: which joints; None: all.
        folds: number of contiguous blocks of a single recording.
        gap: gap between held-out cells and the fitted data [s]; None: two periods of the highest
            frequency of the motion.
        band: highest frequency of the motion, below which errors are compared [Hz]; None: 20 Hz,
            or an eighth of a low rate.
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
    numbers = [robot.joint_index(n) for n in (robot.joint_names if joints is None else joints)]
    say("fitting the present laws")
    found = identify(problem, method)
    problem = narrowed(problem, found)
    last = LastPass.of(problem, method, found)
    band = min(motion_band(r) for r in problem.recordings) if band is None else band
    gap = GAP_PERIODS / band if gap is None else gap
    cells = Cells.of(problem, last, folds, gap)
    by_joint = [_own_sums(last, j, cells) for j in range(robot.size)]
    kinematics = [r.kinematics for r in last.equations.records]
    judges, grown = [], []
    for j in numbers:
        name = robot.joint_names[j]
        own = default_changes(_reach(kinematics, j)) if changes is None else dict(changes)
        if changes is None and robot.constraints is not None:
            own = {k: v for k, v in own.items() if k not in load_and_memory()}
        own |= (more or {}).get(name, {})
        judges.append(JointJudge(last, robot, j, cells, by_joint, found.theta, band))
        grown.append(_grown(judges[-1], name, own, depth, max(len(own) * len(numbers), 1), say))
    say("fitting the chosen laws of all joints together")
    settled, dropped = settled_together(AllJoints(judges, by_joint), [path for _, path in grown])
    made, laws = [], dict[str, FrictionLaw]()
    for judge, (scores, path), chosen in zip(judges, grown, settled, strict=True):
        name = robot.joint_names[judge.joint]
        reasons = {s.name: f"{chosen.name} is better" for s in path} | {chosen.name: ""}
        reasons |= {s.name: s.verdict for number, s in dropped if number == judge.joint}
        final = [replace(s, verdict=reasons.get(s.name, s.verdict)) for s in scores]
        taken = next(s for s in final if s.name == chosen.name)
        unit = found.joints[judge.joint].noise_unit
        tried = TriedRange.of(judge, robot.joints[judge.joint].kind)
        made.append(JointLawChoice(name, unit, tuple(final), taken, tried))
        if made[-1].is_changed:
            laws[name] = chosen.law
    chosen_problem = with_laws(problem, laws) if laws else problem
    alone = [j.joint for j, judge in zip(made, judges, strict=True) if judge.is_alone]
    return LawChoice(chosen_problem, tuple(made), found.method, cells.in_words(alone), gap, band)


def with_laws(problem: Problem, laws: Mapping[str, FrictionLaw]) -> Problem:
    """The problem with other friction laws, by joint name.

    Chosen parameters and starting values of terms that are replaced are removed.
    """
    robot = problem.robot.with_friction(laws)
    changed_joints = {robot.places[find_joint(robot.joint_names, name)] for name in laws}

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
    if not method.handles.law_choice:
        raise IdentificationError(
            "laws are compared by least squares or instruments on the measured motion, not by "
            f"{method.label}",
            advice="choose the laws with 'ls', 'iv' or 'piv'",
        )
    return method


def _grown(
    judge: JointJudge,
    name: str,
    changes: Mapping[str, Change],
    depth: int,
    tests: int,
    say: Callable[[str], None],
) -> tuple[list[LawScore], list[LawScore]]:
    """All laws tried on one joint, and those that replaced one another, the present one first."""
    say(f"{name}: present law")
    base = judge.score("present law", judge.robot.joints[judge.joint].friction)
    scores, path, known = [base], [base], {key_of(base.law)}
    # what a smoothed sign leaves where it is sharp looks like Stribeck friction or presliding, so
    # it is first; the next change may be one of either law
    signs = {change: own for change, own in changes.items() if change == SHARP_SIGN}
    for number in range(depth + 1):
        starts = dict.fromkeys([path[-1], path[0] if number == 1 else path[-1]])
        new = _tried(judge, name, starts, changes if number else signs, known, say)
        if not new:
            continue
        scores = [*scores, *new]
        # the effective number of rows is that of the residual of the best law
        scores = with_criterion(scores, *judge.effective(min(scores, key=lambda s: s.rms)))
        current = next(s for s in scores if s.name == path[-1].name)
        new = list(judged(scores[-len(new) :], current, judge.divisions, tests))
        better = [s for s in new if not s.verdict]
        if better:
            path.append(simplest(better))
            said = f"{path[-1].name} is simpler or better"
            new = [s if s.verdict or s is path[-1] else replace(s, verdict=said) for s in new]
        scores[-len(new) :] = new
        if not better and number:
            break
    while len(path) > 1 and path[-1].impossible:
        refused = replace(path[-1], verdict=f"impossible sign: {', '.join(path[-1].impossible)}")
        scores = [refused if s.name == refused.name else s for s in scores]
        path.pop()
    return scores, path


def _tried(
    judge: JointJudge,
    name: str,
    starts: Iterable[LawScore],
    changes: Mapping[str, Change],
    known: set[frozenset[str]],
    say: Callable[[str], None],
) -> list[LawScore]:
    """Scores of all laws one change away from some laws that were not tried yet."""
    new = []
    for start in starts:
        own = changes
        if GAMMA in start.free:
            own = {k: v for k, v in changes.items() if k not in FREE_STEEPNESS}
        for change, law in changed(start.law, own, known).items():
            title = change if start.name == "present law" else f"{start.name} + {change}"
            say(f"{name}: {title}")
            steep = GAMMA in start.free and change not in STEEPNESS and bool(law.slopes)
            kept = (GAMMA,) if steep else ()
            new.append(judge.score(title, law, free_constants(change, law), kept))
    return new


def _own_sums(last: LastPass, joint: int, cells: Cells) -> SegmentSums:
    """Sums of one joint's rows on its own columns."""
    rows = last.rows_of(joint, np.arange(last.equations.regressor.columns_of(joint).size))
    return SegmentSums.of([(r.phi, r.z, r.tau, r.used) for r in rows], cells.segments)


def _reach(kinematics, joint: int) -> Reach:
    """Travel and largest speed of a joint."""
    q = [k.q[joint, k.start : k.stop] for k in kinematics]
    dq = [k.dq[joint, k.start : k.stop] for k in kinematics]
    return Reach(max(float(np.ptp(x)) for x in q), max(float(np.abs(x).max()) for x in dq))
