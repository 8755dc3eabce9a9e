"""Kalman filters that run beside the robot: one sample at a time, in bounded time and memory.

The same filters estimate along a record, see
`pivident.estimation.literature.filters.state_filter`.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from pivident.dynamics.parameters import Parameter
from pivident.estimation.literature.filters.extended import ExtendedSteps
from pivident.estimation.literature.filters.filter_state import (
    DONE,
    INDEFINITE,
    NOT_POSITIVE,
    OPEN,
    FilterNoise,
    FilterRun,
    filter_state,
)
from pivident.estimation.literature.filters.midpoint_step import step_work
from pivident.estimation.literature.filters.robot_equations import robot_equations
from pivident.foundation.errors import FilterDiverged, IdentificationError
from pivident.robot.description import Robot


class KalmanSteps(Protocol):
    """How a filter goes from sample to sample, as `ExtendedKalman` and `UnscentedKalman` do."""

    @property
    def needs_points(self) -> bool:
        """Whether its state holds sigma points."""

    @property
    def square_root(self) -> bool:
        """Whether factors of the covariance are carried."""

    def advance(self, run: FilterRun) -> tuple[int, int, int]:
        """Take samples; status, joint and sample at which it ended."""


#: What ended a filter, by its status.
CAUSES = {
    INDEFINITE: "the mass matrix of its parameters is not positive definite",
    NOT_POSITIVE: "its covariance is not positive definite any more",
    OPEN: "the loops of the mechanism do not close at the positions that it believes in",
}


class KalmanFilter:
    """A filter on (q, dq, θ), whose input is the torque and whose output is the position.

    Args:
        robot: the robot.
        parameters: what is estimated; all other parameters count as zero.
        theta: first values, shape (parameters,).
        covariance: theirs, shape (parameters, parameters), symmetric and positive definite.
        rate: samples in a second [Hz].
        encoder_std: standard deviation of measured positions, shape (joints,) or one for all
            [rad or m].
        torque_std: standard deviation of the torque of a period, likewise [N m or N].
        drift: standard deviation that a parameter gains in a second, shape (parameters,) or one
            for all, in its own unit.
        standstill: speed below which a joint stands still, shape (joints,) or one for all
            [rad/s or m/s].
        still_std: standard deviation of the torque there, where no law of friction holds.
        method: which filter; its options of starts and noises are not used here.

    Raises:
        IdentificationError: arrays that do not fit, noises that are not positive, a covariance
            that is none.
        ExperimentError: friction that (q, dq, θ) does not hold.
    """

    def __init__(
        self,
        robot: Robot,
        parameters: tuple[Parameter, ...],
        theta: ArrayLike,
        covariance: ArrayLike,
        *,
        rate: float,
        encoder_std: ArrayLike,
        torque_std: ArrayLike,
        drift: ArrayLike = 0.0,
        standstill: ArrayLike = 0.0,
        still_std: ArrayLike | None = None,
        method: KalmanSteps | None = None,
    ) -> None:
        self.method = method or ExtendedSteps()
        self.robot, self.parameters, self.rate = robot, tuple(parameters), float(rate)
        n, p = robot.size, len(self.parameters)
        torque = _spread("torque_std", torque_std, n, positive=True)
        still = torque if still_std is None else _spread("still_std", still_std, n, positive=True)
        self._noise = FilterNoise(
            _spread("encoder_std", encoder_std, n, positive=True) ** 2,
            torque**2,
            still**2,
            _spread("standstill", standstill, n),
            _spread("drift", drift, p) ** 2,
        )
        self._equations = robot_equations(robot, self.parameters)
        self._state = filter_state(self._equations, self.method.needs_points)
        self._tau, self._y = np.zeros((1, n)), np.zeros((1, n))
        self._innovations = np.zeros((2, 1, n))
        self.samples = 0
        self._first = _checked(theta, covariance, p)
        self._rooted = self.method.square_root
        self._started = False

    def start(
        self,
        q: ArrayLike,
        dq: ArrayLike | None = None,
        dq_std: ArrayLike = 1.0,
        q_std: ArrayLike | None = None,
    ) -> None:
        """Begin at a position; the parameters keep what they are, speeds forget what they were.

        Args:
            q: measured positions, shape (joints,) [rad or m].
            dq: speeds, shape (joints,) [rad/s or m/s]; None: zero.
            dq_std: their standard deviation, shape (joints,) or one for all.
            q_std: that of the positions; None: that of the encoder.

        Raises:
            LoopNotClosed: the loops of a mechanism do not close there.
        """
        n, state = self.robot.size, self._state
        theta, covariance = self._estimate()
        state.x[:n], state.x[n : 2 * n] = q, 0.0 if dq is None else dq
        state.x[2 * n :] = theta
        whole = np.zeros_like(state.covariance)
        spread = _spread("dq_std", dq_std, n, positive=True)
        near = np.sqrt(self._noise.encoder) if q_std is None else _spread("q_std", q_std, n, True)
        whole[:n, :n], whole[n : 2 * n, n : 2 * n] = np.diag(near**2), np.diag(spread**2)
        whole[2 * n :, 2 * n :] = covariance
        state.covariance[:] = whole
        if self._rooted:
            state.factor[:] = np.linalg.cholesky(whole)
        state.step.vectors[:], state.accelerations[:] = 0.0, 0.0
        if state.step.closed is not None:
            place = step_work(self._equations, state.x[:n], self.robot.joint_names)
            self._state = state._replace(step=place)
        self._started = True

    def update(self, q: ArrayLike, tau: ArrayLike) -> None:
        """Take one sample.

        Args:
            q: measured positions, shape (joints,) [rad or m].
            tau: torques that have acted since the sample before, shape (joints,) [N m or N].

        Raises:
            FilterDiverged: names the sample and the innovation.
        """
        self._tau[0], self._y[0] = tau, q
        if not self._started:
            self.start(self._y[0])
            return
        self._advance(self._tau, self._y, self._innovations)

    def run(self, q: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Take many samples.

        Args:
            q: measured positions, shape (samples, joints) [rad or m].
            tau: torques that have acted before each, likewise [N m or N].

        Returns:
            Innovations in standard deviations, and these [rad or m], shape (2, samples, joints).

        Raises:
            IdentificationError: the filter has no first position.
            FilterDiverged: names the sample and the innovation.
        """
        if not self._started:
            raise IdentificationError(
                "the filter has no first position", advice="call start(q) first"
            )
        # copies: what may not be written to would be compiled anew, with sums in another order
        q, tau = (np.array(x, dtype=float, order="C") for x in (q, tau))
        innovations = np.zeros((2, *q.shape))
        self._advance(tau, q, innovations)
        return innovations

    def _advance(self, tau: np.ndarray, q: np.ndarray, innovations: np.ndarray) -> None:
        """By the compiled filter."""
        status, joint, sample = self.method.advance(
            FilterRun(
                self._equations, self._state, self._noise, 1.0 / self.rate, tau, q, innovations
            )
        )
        if status != DONE:
            raise FilterDiverged(
                self.robot.joint_names[joint],
                self.samples + sample + 1,
                float(self._state.innovation[0, joint]),
                CAUSES.get(status, ""),
            )
        self.samples += len(q)

    def _estimate(self) -> tuple[np.ndarray, np.ndarray]:
        """Parameters and their covariance."""
        if not self._started:
            return self._first
        n, state = self.robot.size, self._state
        if self._rooted:
            own = state.factor[2 * n :]
            return state.x[2 * n :].copy(), own @ own.T
        return state.x[2 * n :].copy(), state.covariance[2 * n :, 2 * n :].copy()

    @property
    def theta(self) -> np.ndarray:
        """Parameters, shape (parameters,)."""
        return self._estimate()[0]

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the parameters, shape (parameters, parameters)."""
        return self._estimate()[1]

    @property
    def q(self) -> np.ndarray:
        """Filtered positions, shape (joints,) [rad or m]."""
        return self._state.x[: self.robot.size].copy()

    @property
    def dq(self) -> np.ndarray:
        """Filtered speeds, shape (joints,) [rad/s or m/s]."""
        return self._state.x[self.robot.size : 2 * self.robot.size].copy()

    @property
    def innovation(self) -> np.ndarray:
        """Measured less expected positions, in standard deviations, shape (joints,)."""
        return self._state.innovation[0].copy()


def _spread(name: str, value: ArrayLike, count: int, positive: bool = False) -> np.ndarray:
    """One number for all, or one for each."""
    given = np.asarray(value, dtype=float)
    if given.shape not in ((), (count,)):
        raise IdentificationError(
            f"{name} has shape {given.shape}", advice=f"one number or {count}"
        )
    least = float(given.min(initial=np.inf))
    if not np.isfinite(given).all() or least < 0.0 or (positive and least == 0.0):
        raise IdentificationError(
            f"{name} is {value!r}",
            advice=f"it has to be {'positive' if positive else 'zero or more'}",
        )
    return np.broadcast_to(given, count).copy()


def _checked(theta: ArrayLike, covariance: ArrayLike, count: int) -> tuple[np.ndarray, np.ndarray]:
    """First parameters and their covariance, refused where they cannot be."""
    values, matrix = np.array(theta, dtype=float), np.array(covariance, dtype=float)
    if values.shape != (count,) or matrix.shape != (count, count):
        raise IdentificationError(
            f"theta and covariance have shapes {values.shape} and {matrix.shape}",
            advice=f"for {count} parameters ({count},) and ({count}, {count}) are needed",
        )
    if not (np.isfinite(values).all() and np.isfinite(matrix).all()):
        raise IdentificationError("theta and covariance hold numbers that are not finite")
    size = np.sqrt(np.abs(np.diag(matrix)))
    scaled = matrix / np.outer(size, size) if (size > 0.0).all() else matrix
    least = float(np.linalg.eigvalsh(0.5 * (scaled + scaled.T))[0])
    if not np.allclose(scaled, scaled.T, atol=1e-9) or not least > 0.0:
        raise IdentificationError(
            "the first covariance is not symmetric and positive definite (smallest eigenvalue "
            f"{least:.3g}, in units of its diagonal)",
            advice="no normal distribution has it",
        )
    return values, matrix
