"""Simulation error of an axis in open loop, with the protocol of the EMPS benchmark.

The recorded drive input moves the model, and nothing leads it back:

    M ddq + f(q, dq) = g u(t),    e_k(p) = q_k(p) - q_k measured

Each stretch of the record starts from the state that its first 20 samples give, the two numbers
q₀, dq₀ with which the model fits them best.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.parameters import standard_parameters
from pivident.estimation.output_error.record_stretches import OpenLoop
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
    """An axis with its drive.

    Attributes:
        robot: the axis, one joint with its friction law.
        drive_gain: force per drive input [N/V].
        values: by name: parameters, constants of the friction law, ``delay`` of the drive [s].
    """

    robot: Robot
    drive_gain: float
    values: dict[str, float]

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
    ) -> list[State]:
        """Position and speed at the start of each stretch that fit its first samples best.

        The search starts from a line through the positions.
        """
        given = [slice(own.start, own.start + GIVEN) for own in stretches]
        times = np.arange(GIVEN) / record.rate
        states: list[State] = [
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


def rms(errors: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(errors**2)))


def _with_shapes(robot: Robot, shapes: dict[str, float]) -> FrictionLaw:
    law = robot.joints[0].friction
    return law.with_shapes(shapes) if shapes else law


def _correction(made: TangentBlock, measured: np.ndarray) -> np.ndarray:
    """Gauss-Newton step of the initial position and speed towards the given samples."""
    by_state = made.q[:, 0, :] * STATE_SIZE
    errors = (measured - made.motion.q)[:, 0]
    return np.linalg.lstsq(by_state, errors, rcond=UNDETERMINED)[0] * STATE_SIZE
