"""Base parameters from the lines of a periodic motion, weighted by the noise between periods.

The equations m τ = m Φθ hold on each line of a periodic motion, m a window that leaves out the
instants at which a joint is slow. With Φ_A, τ_A and Φ_B, τ_B from the mean of the first and of the
second half of the periods, and Z_A = Φ_B, Z_B = Φ_A,

    θ = (Σ_k Σ_h Z_hᴴ Φ_h/σ²_k)⁻¹ Σ_k Σ_h Z_hᴴ τ_h/σ²_k,      h = A, B

over the lines k from zero to the highest one. σ²_k is the variance of m (τ - Φθ) from one period to
the next, on the line and its neighbours, of each joint. Noise of one half is not in the other: the
feedback makes no bias, and neither law nor reference is needed (Swevers, Ganseman, Tükel, De
Schutter and Van Brussel 1997 for periodic excitation; Pintelon and Schoukens 2012, ch. 9 and 13,
for weights and instruments).

What repeats with the motion and the model does not explain is no noise: the mean residual of both
halves shows it, and where it exceeds its noise the standard errors are widened by as much.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.answer import answer
from pivident.estimation.equation_record import accumulate
from pivident.estimation.identification import Identification, Iteration
from pivident.estimation.iteration import Estimate, Run, relative_change
from pivident.estimation.kinematics import ABOVE_HALF_POWER, SHARE_OF_RATE
from pivident.estimation.literature.whole_periods import (
    HALVES,
    PeriodicRecord,
    WholePeriods,
    derivatives_on_lines,
    low_lines,
    low_lines_of_all,
    torque_on_lines,
    whole_periods,
    window_around,
)
from pivident.estimation.method import Handles, Method, Say
from pivident.estimation.noise_identification import Prefilters
from pivident.estimation.normal_equations import JointSums, relative_residual, solve
from pivident.estimation.problem import BIASED, Problem
from pivident.estimation.signal_recipes import Bandpass
from pivident.foundation.errors import ExperimentError
from pivident.foundation.options import option
from pivident.foundation.progress import IterationLine
from pivident.foundation.text.finding import Finding, Quantity
from pivident.loop.instruments.given_motion import InstrumentsUsed, agreement
from pivident.loop.motion.motion import (
    Kinematics,
    SimulatedMotion,
    packed_stretch,
    residual_of,
    with_inner,
)
from pivident.signals.random_walk import half_power_frequencies

#: Lines on each side over which a variance is averaged.
NEIGHBOURS = 5

#: Smallest share of the torque's mean power that a line may have as noise.
FLOOR = 1e-20

#: Squared mean residual over its noise from which on the model leaves something that repeats.
UNEXPLAINED = 2.0


@dataclass(frozen=True, eq=False)
class Periods:
    """The periods of one recording on their lines."""

    recording: Recording
    places: WholePeriods
    kinematics: Kinematics  # motion and torque of each period, on all samples
    lines: int  # number of the highest line of the equations
    window: np.ndarray  # m of each joint over a period, shape (joints, samples of it)

    @property
    def halves(self) -> tuple[slice, slice]:
        """Which periods belong to each half: together, so that they share their edges."""
        first = self.places.count // HALVES
        return slice(0, first), slice(first, self.places.count)

    @property
    def spread(self) -> float:
        """Variance of the mean of a half over that of a period, on average over both halves."""
        return float(np.mean([1.0 / (part.stop - part.start) for part in self.halves]))


@dataclass(frozen=True, kw_only=True)
class FrequencyDomain(Method):
    """Weighted least squares with instruments on the lines of a periodic motion.

    Of ``signals``, a band-pass, it has ``cutoff``, up to which lines of the positions are kept, and
    ``bandwidth``, up to which lines of the equations are; both without a filter.

    Attributes:
        period: length of a period [s]; None: from the reference, or else the positions.
        transient: periods at the start that are left out, in which the loop still settles.
        tolerance: change of all parameters, in standard errors, at which the passes end.
        max_iterations: give up after so many.
    """

    period: float | None = option(
        None, "length of a period, a whole number of samples", unit="s", shown="from the record",
        above=0.0,
    )  # fmt: skip
    transient: int = option(
        1, "left out at the start, where the loop still settles", unit="periods", at_least=0
    )
    tolerance: float = option(
        1e-2, "change in standard errors at which the passes end", unit="σ", above=0.0, below=1.0,
        shared=True,
    )  # fmt: skip
    max_iterations: int = option(20, "largest number of passes", at_least=1, shared=True)

    label: ClassVar[str] = "IDIM-FD"
    summary: ClassVar[str] = "on the lines of a periodic motion"
    handles: ClassVar[Handles] = Handles(wrenches=False, weights=False, without_equation=False)
    filters_positions: ClassVar[bool] = False
    of_computed_torque: ClassVar[tuple[Finding, ...]] = (BIASED,)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.signals, Bandpass):
            raise ExperimentError(
                "frequency differentiates on the lines of the motion",
                advice="of its signals it takes cutoff and bandwidth of a bandpass",
            ).about("signals")

    def settled(self, problem: Problem) -> Self:
        """As it is: the highest lines are found with the periods."""
        return self

    def estimate(self, problem: Problem, say: Say, *, test_gains: bool = True) -> Identification:
        """Iterate the estimate and the variances of its lines."""
        say(f"{self.label}: finding whole periods")
        method = replace(self, signals=_settled(self, problem.recordings))
        made = [_periods(problem, recording, method) for recording in problem.recordings]
        say(f"{self.label}: iterating")
        theta = problem.initial_values()
        weights = [np.ones((problem.robot.size, own.lines + 1)) for own in made]
        variance, history, converged = np.ones(problem.robot.size), [], False
        number = 0
        while not converged and number < method.max_iterations:
            number += 1
            load = theta if number > 1 else None
            records = [_record(problem, p, w, load) for p, w in zip(made, weights, strict=True)]
            sums = accumulate(problem.regressor, records, ())
            variance = np.array([s.own_variance() for s in sums]) if number == 1 else variance
            solution = solve(sums, variance, problem.restrictions)
            last, theta = theta, solution.theta
            step = np.abs(theta - last)
            settled = step <= method.tolerance * np.sqrt(np.diag(solution.covariance))
            converged = number > 2 and bool(settled.all())
            residual = relative_residual(sums, theta, variance)
            history.append(Iteration(theta, relative_change(theta, last), residual))
            say(IterationLine(f"estimate {number}: relative error {residual:.3g}"))
            if not converged and number < method.max_iterations:
                weights, variance = _weights(problem, made, theta)
        excess = _excess(problem, sums, records, theta, variance)
        variance = variance * np.maximum(1.0, excess)
        solution = solve(sums, variance, problem.restrictions)
        estimate = Estimate(
            number,
            theta,
            None,
            records,
            Prefilters(()),
            sums,
            replace(solution, theta=theta),
            variance,
        )
        run = Run(tuple(history), converged)
        warnings = tuple(_unexplained(problem, excess))
        return answer(problem, method, estimate, run, warnings, _used(made))


def _settled(method: FrequencyDomain, recordings: Sequence[Recording]) -> Bandpass:
    """The highest lines in numbers: of positions where they sink into noise, of equations the band.

    A band-pass may not go beyond its band by more than its skirts; lines have none, and positions
    that are kept further know reversals better.
    """
    signals = method.signals
    assert isinstance(signals, Bandpass)
    if signals.decimation is None and signals.bandwidth is None:
        signals = replace(signals, bandwidth=signals.band(min(r.rate for r in recordings)))
    if signals.cutoff is not None:
        return signals
    found = [
        np.minimum(ABOVE_HALF_POWER * half_power_frequencies(r.q, r.rate), SHARE_OF_RATE * r.rate)
        for r in recordings
    ]
    return replace(signals, cutoff=tuple(float(f"{c:.3g}") for c in np.max(found, axis=0)))


def _periods(problem: Problem, recording: Recording, method: FrequencyDomain) -> Periods:
    """Motion and torque of all periods of one recording, each on its own lines."""
    places = whole_periods(recording, method.period, method.transient)
    signals, rate, n = method.signals, recording.rate, recording.joints
    assert isinstance(signals, Bandpass)
    lines = min(int(signals.band(rate) * places.length / rate + 1e-9), (places.length - 1) // 2)
    # All periods in one: where one ends there is no edge for noise to leak from.
    whole = slice(places.start, places.start + places.count * places.length)
    moved = derivatives_on_lines(recording.q.T[:, whole], rate, signals.cutoffs(n))
    torque = torque_on_lines(recording.tau.T[:, whole], recording)
    q, dq, ddq, tau = (places.filled(x, recording.samples) for x in (*moved, torque))
    slow = ~problem.speed_limits(recording).moving(places.split(dq).mean(axis=1))
    window = window_around(slow, 0.5 * rate / signals.cutoffs(n))
    unknown = np.full(n, np.nan)
    kinematics = Kinematics(recording, q, dq, ddq, tau, whole.start, whole.stop, unknown, unknown)
    return Periods(recording, places, kinematics, lines, window)


def _record(
    problem: Problem, own: Periods, weights: np.ndarray, theta: np.ndarray | None
) -> PeriodicRecord:
    """Φ, Z and τ of both halves; ``theta``: what makes the load of friction, None: no load."""
    k, places, regressor = own.kinematics, own.places, problem.regressor
    phi, tau, dq = [], [], []
    for part in own.halves:
        q, v, a, t = (places.split(x)[:, part].mean(axis=1) for x in (k.q, k.dq, k.ddq, k.tau))
        # Friction with memory has forgotten where it began when the second period begins.
        twice = replace(k, q=np.tile(q, 2), dq=np.tile(v, 2), ddq=np.tile(a, 2), tau=np.tile(t, 2))
        motion = with_inner(regressor, twice, theta)
        columns = packed_stretch(regressor, motion, slice(places.length, 2 * places.length))
        phi.append(low_lines(columns * own.window[regressor.row], own.lines))
        tau.append(low_lines(t * own.window, own.lines))
        dq.append(low_lines(v, own.lines))
    rows = phi[0].shape[1]
    at = places.start + np.arange(rows) * (places.length / rows)
    t = own.recording.start_time + np.repeat(at, HALVES) / own.recording.rate
    used = np.repeat(low_lines(own.window, own.lines) > 0.5, HALVES, axis=1)
    return PeriodicRecord(
        k, t, _beside(phi), _beside(phi[::-1]), _beside(tau), _beside(dq), used, weights=weights
    )


def _beside(halves: Sequence[np.ndarray]) -> np.ndarray:
    """Rows of both halves, instant by instant."""
    return np.stack(halves, axis=2).reshape(len(halves[0]), -1)


def _weights(
    problem: Problem, made: Sequence[Periods], theta: np.ndarray
) -> tuple[list[np.ndarray], np.ndarray]:
    """Weights of the lines of each recording, and the variance of a weighted row of each joint."""
    variances = []
    for own in made:
        moved = with_inner(problem.regressor, own.kinematics, theta)
        error = residual_of(problem.regressor, moved, theta)
        error = low_lines_of_all(own.places.split(error) * own.window[:, None], own.lines)
        spectrum = np.fft.rfft(error, axis=2) / np.sqrt(error.shape[2])
        torque = np.mean(own.places.split(own.kinematics.tau) ** 2, axis=(1, 2))
        smooth = _over_neighbours(np.var(spectrum, axis=1, ddof=1)) * own.spread
        variances.append(np.maximum(smooth, FLOOR * torque[:, None] + 1e-300))
    common = np.mean([v.mean(axis=1) for v in variances], axis=0)
    return [np.sqrt(common[:, None] / v) for v in variances], common


def _over_neighbours(power: np.ndarray) -> np.ndarray:
    """Means over the lines around each one, fewer at the ends, shape as of ``power``."""
    kernel = np.ones(2 * NEIGHBOURS + 1)
    count = np.convolve(np.ones(power.shape[1]), kernel, mode="same")
    if len(kernel) > power.shape[1]:
        return np.broadcast_to(power.mean(axis=1, keepdims=True), power.shape)
    return np.stack([np.convolve(own, kernel, mode="same") / count for own in power])


def _excess(
    problem: Problem,
    sums: Sequence[JointSums],
    records: Sequence[PeriodicRecord],
    theta: np.ndarray,
    variance: np.ndarray,
) -> np.ndarray:
    """Mean square of the halves' mean residual over that of its noise, shape (joints,)."""
    squares, rows = np.zeros((2, len(sums)))
    for record in records:
        error = record.whitened(record.residual(problem.regressor, theta), (), variance)
        both = error.reshape(len(error), -1, HALVES).sum(axis=2) / np.sqrt(HALVES)
        used = record.used[:, ::HALVES]
        squares += np.sum(both**2 * used, axis=1)
        rows += used.sum(axis=1)
    return squares / np.maximum(rows - [s.columns.size for s in sums], 1.0)


def _unexplained(problem: Problem, excess: np.ndarray) -> Iterator[Finding]:
    """Joints whose residual repeats with the motion."""
    for joint, own in zip(problem.robot.joint_names, excess, strict=True):
        if own > UNEXPLAINED:
            text = (
                f"What the model of {joint} does not explain repeats from period to period, and "
                f"is {np.sqrt(own):.2g} times as large as the noise between periods; the standard "
                "errors are widened as if it were noise."
            )
            step = "Look at its residual over a period: friction at reversals, or a flexible joint."
            evidence = {"ratio": Quantity(float(np.sqrt(own)), "", bound=float(UNEXPLAINED**0.5))}
            yield Finding("note", "frequency", "repeats", text, joint, step, evidence)


def _used(made: Sequence[Periods]) -> InstrumentsUsed:
    """The instruments: each half of the periods is that of the other."""
    found = tuple(
        f"{own.recording.name!r}: {own.places.count} periods of "
        f"{own.places.length / own.recording.rate:.4g} s, lines to "
        f"{own.lines * own.recording.rate / own.places.length:.4g} Hz"
        for own in made
    )
    kinematics = [own.kinematics for own in made]
    moved = [
        SimulatedMotion(np.roll(k.q, -own.places.length, axis=1), k.recording.rate)
        for k, own in zip(kinematics, made, strict=True)
    ]
    return InstrumentsUsed("repetition", found, tuple(agreement(kinematics, moved).tolist()))
