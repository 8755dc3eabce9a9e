"""Joint posterior of all functions of a state-dependent model, by one linear system.

Back-fitting gives the functions, but the smoother of each treats the others as known. Here every
function is described by its knots, level and slope of an integrated random walk; the expected
course between two knots is the cubic that they determine, and white increments w with
Var(w) = NVR r Q(Δ) lead from knot to knot:

    y = Σ A_i w_i + e,     Cov(w | y) = r (AᵀA + P)⁻¹,     P = 1 for increments, 0 for the start.

The mean level of a centred function over its samples is held at zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pivident.friction.random_walk_regression import START

if TYPE_CHECKING:
    from scipy.sparse import csr_array

#: Weight of the condition that a centred function has mean zero, in samples.
FIRM = 1e6


@dataclass(frozen=True, eq=False)
class WalkColumns:
    """One function of the model."""

    u: np.ndarray  # coordinate of each sample, 0 to 1, shape (samples,)
    z: np.ndarray  # regressor, likewise
    nvr: float  # noise-to-variance ratio per unit of u
    order: int  # 1 or 2
    centred: bool  # whether its mean over its samples is zero
    points: int  # number of knots, evenly spaced


@dataclass(frozen=True, eq=False)
class JointPosterior:
    """Levels of all functions at their knots."""

    value: np.ndarray  # posterior means, shape (all knots,)
    covariance: np.ndarray  # in units of the noise variance r, shape (all knots, all knots)
    freedom: float  # degrees of freedom that the functions use, tr AᵀA (AᵀA + P)⁻¹


def joint_posterior(y: np.ndarray, functions: Sequence[WalkColumns]) -> JointPosterior:
    """Solve for all functions together."""
    from scipy.linalg import block_diag, cho_factor, cho_solve
    from scipy.sparse import hstack

    walks = [_walk(f) for f in functions]
    between = [_between(f) for f in functions]
    seen = hstack([m.multiply(f.z[:, None]) for m, f in zip(between, functions, strict=True)])
    seen = seen.tocsr()
    walk = block_diag(*walks)
    gram = walk.T @ (seen.T @ seen).toarray() @ walk
    precision = gram.copy()
    start = 0
    for f, own_walk, own_between in zip(functions, walks, between, strict=True):
        stop = start + own_walk.shape[1]
        penalty = np.ones(stop - start)
        penalty[: f.order] = 1.0 / START
        precision[range(start, stop), range(start, stop)] += penalty
        if f.centred:
            mean = np.asarray(own_between[f.z != 0.0].mean(axis=0)).ravel() @ own_walk
            precision[start:stop, start:stop] += FIRM * np.outer(mean, mean)
        start = stop
    factor = cho_factor(precision, lower=True)
    covariance = cho_solve(factor, np.eye(len(precision)))
    level = block_diag(*[w[: f.points] for w, f in zip(walks, functions, strict=True)])
    return JointPosterior(
        value=level @ (covariance @ (walk.T @ (seen.T @ y))),
        covariance=level @ covariance @ level.T,
        freedom=float(np.sum(covariance * gram)),
    )


def _walk(f: WalkColumns) -> np.ndarray:
    """Levels, then slopes, at the knots from start and unit increments, (order points)²."""
    d = 1.0 / (f.points - 1)
    size = f.order * f.points
    level, slope = np.zeros((f.points, size)), np.zeros((f.points, size))
    level[0, 0] = 1.0
    if f.order == 1:
        for k in range(1, f.points):
            level[k] = level[k - 1]
            level[k, k] = np.sqrt(f.nvr * d)
        return level
    slope[0, 1] = 1.0
    root = np.sqrt(f.nvr) * np.linalg.cholesky(np.array([[d**3 / 3, d**2 / 2], [d**2 / 2, d]]))
    for k in range(1, f.points):
        level[k], slope[k] = level[k - 1] + d * slope[k - 1], slope[k - 1]
        level[k, 2 * k : 2 * k + 2] = root[0]
        slope[k, 2 * k : 2 * k + 2] = root[1]
    return np.vstack([level, slope])


def _between(f: WalkColumns) -> csr_array:
    """Expected value of the walk at the samples, between two knots: a line, or a cubic."""
    from scipy.sparse import csr_array

    d = 1.0 / (f.points - 1)
    k = np.clip((f.u / d).astype(int), 0, f.points - 2)
    s = np.clip(f.u / d - k, 0.0, 1.0)
    shares = {0: 1.0 - s, 1: s}  # by place: level before and after, slope before and after
    if f.order == 2:
        shares = {
            0: (1.0 + 2.0 * s) * (1.0 - s) ** 2,
            1: s * s * (3.0 - 2.0 * s),
            f.points: s * (1.0 - s) ** 2 * d,
            f.points + 1: s * s * (s - 1.0) * d,
        }
    columns = np.concatenate([k + place for place in shares])
    rows = np.tile(np.arange(f.u.size), len(shares))
    entries = (np.concatenate(list(shares.values())), (rows, columns))
    return csr_array(entries, shape=(f.u.size, f.order * f.points))
