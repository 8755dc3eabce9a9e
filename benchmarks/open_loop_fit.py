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
from scipy.signal import lfilter
from scipy.stats import t as student

from pivident.dynamics.parameters import standard_parameters
from pivident.errors import PividentError
from pivident.recording.recording import Recording
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionLaw
from pivident.simulation.closed_loop import LoopSignals
from pivident.simulation.direction import Direction, ParametrisedLoop
from pivident.simulation.open_loop import OpenLoop
from pivident.simulation.tangents import has_compiled_tangents, simulate_with_tangents
from pivident.threads import run_in_threads

#: Samples that may set the initial state, and that the score leaves out.
GIVEN = 20

#: Directions of the initial state, and typical sizes of them [m, m/s].
STATE = (Direction("initial_position", joint=0), Direction("initial_speed", joint=0))
STATE_SIZE = np.array([1e-3, 0.1])

#: Corrections of the initial state: it is nearly linear in what is corrected.
CORRECTIONS = 2

#: Distance and speed at which a simulation counts as diverged [m, m/s].
TOO_FAR, TOO_FAST = 100.0, 100.0

#: Error of a stretch that cannot be simulated [mm]: the search steps back from it.
FAILED = 1e3

#: Size of a delay, which starts at zero [s], and of other unknowns that are zero.
DELAY_SIZE, SMALLEST = 1e-4, 1.0

#: Relative step of forward differences.
DIFFERENCE = 2e-3

#: Range of the logarithm of a positive constant around its start, and relative tolerance.
LOGARITHM, TOLERANCE = 4.0, 1e-3

#: Logarithm at which an end of an interval means "no bound".
OVERFLOW = 20.0


class Stretch(NamedTuple):
    """Samples of a record, the last one excluded."""

    start: int
    stop: int


@dataclass(frozen=True, eq=False)
class OpenLoopModel:
    """An axis with its drive, in terms of what is sought.

    Attributes:
        robot: the axis, one joint with its friction law.
        drive_gain: force per drive input [N/V].
        values: where the search starts, by name: parameters, constants of the friction law,
            ``delay`` of the drive [s]; ``lag``, time constant of the drive [s], is never sought.
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

    def loop(self, record: Recording, stretch: Stretch) -> ParametrisedLoop:
        """The model on a stretch of a record, from the state that its first samples give."""
        shapes = {s.name: s.value for s in self.robot.joints[0].friction.shapes}
        shapes |= {name: v for name, v in self.values.items() if name in (*shapes, "gamma")}
        robot = self.robot.with_friction(_with_shapes(self.robot, shapes))
        parameters = standard_parameters(robot)
        theta = np.array([self.values.get(p.name, 0.0) for p in parameters])
        span = slice(*stretch)
        q, u = record.q[span], self._input(record)[span]
        signals = LoopSignals(
            rate=record.rate, q_ref=np.zeros_like(q), dq_ref=None, inputs=u, noise=None,
            drive_gain=np.array([self.drive_gain]), limit=np.array([np.inf]),
            bound=np.array([TOO_FAR]), speed_bound=np.array([TOO_FAST]),
            drive_delay=self.values.get("delay", 0.0),
        )  # fmt: skip
        given = replace(signals, q_ref=signals.q_ref[:GIVEN], inputs=u[:GIVEN])
        speed = np.polyfit(np.arange(GIVEN) / record.rate, q[:GIVEN, 0], 1)[:1]
        short = ParametrisedLoop(robot, parameters, theta, OpenLoop(), given, (q[0], speed))
        for _ in range(CORRECTIONS):
            made = simulate_with_tangents(short, STATE)
            scaled = made.q[:, 0, :] * STATE_SIZE
            step = np.linalg.lstsq(scaled, (q[:GIVEN] - made.motion.q)[:, 0], rcond=None)[0]
            position, speed = (step * STATE_SIZE).tolist()
            short = replace(short, start=(short.begin[0] + position, short.begin[1] + speed))
        return replace(short, signals=signals)

    def _input(self, record: Recording) -> np.ndarray:
        """Drive input [V], after a first-order lag where there is one, shape (samples, 1)."""
        u = record.tau / self.drive_gain
        lag = self.values.get("lag", 0.0) * record.rate
        if lag == 0.0:
            return u
        fade = float(np.exp(-1.0 / lag))
        return lfilter([1.0 - fade], [1.0, -fade], u, axis=0, zi=fade * u[:1])[0]

    def errors(self, record: Recording, stretch: Stretch) -> np.ndarray:
        """Simulated less measured position [mm], shape (samples,)."""
        motion = simulate_with_tangents(self.loop(record, stretch), ()).motion
        return 1e3 * (motion.q - record.q[slice(*stretch)])[:, 0]

    def score(self, record: Recording, stretch: Stretch) -> float:
        """Root mean square of the errors after the given samples [mm]."""
        return rms(self.errors(record, stretch)[GIVEN:])

    def linearised(self, record: Recording, stretch: Stretch) -> tuple[np.ndarray, np.ndarray]:
        """Errors [mm] and their derivatives by what is sought, (samples,) and (samples, names)."""
        loop = self.loop(record, stretch)
        if not has_compiled_tangents(loop):
            return self._by_differences(record, stretch)
        made = simulate_with_tangents(loop, [*self.directions, *STATE])
        by_state = made.q[:, 0, len(self.names) :] * STATE_SIZE
        by_sought = made.q[:, 0, : len(self.names)]
        taken = np.linalg.lstsq(by_state[:GIVEN], by_sought[:GIVEN], rcond=None)[0]
        errors = (made.motion.q - record.q[slice(*stretch)])[:, 0]
        return 1e3 * errors, 1e3 * (by_sought - by_state @ taken)

    def _by_differences(self, record: Recording, stretch: Stretch) -> tuple[np.ndarray, np.ndarray]:
        """As ``linearised``, by forward differences whose steps are above those of the simulator.

        Friction of path and position is integrated to 2e-4 of its level, in steps that depend on
        the motion: changes that are much smaller drown in that.
        """
        here = self.errors(record, stretch)
        columns = np.empty((len(here), len(self.names)))
        for k, name in enumerate(self.names):
            value = self.values[name]
            step = DIFFERENCE * (abs(value) or SMALLEST)
            moved = replace(self, values=self.values | {name: value + step})
            columns[:, k] = (moved.errors(record, stretch) - here) / step
        return here, columns


@dataclass(frozen=True, eq=False)
class OpenLoopFit:
    """What came out of a fit.

    Attributes:
        model: with the estimates.
        low: lower ends of the 95 % intervals, by name.
        high: their upper ends.
        simulations: simulations with tangents of all stretches.
    """

    model: OpenLoopModel
    low: dict[str, float]
    high: dict[str, float]
    simulations: int


def rms(errors: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(errors**2)))


def fit_open_loop(
    model: OpenLoopModel,
    record: Recording,
    stretches: Sequence[Stretch],
    most: int = 30,
    windows: Sequence[Stretch] | None = None,
) -> OpenLoopFit:
    """Least squares of the open-loop errors over stretches of a record.

    Positive constants (those of shape) are sought as their logarithm. Intervals come from the
    jackknife over windows of time: an error of open loop is correlated over the whole stretch, and
    intervals for white errors would be far too narrow.

    Args:
        model: where the search starts, and what is sought.
        record: of the axis.
        stretches: of the record, each with its own initial state.
        most: simulations that the search may take.
        windows: of the jackknife, at least two, inside of the stretches; None: the stretches,
            or their halves where there is only one.
    """
    start = np.array([model.values[name] for name in model.names])
    constants = np.array([d.kind == "shape" for d in model.directions])
    delays = np.array([d.kind == "delay" for d in model.directions])
    size = np.where(start != 0.0, np.abs(start), np.where(delays, DELAY_SIZE, SMALLEST))
    low = np.where(constants, -LOGARITHM, np.where(delays, -1e-9, -np.inf))
    first = np.where(constants, 0.0, start / size)
    last: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}
    count = 0

    def values(z: np.ndarray) -> np.ndarray:
        return np.where(
            constants,
            start * np.exp(np.where(constants, np.clip(z, -OVERFLOW, OVERFLOW), 0.0)),
            z * size,
        )

    def evaluate(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        nonlocal count
        if z.tobytes() not in last:
            count += 1
            here = values(z)
            made = _linearised(model.with_values(np.maximum(here, np.where(delays, 0.0, here))),
                               record, stretches)  # fmt: skip
            last.clear()
            slope = np.where(constants, here, size)
            last[z.tobytes()] = (
                np.concatenate([e for e, _ in made]), np.concatenate([j for _, j in made]) * slope
            )  # fmt: skip
        return last[z.tobytes()]

    found = least_squares(
        lambda z: evaluate(z)[0], first, lambda z: evaluate(z)[1], x_scale="jac", max_nfev=most,
        bounds=(low, np.where(constants, LOGARITHM, np.inf)), ftol=TOLERANCE, xtol=TOLERANCE,
    )  # fmt: skip
    errors, columns = evaluate(found.x)
    half = _half_widths(errors, columns, _rows(stretches, windows or _windows(stretches)))
    ends = (values(found.x - half), values(found.x + half))
    answer = model.with_values(np.maximum(values(found.x), np.where(delays, 0.0, -np.inf)))
    bounds = [dict(zip(model.names, end.tolist(), strict=True)) for end in ends]
    return OpenLoopFit(answer, bounds[0], bounds[1], count)


def _with_shapes(robot: Robot, shapes: dict[str, float]) -> FrictionLaw:
    law = robot.joints[0].friction
    return law.with_shapes(shapes) if shapes else law


def _linearised(
    model: OpenLoopModel, record: Recording, stretches: Sequence[Stretch]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Errors and derivatives of all stretches; large errors where one cannot be simulated."""
    made: list[tuple[np.ndarray, np.ndarray]] = [(np.zeros(0), np.zeros((0, 0)))] * len(stretches)

    def work(k: int) -> None:
        try:
            made[k] = model.linearised(record, stretches[k])
        except (PividentError, ValueError):
            rows = stretches[k].stop - stretches[k].start
            made[k] = np.full(rows, FAILED), np.zeros((rows, len(model.names)))

    run_in_threads(work, range(len(stretches)))
    return made


def _windows(stretches: Sequence[Stretch]) -> list[Stretch]:
    """The stretches, or the halves of the only one."""
    if len(stretches) > 1:
        return list(stretches)
    (own,) = stretches
    middle = (own.start + own.stop) // 2
    return [Stretch(own.start, middle), Stretch(middle, own.stop)]


def _rows(stretches: Sequence[Stretch], windows: Sequence[Stretch]) -> list[np.ndarray]:
    """Rows of the stacked stretches that belong to each window."""
    samples = np.concatenate([np.arange(*s) for s in stretches])
    return [np.flatnonzero((samples >= w.start) & (samples < w.stop)) for w in windows]


def _half_widths(errors: np.ndarray, columns: np.ndarray, windows: list[np.ndarray]) -> np.ndarray:
    """Half widths of 95 % intervals by the jackknife over windows of time, one step each.

    Without a window w the estimate is p + δ_w, δ_w = (H - H_w)⁻¹ J_wᵀ e_w, and the variance is
    (W - 1)/W Σ δ_w². With few windows it is more cautious than the sandwich, which it tends to.
    """
    count, gram = len(windows), columns.T @ columns
    steps = [
        np.linalg.pinv(gram - columns[w].T @ columns[w], rcond=1e-12, hermitian=True)
        @ (columns[w].T @ errors[w])
        for w in windows
    ]
    variance = (count - 1) / count * (np.array(steps) ** 2).sum(axis=0)
    return float(student.ppf(0.975, count - 1)) * np.sqrt(variance)
