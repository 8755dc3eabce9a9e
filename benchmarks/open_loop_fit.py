"""Simulation error of an axis in open loop, with the protocol of the EMPS benchmark.

The recorded drive input moves the model, and nothing leads it back:

    M ddq + f(q, dq) = g u(t),    e_k(p) = q_k(p) - q_k measured

Each stretch of the record starts from the state that its first 20 samples give, the two numbers
q₀, dq₀ with which the model fits them best. These depend on the parameters p, so the derivative of
the errors is that of the simulation less the part that the initial state takes,

    J = J_p - J_s (J_s'ᵀ J_s')⁻¹ J_s'ᵀ J_p',        ' on the first 20 samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from pivident.data.recording.recording import Recording
from pivident.dynamics.parameters import standard_parameters
from pivident.estimation.output_error.record_stretches import OpenLoop
from pivident.foundation.errors import PividentError
from pivident.loop.simulation.closed_loop import LoopSignals
from pivident.loop.simulation.direction import Direction, ParametrisedLoop
from pivident.loop.simulation.tangents import TangentBlock, simulate_with_tangents
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionLaw

#: Samples that may set the initial state, and that the score leaves out.
GIVEN = 20

#: Directions of the initial state, and typical sizes of them [m, m/s].
STATE = (Direction("initial_position", joint=0), Direction("initial_speed", joint=0))
STATE_SIZE = np.array([1e-3, 0.1])

#: Most corrections of the initial state, and the share of its typical size that settles it. Where
#: the carriage reverses within the given samples the second correction is not yet the last one.
MAX_CORRECTIONS, SETTLED = 8, 1e-4

#: Share of the largest singular value below which the given samples do not determine a state: the
#: speed of a carriage at rest leaves no trace in its positions.
UNDETERMINED = 1e-2

#: Distance and speed at which a simulation counts as diverged [m, m/s].
TOO_FAR, TOO_FAST = 100.0, 100.0

#: Error of a stretch that cannot be simulated [mm]: the search steps back from it.
FAILED = 1e3

#: Size of a delay, which starts at zero [s], and of other unknowns that are zero.
DELAY_SIZE, SMALLEST = 1e-4, 1.0

#: Range of the logarithm of a positive constant around its start, and relative tolerance.
LOGARITHM, TOLERANCE = 4.0, 1e-3

#: Logarithm at which an end of an interval means "no bound".
OVERFLOW = 20.0


#: Position and speed of the axis, each (1,).
State = tuple[np.ndarray, np.ndarray]


class Stretch(NamedTuple):
    """Samples of a record, the last one excluded."""

    start: int
    stop: int


def stretch_tangents(
    loop: ParametrisedLoop,
    stretches: Sequence[slice],
    starts: Sequence[State],
    directions: Sequence[Direction],
) -> list[TangentBlock]:
    """As ``simulate_with_tangents``, stretches of the loop's signals, each from its own state.

    Args:
        loop: what is simulated; its own start does not matter.
        stretches: samples of its signals.
        starts: positions and speeds at the first sample of each, (joints,) each.
        directions: parameters to differentiate along.

    Returns:
        Motion and tangents of each stretch; ``samples`` are those of the loop's signals.
    """
    made = []
    for span, start in zip(stretches, starts, strict=True):
        own = replace(loop, signals=loop.signals.part(span), start=start)
        made.append(simulate_with_tangents(own, directions)._replace(samples=span))
    return made


@dataclass(frozen=True, eq=False)
class OpenLoopModel:
    """An axis with its drive, in terms of what is sought.

    Attributes:
        robot: the axis, one joint with its friction law.
        drive_gain: force per drive input [N/V].
        values: where the search starts, by name: parameters, constants of the friction law,
            ``delay`` of the drive [s].
        names: those that are sought.
    """

    robot: Robot
    drive_gain: float
    values: dict[str, float]
    names: tuple[str, ...]

    def with_values(self, values: np.ndarray) -> OpenLoopModel:
        """The same with other values of what is sought, shape (names,)."""
        found = dict(zip(self.names, np.asarray(values, float).tolist(), strict=True))
        return replace(self, values=self.values | found)

    @property
    def directions(self) -> list[Direction]:
        """What is sought as directions of the simulation."""
        parameters = {p.name for p in standard_parameters(self.robot)}
        return [
            Direction("delay") if name == "delay"
            else Direction("parameter", name) if name in parameters
            else Direction("shape", name, 0)
            for name in self.names
        ]  # fmt: skip

    def loop(self, record: Recording) -> ParametrisedLoop:
        """The model under the drive input of a record."""
        shapes = {s.name: s.value for s in self.robot.joints[0].friction.shapes}
        shapes |= {name: v for name, v in self.values.items() if name in (*shapes, "gamma")}
        robot = self.robot.with_friction(_with_shapes(self.robot, shapes))
        parameters = standard_parameters(robot)
        theta = np.array([self.values.get(p.name, 0.0) for p in parameters])
        u = record.tau / self.drive_gain
        signals = LoopSignals(
            rate=record.rate, q_ref=np.zeros_like(u), dq_ref=None, inputs=u, noise=None,
            drive_gain=np.array([self.drive_gain]), limit=np.array([np.inf]),
            bound=np.array([TOO_FAR]), speed_bound=np.array([TOO_FAST]),
            drive_delay=self.values.get("delay", 0.0),
        )  # fmt: skip
        return ParametrisedLoop(robot, parameters, theta, OpenLoop(), signals)

    def starts(
        self,
        loop: ParametrisedLoop,
        record: Recording,
        stretches: Sequence[Stretch],
        near: Sequence[State] = (),
    ) -> list[State]:
        """Position and speed at the start of each stretch that fit its first samples best.

        The search starts from states ``near`` them, or from a line through the positions.
        """
        given = [slice(own.start, own.start + GIVEN) for own in stretches]
        times = np.arange(GIVEN) / record.rate
        states = list(near) or [
            (record.q[span.start], np.polyfit(times, record.q[span, 0], 1)[:1]) for span in given
        ]
        open_ones = list(range(len(states)))
        for _ in range(MAX_CORRECTIONS):
            made = stretch_tangents(
                loop, [given[k] for k in open_ones], [states[k] for k in open_ones], STATE
            )
            steps = [_correction(own, record.q[own.samples]) for own in made]
            for k, step in zip(open_ones, steps, strict=True):
                states[k] = states[k][0] + step[0], states[k][1] + step[1]
            open_ones = [
                k for k, step in zip(open_ones, steps, strict=True)
                if np.abs(step / STATE_SIZE).max() > SETTLED
            ]  # fmt: skip
            if not open_ones:
                break
        return states

    def errors(self, record: Recording, stretch: Stretch, finer: int = 1) -> np.ndarray:
        """Simulated less measured position [mm], shape (samples,).

        Args:
            record: of the axis.
            stretch: samples to simulate.
            finer: steps of the simulation in place of one.
        """
        loop = self.loop(record)
        start = self.starts(loop, record, [stretch])
        signals = loop.signals.part(slice(*stretch))
        u = np.repeat(signals.inputs, finer, axis=0)
        held = replace(signals, rate=finer * record.rate, q_ref=np.zeros_like(u), inputs=u)
        (made,) = stretch_tangents(replace(loop, signals=held), [slice(0, len(u))], start, ())
        return 1e3 * (made.motion.q[::finer] - record.q[slice(*stretch)])[:, 0]

    def score(self, record: Recording, stretch: Stretch) -> float:
        """Root mean square of the errors after the given samples [mm]."""
        return rms(self.errors(record, stretch)[GIVEN:])

    def linearised(
        self, record: Recording, stretches: Sequence[Stretch], near: Sequence[State] = ()
    ) -> tuple[np.ndarray, np.ndarray, list[State]]:
        """Errors [mm] and derivatives by what is sought, of all stretches one after the other.

        Shapes (samples,) and (samples, names); then the initial states, see ``starts``.
        """
        loop, count = self.loop(record), len(self.names)
        states = self.starts(loop, record, stretches, near)
        spans = [slice(*own) for own in stretches]
        errors, columns = [], []
        for made in stretch_tangents(loop, spans, states, [*self.directions, *STATE]):
            by_state = made.q[:, 0, count:] * STATE_SIZE
            by_sought = made.q[:, 0, :count]
            taken = np.linalg.lstsq(by_state[:GIVEN], by_sought[:GIVEN], rcond=UNDETERMINED)[0]
            errors.append(1e3 * (made.motion.q - record.q[made.samples])[:, 0])
            columns.append(1e3 * (by_sought - by_state @ taken))
        return np.concatenate(errors), np.concatenate(columns), states


@dataclass(frozen=True, eq=False)
class OpenLoopFit:
    """What came out of a fit.

    Attributes:
        model: with the estimates.
        low: lower ends of the 95 % intervals, by name.
        high: their upper ends.
        without: with the estimates that leave one group of stretches out each.
        simulations: simulations with tangents of all stretches.
    """

    model: OpenLoopModel
    low: dict[str, float]
    high: dict[str, float]
    without: tuple[OpenLoopModel, ...]
    simulations: int

    def expected_error(self, record: Recording, stretch: Stretch) -> float:
        """Error of the simulated position that the uncertainty of the estimate explains [mm].

        √((W - 1)/W Σ ‖q_w - q‖²/samples) over the estimates without one of W groups. The measured
        position sets the initial state and cancels otherwise.
        """
        own = self.model.errors(record, stretch)[GIVEN:]
        moved = [rms(model.errors(record, stretch)[GIVEN:] - own) for model in self.without]
        return float(np.sqrt((1.0 - 1.0 / len(moved)) * np.sum(np.square(moved))))


def rms(errors: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(errors**2)))


def fit_open_loop(
    model: OpenLoopModel,
    record: Recording,
    stretches: Sequence[Stretch],
    groups: Sequence[Sequence[int]] | None = None,
    most: int = 30,
) -> OpenLoopFit:
    """Least squares of the open-loop errors over stretches of a record.

    Positive constants (those of shape) are sought as their logarithm. Intervals come from the
    jackknife over groups of stretches: an error of open loop is correlated over a whole stretch,
    and intervals for white errors would be far too narrow.

    Args:
        model: where the search starts, and what is sought.
        record: of the axis.
        stretches: of the record, each with its own initial state.
        groups: indices of stretches that the jackknife leaves out together, at least two groups;
            None: each stretch is one.
        most: simulations that the search may take.
    """
    search = _Search(model, record, tuple(stretches))
    z, errors, columns = search.run(most)
    shifts = _shifts(errors, columns, _rows(stretches, groups))
    variance = (1.0 - 1.0 / len(shifts)) * (shifts**2).sum(axis=0)
    half = float(student.ppf(0.975, len(shifts) - 1)) * np.sqrt(variance)
    low, high = (
        dict(zip(model.names, search.values(z + sign * half, bounded=False).tolist(), strict=True))
        for sign in (-1.0, 1.0)
    )
    models = [model.with_values(search.values(z + shift)) for shift in (0.0, *shifts)]
    return OpenLoopFit(models[0], low, high, tuple(models[1:]), search.count)


class _Search:
    """Least squares on scaled unknowns z: shares of the start, logarithms of positive constants."""

    def __init__(
        self, model: OpenLoopModel, record: Recording, stretches: tuple[Stretch, ...]
    ) -> None:
        self.model, self.record, self.stretches, self.count = model, record, stretches, 0
        self.start = np.array([model.values[name] for name in model.names])
        self.constants = np.array([d.kind == "shape" for d in model.directions])
        self.delays = np.array([d.kind == "delay" for d in model.directions])
        nothing = np.where(self.delays, DELAY_SIZE, SMALLEST)
        self.size = np.where(self.start != 0.0, np.abs(self.start), nothing)
        self._known: tuple[bytes, np.ndarray, np.ndarray] = (b"", np.zeros(0), np.zeros(0))
        self._states: list[State] = []

    def values(self, z: np.ndarray, bounded: bool = True) -> np.ndarray:
        """What is sought at z; ``bounded``: a delay is not negative."""
        exponent = np.clip(np.where(self.constants, z, 0.0), -OVERFLOW, OVERFLOW)
        linear = np.where(self.delays & bounded, np.maximum(z, 0.0), z) * self.size
        return np.where(self.constants, self.start * np.exp(exponent), linear)

    def run(self, most: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The best z, its errors, and their derivatives by z."""
        first = np.where(self.constants, 0.0, self.start / self.size)
        low = np.where(self.constants, -LOGARITHM, np.where(self.delays, -1e-9, -np.inf))
        found = least_squares(
            lambda z: self._evaluate(z)[0], first, lambda z: self._evaluate(z)[1], x_scale="jac",
            bounds=(low, np.where(self.constants, LOGARITHM, np.inf)), max_nfev=most,
            ftol=TOLERANCE, xtol=TOLERANCE,
        )  # fmt: skip
        return found.x, found.fun, found.jac

    def _evaluate(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if z.tobytes() != self._known[0]:
            self.count += 1
            values = self.values(z)
            slopes = np.where(self.constants, values, self.size)
            errors, columns = self._linearised(self.model.with_values(values))
            self._known = z.tobytes(), errors, columns * slopes
        return self._known[1:]

    def _linearised(self, model: OpenLoopModel) -> tuple[np.ndarray, np.ndarray]:
        """Errors and derivatives of all stretches; large errors where they cannot be simulated."""
        try:
            errors, columns, self._states = model.linearised(
                self.record, self.stretches, self._states
            )
        except (PividentError, ValueError):
            rows = sum(own.stop - own.start for own in self.stretches)
            return np.full(rows, FAILED), np.zeros((rows, len(model.names)))
        return errors, columns


def _with_shapes(robot: Robot, shapes: dict[str, float]) -> FrictionLaw:
    law = robot.joints[0].friction
    return law.with_shapes(shapes) if shapes else law


def _correction(made: TangentBlock, measured: np.ndarray) -> np.ndarray:
    """Gauss-Newton step of the initial position and speed towards the given samples."""
    by_state = made.q[:, 0, :] * STATE_SIZE
    errors = (measured - made.motion.q)[:, 0]
    return np.linalg.lstsq(by_state, errors, rcond=UNDETERMINED)[0] * STATE_SIZE


def _rows(stretches: Sequence[Stretch], groups: Sequence[Sequence[int]] | None) -> list[np.ndarray]:
    """Rows of the stacked stretches that belong to each group."""
    ends = np.cumsum([own.stop - own.start for own in stretches])
    rows = np.split(np.arange(ends[-1]), ends[:-1])
    return [np.concatenate([rows[k] for k in g]) for g in groups or [[k] for k in range(len(rows))]]


def _shifts(errors: np.ndarray, columns: np.ndarray, groups: list[np.ndarray]) -> np.ndarray:
    """Changes of the estimate without one group of rows each, shape (groups, unknowns).

    One Gauss-Newton step, δ_w = (H - H_w)⁻¹ J_wᵀ e_w. The variance of the jackknife is
    (W - 1)/W Σ δ_w²; with few groups it is more cautious than the sandwich, which it tends to.
    """
    gram = columns.T @ columns
    return np.array(
        [
            np.linalg.pinv(gram - columns[w].T @ columns[w], rcond=1e-12, hermitian=True)
            @ (columns[w].T @ errors[w])
            for w in groups
        ]
    )
