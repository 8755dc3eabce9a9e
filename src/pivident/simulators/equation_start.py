"""Where the search starts: values whose equations of motion hold along the measured motion.

    min_p Σ_j ‖r_j‖²/s_j²,   r = τ(t - T - h/2) - Φ(q_m - b, dq, ddq) θ,   τ = law(q_ref, q_m)

The known law gives the torque at the positions q_m that its encoders showed, h is its period, over
which the torque is held, T the delay, b the bias of the encoders. Nothing is simulated here: where
a loop with wrong values swings or diverges, its simulation says little of the right ones, while the
equation is nearly linear in them. Noise in the accelerations biases it; it is a start, no estimate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.output_error.stretch import Stretch
from pivident.estimation.output_error.unknowns import Unknown, values_of, with_values
from pivident.motion.law_torque import controller_outputs
from pivident.signals.random_walk import smooth_channels
from pivident.simulation.closed_loop import LoopSignals
from pivident.simulation.direction import ParametrisedLoop

#: Evaluations of the equations with their differences, at most, and the relative decrease of their
#: squares that is worth no further one.
MAX_EVALUATIONS, DECREASE = 30, 1e-4

#: Weight of a prior at the values to begin with: what no equation depends on stays there. A change
#: by all of a value, or of its range, counts as a share of so much of each torque.
PRIOR = 1e-3


@dataclass(frozen=True, eq=False)
class _Motion:
    """A record's smoothed motion, and what the law read."""

    stretch: Stretch
    q: np.ndarray  # that encoders show, shape (samples, joints) [rad or m]; likewise
    dq: np.ndarray
    ddq: np.ndarray
    read: np.ndarray  # at the rate of the law, shape (control samples, joints) [rad or m]

    @classmethod
    def of(cls, stretch: Stretch) -> _Motion:
        """Smooth the positions of a stretch, and interpolate them to the rate of its law."""
        from scipy.interpolate import CubicSpline

        smooth = smooth_channels(stretch.q, stretch.rate)
        logged = np.arange(stretch.samples) * stretch.step
        control = np.minimum(np.arange(len(stretch.loop.signals.q_ref)), logged[-1])
        read = CubicSpline(logged, smooth.q, axis=0)(control)
        return cls(stretch, smooth.q, smooth.dq, smooth.ddq, read)

    def residual(
        self, unknowns: Sequence[Unknown], values: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Residuals r and torques τ of the compared samples, each (samples, joints) [N m or N]."""
        loop = with_values(self.stretch.loop, unknowns, values)
        signals = loop.signals
        bias = 0.0 if signals.noise is None else np.asarray(signals.noise)[0]
        tau = _law_torque(loop, self.read)
        late = signals.drive_delay * signals.rate + 0.5
        times = np.arange(len(self.q)) * self.stretch.step - late
        at = np.arange(len(tau))
        tau = np.stack([np.interp(times, at, own) for own in tau.T], axis=1)
        regressor = regressor_of(loop.robot, loop.parameters)
        model = regressor.torque(self.q - bias, self.dq, self.ddq, loop.theta)
        used = slice(self.stretch.first, None)
        return (tau - model)[used], tau[used]


def equation_start(stretches: Sequence[Stretch], unknowns: Sequence[Unknown]) -> np.ndarray:
    """Values of the unknowns, within their bounds, shape (unknowns,).

    ``stretches``: records beside loops with values from which the equations are solved; the law and
    what drives it are those of the loops.
    """
    from scipy.optimize import least_squares

    low, high = (np.array([getattr(u, side) for u in unknowns]) for side in ("low", "high"))
    motions = [_Motion.of(own) for own in stretches]
    begin = np.clip(values_of(stretches[0].loop, unknowns), low, high)
    torque = np.concatenate([own.residual(unknowns, begin)[1] for own in motions])
    scale = np.maximum(torque.std(axis=0), 1e-9 * max(torque.std(), 1e-300))
    reach = np.where(np.isfinite(high - low), 0.5 * (high - low), 1.0)
    size = np.where(begin != 0.0, np.abs(begin), reach) / (PRIOR * np.sqrt(torque.size))

    def equations(values: np.ndarray) -> np.ndarray:
        left = [own.residual(unknowns, values)[0] / scale for own in motions]
        return np.concatenate([*(own.ravel() for own in left), (values - begin) / size])

    found = least_squares(
        equations, begin, bounds=(low, high), x_scale="jac", ftol=DECREASE,
        max_nfev=MAX_EVALUATIONS,
    )  # fmt: skip
    return np.clip(found.x, low, high)


def _law_torque(loop: ParametrisedLoop, read: np.ndarray) -> np.ndarray:
    """Torque that a loop's law commands where its encoders show ``read``, of its shape."""
    signals: LoopSignals = loop.signals
    added = np.zeros((1, loop.robot.size)) if signals.inputs is None else signals.inputs
    output = controller_outputs(
        loop.robot, loop.controller, read, signals.q_ref, signals.dq_ref,
        np.broadcast_to(added, read.shape), signals.limit, signals.rate,
    )  # fmt: skip
    return signals.drive_gain * output
