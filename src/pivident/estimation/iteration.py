"""The named things that pass from step to step of an iteration, and when it ends.

    Pass → (a) simulate → Simulated → Equations of all records → (b) solve → Estimate → (c) → …

`prefiltered_iv.piv` is the loop; IDIM-PIV, IDIM-IV and DIDIM give it their own `Steps`.

Friction that grows with the load depends on the parameters that are sought: the load of a joint is
the torque of inertia, gravity and springs, Φ_r θ_r. Estimators take it from their last estimate
and repeat until it has settled; the first one does without that friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.covariance.sandwich import sandwich
from pivident.estimation.equation_record import EquationRecord, accumulate
from pivident.estimation.full_rate import records_without_instruments
from pivident.estimation.identification import Iteration
from pivident.estimation.instrument_choice import InstrumentSource
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.method import InstrumentalMethod, IteratedMethod
from pivident.estimation.noise_identification import Prefilters
from pivident.estimation.normal_equations import (
    JointSums,
    Solution,
    joint_variances,
    relative_residual,
    weighted_solution,
)
from pivident.estimation.problem import Problem
from pivident.foundation.errors import MassMatrixNotPositiveDefinite, SimulationDiverged
from pivident.foundation.text.finding import Finding, Quantity
from pivident.loop.motion.motion import Kinematics, SimulatedMotion, SpeedLimits, with_inner
from pivident.loop.motion.simulated_detail import with_forced_detail, with_simulated_detail
from pivident.signals.prefilter import Prefilter

#: Share of a step that the next one takes back where an iteration alternates between two estimates.
TAKEN_BACK = 0.8

#: Change of an estimate, in standard errors, below which its load has settled; and relative to
#: the largest parameter, for records without noise.
LOAD_SETTLED, ROUNDING = 0.01, 1e-12

#: Estimates after which a load that does not settle is given up.
MAX_PASSES = 30


def estimate_without_load(
    problem: Problem, kinematics: Sequence[Kinematics], limits: Sequence[SpeedLimits]
) -> np.ndarray | None:
    """Least squares without the friction that grows with the load: what makes the first load.

    Result: parameters, shape (parameters,), zero for the friction left out; None where no column
    depends on the load.
    """
    if not problem.regressor.depends_on_load:
        return None
    others = np.flatnonzero(~problem.regressor.load_parameters)
    regressor = regressor_of(problem.robot, [problem.regressor.parameters[k] for k in others])
    known = [with_inner(regressor, k) for k in kinematics]
    filters = [Prefilter()] * problem.robot.size
    records = records_without_instruments(known, limits)
    sums = accumulate(regressor, records, filters, by_window=False)
    restrictions = problem.restrictions.on(others)
    theta = np.zeros(len(problem.names))
    theta[others] = weighted_solution(sums, restrictions, np.zeros(others.size), 1.0)[0].theta
    return theta


def has_settled(theta: np.ndarray, last: np.ndarray, std: np.ndarray) -> bool:
    """Whether an estimate changed so little that its load stands still."""
    change = np.abs(theta - last)
    return bool((change <= LOAD_SETTLED * std + ROUNDING * np.abs(theta).max()).all())


def relative_change(theta: np.ndarray, last: np.ndarray) -> float:
    """Largest change relative to the larger of both values."""
    size = np.maximum(np.maximum(np.abs(theta), np.abs(last)), 1e-300)
    return float((np.abs(theta - last) / size).max(initial=0.0))


#: Condition number from which on a motion hardly separates some parameters.
LARGE_CONDITION = 200.0

#: A parameter smaller than so many standard errors is near zero: its change is compared with them.
NEAR_ZERO = 5.0

#: Largest change of a parameter in the last iteration, in standard errors.
SETTLED = 0.2


@dataclass(frozen=True, eq=False)
class Signals:
    """All recordings smoothed, before there is a simulation."""

    problem: Problem  # what is given
    kinematics: list[Kinematics]  # motion and torque of each recording
    limits: list[SpeedLimits]  # speeds below which samples are excluded, likewise
    #: Estimate that makes the first load of friction; None: there is no such.
    without_load: np.ndarray | None

    @classmethod
    def of(cls, problem: Problem, method: IteratedMethod) -> Signals:
        """Smooth all recordings by the method's recipe."""
        kinematics = [estimate_kinematics(r, method.signals) for r in problem.recordings]
        limits = [problem.speed_limits(r) for r in problem.recordings]
        return cls(problem, kinematics, limits, estimate_without_load(problem, kinematics, limits))

    def with_kinematics(self, kinematics: list[Kinematics]) -> Signals:
        """The same with other measured motions, where the instruments come with their own."""
        if kinematics is self.kinematics:
            return self
        first = estimate_without_load(self.problem, kinematics, self.limits)
        return replace(self, kinematics=kinematics, without_load=first)

    def load(self, number: int, theta: np.ndarray) -> np.ndarray:
        """Parameters that make the load: θ, or those without load as long as there is no θ."""
        return theta if number or self.without_load is None else self.without_load

    def measured(
        self, theta: np.ndarray | None, motions: Sequence[SimulatedMotion] = ()
    ) -> list[Kinematics]:
        """Measured motions with inner signals for the load of θ.

        ``motions``: simulated ones, which give back what the smoother takes; to a floating base,
        which is not simulated, the forces on it do.
        """
        kinematics, regressor = self.kinematics, self.problem.regressor
        if motions:
            kinematics = list(map(with_simulated_detail, kinematics, motions))
        if motions and theta is not None:
            kinematics = [with_forced_detail(regressor, k, theta) for k in kinematics]
        return [with_inner(regressor, k, theta) for k in kinematics]

    def simulated(
        self, motions: Sequence[SimulatedMotion], theta: np.ndarray
    ) -> list[SimulatedMotion]:
        """Simulated motions likewise."""
        return [with_inner(self.problem.regressor, m, theta) for m in motions]


class Simulated(NamedTuple):
    """Step (a): motions of all recordings, the parameters that made them, halvings on the way."""

    motions: list[SimulatedMotion]
    theta: np.ndarray
    halvings: int


@dataclass(frozen=True, eq=False)
class Pass:
    """Where the iteration stands."""

    number: int  # how many estimates have been made; 0: θ are initial values
    theta: np.ndarray  # parameters, shape (parameters,)
    #: Parameters that were simulated last, to halve the way to θ; None: none were.
    simulated: np.ndarray | None
    records: Sequence[EquationRecord]  # equations of all recordings that θ was estimated from
    prefilters: Prefilters  # what they were filtered with

    @property
    def reservations(self) -> list[Finding]:
        """Parameters that the motion hardly separates: not known before the first estimate."""
        return []


@dataclass(frozen=True, eq=False)
class Estimate(Pass):
    """Step (b): what the equations were solved to."""

    sums: list[JointSums]  # normal equations, one per joint
    solution: Solution  # θ̂ and its covariance
    variance: np.ndarray  # λ of each joint, shape (joints,)

    @property
    def reservations(self) -> list[Finding]:
        """Parameters that the motion hardly separates."""
        return poor_motion(self.solution)


def solved_otherwise(
    start: Estimate, theta: np.ndarray, covariance: np.ndarray, condition: float, passes: np.ndarray
) -> tuple[Estimate, tuple[Iteration, ...]]:
    """An estimate of the same equations by another method than theirs, and its passes.

    ``start``: least squares; ``theta``, ``covariance`` and ``condition``: what the method found;
    ``passes``: parameters after each, shape (passes, parameters).
    """
    solution = Solution(theta, covariance, condition, start.solution.weakest)
    variance = joint_variances(start.sums, theta)
    history, last = [], start.theta
    for own in passes:
        residual = relative_residual(start.sums, own, start.variance)
        history.append(Iteration(own, relative_change(own, last), residual))
        last = own
    made = replace(start, number=len(passes), theta=theta, solution=solution, variance=variance)
    return made, tuple(history)


class Steps(Protocol):
    """The parts of one method's iteration."""

    @property
    def signals(self) -> Signals:
        """The smoothed recordings."""

    @property
    def method(self) -> InstrumentalMethod:
        """Options: tolerance, iterations, weights, covariance."""

    @property
    def auxiliary(self) -> InstrumentSource:
        """What makes the instruments: the simulated loop, or a motion of the record."""

    @property
    def earliest(self) -> int:
        """Number of the first estimate that may be the last."""

    @property
    def always_by_window(self) -> bool:
        """Whether sums are kept for each window of time before they are needed."""

    @property
    def repeatable(self) -> bool:
        """Whether the same θ makes the same equations: then two estimates may alternate."""

    def start(self) -> Pass:
        """Step 1: θ⁰ and H = 1."""

    def noise_models(self, last: Pass, theta: np.ndarray) -> Prefilters:
        """Step (c): prefilters from the residual of θ."""

    def equations(
        self, last: Pass, simulated: Simulated, prefilters: Prefilters
    ) -> tuple[Sequence[EquationRecord], Prefilters]:
        """Records with the simulated instruments, and what they are filtered with."""


def start_number(method: IteratedMethod) -> int:
    """Estimates before the first iteration: whether least squares makes one."""
    return int(method.start == "least-squares")


def initial_pass(problem: Problem, prefilters: Prefilters) -> Pass:
    """θ⁰: nominal inertias, zero friction, or what the problem says."""
    return Pass(0, problem.initial_values(), None, (), prefilters)


def least_squares_pass(signals: Signals, nominal: Pass, records: Sequence[EquationRecord]) -> Pass:
    """θ⁰ by least squares, nearer to the answer than nominal values, which may lack the rotors.

    ``nominal``: the pass of the initial values, from which the way to θ⁰ is halved where the loop
    cannot be simulated; ``records``: equations without instruments.
    """
    problem, filters = signals.problem, nominal.prefilters.filters
    sums = accumulate(problem.regressor, records, filters, by_window=False)
    theta = weighted_solution(sums, problem.restrictions, nominal.theta, 1.0)[0].theta
    return Pass(1, theta, nominal.theta, records, nominal.prefilters)


def simulate(steps: Steps, last: Pass, run: Run) -> Simulated:
    """Step (a): simulate θ, or the first point of half the way to it that can be simulated.

    An iteration that alternates goes half the way: it still ends only where the estimate is what it
    was simulated with. Where no point can be simulated, the error tells what the motion lacks.
    """
    theta = last.theta
    if run.alternates and steps.repeatable and last.simulated is not None:
        theta = 0.5 * (last.simulated + theta)
    try:
        return Simulated(*steps.auxiliary.simulate_or_halve(last.simulated, theta))
    except (SimulationDiverged, MassMatrixNotPositiveDefinite) as error:
        for finding in last.reservations:
            error.add_note(finding.advised)
        raise


def solve(steps: Steps, last: Pass, simulated: Simulated, prefilters: Prefilters) -> Estimate:
    """Step (b): (P-28), with weights λ_j from the residual of its own estimate."""
    problem, number, power = steps.signals.problem, last.number + 1, steps.method.weight_power
    records, prefilters = steps.equations(last, simulated, prefilters)
    highest = start_number(steps.method) + steps.method.max_iterations
    by_window = steps.always_by_window or number >= min(steps.earliest, highest)
    sums = accumulate(problem.regressor, records, prefilters.filters, by_window)
    solution, variance = weighted_solution(sums, problem.restrictions, simulated.theta, power)
    return Estimate(
        number, solution.theta, simulated.theta, records, prefilters, sums, solution, variance
    )


@dataclass(frozen=True, eq=False)
class Run:
    """All iterations so far, and whether they converged."""

    history: tuple[Iteration, ...] = ()
    converged: bool = False
    alternates: bool = False  # whether a step has taken back most of the one before

    def after(self, steps: Steps, estimate: Estimate, halvings: int) -> Run:
        """With one more iteration.

        Parameters and residual must both change by less than ``tolerance``: the parameters
        relative to the larger of their size and five standard errors (with a tolerance of 1 %, a
        twentieth of a standard error for a parameter near zero), and at the same time by less than
        a fifth of a standard error; the residual relative to itself.
        """
        method, theta, sums = steps.method, estimate.theta, estimate.sums
        covariance, may_be_last = estimate.solution.covariance, estimate.number >= steps.earliest
        if method.covariance != "formula" and may_be_last:
            freedom = steps.signals.problem.restrictions.freedom
            covariance = sandwich(sums, theta, estimate.variance, method.weight_power, freedom)
        std = np.maximum(np.sqrt(np.diag(covariance)), 1e-300)  # zero where a value is fixed
        assert estimate.simulated is not None
        step = np.abs(theta - estimate.simulated)
        change = float((step / np.maximum(np.abs(theta), NEAR_ZERO * std)).max())
        settled = bool((step < SETTLED * std)[steps.signals.problem.varying].all())
        residual = relative_residual(sums, theta, estimate.variance)
        before = self.history[-1].residual if self.history else np.inf
        made = Iteration(theta, change, residual, halvings, estimate.prefilters.orders)
        still = change < method.tolerance and settled and may_be_last
        converged = still and abs(residual - before) < method.tolerance * residual
        history = (*self.history, made)
        return Run(history, bool(converged), self.alternates or _takes_back(history))

    def __str__(self) -> str:
        last = self.history[-1]
        return (
            f"iteration {len(self.history)}: parameters change by {100 * last.change:.3g} %, "
            f"residual {100 * last.residual:.3g} %"
        )


def _takes_back(history: Sequence[Iteration]) -> bool:
    """Whether the last step goes back at least ``TAKEN_BACK`` of the one before."""
    if len(history) < 3:
        return False
    before, middle, now = (made.theta for made in history[-3:])
    size = np.maximum(np.abs(now) + np.abs(middle), 1e-300)
    first, second = (middle - before) / size, (now - middle) / size
    return bool(first @ second < -TAKEN_BACK * (first @ first))


def poor_motion(solution: Solution) -> list[Finding]:
    """Parameters that the motion hardly separates; no reservation, since intervals say it."""
    if solution.condition <= LARGE_CONDITION:
        return []
    text = (
        f"The motion hardly separates {', '.join(solution.weakest)} (condition number "
        f"{solution.condition:.0f})."
    )
    step = "Add a second, different motion, or estimate fewer parameters."
    evidence = {"condition number": Quantity(float(solution.condition))}
    return [Finding("note", "motion", "ill-conditioned", text, "", step, evidence)]
