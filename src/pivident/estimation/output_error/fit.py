"""The fit of a simulation to what was measured: Gauss–Newton steps with weights from the noise.

    p ← p + δ,   δ = H⁻¹ g   (`reduced_equations`),   weights from the errors that a step leaves

Each pass (a) simulates with tangents, (b) solves for the step, (c) makes noise models of the errors
that the step leaves, and solves again with them. A step that makes the weighted errors larger, or a
loop that cannot be simulated, is taken back and shortened by Levenberg–Marquardt's damping. In a
closed loop, whose motion hardly changes, derivatives are kept behind a small step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pivident.estimation.output_error.fit_answer import fit_answer
from pivident.estimation.output_error.loop_unknowns import (
    Unknown,
    start_directions,
    values_of,
    with_values,
)
from pivident.estimation.output_error.noise_weights import (
    NoiseWeights,
)
from pivident.estimation.output_error.record_stretches import OpenLoop, Stretch
from pivident.estimation.output_error.shaking import loop_noise, shaking
from pivident.estimation.output_error.simulated_errors import SimulatedErrors, simulated_errors
from pivident.estimation.output_error.simulation_fit import FitOptions, FitPass, SimulationFit
from pivident.estimation.output_error.thinning import POSITIONS, TORQUES
from pivident.estimation.output_error.weighted_step import (
    Point,
    WeightedStep,
    WeightedSteps,
    inverse_of_free,
)
from pivident.foundation.common_work import is_shared, once
from pivident.foundation.errors import (
    IdentificationError,
    MassMatrixNotPositiveDefinite,
    SimulationDiverged,
)
from pivident.foundation.progress import IterationLine

#: Passes that make noise models; later ones keep them, so that the estimate can settle.
MODEL_PASSES = 2

#: Damping after a first refused step, where errors have kinks, and the factor of each further one.
DAMPING, DAMPING_AT_KINKS, HARDER = 1e-4, 1e-2, 10.0

#: Factor by which the damping falls after a step that was taken, and where it ends.
EASIER, UNDAMPED = 10.0, 1e-9

#: Steps in a row that may be refused.
MAX_REFUSED = 8

#: Relative increase of the weighted errors that counts as none.
SAME = 1e-9

#: Share of the squared errors that a last step of correlated errors may still gain.
LITTLE = 1e-3

#: What squared errors of unit variance may still have to gain where no step is taken any more.
WITHIN_NOISE = 1.0

#: Relative change of the unknowns behind which derivatives are kept, over the tolerance. In a
#: closed loop they change less than the unknowns, and that share of a standard error is what it may
#: cost. In an open one errors grow with time, and the derivatives change by more.
STEADY = 0.5

#: A value smaller than so many standard errors is near zero: its change is compared with them.
NEAR_ZERO = 5.0


def fit_simulation(
    stretches: Sequence[Stretch],
    unknowns: Sequence[Unknown],
    options: FitOptions | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> SimulationFit:
    """Fit unknowns of simulated loops to measured positions, torques or both.

    Args:
        stretches: records beside their loops, whose values are where the search starts.
        unknowns: what is sought; all stretches share it.
        options: how; None: the defaults.
        say: called with one line after each pass.

    Returns:
        Estimates with covariance, errors and history.

    Raises:
        SimulationDiverged: the start, or the shortest of refused steps, cannot be simulated; names
            the joint and the time.
        MassMatrixNotPositiveDefinite: likewise.
        RankDeficientRegressor: nothing determines some unknowns, and they are not to be held.
        IdentificationError: torques are to be compared where none were measured.
    """
    return _Search(tuple(stretches), tuple(unknowns), options or FitOptions()).run(say)


class _Search:
    """The iteration."""

    def __init__(
        self, stretches: tuple[Stretch, ...], unknowns: tuple[Unknown, ...], options: FitOptions
    ) -> None:
        if TORQUES in options.channels and any(s.tau is None for s in stretches):
            lacking = next(s.name for s in stretches if s.tau is None)
            raise IdentificationError(
                f"recording {lacking!r} has no measured torque to compare with",
                advice="compare positions",
            )
        self.stretches, self.unknowns, self.options = stretches, unknowns, options
        self.closed = not any(isinstance(s.loop.controller, OpenLoop) for s in stretches)
        #: Errors of a run over several moves have kinks wherever a joint stops: their least value
        #: is where no step gains, not where derivatives vanish.
        self.has_kinks = any(s.is_long_run for s in stretches)
        self.shaking: list[np.ndarray] = []
        self.steps = WeightedSteps(stretches, unknowns, options)
        # compared up to the bandwidth: the window of ``Thinning`` halves the amplitude there
        self.factors = [
            max(1, int(s.rate / 2.0 / options.bandwidth + 1e-9)) if options.bandwidth else 1
            for s in stretches
        ]

    def run(self, say: Callable[[str], None]) -> SimulationFit:
        """Passes until the unknowns settle."""
        start = values_of(self.stretches[0].loop, self.unknowns)
        start = np.clip(start, self.steps.low, self.steps.high)
        zeros = tuple(
            np.zeros(0 if s.start_std is None else s.start_std.size) for s in self.stretches
        )
        point = self._begin(start, zeros)
        history: list[FitPass] = []
        noise: NoiseWeights | None = None
        damping, converged, shaken, whole_steps_failed = 0.0, False, False, False
        for number in range(self.options.max_iterations):
            solved = self.steps.solved(point, noise, number < MODEL_PASSES)
            noise = solved.noise
            change = self._change(point, solved, solved.step)
            settled = self._has_settled(solved)
            if settled and not shaken and number >= MODEL_PASSES - 1:
                shaken, again = True, self._shaken(point)
                if again is not None:
                    say(IterationLine("mean motion that noise in the loop adds"))
                    point = again
                    continue
            if settled and number >= MODEL_PASSES - 1:
                history.append(self._pass(point, solved, change, 0))
                say(_line(history))
                converged = True
                break
            step, refused, damping, reached = self._advance(point, solved, damping)
            history.append(self._pass(point, replace(solved, step=step), change, refused))
            say(_line(history))
            if reached is None:  # no step gains any more; derivatives may still promise much
                converged = solved.gain <= max(WITHIN_NOISE, LITTLE * solved.cost)
                if not self.has_kinks or whole_steps_failed:
                    converged |= self.has_kinks
                    break
                whole_steps_failed, damping = True, 0.0
                continue
            whole_steps_failed, point = False, reached
        stretches = [self._moved(k, point.values, own) for k, own in enumerate(point.starts)]
        return fit_answer(self.steps, stretches, self.factors, point, solved, history, converged)

    def _begin(self, start: np.ndarray, zeros: tuple[np.ndarray, ...]) -> Point:
        """The first simulation. Methods that compare other signals of the record share it."""
        complete = self.closed and all(s.tau is not None for s in self.stretches)
        if not (is_shared() and complete):
            return self._at(start, zeros)

        def make() -> list[SimulatedErrors]:
            stretches = [self._moved(k, start, own) for k, own in enumerate(zeros)]
            return simulated_errors(stretches, self.unknowns, (POSITIONS, TORQUES), self.factors)

        key = ("tangents", self.stretches, self.unknowns, tuple(self.factors), start.tobytes())
        made = tuple(own.of_channels(self.options.channels) for own in once(key, make))
        return Point(start, zeros, made)

    def _at(self, values: np.ndarray, starts: tuple[np.ndarray, ...]) -> Point:
        """(a) Simulate with tangents."""
        stretches = [self._moved(k, values, own) for k, own in enumerate(starts)]
        made = simulated_errors(stretches, self.unknowns, self.options.channels, self.factors)
        return Point(values, starts, self._without_shaking(made))

    def _beside(self, point: Point, values: np.ndarray, starts: tuple[np.ndarray, ...]) -> Point:
        """Simulate without tangents, near a point whose derivatives are kept."""
        stretches = [
            replace(self._moved(k, values, own), start_std=None) for k, own in enumerate(starts)
        ]
        made = simulated_errors(stretches, (), self.options.channels, self.factors)
        errors = [
            replace(own, columns=last.columns) for own, last in zip(made, point.made, strict=True)
        ]
        return Point(values, starts, self._without_shaking(errors))

    def _shaken(self, point: Point) -> Point | None:
        """The same point, with the mean of what noise in the loop does taken from the errors.

        None: there is no such noise.
        """
        stretches = [self._moved(k, point.values, own) for k, own in enumerate(point.starts)]
        noise = [loop_noise(own) for own in stretches]
        if not any(own.any() for own in noise):
            return None
        self.shaking = shaking(stretches, noise, self.options.channels, self.factors)
        return replace(point, made=self._without_shaking(point.made))

    def _without_shaking(self, made: Sequence[SimulatedErrors]) -> tuple[SimulatedErrors, ...]:
        """Errors less the mean motion that noise in the loop adds."""
        if not self.shaking:
            return tuple(made)
        return tuple(
            replace(own, errors=own.errors - mean)
            for own, mean in zip(made, self.shaking, strict=True)
        )

    def _moved(self, k: int, values: np.ndarray, start: np.ndarray) -> Stretch:
        """Stretch k with other values and another initial state."""
        stretch = self.stretches[k]
        loop = with_values(stretch.loop, self.unknowns, values)
        for direction, step in zip(start_directions(loop.robot.size), start.tolist(), strict=False):
            if step != 0.0:
                loop = loop.moved(direction, step)
        return stretch.with_loop(loop)

    def _change(self, point: Point, solved: WeightedStep, step: np.ndarray) -> float:
        """Largest |δ| / max(|p|, 5σ) of a step."""
        covariance = inverse_of_free(solved.equations.gram, ~solved.held & ~solved.bound)
        size = np.maximum(np.abs(point.values), NEAR_ZERO * np.sqrt(np.diag(covariance)))
        return float(np.max(np.abs(step) / np.maximum(size, 1e-300), initial=0.0))

    def _has_settled(self, solved: WeightedStep) -> bool:
        """Whether the step is next to nothing.

        Its gain δᵀ H δ is at least (δ_i/σ_i)² with the standard errors of white errors. Where
        errors are correlated those of the windows count, if nearly nothing is to be gained.
        """
        small = solved.gain <= self.options.tolerance**2 + SAME * solved.cost
        return small or self._is_little(solved, solved.step, solved.gain)

    def _is_little(self, solved: WeightedStep, step: np.ndarray, gained: float) -> bool:
        """Whether a step and its gain are small beside standard errors of the windows."""
        if gained > LITTLE * solved.cost:
            return False
        kept = np.flatnonzero(~solved.held & ~solved.bound)
        std = np.sqrt(np.diag(solved.equations.scores_without(step, kept).covariance))
        return bool((np.abs(step[kept]) <= self.options.tolerance * std).all())

    def _advance(
        self, point: Point, solved: WeightedStep, damping: float
    ) -> tuple[np.ndarray, int, float, Point | None]:
        """Take the step, shorter as long as it makes things worse.

        Result: the step, how many were refused, the damping, the new point; None where the errors
        cannot become smaller any more.
        """
        failure: IdentificationError | None = None
        for refused in range(MAX_REFUSED + 1):
            equations = solved.equations.damped(damping) if damping else solved.equations
            step = self.steps.bounded(point, equations, solved.held).step
            starts = tuple(
                own + each.start_step(step)
                for own, each in zip(point.starts, equations.stretches, strict=True)
            )
            change, values = self._change(point, solved, step), point.values + step
            steady = self.closed and change <= STEADY * self.options.tolerance
            try:
                reached = (
                    self._beside(point, values, starts) if steady else self._at(values, starts)
                )
            except (SimulationDiverged, MassMatrixNotPositiveDefinite) as error:
                failure = error
            else:
                gained = solved.cost - self.steps.cost(reached, solved.noise)
                if gained >= -SAME * solved.cost:
                    small = gained <= self.options.tolerance**2
                    still = damping > 0.0 and (small or self._is_little(solved, step, gained))
                    still |= self.has_kinks and gained <= LITTLE * solved.cost
                    damping = _after(damping, gained, equations.gain(step))
                    return step, refused, damping, None if still else reached
                failure = None
            damping = HARDER * damping or (DAMPING_AT_KINKS if self.has_kinks else DAMPING)
        if failure is not None:
            raise failure
        if solved.gain <= WITHIN_NOISE or self.has_kinks:
            return np.zeros_like(solved.step), MAX_REFUSED, damping, None
        raise IdentificationError(
            "no step makes the simulation error smaller, though its derivatives promise one: the "
            "simulated motion jumps as parameters change (friction at standstill, limits that "
            "are reached)",
            advice="start from other values, or use piv",
        )

    def _pass(self, point: Point, solved: WeightedStep, change: float, refused: int) -> FitPass:
        """An entry of the history."""
        rows = sum(int(own.used.sum()) for own in point.made)
        values = point.values + solved.step
        return FitPass(values, change, solved.cost / rows, refused, solved.noise.orders)


def _after(damping: float, gained: float, promised: float) -> float:
    """The damping after a step that was taken: less where it kept what its derivatives promised."""
    if damping > 0.0 and gained < 0.25 * promised:
        return damping * HARDER**0.5
    return damping / EASIER if damping > UNDAMPED else 0.0


def _line(history: Sequence[FitPass]) -> IterationLine:
    """One line for the last pass."""
    last = history[-1]
    refused = f", {last.refused} steps taken back" if last.refused else ""
    return IterationLine(
        f"pass {len(history)}: parameters change by {100 * last.change:.3g} %, weighted error "
        f"{np.sqrt(last.cost):.6g}{refused}"
    )
