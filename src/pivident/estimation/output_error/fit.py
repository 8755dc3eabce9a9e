"""The fit of a simulation to what was measured: Gauss–Newton steps with weights from the noise.

    p ← p + δ,   δ = H⁻¹ g   (`reduced_equations`),   weights from the errors that a step leaves

Each pass (a) simulates with tangents, (b) solves for the step, (c) makes noise models of the errors
that the step leaves, and solves again with them. A step that makes the weighted errors larger, or a
loop that cannot be simulated, is taken back and shortened by Levenberg–Marquardt's damping.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pivident.errors import (
    IdentificationError,
    MassMatrixNotPositiveDefinite,
    RankDeficientRegressor,
    SimulationDiverged,
)
from pivident.estimation.covariance.sandwich import Jackknife
from pivident.estimation.covariance.stationary_noise import covariance_by_test
from pivident.estimation.noise_options import AutoRegressive
from pivident.estimation.output_error.bounded_step import (
    BoundedStep,
    bounded_step,
    condition_of,
    to_hold,
    undetermined,
)
from pivident.estimation.output_error.noise_weights import (
    HUBER_MEAN,
    NoiseWeights,
    fitted_noise,
    loss,
    whitened_errors,
    whitened_sums,
)
from pivident.estimation.output_error.reduced_equations import (
    ReducedEquations,
    error_variances,
    stretch_equations,
)
from pivident.estimation.output_error.shaking import loop_noise, shaking
from pivident.estimation.output_error.simulated_errors import (
    POSITIONS,
    TORQUES,
    SimulatedErrors,
    simulated_errors,
)
from pivident.estimation.output_error.stretch import Stretch
from pivident.estimation.output_error.unknowns import (
    Unknown,
    start_directions,
    values_of,
    with_values,
)

#: Rounds of weights and step in a pass that makes noise models.
ROUNDS = 2

#: Passes that make noise models; later ones keep them, so that the estimate can settle.
MODEL_PASSES = 2

#: Damping after a first refused step, and the factor of each further one.
DAMPING, HARDER = 1e-4, 10.0

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

#: Relative error of a simulated signal that is rounding.
ROUNDING = 1e-12

#: A value smaller than so many standard errors is near zero: its change is compared with them.
NEAR_ZERO = 5.0


@dataclass(frozen=True)
class FitOptions:
    """How a simulation is fitted.

    Attributes:
        channels: what is compared, some of `POSITIONS` and `TORQUES`.
        noise: recipe of the noise models; None: errors count as white.
        motion_band: highest frequency of the motion [Hz], see `AutoRegressive`.
        bandwidth: frequency up to which errors are compared [Hz].
        robust: Huber's loss in place of squares.
        undetermined: ``refuse`` unknowns that nothing determines, or ``hold`` them.
        tolerance: step in standard errors at which the iteration may end: no combination of
            unknowns moves by more.
        max_iterations: give up after so many passes.
    """

    channels: tuple[int, ...] = (POSITIONS, TORQUES)
    noise: AutoRegressive | None = field(default_factory=AutoRegressive)
    motion_band: float = 20.0
    bandwidth: float = 100.0
    robust: bool = False
    undetermined: str = "refuse"
    tolerance: float = 0.2
    max_iterations: int = 30


@dataclass(frozen=True, eq=False)
class FitPass:
    """One pass of the iteration, for its history."""

    values: np.ndarray  # unknowns after it, shape (unknowns,)
    change: float  # largest |δ| / max(|p|, 5σ)
    cost: float  # weighted errors per row, before the step
    refused: int  # steps that were taken back before it
    orders: tuple[int, ...]  # of the noise models


@dataclass(frozen=True, eq=False)
class SimulationFit:
    """What came out.

    Attributes:
        unknowns: what was sought.
        values: estimates, shape (unknowns,).
        covariance: H⁻¹ where the windows of time agree with it, else theirs, shape
            (unknowns, unknowns); zero where held.
        window_covariance: from windows of time, likewise.
        formula_covariance: H⁻¹, for errors that are white behind their weights, likewise.
        held: unknowns that nothing determines and that were held, shape (unknowns,).
        bound: unknowns at a bound, likewise: their interval has one side.
        converged: whether the iteration settled.
        history: its passes.
        condition: condition number of the scaled derivatives.
        weakest: names in the least determined direction.
        noise: noise models and variances.
        errors: of each stretch after the last step, thinned, shape (channels, joints, rows).
        white: the same of unit variance, NaN where not used.
        rates: rows per second of each stretch [Hz].
        rms: root mean square of the errors of positions and torques, not thinned, before the last
            step, shape (2, joints) [rad or m; N m or N].
        stretches: with the loops of the estimate.
        windows: windows of time behind ``covariance``.
        channels: what was compared, see `FitOptions`.
        factors: measured samples for each thinned row, one for each stretch.
        made: errors and derivatives before the last step.
    """

    unknowns: tuple[Unknown, ...]
    values: np.ndarray
    covariance: np.ndarray
    window_covariance: np.ndarray
    formula_covariance: np.ndarray
    held: np.ndarray
    bound: np.ndarray
    converged: bool
    history: tuple[FitPass, ...]
    condition: float
    weakest: tuple[str, ...]
    noise: NoiseWeights
    errors: tuple[np.ndarray, ...]
    white: tuple[np.ndarray, ...]
    rates: tuple[float, ...]
    rms: np.ndarray
    stretches: tuple[Stretch, ...]
    windows: Jackknife
    channels: tuple[int, ...]
    factors: tuple[int, ...]
    made: tuple[SimulatedErrors, ...]

    @property
    def std(self) -> np.ndarray:
        """Standard errors, shape (unknowns,); zero where held."""
        return np.sqrt(np.diag(self.covariance))

    def value(self, name: str) -> float:
        """The estimate of one unknown."""
        return float(self.values[[u.name for u in self.unknowns].index(name)])


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


@dataclass(frozen=True, eq=False)
class _Point:
    """Where the search stands: values, initial states, errors, derivatives."""

    values: np.ndarray  # of the unknowns
    starts: tuple[np.ndarray, ...]  # how far each stretch's initial state is from what was given
    made: tuple[SimulatedErrors, ...]


@dataclass(frozen=True, eq=False)
class _Solved:
    """A step from a point, with the weights that it was solved with."""

    noise: NoiseWeights
    equations: ReducedEquations
    step: np.ndarray
    bound: np.ndarray
    held: np.ndarray
    cost: float  # weighted squares of the errors at the point

    @property
    def gain(self) -> float:
        """By how much the step, with those of the initial states, makes the squares smaller."""
        return self.equations.gain(self.step)


class _Search:
    """The iteration."""

    def __init__(
        self, stretches: tuple[Stretch, ...], unknowns: tuple[Unknown, ...], options: FitOptions
    ) -> None:
        if TORQUES in options.channels and any(s.tau is None for s in stretches):
            lacking = next(s.name for s in stretches if s.tau is None)
            raise IdentificationError(
                f"recording {lacking!r} has no measured torque to compare with; compare positions"
            )
        self.stretches, self.unknowns, self.options = stretches, unknowns, options
        self.shaking: list[np.ndarray] = []
        self.held = np.zeros(len(unknowns), bool)
        #: What was declared, the loop, is held rather than a parameter of the model.
        self.declared = np.array([u.direction.kind != "parameter" for u in unknowns])
        self.low = np.array([u.low for u in unknowns])
        self.high = np.array([u.high for u in unknowns])
        # compared up to the bandwidth: the window of ``Thinning`` halves the amplitude there
        self.factors = [
            max(1, int(s.rate / 2.0 / options.bandwidth + 1e-9)) if options.bandwidth else 1
            for s in stretches
        ]

    def run(self, say: Callable[[str], None]) -> SimulationFit:
        """Passes until the unknowns settle."""
        start = np.clip(values_of(self.stretches[0].loop, self.unknowns), self.low, self.high)
        zeros = tuple(
            np.zeros(0 if s.start_std is None else s.start_std.size) for s in self.stretches
        )
        point = self._at(start, zeros)
        history: list[FitPass] = []
        noise: NoiseWeights | None = None
        damping, converged, shaken = 0.0, False, False
        for number in range(self.options.max_iterations):
            solved = self._solved(point, noise, number < MODEL_PASSES)
            noise = solved.noise
            change, settled = self._change(point, solved), self._has_settled(solved)
            if settled and not shaken and number >= MODEL_PASSES - 1:
                shaken, again = True, self._shaken(point)
                if again is not None:
                    say("mean motion that noise in the loop adds")
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
            if reached is None:  # what is left to gain is rounding
                converged = True
                break
            point = reached
        return self._answer(point, solved, history, converged)

    def _at(self, values: np.ndarray, starts: tuple[np.ndarray, ...]) -> _Point:
        """(a) Simulate with tangents."""
        stretches = [self._moved(k, values, own) for k, own in enumerate(starts)]
        made = simulated_errors(stretches, self.unknowns, self.options.channels, self.factors)
        return _Point(values, starts, self._without_shaking(made))

    def _shaken(self, point: _Point) -> _Point | None:
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

    def _solved(self, point: _Point, before: NoiseWeights | None, models: bool) -> _Solved:
        """(b) and (c): the step, with weights from what it leaves.

        ``before``: noise models of the last pass; ``models``: whether to make new ones.
        """
        channels, joints = point.made[0].errors.shape[:2]
        noise = before or replace(
            NoiseWeights.white(channels, joints), variance=self._first_variances(point)
        )
        solved = self._step(point, noise)
        if not models or self.options.noise is None:
            return solved
        for _ in range(ROUNDS):
            left = self._left(point, solved)
            noise = fitted_noise(
                left,
                [own.used for own in point.made],
                point.made[0].rate,
                self.options.noise,
                self.options.motion_band,
            )
            solved = self._step(point, noise)
        return solved

    def _first_variances(self, point: _Point) -> np.ndarray:
        """λ before anything is known: mean squares of the errors, shape (channels, joints)."""
        squares = sum((own.errors**2 * own.used).sum(axis=2) for own in point.made)
        rows = sum(own.used.sum(axis=2) for own in point.made)
        return np.maximum(squares / np.maximum(rows, 1), 1e-300)

    def _step(self, point: _Point, noise: NoiseWeights) -> _Solved:
        """Solve, with λ from the errors that the step leaves, twice."""
        sums = whitened_sums(point.made, noise, self.options.robust)
        variance = noise.variance
        consistent = HUBER_MEAN if self.options.robust else 1.0
        for _ in range(3):
            equations = self._equations(point, sums, variance)
            held = self._held(equations)
            found = self._bounded(point, equations, held)
            whole = [np.concatenate([found.step, own.start_step(found.step)])
                     for own in equations.stretches]  # fmt: skip
            variance = error_variances(sums, whole, float(np.count_nonzero(~held)))
            variance = np.maximum(variance / consistent, self._rounding(point, noise))
        equations = self._equations(point, sums, variance)
        settled = replace(noise, variance=variance)
        cost = self._cost(point, settled)
        return _Solved(settled, equations, found.step, found.bound, held, cost)

    def _equations(self, point: _Point, sums: Sequence, variance: np.ndarray) -> ReducedEquations:
        """Normal equations of all stretches."""
        return ReducedEquations.of(
            [
                stretch_equations(own, variance, len(self.unknowns), stretch.start_std, moved)
                for own, stretch, moved in zip(sums, self.stretches, point.starts, strict=True)
            ]
        )

    def _held(self, equations: ReducedEquations) -> np.ndarray:
        """Unknowns to hold, or the refusal of them; what was held once stays so."""
        free = np.flatnonzero(~self.held)
        groups = undetermined(equations.gram[np.ix_(free, free)])
        if not groups:
            return self.held
        if self.options.undetermined == "refuse":
            names = [tuple(self.unknowns[int(free[i])].name for i in group) for group in groups]
            raise RankDeficientRegressor(
                len(self.unknowns) - len(groups), len(self.unknowns), names
            )
        self.held = to_hold(equations.gram, self.held, self.declared)
        return self.held

    def _change(self, point: _Point, solved: _Solved) -> float:
        """Largest |δ| / max(|p|, 5σ) of the step."""
        size = np.maximum(np.abs(point.values), NEAR_ZERO * self._formula_std(solved))
        return float(np.max(np.abs(solved.step) / np.maximum(size, 1e-300), initial=0.0))

    def _has_settled(self, solved: _Solved) -> bool:
        """Whether the step is next to nothing.

        Its gain δᵀ H δ is at least (δ_i/σ_i)² with the standard errors of white errors. Where
        errors are correlated those of the windows count, if nearly nothing is to be gained.
        """
        small = solved.gain <= self.options.tolerance**2 + SAME * solved.cost
        return small or self._is_little(solved, solved.step, solved.gain)

    def _is_little(self, solved: _Solved, step: np.ndarray, gained: float) -> bool:
        """Whether a step and its gain are small beside standard errors of the windows."""
        if gained > LITTLE * solved.cost:
            return False
        kept = np.flatnonzero(~solved.held & ~solved.bound)
        std = np.sqrt(np.diag(solved.equations.scores_without(step, kept).covariance))
        return bool((np.abs(step[kept]) <= self.options.tolerance * std).all())

    def _formula_std(self, solved: _Solved) -> np.ndarray:
        """√diag H⁻¹ of the free unknowns, zero for the others."""
        return np.sqrt(np.diag(_inverse(solved.equations.gram, ~solved.held & ~solved.bound)))

    def _advance(
        self, point: _Point, solved: _Solved, damping: float
    ) -> tuple[np.ndarray, int, float, _Point | None]:
        """Take the step, shorter as long as it makes things worse.

        Result: the step, how many were refused, the damping, the new point; None where the errors
        cannot become smaller any more.
        """
        failure: IdentificationError | None = None
        for refused in range(MAX_REFUSED + 1):
            equations = solved.equations.damped(damping) if damping else solved.equations
            step = self._bounded(point, equations, solved.held).step
            starts = tuple(
                own + each.start_step(step)
                for own, each in zip(point.starts, equations.stretches, strict=True)
            )
            try:
                reached = self._at(point.values + step, starts)
            except (SimulationDiverged, MassMatrixNotPositiveDefinite) as error:
                failure = error
            else:
                gained = solved.cost - self._cost(reached, solved.noise)
                if gained >= -SAME * solved.cost:
                    small = gained <= self.options.tolerance**2
                    still = damping > 0.0 and (small or self._is_little(solved, step, gained))
                    damping = _after(damping, gained, equations.gain(step))
                    return step, refused, damping, None if still else reached
                failure = None
            damping = HARDER * damping or DAMPING
        if failure is not None:
            raise failure
        if solved.gain <= WITHIN_NOISE:
            return np.zeros_like(solved.step), MAX_REFUSED, damping, None
        raise IdentificationError(
            "no step makes the simulation error smaller, though its derivatives promise one: the "
            "simulated motion jumps as parameters change (friction at standstill, limits that are "
            "reached); start from other values, or use piv"
        )

    def _rounding(self, point: _Point, noise: NoiseWeights) -> np.ndarray:
        """Variance of rounding errors behind the filters, shape (channels, joints)."""
        size = np.max([own.size for own in point.made], axis=0)
        gain = np.array([[np.sum(np.square(f.fir)) for f in own] for own in noise.filters])
        return gain * (ROUNDING * size) ** 2 + 1e-300

    def _bounded(self, point: _Point, equations: ReducedEquations, held: np.ndarray) -> BoundedStep:
        """The step that solves equations within the bounds."""
        low, high = self.low - point.values, self.high - point.values
        return bounded_step(equations.gram, equations.moment, low, high, held)

    def _cost(self, point: _Point, noise: NoiseWeights) -> float:
        """Weighted squares of the errors, with that of the initial states' prior."""
        total = self._prior(point.starts)
        for own in point.made:
            total += loss(whitened_errors(own, noise), noise.variance, self.options.robust)
        return total

    def _prior(self, starts: Sequence[np.ndarray]) -> float:
        """Squares of the initial states' distance from what was given."""
        return sum(
            float(np.sum((own / s.start_std) ** 2))
            for own, s in zip(starts, self.stretches, strict=True)
            if s.start_std is not None
        )

    def _left(self, point: _Point, solved: _Solved) -> list[np.ndarray]:
        """Errors that a step leaves, by the derivatives: e - J δ."""
        left = []
        for made, own in zip(point.made, solved.equations.stretches, strict=True):
            whole = np.concatenate([solved.step, own.start_step(solved.step)])
            left.append(made.errors - np.einsum("cjdr,d->cjr", made.columns, whole))
        return left

    def _pass(self, point: _Point, solved: _Solved, change: float, refused: int) -> FitPass:
        """An entry of the history."""
        rows = sum(int(own.used.sum()) for own in point.made)
        values = point.values + solved.step
        return FitPass(values, change, solved.cost / rows, refused, solved.noise.orders)

    def _answer(
        self, point: _Point, solved: _Solved, history: Sequence[FitPass], converged: bool
    ) -> SimulationFit:
        """Everything that comes with the estimate."""
        step = solved.step if converged else np.zeros_like(solved.step)
        values = np.clip(point.values + step, self.low, self.high)
        free = ~solved.held & ~solved.bound
        formula = _inverse(solved.equations.gram, free)
        kept = np.flatnonzero(free)
        windows = solved.equations.scores_without(step, kept)
        covariance, own = np.zeros_like(formula), np.zeros_like(formula)
        grid = np.ix_(kept, kept)
        own[grid] = windows.covariance
        covariance[grid] = covariance_by_test(formula[grid], windows)
        everywhere = _inverse(solved.equations.gram, ~solved.held)
        for i in np.flatnonzero(solved.bound):
            formula[i, i] = covariance[i, i] = own[i, i] = everywhere[i, i]
        condition, share = condition_of(solved.equations.gram[np.ix_(kept, kept)])
        order = np.argsort(-share)
        weakest = tuple(self.unknowns[int(kept[i])].name for i in order if share[i] > 0.3)
        left = self._left(point, replace(solved, step=step))
        white = []
        for made, errors in zip(point.made, left, strict=True):
            own = whitened_errors(replace(made, errors=errors), solved.noise)
            own /= np.sqrt(solved.noise.variance)[:, :, None]
            own[~made.used] = np.nan
            white.append(own)
        starts = tuple(
            own + equations.start_step(step)
            for own, equations in zip(point.starts, solved.equations.stretches, strict=True)
        )
        samples = np.array([float(s.samples) for s in self.stretches])
        squares = sum(
            n * own.mean_square for n, own in zip(samples.tolist(), point.made, strict=True)
        )
        return SimulationFit(
            unknowns=self.unknowns,
            values=values,
            covariance=covariance,
            window_covariance=own,
            formula_covariance=formula,
            held=solved.held,
            bound=solved.bound,
            converged=converged,
            history=tuple(history),
            condition=condition,
            weakest=weakest,
            noise=solved.noise,
            errors=tuple(left),
            white=tuple(white),
            rates=tuple(own.rate for own in point.made),
            rms=np.sqrt(squares / samples.sum()),
            stretches=tuple(self._moved(k, values, own) for k, own in enumerate(starts)),
            windows=windows,
            channels=self.options.channels,
            factors=tuple(self.factors),
            made=point.made,
        )


def _after(damping: float, gained: float, promised: float) -> float:
    """The damping after a step that was taken: less where it kept what its derivatives promised."""
    if damping > 0.0 and gained < 0.25 * promised:
        return damping * HARDER**0.5
    return damping / EASIER if damping > UNDAMPED else 0.0


def _inverse(gram: np.ndarray, free: np.ndarray) -> np.ndarray:
    """H⁻¹ of the free unknowns, zero for the others, shape of ``gram``."""
    out, kept = np.zeros_like(gram), np.flatnonzero(free)
    own = gram[np.ix_(kept, kept)]
    scale = np.sqrt(np.maximum(np.diag(own), 1e-300))
    out[np.ix_(kept, kept)] = np.linalg.inv(own / np.outer(scale, scale)) / np.outer(scale, scale)
    return out


def _line(history: Sequence[FitPass]) -> str:
    """One line for the last pass."""
    last = history[-1]
    refused = f", {last.refused} steps taken back" if last.refused else ""
    return (
        f"pass {len(history)}: parameters change by {100 * last.change:.3g} %, weighted error "
        f"{np.sqrt(last.cost):.6g}{refused}"
    )
