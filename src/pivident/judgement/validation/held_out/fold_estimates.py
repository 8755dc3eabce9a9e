"""Estimates without a block of the motion, from sums over the record.

With filters, instruments, weights and loads as they are, an estimate solves normal equations that
are sums over time, so that it is solved again without a block of time by leaving its terms out:

    θ₍ₖ₎ = (Σ_j Σ_{t∉k} z φᵀ)⁻¹ Σ_j Σ_{t∉k} z τ

One pass over the record makes the sums of all parts of which the folds consist. What the estimate
of the whole record was made with is shared: the smoothing of the positions, the noise models and
the weights λ_j, the simulated motion of the instruments, the load of friction that grows with it.
They are no parameters of the torque model. Filters run through a held-out block; the gaps on both
of its sides are what they need to forget its torques.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.normal_equations import JointSums, solve
from pivident.estimation.solved_equations import Equations
from pivident.foundation.errors import IdentificationError
from pivident.foundation.threads import linear_algebra_in_one_thread
from pivident.judgement.validation.held_out.folds import Fold, Piece

#: Condition number over that of the whole record from which on the rest is no motion to fit.
POORER = 100.0


def estimates_without(
    found: Identification, moving: Sequence[tuple[int, int]], folds: Sequence[Fold]
) -> list[Identification | IdentificationError]:
    """For each fold the estimate without it, or why there is none.

    Args:
        found: estimate of the whole record, with its equations.
        moving: part (start, stop) of each recording that is fitted, in samples.
        folds: what is left out in turn.

    Returns:
        Estimates that have parameters of their own. Their covariances are those of the whole
        record, larger as (Σ ZᵀZ/λ)⁻¹ is without the fold; everything else is that of the whole
        record, and signals and equations are not there.
    """
    assert found.equations is not None
    parts = [p for k, span in enumerate(moving) for p in _parts(k, span, folds)]
    sums = sums_of(found.equations, parts)
    whole = _together(sums)
    before = solve(whole, np.ones(len(whole)), found.restrictions).covariance

    def without(fold: Fold) -> Identification:
        own = [s for s, p in zip(sums, parts, strict=True) if not _is_left_out(p, fold)]
        return _solved(found, _together(own), before)

    return of_each(folds, without)


def of_each(
    folds: Sequence[Fold], without: Callable[[Fold], Identification]
) -> list[Identification | IdentificationError]:
    """The estimate without each fold in turn, or why there is none."""
    made: list[Identification | IdentificationError] = []
    with linear_algebra_in_one_thread():
        for fold in folds:
            try:
                made.append(without(fold))
            except (IdentificationError, np.linalg.LinAlgError) as error:
                made.append(IdentificationError.of_part("", error))
    return made


def sums_of(equations: Equations, parts: Sequence[Piece]) -> list[list[JointSums]]:
    """Normal equations of each part, of all joints, weighted; one pass over all recordings."""
    names, regressor = equations.regressor.robot.joint_names, equations.regressor
    sums = [
        [JointSums.empty(name, regressor.columns_of(j)) for j, name in enumerate(names)]
        for _ in parts
    ]
    for j in range(len(names)):
        left_out = not any(record.used[j].any() for record in equations.records)
        for own in sums:
            own[j].left_out = left_out
    samples = [record.sample_numbers for record in equations.records]
    for block in equations.blocks():
        here = samples[block.record][block.span]
        for part, own in zip(parts, sums, strict=True):
            if part.recording != block.record:
                continue
            inside = slice(*np.searchsorted(here, (part.start - 0.5, part.stop - 0.5)).tolist())
            if inside.start == inside.stop:
                continue
            for joint, rows in zip(own, block.joints, strict=True):
                z = rows.z[:, inside] if equations.has_instruments else None
                joint.add(rows.phi[:, inside], z, rows.tau[inside], rows.used[inside])
    return sums


def _parts(recording: int, span: tuple[int, int], folds: Sequence[Fold]) -> list[Piece]:
    """Parts of a recording of which each belongs to a fold as a whole or not at all."""
    own = [p for fold in folds for p in fold.left_out if p.recording == recording]
    cuts = sorted({*span, *(p.start for p in own), *(p.stop for p in own)})
    return [Piece(recording, a, b) for a, b in pairwise(cuts)]


def _is_left_out(part: Piece, fold: Fold) -> bool:
    return any(
        p.recording == part.recording and p.start <= part.start < p.stop for p in fold.left_out
    )


def _together(parts: Sequence[Sequence[JointSums]]) -> list[JointSums]:
    """The sums of several parts added up, of all joints."""
    names = "zf", "zz", "ff", "zt", "ft", "tt", "rows", "surplus"
    return [
        replace(own[0], **{name: sum(getattr(part, name) for part in own) for name in names})
        for own in zip(*parts, strict=True)
    ]


def _solved(found: Identification, sums: Sequence[JointSums], before: np.ndarray) -> Identification:
    """The estimate from sums whose weights are in them already.

    ``before``: covariance by the sums of all parts, as `solve` gives it.
    """
    solution = solve(sums, np.ones(len(sums)), found.restrictions)
    if solution.condition > POORER * found.condition:
        raise IdentificationError(
            f"without it the motion does not separate {', '.join(solution.weakest)} (condition "
            f"number {solution.condition:.3g}, with it {found.condition:.3g})",
            advice="take more folds, or a longer motion",
        )
    fixed = np.diag(before) == 0.0
    growth = np.sqrt(np.diag(solution.covariance) / np.where(fixed, 1.0, np.diag(before)))
    return without_fold(found, solution.theta, **widened(found, np.outer(growth, growth)))


def widened(found: Identification, share: float | np.ndarray) -> dict[str, np.ndarray]:
    """Covariances of an estimate from fewer rows; ``share``: how many times as large they are."""
    kinds = ("covariance", "robust_covariance", "formula_covariance")
    return {kind: share * getattr(found, kind) for kind in kinds}


def without_fold(found: Identification, theta: np.ndarray, **others: Any) -> Identification:
    """An identification with other parameters, without the signals and equations of its own."""
    own = {"theta": theta, "judged": None} | others
    return replace(found, recordings=(), motion=found.fitted_range, equations=None, **own)
