"""IDIM-LS: ordinary and weighted least squares on the inverse dynamic model, (P-19)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from pivident.estimation.answer import answer
from pivident.estimation.covariance.sandwich import jackknife
from pivident.estimation.decimated import decimate_record
from pivident.estimation.equation_record import EquationRecord, accumulate
from pivident.estimation.full_rate import records_without_instruments
from pivident.estimation.identification import Identification, Iteration
from pivident.estimation.iteration import (
    MAX_PASSES,
    Estimate,
    Run,
    estimate_without_load,
    has_settled,
    relative_change,
)
from pivident.estimation.kinematics import estimate_kinematics, settled_recipe
from pivident.estimation.method import Handles, Method, Say
from pivident.estimation.noise_identification import Prefilters
from pivident.estimation.normal_equations import JointSums, Solution, relative_residual, solve
from pivident.estimation.problem import BIASED, Problem
from pivident.estimation.signal_recipes import Bandpass, Decimated
from pivident.foundation.common_work import once
from pivident.foundation.options import option
from pivident.foundation.progress import IterationLine
from pivident.foundation.text.finding import Finding
from pivident.loop.motion.motion import MOTION_BAND, Kinematics, SpeedLimits, with_inner


@dataclass(frozen=True, kw_only=True)
class LeastSquares(Method):
    """IDIM-LS: ordinary (weighted = False) or weighted by each joint's own residual.

    θ = (Σ ΦᵀΦ/λ_j)⁻¹ Σ Φᵀτ/λ_j, λ_j from each joint's own least squares (Gautier 1997), is biased
    where the positions were measured inside a feedback loop. Friction that grows with the load is
    estimated again with the load of the last estimate until that stands still.

    Attributes:
        weighted: whether joints are weighted by the inverse of their residual variance.

    Example:
        >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> recording = pv.simulate(robot, loop, duration=5.0, encoder=1e-5).recording
        >>> problem = pv.Problem(robot, (recording,))
        >>> for weighted in (False, True):  # the standard error of the elbow's friction [N m]
        ...     result = pv.identify(problem, pv.LeastSquares(weighted=weighted))
        ...     print(result.method, round(result.bse["fc2"], 4))
        IDIM-OLS 0.0083
        IDIM-WLS 0.0043
    """

    weighted: bool = option(True, "weight joints by the inverse of their residual variance")

    of_computed_torque: ClassVar[tuple[Finding, ...]] = (BIASED,)

    @property
    def label(self) -> str:  # type: ignore[override]
        """Name as in the literature."""
        return "IDIM-WLS" if self.weighted else "IDIM-OLS"

    @property
    def summary(self) -> str:  # type: ignore[override]
        """What it is, in a few words."""
        if self.weighted:
            return "least squares: fast, and biased by the feedback loop"
        return "least squares without weights"

    @property
    def group(self) -> str:  # type: ignore[override]
        """Heading under which it is offered."""
        return "" if self.weighted else "Regressions"

    @property
    def handles(self) -> Handles:  # type: ignore[override]
        """What it copes with: a load with weights only."""
        return Handles(law_choice=True, shape_constants=True, payload=self.weighted)

    @property
    def keys(self) -> tuple[str, ...]:
        """Options that a file may set: weights have names of their own, ``ls`` and ``ols``."""
        return ("signals",)

    def settled(self, problem: Problem) -> Self:
        """With cut-offs and band in numbers; a slow log is thinned only where that is surer."""
        thinned, own = super().settled(problem), self.signals
        if not isinstance(own, Bandpass) or own.decimation or own.bandwidth:
            return thinned
        recipe = settled_recipe(replace(own, decimation=1), problem.recordings)
        whole = replace(self, signals=recipe)
        slow = own.band(min(r.rate for r in problem.recordings)) < MOTION_BAND
        return whole if slow and is_surer(problem, whole, thinned) else thinned

    def estimate(self, problem: Problem, say: Say, *, test_gains: bool = True) -> Identification:
        """One solution, or several where friction grows with the load."""
        say(f"{self.label}: filtering the records")
        kinematics = [estimate_kinematics(r, self.signals) for r in problem.recordings]
        say(f"{self.label}: solution, residuals and covariance")
        return answer(problem, self, *settled_least_squares(problem, self, kinematics, say))


def is_surer(problem: Problem, other: LeastSquares, than: LeastSquares) -> bool:
    """Whether one method knows the torques of its own record better than another.

    A wider band has more rows, with errors that may be larger and derivatives that may be wrong:
    the variance of the torques tr(P Σ_j ΦᵀΦ/λ_j), P from windows of time, Φ and λ of ``than``, is
    larger, or the torques of both are further apart than their variances together.
    """
    fits = []
    for method in (than, other):
        kinematics = [estimate_kinematics(r, method.signals) for r in problem.recordings]
        fits.append(settled_least_squares(problem, method, kinematics, lambda line: None)[0])
    freedom = problem.restrictions.freedom
    known, found = (jackknife(f.sums, f.theta, f.variance, freedom=freedom) for f in fits)
    information = np.zeros_like(known.covariance)
    for joint, variance in zip(fits[0].sums, fits[0].variance, strict=True):
        information[np.ix_(joint.columns, joint.columns)] += joint.ff / variance
    of_known, of_found = (float(np.sum(j.covariance * information)) for j in (known, found))
    apart = fits[1].theta - fits[0].theta
    return of_found < of_known and apart @ information @ apart <= of_known + of_found


#: Least squares, weighted and not.
LS, OLS = LeastSquares(), LeastSquares(weighted=False)


def least_squares_start(
    problem: Problem, method: Method, say: Say
) -> tuple[list[Kinematics], Estimate]:
    """Motions and torques by a method's recipe, and least squares on them, where it begins."""
    say(f"{method.label}: filtering the records")
    kinematics = [estimate_kinematics(r, method.signals) for r in problem.recordings]
    least = LeastSquares(signals=method.signals)
    return kinematics, settled_least_squares(problem, least, kinematics, say)[0]


def settled_least_squares(
    problem: Problem, method: LeastSquares, kinematics: Sequence[Kinematics], say: Say
) -> tuple[Estimate, Run]:
    """The estimate with its equations, and how it came about, for all who ask for it."""
    key = "least squares", problem, method, *kinematics
    return once(key, lambda: _settled(problem, method, kinematics, say))


def _settled(
    problem: Problem, method: LeastSquares, kinematics: Sequence[Kinematics], say: Say
) -> tuple[Estimate, Run]:
    """One solution, or several until the load of friction is that of the estimate."""
    limits = [problem.speed_limits(r) for r in problem.recordings]
    theta = estimate_without_load(problem, kinematics, limits)
    run, settled = Run(), False
    while not settled and len(run.history) < MAX_PASSES:
        known = [with_inner(problem.regressor, k, theta) for k in kinematics]
        estimate = _estimate(problem, method, _records(problem, method, known, limits))
        settled, change = True, 0.0
        if theta is not None:
            std = np.sqrt(np.diag(estimate.solution.covariance))
            settled = has_settled(estimate.theta, theta, std)
            change = relative_change(estimate.theta, theta)
        residual = relative_residual(estimate.sums, estimate.theta, estimate.variance)
        run = Run((*run.history, Iteration(estimate.theta, change, residual)), settled)
        theta = estimate.theta
        if not settled:
            size = f"parameters change by {100 * change:.3g} %"
            say(IterationLine(f"load from estimate {len(run.history)}: {size}"))
    return estimate, run


def _records(
    problem: Problem, method: LeastSquares, kinematics: list[Kinematics], limits: list[SpeedLimits]
) -> Sequence[EquationRecord]:
    """Equations of all recordings, decimated or at full rate."""
    if not isinstance(method.signals, Decimated):
        return records_without_instruments(kinematics, limits)
    return [
        decimate_record(problem.regressor, k, method.signals, lim)
        for k, lim in zip(kinematics, limits, strict=True)
    ]


def _estimate(
    problem: Problem, method: LeastSquares, records: Sequence[EquationRecord]
) -> Estimate:
    """Solution with the weights 1/λ_j, or with a common λ."""
    full_rate = not isinstance(method.signals, Decimated)
    prefilters = Prefilters.none(problem) if full_rate else Prefilters(())
    sums = accumulate(problem.regressor, records, prefilters.filters)
    solution, variance = _solve(problem, method, sums)
    return Estimate(1, solution.theta, None, records, prefilters, sums, solution, variance)


def _solve(
    problem: Problem, method: LeastSquares, sums: list[JointSums]
) -> tuple[Solution, np.ndarray]:
    """One solution; its variances are those of the weights, or the common one without weights."""
    variance = np.array([s.own_variance() for s in sums])
    known = problem.restrictions
    if not method.weighted:  # a prior would weigh against squares whose size is not known yet
        theta = solve(sums, np.ones(len(sums)), known.without_prior).theta
        rows, weight = sum(s.rows for s in sums), sum(s.weight for s in sums)
        square = sum(s.residual_sum(theta) for s in sums)
        common = square / max(rows - known.freedom.free.size, 1) * (rows / max(weight, 1e-300))
        variance = np.full(len(sums), max(common, 1e-300))
    return solve(sums, variance, known, checked=True), variance
