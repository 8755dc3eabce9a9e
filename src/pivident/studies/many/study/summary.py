"""Summary of a study: bias, coverage, efficiency and figures of merit, as numbers and as text.

Shares and relative errors are fractions of one; standard errors, biases and bounds have the unit of
their parameter; figures of merit are percentages, as in the literature.

Figures of merit of BIRDy (Leboutet et al. 2021), on a motion not used for identification.

    d_τ = 100 mean_j ‖τ̂_j - τ_j‖/‖τ_j‖        torque along the true second motion
    d_q = 100 mean_j ‖q̂_j - q_j‖/‖q_j‖        positions of the simulated loop
    d_β = 100 (2/b) Σ_i |β̂_i - β_i| / (|β̂_i| + |β_i|)

All in percent, without noise; d_q is NaN if the loop cannot be simulated with the estimates.

The summary of a study as plain text, for terminals.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

from pivident.foundation.distributions import student
from pivident.foundation.errors import IdentificationError
from pivident.foundation.extras import require
from pivident.foundation.text.numbers import plain_table
from pivident.foundation.text.plain_values import plain
from pivident.studies.many.study.bench import Bench
from pivident.studies.many.study.bound import Bounds, efficiency_bounds

if TYPE_CHECKING:
    import polars as pl

Interval = tuple[float, float]
#: Coverage of ±2 standard deviations of a normal distribution.
NOMINAL_COVERAGE = math.erf(2.0 / math.sqrt(2.0))
#: Confidence of the intervals of the summary itself.
CONFIDENCE = 0.95
NAN = float("nan")
HEADINGS = (
    "method", "runs", "covered", "interval", "median error", "predicted/found", "efficiency",
    "iterations", "simulations", "time",
)  # fmt: skip


@dataclass(frozen=True)
class ParameterSummary:
    """One parameter by one method."""

    name: str  # base parameter
    unit: str  # its unit
    truth: float  # true value
    mean: float  # mean estimate
    bias: float  # mean minus truth
    bias_std: float  # standard error of the bias, over the records
    spread: float  # empirical standard deviation of the estimates
    predicted: float  # mean of the reported standard errors
    predicted_over_empirical: float  # predicted over spread
    robust_over_empirical: float  # mean of the robust standard errors over spread
    coverage: float  # share of runs whose truth lies within ±2 reported std
    coverage_interval: Interval  # its Wilson interval
    median_relative_error: float  # median of |θ̂ - θ|/|θ|; NaN if the truth is zero
    bound: float  # smallest standard error by (P-23), NaN without one
    efficiency: float  # (bound/spread)²
    sensor_bound: float  # the same from the torque sensor's noise alone, NaN without it
    runs: int  # number of estimates

    @property
    def bias_over_spread(self) -> float:
        """|bias| over spread."""
        return abs(self.bias) / self.spread if self.spread > 0 else NAN


@dataclass(frozen=True)
class Merit:
    """Figures of merit of a set of parameters [%]."""

    d_tau: float  # error of the torque
    d_q: float  # error of the simulated positions, NaN if they diverge
    d_beta: float  # distance of the parameters


def figures_of_merit(bench: Bench, theta: np.ndarray) -> Merit:
    """Figures of merit on the bench's second motion."""
    true, regressor = bench.second_motion, bench.regressor
    torque = regressor.torque(true.q, true.dq, true.ddq, theta)
    try:
        made = bench.simulated(regressor.parameters, theta, bench.second_reference, clip=True)
        d_q = _distance(made.q, true.q)
    except IdentificationError:
        d_q = float("nan")
    return Merit(_distance(torque, true.tau), d_q, _parameter_distance(theta, bench.expected))


def _distance(estimated: np.ndarray, true: np.ndarray) -> float:
    """100 mean_j ‖x̂_j - x_j‖/‖x_j‖ of signals (samples, joints), over joints with a signal."""
    size = np.linalg.norm(true, axis=0)
    error = np.linalg.norm(estimated - true, axis=0)
    return float(100.0 * np.mean(error[size > 0] / size[size > 0]))


def _parameter_distance(estimated: np.ndarray, true: np.ndarray) -> float:
    size = np.abs(estimated) + np.abs(true)
    share = np.divide(np.abs(estimated - true), size, out=np.zeros(size.shape), where=size > 0)
    return float(100.0 * 2.0 / size.size * share.sum())


@dataclass(frozen=True)
class MethodSummary:
    """One method over all parameters; means over parameters are geometric."""

    coverage: float  # share of runs and parameters whose truth lies within ±2 reported std
    coverage_interval: Interval  # its interval, clustered by record
    robust_coverage: float  # the same with the robust standard errors
    median_relative_error: float  # over all runs and parameters
    relative_spread: float  # mean of spread/|truth|
    predicted_over_empirical: float  # mean over parameters
    robust_over_empirical: float  # likewise
    efficiency: float  # mean of (bound/spread)², NaN without a bound
    spread_over_sensor_bound: float  # mean of spread over the bound from the torque sensor alone
    variance_ratio: dict[str, float]  # mean variance over that of each other method
    largest_bias: tuple[float, str]  # largest |bias|/spread, and its parameter
    runs: int  # number of estimates
    records: int  # number of different records among them
    failed: int  # number of runs without an estimate
    not_converged: int  # number of estimates whose iteration did not converge
    errors: dict[str, int]  # number of runs that ended with each class of error
    messages: dict[str, str]  # first message of each class
    iterations: tuple[float, int]  # median and largest number
    simulations: float  # median number of simulations of the loop, NaN where rows are without
    seconds: float  # median time of an identification [s]
    merit: Merit  # medians over the runs of the figures of merit [%]
    simulations_diverged: int  # estimates with which the second motion cannot be simulated
    merit_of_mean: Merit | None  # figures of merit of the mean estimate [%], None without runs
    parameters: tuple[ParameterSummary, ...]  # parameter by parameter


@dataclass(frozen=True)
class Summary:
    """A whole study."""

    scenario: str  # its name, with the condition
    description: str  # in words
    hash: str  # SHA-256 of the scenario
    version: str  # version of pivident
    runs: int  # number of runs with rows
    methods: dict[str, MethodSummary]  # method by method

    def to_json(self) -> str:
        """As strict JSON: numbers that are not finite are null, parameters are by name."""
        content = plain(self)
        for method in content["methods"].values():
            method["parameters"] = {p.pop("name"): p for p in method["parameters"]}
        content["nominal_coverage"] = NOMINAL_COVERAGE
        return json.dumps(content, indent=1, allow_nan=False)


def summarise(bench: Bench, rows: pl.DataFrame) -> Summary:
    """Summarise all rows of a study."""
    from pivident.foundation.version import __version__

    try:
        bounds = efficiency_bounds(bench)
    except IdentificationError:  # the true robot does not follow its reference: no run did
        bounds = Bounds(None, None)
    tables = {
        name: _Table(bench, rows.filter(rows["method"] == name)) for name in bench.scenario.methods
    }
    return Summary(
        bench.scenario.title,
        bench.scenario.content.description,
        bench.scenario.hash,
        __version__,
        rows["run"].n_unique(),
        {name: _method(bench, table, bounds, tables) for name, table in tables.items()},
    )


class _Table:
    """The rows of one method as arrays."""

    def __init__(self, bench: Bench, rows: pl.DataFrame) -> None:
        pl = require("polars", extra="tables", purpose="a Monte Carlo study")
        self.failures = rows.filter(pl.col("error").is_not_null())
        self.rows = rows.filter(pl.col("error").is_null())
        if "simulations" not in rows.columns:  # rows of an older program
            self.rows = self.rows.with_columns(pl.lit(None, pl.Int64).alias("simulations"))
        size = len(bench.estimated)
        self.theta, self.std, self.robust = (
            np.array(self.rows[key].to_list(), dtype=float).reshape(-1, size)
            for key in ("theta", "std", "robust_std")
        )
        self.record = self.rows["record"].to_numpy()
        self.error = self.theta - bench.expected
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = np.abs(self.error / bench.expected)
        self.relative = np.where(np.isfinite(relative), relative, np.nan)
        several = len(self.theta) > 1
        self.spread = self.theta.std(axis=0, ddof=1) if several else np.full(size, NAN)
        self.covered = np.abs(self.error) < 2.0 * self.std


def _method(
    bench: Bench, table: _Table, bounds: Bounds, others: dict[str, _Table]
) -> MethodSummary:
    parameters = tuple(_parameter(bench, table, bounds, k) for k in range(len(bench.estimated)))
    expected = np.abs(bench.expected)
    failed = table.failures
    errors = Counter(failed["error"].to_list())
    first = {name: failed.filter(failed["error"] == name)["message"][0] for name in errors}
    rows, count = table.rows, len(table.theta)
    biases = [(p.bias_over_spread, p.name) for p in parameters]
    finite = [b for b in biases if math.isfinite(b[0])]
    iterations = rows["iterations"].to_list()
    medians = [_median(rows[key].drop_nulls().to_list()) for key in ("d_tau", "d_q", "d_beta")]
    return MethodSummary(
        coverage=_mean(table.covered),
        coverage_interval=clustered_interval(table.covered.mean(axis=1), table.record),
        robust_coverage=_mean(np.abs(table.error) < 2.0 * table.robust),
        median_relative_error=_median(table.relative[np.isfinite(table.relative)]),
        relative_spread=geometric_mean(table.spread[expected > 0] / expected[expected > 0]),
        predicted_over_empirical=geometric_mean([p.predicted_over_empirical for p in parameters]),
        robust_over_empirical=geometric_mean([p.robust_over_empirical for p in parameters]),
        efficiency=geometric_mean([p.efficiency for p in parameters]),
        spread_over_sensor_bound=geometric_mean(
            [p.spread / p.sensor_bound if p.sensor_bound > 0 else NAN for p in parameters]
        ),
        variance_ratio={
            name: geometric_mean((table.spread / other.spread) ** 2)
            for name, other in others.items()
            if other is not table
        },
        largest_bias=max(finite, default=(NAN, "")),
        runs=count,
        records=len(np.unique(table.record)),
        failed=len(failed),
        not_converged=count - int(rows["converged"].sum() or 0),
        errors=dict(errors),
        messages=first,
        iterations=(_median(iterations), max(iterations, default=0)),
        simulations=_median(rows["simulations"].drop_nulls().to_list()),
        seconds=_median(rows["seconds"].to_list()),
        merit=Merit(*medians),
        simulations_diverged=int(rows["d_q"].null_count()),
        merit_of_mean=figures_of_merit(bench, table.theta.mean(axis=0)) if count else None,
        parameters=parameters,
    )


def _parameter(bench: Bench, table: _Table, bounds: Bounds, k: int) -> ParameterSummary:
    error, covered, spread = table.error[:, k], table.covered[:, k], float(table.spread[k])
    predicted, robust = _mean(table.std[:, k]), _mean(table.robust[:, k])
    bound = NAN if bounds.equation is None else float(bounds.equation[k])
    sensor = NAN if bounds.torque_sensor is None else float(bounds.torque_sensor[k])
    means = record_means(error, table.record)
    several = means.size > 1
    relative = table.relative[:, k]
    return ParameterSummary(
        name=bench.estimated[k],
        unit=bench.regressor.parameters[k].unit,
        truth=float(bench.expected[k]),
        mean=_mean(table.theta[:, k]),
        bias=_mean(error),
        bias_std=float(means.std(ddof=1) / math.sqrt(means.size)) if several else NAN,
        spread=spread,
        predicted=predicted,
        predicted_over_empirical=predicted / spread if spread > 0 else NAN,
        robust_over_empirical=robust / spread if spread > 0 else NAN,
        coverage=_mean(covered),
        coverage_interval=wilson_interval(_mean(covered), means.size),
        median_relative_error=_median(relative[np.isfinite(relative)]),
        bound=bound,
        efficiency=(bound / spread) ** 2 if spread > 0 else NAN,
        sensor_bound=sensor,
        runs=error.size,
    )


def wilson_interval(share: float, count: int) -> Interval:
    """Interval of a share of ``count`` independent cases (Wilson 1927), NaN without any."""
    if count == 0 or math.isnan(share):
        return NAN, NAN
    z = NormalDist().inv_cdf(0.5 + CONFIDENCE / 2)
    middle = share + z**2 / (2 * count)
    half = z * math.sqrt(share * (1 - share) / count + z**2 / (4 * count**2))
    scale = 1 + z**2 / count
    return max(0.0, (middle - half) / scale), min(1.0, (middle + half) / scale)


def clustered_interval(shares: np.ndarray, clusters: np.ndarray) -> Interval:
    """Interval of the mean of shares that depend on each other within a cluster.

    The parameters of a run share its noise, and runs of one record share the record, so that only
    the means of records are independent: m ± t s/√R with their standard deviation s. If all are
    equal, Wilson's interval with one case per record.
    """
    means = record_means(shares, clusters)
    if means.size < 2:
        return NAN, NAN
    if np.ptp(means) == 0.0:  # all equal: their spread carries no information
        return wilson_interval(float(means[0]), means.size)
    quantile = float(student.ppf(0.5 + CONFIDENCE / 2, means.size - 1))
    half = quantile * float(means.std(ddof=1)) / math.sqrt(means.size)
    middle = float(means.mean())
    return max(0.0, middle - half), min(1.0, middle + half)


def record_means(values: np.ndarray, records: np.ndarray) -> np.ndarray:
    """Mean of the values of each record, shape (records,)."""
    _, index, count = np.unique(records, return_inverse=True, return_counts=True)
    return np.bincount(index, weights=values, minlength=count.size) / np.maximum(count, 1)


def geometric_mean(values: Sequence[float] | np.ndarray) -> float:
    """Geometric mean of the positive values, NaN without any."""
    x = np.asarray(values, dtype=float)
    x = x[np.isfinite(x) & (x > 0)]
    return float(np.exp(np.mean(np.log(x)))) if x.size else NAN


def _mean(values: np.ndarray) -> float:
    return float(np.mean(values)) if np.size(values) else NAN


def _median(values: Sequence[float] | np.ndarray) -> float:
    return float(np.median(values)) if len(values) else NAN


def summary_text(summary: Summary) -> str:
    """A table with one line per method, errors, and a note on the intervals."""
    rows = []
    for name, m in summary.methods.items():
        low, high = m.coverage_interval
        rows.append(
            (
                name,
                str(m.runs),
                percent(m.coverage, 1),
                f"{percent(low, 1, '')}–{percent(high, 1)}" if math.isfinite(low) else "–",
                percent(m.median_relative_error, 5),
                number(m.predicted_over_empirical),
                number(m.efficiency),
                number(m.iterations[0]),
                number(m.simulations),
                "–" if math.isnan(m.seconds) else f"{m.seconds:.2f} s",
            )
        )
    table = [
        (heading, ">" if k else "<", [row[k] for row in rows]) for k, heading in enumerate(HEADINGS)
    ]
    lines = [plain_table(table)]
    for name, m in summary.methods.items():
        lines += [
            f"{name}: {count} run(s) ended with {error}: {m.messages[error]}"
            for error, count in m.errors.items()
        ]
        if m.not_converged:
            lines.append(f"{name}: {m.not_converged} estimate(s) did not converge")
    note = (
        f"A 2σ interval should cover the truth in {100 * NOMINAL_COVERAGE:.1f} % of the cases; "
        "the interval of the coverage is a 95 % interval over the runs."
    )
    return "\n".join([f"{summary.scenario}: {summary.description}".rstrip(": "), *lines, note])


def percent(share: float, digits: int, unit: str = " %") -> str:
    """A fraction as percentage, with this many decimals; more if it is small."""
    if not math.isfinite(share):
        return "–"
    value = 100.0 * share
    if 0 < abs(value) < 10.0**-digits:
        return f"{value:.2g}{unit}"
    return f"{value:.{digits}f}{unit}"


def number(value: float) -> str:
    """Three digits, or a dash."""
    return f"{value:.3g}" if math.isfinite(value) else "–"
