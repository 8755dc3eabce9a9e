"""Motions that are linear in their coefficients, at rest at both ends.

    q_j(t) = Σ_k b_k(t) x_kj,      dq_j = Σ_k ḃ_k x_kj,      ddq_j = Σ_k b̈_k x_kj

The first coefficient of a joint is the position at which it starts and ends, b_0 = 1; all other
b_k vanish at both ends with their speeds and accelerations. Three families of b_k:

- ``fourier``: sines and cosines of kω, less the quintic polynomial of the same values, speeds and
  accelerations at the ends.
- ``splines``: quintic B-splines on equidistant knots, those at the ends left out.
- ``postures``: moves from posture to posture as every teach pendant runs them. All joints
  accelerate, keep their speeds and brake together, so the way to the next posture is the same
  share of each joint's; x_k is the way from the first posture to posture k.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Literal, get_args

import numpy as np

from pivident.foundation.errors import UnusableValue
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.plain_values import LATER, As, Limits, Sized
from pivident.loop.simulation.reference import trapezoidal_move

MotionKind = Literal["fourier", "splines", "postures"]

#: Longest round of a stored motion [s], most rounds, and the largest number of functions.
MAX_DURATION, MAX_ROUNDS, MAX_FUNCTIONS = 86_400.0, 10_000, 10_000

#: Rest at each posture [s], and the share of a move in which the joints accelerate.
DWELL, RISE_SHARE = 0.05, 0.3

#: Share of that acceleration in which it rises, and in which it falls.
EDGE = 0.25


@dataclass(frozen=True)
class MotionFamily:
    """Functions b_k of one kind.

    Attributes:
        kind: ``fourier``, ``splines`` or ``postures``.
        duration: of one round of the motion [s].
        size: number of functions, the constant one included.
        rounds: how often the motion is run, one round after the other.
    """

    kind: MotionKind
    duration: float
    size: int
    rounds: int = 1

    def __post_init__(self) -> None:
        if self.kind not in get_args(MotionKind):
            raise UnusableValue(
                f"kind is {self.kind!r}", advice=f"choose {', '.join(get_args(MotionKind))}"
            )
        if self.kind == "fourier" and (self.size < 3 or self.size % 2 == 0):
            raise ValueError(f"a Fourier motion has 1 + 2 harmonics functions, not {self.size}")

    @property
    def time_scale(self) -> float:
        """Shortest time in which the motion changes its course [s]."""
        if self.kind == "fourier":
            return self.duration / (self.size - 1)
        if self.kind == "splines":
            return self.duration / (self.size + 4)
        return self.move_duration / 2.0

    @property
    def move_duration(self) -> float:
        """Duration of each move between postures [s]."""
        return self.duration / self.size - DWELL

    @property
    def breakpoints(self) -> np.ndarray:
        """Times of one round between which the functions are polynomials or smooth, ends included.

        Shape (breakpoints,) [s].
        """
        if self.kind == "fourier":
            return np.array([0.0, self.duration])
        if self.kind == "splines":
            return _inner_knots(self.duration, self.size)
        rise = RISE_SHARE * self.move_duration
        ramp = rise * np.array([0.0, EDGE, 1.0 - EDGE, 1.0])
        move = np.concatenate([ramp, self.move_duration - rise + ramp])
        starts = np.arange(self.size) * (self.move_duration + DWELL)
        return np.append((starts[:, None] + move).ravel(), self.duration)

    def functions(self, t: np.ndarray) -> np.ndarray:
        """The functions and their first three derivatives.

        Args:
            t: times [s], shape (samples,); outside the motion it rests.

        Returns:
            b, ḃ, b̈ and the third derivative, shape (4, samples, size).
        """
        t = np.clip(np.asarray(t, dtype=float), 0.0, self.rounds * self.duration)
        if self.rounds > 1:
            t = np.where(t < self.rounds * self.duration, t % self.duration, self.duration)
        if self.kind == "fourier":
            return _fourier(t, self.duration, (self.size - 1) // 2)
        if self.kind == "splines":
            return _splines(t, self.duration, self.size)
        return _postures(t, self.size, self.move_duration)


@dataclass(frozen=True, eq=False)
class ExcitingMotion(Displayed):
    """A motion of a robot: a family of functions and their coefficients.

    Attributes:
        family: the functions.
        coefficients: x, shape (size, joints) [rad or m].
    """

    family: MotionFamily
    coefficients: np.ndarray

    @property
    def kind(self) -> MotionKind:
        """``fourier``, ``splines`` or ``postures``."""
        return self.family.kind

    @property
    def duration(self) -> float:
        """Duration of all rounds [s]."""
        return self.family.rounds * self.family.duration

    @property
    def one_round(self) -> ExcitingMotion:
        """The first round alone."""
        return replace(self, family=replace(self.family, rounds=1))

    @property
    def start(self) -> np.ndarray:
        """Posture at both ends, shape (joints,) [rad or m]."""
        return self.coefficients[0].copy()

    @property
    def postures(self) -> np.ndarray | None:
        """Postures in their order, both ends included; None for a motion that has none."""
        if self.kind != "postures":
            return None
        ways = self.coefficients.copy()
        ways[0] = 0.0
        return self.start + np.vstack([ways[:1], *[np.roll(ways, -1, axis=0)] * self.family.rounds])

    def times(self, rate: float) -> np.ndarray:
        """Instants of the motion at a rate [Hz], from 0 to its end, shape (samples,) [s]."""
        return np.arange(int(np.floor(self.duration * rate + 1e-9)) + 1) / rate

    def sampled(self, rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The motion at a rate.

        Args:
            rate: of the samples [Hz].

        Returns:
            q, dq, ddq, each (samples, joints).
        """
        q, dq, ddq, _ = self.at(self.times(rate))
        return q, dq, ddq

    def at(self, t: np.ndarray) -> np.ndarray:
        """Positions, speeds, accelerations and jerks, shape (4, samples, joints).

        Args:
            t: times [s], shape (samples,).
        """
        return self.family.functions(t) @ self.coefficients


@dataclass(frozen=True, eq=False)
class MotionTable:
    """A motion as a file holds it, from which it comes back bit for bit."""

    kind: MotionKind
    duration: Annotated[float, Limits(gt=0.0, le=MAX_DURATION)]
    rounds: Annotated[int, LATER, Limits(ge=1, le=MAX_ROUNDS)] = 1
    coefficients: Annotated[
        np.ndarray, Sized("functions", "joints"), Limits(min_length=1, max_length=MAX_FUNCTIONS)
    ] = field(kw_only=True)

    @classmethod
    def of(cls, motion: ExcitingMotion) -> MotionTable:
        """The table of a motion."""
        own = motion.family
        return cls(own.kind, own.duration, own.rounds, coefficients=motion.coefficients)

    def motion(self) -> ExcitingMotion:
        """The motion of the table.

        Raises:
            ValueError: its family has no so many functions, or its moves take no time.
        """
        family = MotionFamily(self.kind, self.duration, len(self.coefficients), self.rounds)
        if self.kind == "postures" and not family.move_duration > 0.0:
            raise ValueError(f"{self.duration:g} s leave no time for {family.size} moves")
        return ExcitingMotion(family, self.coefficients)


#: A motion in a file.
StoredMotion = Annotated[ExcitingMotion, As(MotionTable, MotionTable.of, MotionTable.motion)]


def _fourier(t: np.ndarray, duration: float, harmonics: int) -> np.ndarray:
    """Sines and cosines of unit speed at 2πk/T, less a quintic that brings them to rest."""
    omega = 2.0 * np.pi / duration * np.arange(1, harmonics + 1)
    phase = np.outer(t, omega)
    sine, cosine = np.sin(phase), np.cos(phase)
    waves = [
        np.hstack([sine / omega, -cosine / omega]),
        np.hstack([cosine, sine]),
        np.hstack([-sine * omega, cosine * omega]),
        np.hstack([-cosine * omega**2, -sine * omega**2]),
    ]
    ends = [np.concatenate([0.0 * omega, -1.0 / omega])]
    ends += [np.concatenate([1.0 + 0.0 * omega, 0.0 * omega]), np.concatenate([0.0 * omega, omega])]
    quintic = _quintic(t / duration, duration)
    # over whole periods the ends have the same value, speed and acceleration
    series = np.stack([w - quintic[:, i] @ np.array(ends) for i, w in enumerate(waves)])
    return np.concatenate([_constant(t), series], axis=2)


def _quintic(x: np.ndarray, duration: float) -> np.ndarray:
    """Quintics of unit value, speed and acceleration at both ends, and three derivatives.

    Shape (samples, 4, 3); x is the time as a share of the duration.
    """
    ends = np.concatenate([_powers(np.zeros(1), duration), _powers(np.ones(1), duration)], axis=1)
    conditions = ends[:3].transpose(1, 0, 2).reshape(6, 6)
    polynomials = np.linalg.solve(conditions, np.vstack([np.eye(3), np.eye(3)]))
    return (_powers(x, duration) @ polynomials).transpose(1, 0, 2)


def _powers(x: np.ndarray, duration: float) -> np.ndarray:
    """1, x … x⁵ and their first three derivatives by time, shape (4, samples, 6)."""
    powers = np.arange(6)
    out = np.zeros((4, x.size, 6))
    for derivative in range(4):
        factor = np.prod(powers[:, None] - np.arange(derivative), axis=1)
        lowered = x[:, None] ** np.maximum(powers - derivative, 0)
        out[derivative] = np.where(powers >= derivative, lowered * factor, 0.0)
        out[derivative] /= duration**derivative
    return out


def _splines(t: np.ndarray, duration: float, size: int) -> np.ndarray:
    """Quintic B-splines whose first three and last three coefficients are zero."""
    from scipy.interpolate import BSpline

    degree, count = 5, size - 1 + 6
    inner = _inner_knots(duration, size)
    knots = np.concatenate([np.zeros(degree), inner, np.full(degree, duration)])
    spline = BSpline(knots, np.eye(count)[:, 3:-3], degree)
    series = np.stack([spline(t, nu=derivative) for derivative in range(4)])
    return np.concatenate([_constant(t), series], axis=2)


def _inner_knots(duration: float, size: int) -> np.ndarray:
    """Equidistant knots of so many splines and the constant, both ends included."""
    return np.linspace(0.0, duration, size + 1)


def _postures(t: np.ndarray, size: int, move: float) -> np.ndarray:
    """Shares of the ways from the first posture to the others, which are passed in their order."""
    out = np.zeros((4, t.size, size))
    rise = RISE_SHARE * move
    for k in range(size):  # from posture k to the next one
        way = trapezoidal_move(t - k * (move + DWELL), rise, move - rise, EDGE)
        out[:, :, k] -= way
        out[:, :, (k + 1) % size] += way
    out[:, :, 0] = _constant(t)[:, :, 0]
    return out


def _constant(t: np.ndarray) -> np.ndarray:
    """The constant function and its derivatives."""
    constant = np.zeros((4, t.size, 1))
    constant[0] = 1.0
    return constant
