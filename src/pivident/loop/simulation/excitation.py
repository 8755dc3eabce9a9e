"""Motions that excite: Fourier series whose observation matrix is well conditioned.

    q_j(t) = q0_j + Σ_k [a_jk sin(kωt) - b_jk cos(kωt)] / (kω)

starts at rest, Σ_k a_jk = 0 and Σ_k k b_jk = 0, and stays inside the limits of positions, speeds
and accelerations. Among such series the optimiser looks for a small

    cond(WᵀW) + 100/σ_min(W)

(Leboutet et al. 2021), W the observation matrix of one period.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pivident.dynamics.parameters import Parameter
from pivident.dynamics.robot_regressor import regressor_of
from pivident.foundation.text.plain_values import Known, Sized
from pivident.robot.description import Robot

#: Samples per period of the highest harmonic on which limits and W are evaluated.
SAMPLES_PER_PERIOD = 10

#: Share of the limits that is used: between those samples a motion may go a little further.
MARGIN = 0.97

#: Random series that the search starts from, and how far its first steps go.
FIRST_DRAWS, FIRST_STEP = 100, 0.3

#: Range of a revolute joint without position limits [rad].
FREE_RANGE = np.pi


@dataclass(frozen=True, eq=False)
class FourierSeries:
    """A periodic motion."""

    frequency: float  # of the first harmonic [Hz]
    offset: Annotated[np.ndarray, Sized("joints")]  # q0 [rad or m], shape (joints,)
    #: Amplitudes of cos in the speed [rad/s or m/s], shape (joints, harmonics); ``b`` of sin.
    a: Annotated[np.ndarray, Sized("joints", "harmonics")]
    b: Annotated[np.ndarray, Sized("joints", "harmonics")]  # see above
    cost: Known = float("nan")  # cond(WᵀW) + 100/σ_min(W), NaN where nothing was optimised

    def sampled(self, rate: float, samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The motion: q, dq, ddq, each (samples, joints)."""
        t = np.arange(samples) / rate
        omega = 2.0 * np.pi * self.frequency * np.arange(1, self.a.shape[1] + 1)
        sine, cosine = np.sin(np.outer(t, omega)), np.cos(np.outer(t, omega))
        q = self.offset + sine @ (self.a / omega).T - cosine @ (self.b / omega).T
        dq = cosine @ self.a.T + sine @ self.b.T
        return q, dq, -(sine * omega) @ self.a.T + (cosine * omega) @ self.b.T


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """What a motion must stay inside of; arrays of shape (joints,)."""

    low: np.ndarray  # lowest positions [rad or m]
    high: np.ndarray  # highest positions
    speed: np.ndarray  # largest speeds [rad/s or m/s]
    acceleration: np.ndarray  # largest accelerations [rad/s² or m/s²]; infinite for none


def motion_limits(robot: Robot, share: float, acceleration: float | None) -> MotionLimits:
    """Limits of a robot's description.

    ``acceleration``: largest acceleration of all joints [rad/s² or m/s²], or None.
    """
    free = (-FREE_RANGE, FREE_RANGE)
    ranges = [free if j.position_limits is None else j.position_limits for j in robot.joints]
    low, high = np.array(ranges, dtype=float).T
    most = np.inf if acceleration is None else acceleration
    return MotionLimits(low, high, share * robot.rated_speeds, np.full(robot.size, most))


def random_series(
    limits: MotionLimits, harmonics: int, frequency: float, seed: int
) -> FourierSeries:
    """A series with random amplitudes, as large as the limits allow.

    ``frequency``: of the first one [Hz].
    """
    rng = np.random.default_rng(seed)
    return _fitted(rng.standard_normal((limits.low.size, 2 * harmonics + 1)), limits, frequency)


def optimised_series(
    robot: Robot,
    parameters: tuple[Parameter, ...],
    limits: MotionLimits,
    harmonics: int,
    frequency: float,
    seed: int,
    evaluations: int = 4000,
    progress: Callable[[str], None] | None = None,
) -> FourierSeries:
    """A series with a small cond(WᵀW) + 100/σ_min(W), by an evolution strategy.

    The best of some random series is changed at random, and a better one takes its place; steps
    grow after a success and shrink after a failure, so that one in five succeeds.

    ``frequency``: of the first one [Hz].
    """
    rng = np.random.default_rng(seed)
    regressor = regressor_of(robot, parameters)
    shape = (robot.size, 2 * harmonics + 1)

    def judged(raw: np.ndarray) -> FourierSeries:
        series = _fitted(raw, limits, frequency)
        rate, samples = _grid(frequency, harmonics)
        motion = series.sampled(rate, samples)
        inner = regressor.levels(motion[1].T)
        phi = regressor.matrix(*motion, inner=inner).reshape(-1, len(parameters))
        least, *_, most = np.linalg.eigvalsh(phi.T @ phi)
        cost = float(most / least + 100.0 / np.sqrt(least)) if least > 0.0 else np.inf
        return FourierSeries(series.frequency, series.offset, series.a, series.b, cost)

    draws = [rng.standard_normal(shape) for _ in range(FIRST_DRAWS)]
    found = [judged(raw) for raw in draws]
    k = int(np.argmin([s.cost for s in found]))
    best, raw, step = found[k], draws[k], FIRST_STEP
    for count in range(evaluations - FIRST_DRAWS):
        changed = raw + step * rng.standard_normal(shape)
        tried = judged(changed)
        if tried.cost < best.cost:
            best, raw, step = tried, changed, min(2.0, step * 1.22)
        else:
            step = max(1e-4, step * 0.951)
        if progress is not None and count % 500 == 0:
            progress(f"excitation: cond(WᵀW) + 100/σ_min(W) = {best.cost:.4g}")
    return best


def _grid(frequency: float, harmonics: int) -> tuple[float, int]:
    """Rate [Hz] and number of the samples of one period."""
    samples = SAMPLES_PER_PERIOD * harmonics
    return frequency * samples, samples


def _fitted(raw: np.ndarray, limits: MotionLimits, frequency: float) -> FourierSeries:
    """Random numbers as a series at rest at its start, as large as its limits allow.

    ``frequency``: of the first harmonic [Hz].
    """
    harmonics = (raw.shape[1] - 1) // 2
    a, b = raw[:, :harmonics].copy(), raw[:, harmonics:-1].copy()
    number = np.arange(1, harmonics + 1)
    if harmonics > 1:  # rest at the start: take out what is not at rest
        a -= a.mean(axis=1, keepdims=True)
        b -= np.outer(b @ number, number) / (number @ number)
    still = np.zeros(len(raw))
    q, dq, ddq = FourierSeries(frequency, still, a, b).sampled(*_grid(frequency, harmonics))
    scale = MARGIN * np.min(
        [
            (limits.high - limits.low) / np.ptp(q, axis=0),
            limits.speed / np.abs(dq).max(axis=0),
            limits.acceleration / np.abs(ddq).max(axis=0),
        ],
        axis=0,
    )
    a, b, q = a * scale[:, None], b * scale[:, None], q * scale
    room = (limits.high - limits.low) - np.ptp(q, axis=0)
    share = 0.5 * (1.0 + np.tanh(raw[:, -1]))
    spare = 0.5 * (1.0 / MARGIN - 1.0) * np.ptp(q, axis=0)  # the margin, on both sides
    offset = limits.low - q.min(axis=0) + spare + share * np.maximum(room - 2 * spare, 0.0)
    return FourierSeries(frequency, offset, a, b)
