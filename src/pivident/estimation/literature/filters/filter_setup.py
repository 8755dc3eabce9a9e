"""What a filter begins with: stretches of records, first parameters and their spread, noises.

Encoder noise is that of the random walk smoother. The noise of the torque is where the innovations
of each joint are likeliest,

    log L_j = -½ Σ (log s_j + z_j²),

searched by an extended Kalman filter on a grid below and above the residual of least squares, which
holds the noise of the derivatives, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.forward import make_model
from pivident.dynamics.friction_table import dry_friction_level
from pivident.estimation.iteration import Estimate
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.literature.filters.online import KalmanFilter, KalmanSteps
from pivident.estimation.method import Handles, Method, Refit, Start
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.common_work import once
from pivident.foundation.errors import ExperimentError, FilterDiverged
from pivident.foundation.options import option, per_joint
from pivident.loop.motion.motion import Kinematics
from pivident.signals.alignment import torque_shift

#: Samples on which noise of the torque is searched, roughly and then more finely.
SEARCHED = (2_500, 10_000)

#: Standard deviations of the torque that are tried, over that of the residual: decades.
DECADES = np.arange(1.0, -3.1, -0.5)

#: Step of the second, finer search, decades.
FINER = 0.2

#: Standard deviation of dry friction at standstill, over its level: that of any value up to it.
SHARE_AT_STANDSTILL = 3.0**-0.5

#: Least encoder noise that is assumed, over the range of a joint's motion.
LEAST_NOISE = 1e-9


@dataclass(frozen=True, kw_only=True)
class FilterOptions(Method):
    """Start and noises of a filter with the state (q, dq, θ).

    Its input is the torque, its output q.

    Attributes:
        start: first parameters: ``least-squares`` on the record, or the problem's ``initial``
            values.
        spread: first standard deviation of each parameter: in standard errors of least squares
            (None: 10), or as a share of initial values, and where these are zero of the value that
            alone would explain the torque of a joint (None: 0.3).
        drift: standard deviation that a parameter gains in a second, as a share of its first value.
        encoder_noise: standard deviation of measured positions of all joints, or of each [rad or
            m]; None: from the record.
        torque_noise: standard deviation of the torques, white from sample to sample, likewise
            [N m or N]; None: the likeliest one.
        passes: how often the record is gone through, each time with the first spread.
        correlated_start: whether it begins with the correlations of least squares.
    """

    start: Start = option(
        "least-squares",
        'first parameters: least squares on the record, or the `"initial"` values',
    )
    spread: float | None = option(
        None,
        "first standard deviation of each parameter: in standard errors of least squares (not "
        "given: 10), or as a share of initial values (0.3)",
        shown="see meaning", above=0.0,
    )  # fmt: skip
    drift: float = option(
        0.0,
        "standard deviation that a parameter gains in a second, as a share of its first value",
        unit="1/s", at_least=0.0,
    )  # fmt: skip
    encoder_noise: float | tuple[float, ...] | None = option(
        None, "standard deviation of the measured positions, of all joints or of each",
        unit="rad or m", kind="number or list", shown="from the record", above=0.0,
    )  # fmt: skip
    torque_noise: float | tuple[float, ...] | None = option(
        None, "standard deviation of the torques, likewise",
        unit="N m or N", kind="number or list", shown="the likeliest", above=0.0,
    )  # fmt: skip
    passes: int = option(
        1, "how often the record is gone through, each time with the first spread", at_least=1
    )

    group: ClassVar[str] = "Filters"
    handles: ClassVar[Handles] = Handles(
        wrenches=False, inner_friction=False, known=(), weights=False, without_equation=False
    )
    refit: ClassVar[Refit] = "samples"
    correlated_start: ClassVar[bool] = False

    @property
    def first_spread(self) -> float:
        """The spread, or what stands for None."""
        usual = 10.0 if self.start == "least-squares" else 0.3
        return usual if self.spread is None else self.spread


@dataclass(frozen=True, eq=False)
class FilterStretch:
    """Successive samples that a filter goes through; it begins anew at each."""

    recording: int  # number of the recording
    first: int  # number of the first sample there
    q: np.ndarray  # measured positions, (samples, joints) [rad or m]
    tau: np.ndarray  # torques that acted before each, likewise [N m or N]
    dq: np.ndarray  # speeds of least squares, likewise [rad/s or m/s]
    difference: np.ndarray  # encoder noise in a difference of two samples, (joints,) [rad/s or m/s]

    @property
    def dq_std(self) -> np.ndarray:
        """Standard deviation of the first speed, (joints,) [rad/s or m/s]."""
        return self.difference + 1e-3 * np.abs(self.dq).max(axis=0) + 1e-9

    def part(self, begin: int, end: int) -> tuple[np.ndarray, np.ndarray]:
        """Positions and torques of some samples."""
        return self.q[begin:end], self.tau[begin:end]

    def without(self, left_out: np.ndarray) -> list[FilterStretch]:
        """What remains where samples are left out, a flag for each of the recording's."""
        used = ~left_out[self.first : self.first + len(self.q)]
        edges = np.flatnonzero(np.diff(np.concatenate([[False], used, [False]]))).reshape(-1, 2)
        return [
            replace(self, first=self.first + a, q=self.q[a:b], tau=self.tau[a:b], dq=self.dq[a:b])
            for a, b in edges.tolist()
            if b - a > 2
        ]


@dataclass(frozen=True, eq=False)
class FilterSetup:
    """Where a filter starts, and which noises it assumes."""

    rate: float  # [Hz]
    theta: np.ndarray  # (parameters,)
    covariance: np.ndarray  # (parameters, parameters)
    drift: np.ndarray  # standard deviation gained in a second, (parameters,)
    encoder: np.ndarray  # standard deviations, (joints,) [rad or m]
    torque: np.ndarray  # likewise [N m or N]
    dry: np.ndarray  # the same, besides, at standstill, of dry friction
    limits: np.ndarray  # speeds of standstill, (joints,) [rad/s or m/s]

    @property
    def still(self) -> np.ndarray:
        """Standard deviation of the torques at standstill, (joints,) [N m or N]."""
        return np.hypot(self.torque, self.dry)

    def kalman(self, problem: Problem, method: KalmanSteps | None = None) -> KalmanFilter:
        """A filter that starts here; ``method``: None: the extended one."""
        return KalmanFilter(
            problem.robot, problem.regressor.parameters, self.theta, self.covariance,
            rate=self.rate, encoder_std=self.encoder, torque_std=self.torque, drift=self.drift,
            standstill=self.limits, still_std=self.still, method=method,
        )  # fmt: skip


def acting_torques(recording: Recording) -> np.ndarray:
    """Torque that acted, on average, in the period before each sample, (samples, joints)."""
    shift = torque_shift(
        recording.rate,
        recording.torque_timing,
        control_rate=recording.control_rate or None,
        delay=recording.delay - recording.drive_delay,
    )
    count = np.arange(recording.samples)
    at = np.clip(count - 0.5 - shift, 0, recording.samples - 1)
    return np.stack([np.interp(at, count, own) for own in recording.tau.T], axis=1)


def stretches_of(
    problem: Problem, kinematics: Sequence[Kinematics], encoder: np.ndarray
) -> list[FilterStretch]:
    """Usable samples of all recordings."""
    return [
        FilterStretch(
            r,
            known.start,
            recording.q[known.start : known.stop],
            acting_torques(recording)[known.start : known.stop],
            known.dq[:, known.start : known.stop].T,
            encoder * recording.rate,
        )
        for r, (recording, known) in enumerate(zip(problem.recordings, kinematics, strict=True))
    ]


def encoder_noise(problem: Problem, method: FilterOptions) -> np.ndarray:
    """Standard deviation of the measured positions, (joints,)."""
    if method.encoder_noise is not None:
        return per_joint("encoder_noise", method.encoder_noise, problem.robot.size)
    found = [estimate_kinematics(r, RandomWalk()).encoder_std for r in problem.recordings]
    reach = np.max([np.ptp(r.q, axis=0) for r in problem.recordings], axis=0)
    return np.maximum(np.sqrt(np.mean(np.square(found), axis=0)), LEAST_NOISE * reach + 1e-15)


def filter_setup(
    problem: Problem,
    method: FilterOptions,
    estimate: Estimate,
    stretches: Sequence[FilterStretch],
    encoder: np.ndarray,
) -> FilterSetup:
    """Start and noises from least squares.

    Raises:
        ExperimentError: recordings of different rates, or numbers that do not fit the joints.
    """
    rates = {float(r.rate) for r in problem.recordings}
    if len(rates) > 1:
        listed = ", ".join(f"{rate:g}" for rate in sorted(rates))
        raise ExperimentError(
            f"a filter steps at one rate, but the recordings have {listed} Hz",
            advice="give those of one rate",
        )
    if method.start == "initial":
        theta = problem.initial_values()
        size = np.where(theta != 0.0, np.abs(theta), explaining_values(estimate))
    else:
        theta, size = estimate.theta, np.sqrt(np.diag(estimate.solution.covariance))
    limits = np.max([problem.speed_limits(r).joints for r in problem.recordings], axis=0)
    friction = make_model(problem.robot, problem.regressor.parameters, estimate.theta).friction
    dry = dry_friction_level(friction, problem.robot.size)
    rows = sum(int(r.used.sum()) for r in estimate.records) / problem.robot.size
    apart = max(sum(len(s.q) for s in stretches) / max(rows, 1.0), 1.0)
    setup = FilterSetup(
        rates.pop(),
        theta,
        _first_covariance(method, estimate, size),
        method.drift * np.abs(theta),
        encoder,
        np.sqrt(estimate.variance * apart),
        SHARE_AT_STANDSTILL * dry,
        limits,
    )
    if method.torque_noise is not None:
        return replace(
            setup, torque=per_joint("torque_noise", method.torque_noise, problem.robot.size)
        )
    # searched at least squares, whatever the filter itself begins with
    near = np.sqrt(np.diag(estimate.solution.covariance))
    search = replace(setup, theta=estimate.theta, covariance=np.diag((10.0 * near) ** 2))
    key = "torque noise", problem, method.signals, method.start, method.drift, method.encoder_noise
    torque = once(key, lambda: likeliest_torque_noise(problem, search, stretches))
    return replace(setup, torque=torque)


def _first_covariance(method: FilterOptions, estimate: Estimate, size: np.ndarray) -> np.ndarray:
    """Spread at the start: independent parameters, of particles correlated as least squares has it.

    Particles are few: where columns are nearly dependent, independent ones would be far from all
    torques.
    """
    spread = method.first_spread * size
    if method.correlated_start and method.start == "least-squares":
        return method.first_spread**2 * estimate.solution.covariance
    return np.diag(spread**2)


def explaining_values(estimate: Estimate) -> np.ndarray:
    """Values that alone would explain the torque of a joint: the least over joints."""
    found = np.full(estimate.theta.size, np.inf)
    for own in estimate.sums:
        square = np.diag(own.zf)
        size = np.sqrt(own.tt / np.where(square > 0.0, square, np.nan))
        found[own.columns] = np.fmin(found[own.columns], size)
    return found


def likeliest_torque_noise(
    problem: Problem, setup: FilterSetup, stretches: Sequence[FilterStretch]
) -> np.ndarray:
    """Standard deviation of each joint's torque, searched on the longest stretch, (joints,)."""
    longest = max(stretches, key=lambda s: len(s.q))
    found = np.zeros(problem.robot.size)
    for grid, samples in zip((DECADES, FINER * np.arange(-2.0, 2.1)), SEARCHED, strict=True):
        tried = [replace(setup, torque=setup.torque * 10.0 ** (found + d)) for d in grid]
        scores = np.array([_score(problem, own, longest, samples) for own in tried])
        found = found + np.array([_peak(grid, own) for own in scores.T])
    return setup.torque * 10.0**found


def _score(
    problem: Problem, setup: FilterSetup, stretch: FilterStretch, samples: int
) -> np.ndarray:
    """Log likelihood of the innovations of each joint, (joints,); a filter that ends has none."""
    kalman = setup.kalman(problem)
    kalman.start(stretch.q[0], stretch.dq[0], stretch.dq_std)
    try:
        z, s = kalman.run(*stretch.part(1, samples))
    except FilterDiverged:
        return np.full(problem.robot.size, -np.inf)
    return -(np.log(s) + 0.5 * z**2).sum(axis=0)


def _peak(grid: np.ndarray, score: np.ndarray) -> float:
    """Where a parabola through the best point and its neighbours is highest."""
    if not np.isfinite(score).any():
        return 0.0
    best = int(np.argmax(score))
    if best in (0, len(grid) - 1) or not np.isfinite(score[best - 1 : best + 2]).all():
        return float(grid[best])
    low, top, high = score[best - 1 : best + 2]
    bend = low - 2.0 * top + high
    step = grid[best + 1] - grid[best]
    return float(grid[best] + (0.5 * step * (low - high) / bend if bend < 0.0 else 0.0))
