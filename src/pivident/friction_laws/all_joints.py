"""The chosen laws of all joints together: their errors and signs in the fit of the whole robot.

Laws are chosen joint by joint while the others keep theirs. Together they share the rigid-body
parameters, and a law that was right alone may come out with an impossible sign, or make another
joint worse. Then the joint with that law goes one change back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from pivident.friction_laws.impossible_signs import impossible_signs
from pivident.friction_laws.law_rules import Difference
from pivident.friction_laws.law_scores import JointJudge, LawScore
from pivident.friction_laws.training_set import weighted_sums
from pivident.friction_laws.variable_projection import least_norm_solution
from pivident.robot.friction import FrictionLaw
from pivident.validation.held_out.segment_sums import SegmentSums

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
        sizes = [len(law.terms) for law in laws]
        ends = self.kept.size + np.cumsum([0, *sizes])
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
                    which = judge.segments.training(d.held_out)
                    solved[key] = self._solve(sums, own, which)
                squares = judge.squares_by_cell(laws[number], solved[key][own[number]])
                total += squares * d.held_out
            errors.append(total)
        every = np.arange(self.judges[0].segments.count)
        whole = self._solve(sums, own, every)
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
