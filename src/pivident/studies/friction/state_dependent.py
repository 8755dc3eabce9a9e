"""State-dependent parameters: functions of their own states, and numbers that compare them.

    y_k = Σ_i p_i(x_{i,k}) z_{i,k} + e_k                                                        (1)

Young's approach (Young, McKenna and Bruun 2001; for friction Janot, Young and Gautier 2017): sort
the data by x_i, model p_i as a random walk along the sorted state, apply the fixed-interval
smoother, and iterate over the parameters, each on the residual of the others (back-fitting), until
the functions converge. The noise-to-variance ratios are maximum-likelihood estimates.

Neighbours in the sorted order are not neighbours in time, and the residual of a friction model is
correlated over many samples in time. With D, the number of samples per independent observation
(:func:`correlation_length`),

* the likelihood uses samples D apart in time, whose errors are nearly independent; the likelihoods
  of several such sets with different first samples are added;
* the functions are smoothed from all samples, with a noise variance D times as large;
* the bands come from the joint covariance of all functions with the same variance D r, so that
  the band of one function includes the uncertainty of the others. They are Bayesian bands of the
  smoothing spline, which cover the truth on average along the state (Nychka 1988).

D is found twice: from the residual that the caller expects, and again from that of the first fit.

Contrasts of the joint posterior: features of the friction functions as numbers with intervals.

The speed functions p₊(|dq|) and p₋(|dq|) are split into friction against the motion and offset,

    g(v) = (p₊(v) - p₋(v))/2,     o(v) = (p₊(v) + p₋(v))/2,

and every number is a weighted sum of the functions' values, so its standard error follows from
their joint covariance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pivident.foundation.errors import IdentificationError
from pivident.studies.friction.back_fitting import (
    MAX_POINTS,
    MIN_SAMPLES,
    BackFitted,
    StateDependence,
    WalkColumns,
    averages_of,
    back_fitted,
    contributions,
    joint_posterior,
    varies,
)

#: Smallest number of means from which the correlation is estimated.
MIN_MEANS = 30
Weights = dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class StateDependentParameter:
    """One estimated function."""

    name: str  # of the parameter
    state: np.ndarray  # points of the state, ascending, shape (points,)
    value: np.ndarray  # p at these points, shape (points,)
    std: np.ndarray  # its standard error, likewise; the band is ±2 std
    nvr: float  # noise-to-variance ratio
    is_straight: (
        bool  # whether the likelihood supports no more than a line (order 2) or constant (1)
    )
    contribution: np.ndarray = field(repr=False)  # p(x_k) z_k at all samples, shape (samples,)
    density: np.ndarray = field(repr=False)  # independent samples near each point, shape (points,)

    def at(self, state: np.ndarray) -> np.ndarray:
        """The function at other states, linear between its points and constant outside."""
        return np.interp(state, self.state, self.value)


@dataclass(frozen=True, eq=False)
class StateDependentFit:
    """All functions of the model together."""

    parameters: tuple[StateDependentParameter, ...]  # one for each term
    # joint covariance of all values, in the order of the terms
    covariance: np.ndarray = field(repr=False)
    noise_std: float  # standard deviation of the residual, in the unit of y
    correlation: float  # D, samples that count as one
    effective: float  # number of independent samples
    rounds: int  # rounds of back-fitting
    converged: bool  # whether the functions no longer change
    # y minus all contributions, shape (samples,); NaN on samples that were not used
    residual: np.ndarray = field(repr=False)

    def __getitem__(self, name: str) -> StateDependentParameter:
        """A parameter by its name."""
        return next(p for p in self.parameters if p.name == name)

    def __contains__(self, name: str) -> bool:
        return any(p.name == name for p in self.parameters)

    def contrast(self, weights: dict[str, np.ndarray]) -> tuple[float, float]:
        """Weighted sum of values of the functions, weights by parameter, and its standard error."""
        stacked = np.concatenate(
            [weights.get(p.name, np.zeros(p.state.size)) for p in self.parameters]
        )
        value = float(stacked @ np.concatenate([p.value for p in self.parameters]))
        return value, float(np.sqrt(max(stacked @ self.covariance @ stacked, 0.0)))


def correlation_length(pieces: Sequence[np.ndarray]) -> float:
    """Samples per independent observation, from the variance of means relative to white noise.

        D = max over m of  m Var(mean of m consecutive samples) / Var(sample)

    It tends to 1 + 2 Σ ρ_k for long m. The maximum over all lengths is used: a slow model error
    below strong white noise is invisible in the correlations at short lags and still dominates the
    means.
    """
    pieces = [p[np.isfinite(p)] for p in pieces]
    total = sum(p.size for p in pieces)
    mean = sum(float(p.sum()) for p in pieces) / max(total, 1)
    variance = sum(float(((p - mean) ** 2).sum()) for p in pieces) / max(total, 1)
    if not variance > 0.0:
        return 1.0
    largest, length = 1.0, 2.0
    while total / length >= MIN_MEANS:
        m = int(length)
        means = np.concatenate([p[: p.size // m * m].reshape(-1, m).mean(axis=1) for p in pieces])
        largest = max(largest, m * float(np.mean((means - mean) ** 2)) / variance)
        length *= 1.5
    return largest


def fit_state_dependent(
    y: np.ndarray,
    terms: Sequence[StateDependence],
    *,
    used: np.ndarray | None = None,
    record: np.ndarray | None = None,
    expected: np.ndarray | None = None,
    correlation: float | None = None,
    rounds: int = 100,
    tolerance: float = 1e-4,
) -> StateDependentFit:
    """Estimate the functions of (1) by back-fitting, with their joint bands.

    Samples are in the order of time; correlation ends where ``record`` changes. D
    (``correlation``) is found from the ``expected`` residual, None: y less a straight line in all
    states. A round that changes no contribution by more than ``tolerance`` standard deviations of y
    (rms) is the last.
    """
    y = np.asarray(y, dtype=float)
    used = np.ones(y.size, dtype=bool) if used is None else np.asarray(used, dtype=bool)
    record = np.zeros(y.size, dtype=int) if record is None else np.asarray(record)
    for term in terms:
        if not varies(term, used):
            raise IdentificationError(
                f"the state of {term.name!r} does not vary over the samples in use",
                advice="leave the term out or use a record that varies it",
            )
    if correlation is not None:
        return _with_bands(
            y, terms, used, _fit(y, terms, used, record, correlation, rounds, tolerance)
        )
    first = _straight_residual(y, terms, used) if expected is None else expected
    initial = _correlation(first, used, record)
    found = _fit(y, terms, used, record, initial, rounds, tolerance)
    fresh = _correlation(found.residual(y, terms, used), used, record)
    if not 0.8 < fresh / initial < 1.25:
        found = _fit(y, terms, used, record, fresh, rounds, tolerance)
    return _with_bands(y, terms, used, found)


def contributions_without(
    y: np.ndarray,
    terms: Sequence[StateDependence],
    fit: StateDependentFit,
    used: np.ndarray,
    record: np.ndarray,
    *,
    rounds: int = 100,
    tolerance: float = 1e-3,
) -> np.ndarray:
    """Sum of all terms at *all* samples, estimated from those in ``used`` alone.

    The noise-to-variance ratios and D of a fit are kept. Outside the sampled states a function is
    extrapolated as a line, a centred one as a constant.
    """
    given = [replace(t, nvr=fit[t.name].nvr) for t in terms if varies(t, used)]
    merged, averages = averages_of(y, given, used, record, fit.correlation)
    courses, *_ = back_fitted(averages, merged, rounds, tolerance)
    return np.sum(contributions(given, courses), axis=0)


def _correlation(residual: np.ndarray, used: np.ndarray, record: np.ndarray) -> float:
    values = np.where(used, residual, np.nan)
    return correlation_length([values[record == k] for k in np.unique(record)])


def _straight_residual(
    y: np.ndarray, terms: Sequence[StateDependence], used: np.ndarray
) -> np.ndarray:
    """Residual of straight lines in all states."""
    columns = np.column_stack([c for t in terms for c in (t.regressor, t.regressor * t.state)])
    theta = np.linalg.lstsq(columns[used], y[used], rcond=None)[0]
    return y - columns @ theta


def _fit(
    y: np.ndarray,
    terms: Sequence[StateDependence],
    used: np.ndarray,
    record: np.ndarray,
    correlation: float,
    rounds: int,
    tolerance: float,
) -> BackFitted:
    """Back-fitting at a given D."""
    count = int(used.sum())
    if count / correlation < MIN_SAMPLES:
        raise IdentificationError(
            f"{count} samples correspond to {count / correlation:.0f} independent ones, since the "
            f"residual is correlated over {correlation:.0f} samples",
            advice=f"{MIN_SAMPLES} are needed: use a longer record",
        )
    merged, averages = averages_of(y, terms, used, record, correlation)
    found = back_fitted(averages, merged, rounds, tolerance)
    return BackFitted(correlation, merged, averages, *found)


def _with_bands(
    y: np.ndarray, terms: Sequence[StateDependence], used: np.ndarray, found: BackFitted
) -> StateDependentFit:
    """The functions on their points, with the joint covariance."""
    data, nvrs, merged = found.averages.sorted, found.nvrs, found.merged
    effective = int(used.sum()) / found.correlation
    points = [_points(own.term, nvr, effective) for own, nvr in zip(data, nvrs, strict=True)]
    posterior = joint_posterior(
        found.averages.y,
        [
            WalkColumns(
                own.coordinate(own.term.state),
                own.term.regressor,
                nvr / merged,
                own.term.order,
                own.term.centred,
                n,
            )
            for own, nvr, n in zip(data, nvrs, points, strict=True)
        ],
    )
    parts = contributions(terms, found.courses)
    residual = found.residual(y, terms, used)
    freedom = max(effective - posterior.freedom, 1.0)
    r = float(np.nanmean(residual**2)) * effective / freedom
    # Means have the long-run variance D r divided by their number of samples.
    covariance = r * merged * posterior.covariance
    std = np.split(np.sqrt(np.diag(covariance)), np.cumsum(points)[:-1])
    parameters = []
    for i, (own, course) in enumerate(zip(data, found.courses, strict=True)):
        state = np.linspace(own.low, own.low + own.width, points[i])
        near = np.histogram(own.u, np.linspace(0.0, 1.0, points[i] + 1))[0]
        parameters.append(
            StateDependentParameter(
                name=own.term.name,
                state=state,
                value=np.interp(state, *course),
                std=std[i],
                nvr=nvrs[i],
                is_straight=found.straight[i],
                contribution=parts[i],
                density=near / merged,
            )
        )
    return StateDependentFit(
        parameters=tuple(parameters),
        covariance=covariance,
        noise_std=float(np.sqrt(r)),
        correlation=found.correlation,
        effective=effective,
        rounds=found.rounds,
        converged=found.converged,
        residual=residual,
    )


def _points(term: StateDependence, nvr: float, effective: float) -> int:
    """Four points within the bandwidth h of the function, NVR = 1/(n h^(2 order))."""
    narrow = (max(effective, 1.0) * nvr) ** (0.5 / term.order)
    return int(np.clip(4.0 * narrow, term.points, max(term.points, MAX_POINTS)))


def at(parameter: StateDependentParameter, state: float) -> np.ndarray:
    """Weights of a function's value at a state, linear between its points."""
    return np.array(
        [np.interp(state, parameter.state, row) for row in np.eye(parameter.state.size)]
    )


def common_speeds(fit: StateDependentFit) -> tuple[float, float]:
    """Lowest and highest speed recorded in both directions."""
    forward, backward = fit["positive"].state, fit["negative"].state
    return max(forward[0], backward[0]), min(forward[-1], backward[-1])


def against_motion(fit: StateDependentFit, speed: float, sign: float = -1.0) -> Weights:
    """Weights of g(v); of o(v) with ``sign`` 1."""
    return {
        "positive": 0.5 * at(fit["positive"], speed),
        "negative": sign * 0.5 * at(fit["negative"], speed),
    }


def offset(fit: StateDependentFit, speed: float) -> Weights:
    """Weights of o(v)."""
    return against_motion(fit, speed, 1.0)


def combined(parts: list[tuple[float, Weights]]) -> Weights:
    """Σ c_i w_i of several sets of weights."""
    out: Weights = {}
    for factor, weights in parts:
        for name, w in weights.items():
            out[name] = out.get(name, 0.0) + factor * w
    return out


def slope_over_size(parameter: StateDependentParameter) -> np.ndarray:
    """Weights of the slope of p against |x|, points weighted by their independent samples."""
    size, w = np.abs(parameter.state), parameter.density
    away = size - np.average(size, weights=w)
    squares = float(np.sum(w * away**2))
    return w * away / squares if squares > 0.0 else np.zeros(size.size)
