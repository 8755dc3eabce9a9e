"""Back-fitting: one function after the other, and the joint posterior of all of them.

The samples of one correlation length are replaced by a few means, each term's means are sorted by
its own state, and the walk along the sorted state is smoothed, term by term, until the functions
converge.

Joint posterior of all functions of a state-dependent model, by one linear system.

Back-fitting gives the functions, but the smoother of each treats the others as known. Here every
function is described by its knots, level and slope of an integrated random walk; the expected
course between two knots is the cubic that they determine, and white increments w with
Var(w) = NVR r Q(Δ) lead from knot to knot:

    y = Σ A_i w_i + e,     Cov(w | y) = r (AᵀA + P)⁻¹,     P = 1 for increments, 0 for the start.

The mean level of a centred function over its samples is held at zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pivident.studies.friction.random_walk_regression import (
    NARROWEST,
    START,
    nvr_by_likelihood,
    smooth_parameter,
)

if TYPE_CHECKING:
    from scipy.sparse import csr_array

#: Points at which a function is given: minimum, and maximum where it is rough.
POINTS = 61
MAX_POINTS = 501
#: Sets of samples D apart whose likelihoods are added.
SETS = 8
#: Rounds of back-fitting in which the noise-to-variance ratios are searched again.
SEARCHES = 4
#: Means per correlation length; more would add no information.
DENSITY = 4
#: Largest step of a state within such a mean, as a share of its range.
STEP_OF_STATE = 0.004
#: Smallest number of independent samples.
MIN_SAMPLES = 12
#: Weight of the condition that a centred function has mean zero, in samples.
FIRM = 1e6


@dataclass(frozen=True, eq=False)
class StateDependence:
    """One term p(x) z of the model."""

    name: str  # of the parameter
    state: np.ndarray  # x, shape (samples,)
    regressor: np.ndarray  # z, likewise; zero where the samples carry no information
    # 1: random walk; 2: integrated random walk, a straight line if the data support no more
    order: int = 2
    # noise-to-variance ratio per unit of the coordinate; None: by maximum likelihood
    nvr: float | None = None
    # whether the function has mean zero over its samples, because another one carries the level
    centred: bool = False
    # number of points at which the function is given; more where it is rough
    points: int = POINTS
    # smallest bandwidth of the search, as a share of the state's range. A record that repeats
    # itself repeats its small errors too, and the likelihood would follow them
    narrowest: float = NARROWEST


@dataclass(frozen=True, eq=False)
class Sorted:
    """A term's samples in the order of its state."""

    term: StateDependence  # the term, on averaged samples
    order: np.ndarray  # indices of the samples that are smoothed, by ascending state
    u: np.ndarray  # their coordinate, 0 to 1
    z: np.ndarray  # their regressor
    sets: tuple[np.ndarray, ...]  # for each set of samples D apart, where they are in ``order``
    low: float  # smallest state
    width: float  # range of the state

    def coordinate(self, state: np.ndarray) -> np.ndarray:
        """Coordinate of a state, held within 0 to 1."""
        return np.clip((state - self.low) / self.width, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Averages:
    """Means of consecutive samples, in the order of time."""

    y: np.ndarray  # dependent variable
    sorted: tuple[Sorted, ...]  # the terms on these means, each in the order of its state


@dataclass(frozen=True, eq=False)
class BackFitted:
    """Converged functions, before their bands."""

    correlation: float  # D in samples
    merged: float  # D in means
    averages: Averages  # the means
    courses: list[tuple[np.ndarray, np.ndarray]]  # state and value of each function, ascending
    nvrs: list[float]  # noise-to-variance ratios
    straight: list[bool]  # whether the likelihood supports no more than a straight line
    rounds: int  # rounds of back-fitting
    converged: bool  # whether the functions no longer change

    def residual(
        self, y: np.ndarray, terms: Sequence[StateDependence], used: np.ndarray
    ) -> np.ndarray:
        """Residual of all samples, NaN where they are not used."""
        return np.where(used, y - np.sum(contributions(terms, self.courses), axis=0), np.nan)


def contributions(
    terms: Sequence[StateDependence], courses: Sequence[tuple[np.ndarray, np.ndarray]]
) -> list[np.ndarray]:
    """p(x) z at all samples, for each term."""
    return [np.interp(t.state, *c) * t.regressor for t, c in zip(terms, courses, strict=True)]


def varies(term: StateDependence, used: np.ndarray) -> bool:
    """Whether a term has enough samples with at least two different states."""
    seen = term.state[used & (term.regressor != 0.0)]
    return seen.size >= MIN_SAMPLES and float(np.ptp(seen)) > 0.0


def _sorted(term: StateDependence, every: int) -> Sorted:
    seen = np.flatnonzero(term.regressor)
    order = seen[np.argsort(term.state[seen], kind="stable")]
    x = term.state[order]
    low, width = float(x[0]), float(x[-1] - x[0])
    starts = np.unique(np.linspace(0, every, SETS, endpoint=False).astype(int))
    sets = [np.flatnonzero(order % every == start) for start in starts]
    enough = tuple(s for s in sets if s.size > MIN_SAMPLES // 2)
    return Sorted(term, order, (x - low) / width, term.regressor[order], enough, low, width)


def averages_of(
    y: np.ndarray,
    terms: Sequence[StateDependence],
    used: np.ndarray,
    record: np.ndarray,
    correlation: float,
) -> tuple[float, Averages]:
    """D in means, and means over so few samples that states and errors hardly change.

    Means keep the slow errors and average the fast ones, so the information n/D stays the same.
    """
    at = np.flatnonzero(used)
    travel = [
        float(np.median(np.abs(np.diff(t.state[at])))) / float(np.ptp(t.state[at])) for t in terms
    ]
    slow = STEP_OF_STATE / max(*travel, 1e-12)
    stride = max(1, int(min(correlation / DENSITY, slow)))
    signs = np.array([np.sign(t.regressor[at]) for t in terms])
    breaks = (np.diff(at) > 1) | (np.diff(record[at]) != 0) | (np.diff(signs) != 0).any(axis=0)
    starts = np.concatenate([[0], np.flatnonzero(breaks) + 1])
    since = np.arange(at.size) - np.repeat(starts, np.diff(np.append(starts, at.size)))
    number = np.cumsum(since % stride == 0) - 1
    size = np.bincount(number)

    def mean(x: np.ndarray) -> np.ndarray:
        return np.bincount(number, x[at]) / size

    merged = max(correlation / stride, 1.0)
    every = max(1, round(merged))
    means = [replace(t, state=mean(t.state), regressor=mean(t.regressor)) for t in terms]
    return merged, Averages(mean(y), tuple(_sorted(t, every) for t in means))


def back_fitted(
    averages: Averages, merged: float, rounds: int, tolerance: float
) -> tuple[list[tuple[np.ndarray, np.ndarray]], list[float], list[bool], int, bool]:
    """Courses (state, value) of all functions, their NVR, whether straight, rounds, convergence."""
    data, y = averages.sorted, averages.y
    parts = np.zeros((len(data), y.size))
    left = y.copy()
    scale = float(np.std(y)) or 1.0
    nvrs = [np.nan if own.term.nvr is None else own.term.nvr for own in data]
    straight = [own.term.nvr is not None and own.term.nvr < 1e-6 for own in data]
    means = [0.0] * len(data)
    for count in range(1, rounds + 1):
        moved = 0.0
        for i, own in enumerate(data):
            target = (left + parts[i])[own.order]
            if own.term.nvr is None and count <= SEARCHES:
                sets = [(own.u[s], own.z[s], target[s]) for s in own.sets]
                near = None if count <= 2 else nvrs[i]
                nvrs[i], on_bound = nvr_by_likelihood(
                    sets, own.term.order, near, own.term.narrowest
                )
                straight[i] = on_bound and nvrs[i] < 1.0
            # The noise variance is D r, so the ratio to it is D times smaller.
            found = smooth_parameter(own.u, own.z, target, nvrs[i] / merged, own.term.order)
            means[i] = float(found.value.mean()) if own.term.centred else 0.0
            new = (found.value - means[i]) * own.z
            change = new - parts[i, own.order]
            moved = max(moved, float(np.sqrt(np.mean(change**2))) / scale)
            parts[i, own.order] = new
            left[own.order] -= change
        searched = count > SEARCHES or all(own.term.nvr is not None for own in data)
        if moved <= tolerance and searched:
            break
    courses = []
    for i, own in enumerate(data):
        # An integrated walk is extrapolated as a line. A centred one is held constant: it corrects
        # another function, and nothing is known about the correction outside the data.
        reach = 0.0 if own.term.centred else 0.5
        between = np.linspace(-reach, 1.0 + reach, MAX_POINTS)
        u = np.concatenate([own.u, between])
        place = np.argsort(u, kind="stable")
        z = np.concatenate([own.z, np.zeros(between.size)])
        target = np.concatenate([(left + parts[i])[own.order], np.zeros(between.size)])
        found = smooth_parameter(
            u[place], z[place], target[place], nvrs[i] / merged, own.term.order
        )
        courses.append((own.low + own.width * u[place], found.value - means[i]))
    return courses, nvrs, straight, count, moved <= tolerance


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
    covariance = cho_solve(cho_factor(precision, lower=True), np.eye(len(precision)))
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
