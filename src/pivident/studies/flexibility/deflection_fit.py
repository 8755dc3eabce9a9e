"""Linear fit of a joint's deflection: the terms of `compliance` and the error of the gear.

Terms are torque (the compliance), speed (the link encoder's lag), sign of the speed (friction
before the spring), an offset, the lines of the transmission error and, where they are asked for,
damping, hysteresis and backlash. Torque and its derivative are instrumented with their part that
follows from the reference, so that noise of the torque cannot make the spring look stiff.

Torque and acceleration are low-passed with zero phase; the torque of the motor's inertia is
subtracted. The link encoder is shifted by an estimate of its delay. If the reference was recorded,
functions of it serve as instruments, since they are free of measurement noise, and give the
direction of change of the torque.

Transmission error of a gear: lines in the deflection that repeat with the motor's angle.

A gear with ratio N turns the link by q_m + Σ a_i cos(o_i N q_m) + b_i sin(o_i N q_m), with o_i the
order, cycles per revolution of the motor. Orders need not be integers: the teeth of a cycloidal
gear repeat with fractions of a revolution.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.foundation.errors import IdentificationError
from pivident.signals.bandpass import butterworth, central_difference
from pivident.signals.cubic_spline import cubic_spline
from pivident.studies.flexibility.measured import Measured
from pivident.studies.flexibility.spectral_equations import (
    BLOCKS,
    STUDENT,
    jackknife_standard_error,
    solve_with_jackknife,
)

#: Smallest number of samples in motion, so that each block of the jackknife has some.
MIN_SAMPLES = 20 * BLOCKS
#: Joints below this share of their highest speed stand still: the sign of friction is not known.
STANDSTILL = 0.02
#: Share of the torque's range over which hysteresis and backlash change sides.
TRANSITION = 0.1
#: Smallest number of periods of a line over the travel; fewer are indistinguishable from the load.
MIN_PERIODS = 8
#: Power of a line over the median of its neighbours. A χ² of two degrees of freedom exceeds this
#: with a probability of 2^-16.
LEAST_POWER = 16.0
#: Half width of the neighbourhood, in orders of one period over the travel.
NEIGHBOURS = 25
#: Smallest distance of two lines, in periods over the travel: a line whose amplitude changes with
#: the load has sidebands, which are not separate lines.
SEPARATION = 6
#: Maximum number of lines.
MAX_LINES = 6


@dataclass(frozen=True, eq=False)
class DeflectionMotion:
    """Moving samples of one joint, shape (samples,) each."""

    t: np.ndarray  # instants [s]
    angle: np.ndarray  # of the motor [rad]
    deflection: np.ndarray  # motor angle over gear ratio less the retimed link angle [rad]
    torque: np.ndarray  # low-passed, less that of the motor's inertia [N m]
    # the torque that follows from the reference; the torque itself without one [N m]
    followed: np.ndarray
    torque_rate: np.ndarray  # derivative of the torque [N m/s]
    speed: np.ndarray  # low-passed [rad/s]
    sign: np.ndarray  # smoothed sign of the speed
    direction: np.ndarray  # in which the torque moves, -1 to 1
    # functions of the reference, shape (samples, functions), or None
    instruments: np.ndarray | None
    # remaining delay of the shifted link encoder and its standard error [s]; None: to be estimated
    known_lag: tuple[float, float] | None
    retimed: float  # by how much the link encoder was moved back [s]
    recorded: tuple[float, float]  # lowest and highest recorded difference of the encoders [rad]


def deflection_motion(
    recording: Recording,
    joint: int,
    motor_inertia: float,
    reduction: float,
    cutoff: float,
    known_lag: tuple[float, float] | None,
    gamma: float | None,
    retimed: float = 0.0,
) -> DeflectionMotion:
    """Signals of the samples in motion.

    ``known_lag``: how much later the link encoder is read, and its standard error [s]. ``gamma``:
    slope of the smoothed sign of friction [s/rad]; None: it changes within 2 % of the highest
    speed. ``retimed``: by how much the link encoder is moved back [s].
    """
    if recording.q_link is None:
        raise IdentificationError(
            f"recording {recording.name!r} has no link encoder",
            advice="name its columns as q_link, or use the resonance in the loop "
            "(pivident.studies.flexibility.resonance)",
        )
    rate = recording.rate
    cutoff = min(cutoff, 0.4 * rate)
    q, tau = recording.q[:, joint], recording.tau[:, joint]
    if recording.torque_timing == "held" and recording.control_rate <= 1.01 * rate:
        tau = 0.5 * (tau + np.concatenate([tau[:1], tau[:-1]]))
    speed = central_difference(butterworth(q, rate, cutoff, 2), rate)
    acceleration = central_difference(speed, rate)
    torque = butterworth(tau, rate, cutoff, 2) - motor_inertia * acceleration
    fastest = float(np.abs(speed).max())
    kept = np.abs(speed) > STANDSTILL * fastest
    edge = math.ceil(rate / cutoff)
    kept[:edge] = kept[-edge:] = False
    if kept.sum() < MIN_SAMPLES:
        raise IdentificationError(
            f"joint {recording.joint_names[joint]!r} of recording {recording.name!r} moves for "
            f"{kept.sum()} samples",
            advice=f"{MIN_SAMPLES} are needed: record a longer motion",
        )
    if gamma is None:
        sign = np.tanh(speed / (0.5 * STANDSTILL * fastest))
    else:
        sign = 2 / np.pi * np.arctan(gamma * speed)
    raw = q - recording.q_link[:, joint]
    deflection = q - _earlier(recording.q_link[:, joint], rate, retimed)
    functions = _reference_functions(recording)
    followed = torque
    if functions is not None:
        followed = functions @ np.linalg.lstsq(functions[kept], torque[kept], rcond=None)[0]
    direction = _stop(followed, TRANSITION * float(np.ptp(followed[kept])))
    return DeflectionMotion(
        t=recording.t[kept],
        angle=reduction * q[kept],
        deflection=deflection[kept],
        torque=torque[kept],
        followed=followed[kept],
        torque_rate=central_difference(torque, rate)[kept],
        speed=speed[kept],
        sign=sign[kept],
        direction=direction[kept],
        instruments=None if functions is None else functions[kept],
        known_lag=None if known_lag is None else (known_lag[0] - retimed, known_lag[1]),
        retimed=retimed,
        recorded=(float(raw[kept].min()), float(raw[kept].max())),
    )


def _earlier(x: np.ndarray, rate: float, lag: float) -> np.ndarray:
    """x(t + lag) by a cubic spline, held beyond the ends."""
    if lag == 0.0:
        return x
    at = np.arange(len(x), dtype=float)
    return cubic_spline(at, x)(np.clip(at + lag * rate, 0, len(x) - 1))


def _reference_functions(recording: Recording) -> np.ndarray | None:
    """Functions of the reference that determine the torque of a moving arm, free of noise."""
    if recording.q_ref is None:
        return None
    q = recording.q_ref
    dq = central_difference(q, recording.rate)
    ddq = central_difference(dq, recording.rate)
    sign = np.tanh(dq / (STANDSTILL * np.maximum(np.abs(dq).max(axis=0), 1e-12)))
    centred = q - q.mean(axis=0)
    parts = [dq, sign, ddq, dq**2, np.sin(q), np.cos(q), ddq * centred, ddq * centred**2]
    columns = np.column_stack([np.ones(len(q)), *parts])
    return columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)


def _stop(x: np.ndarray, width: float) -> np.ndarray:
    """Stop operator: direction in which x moves, -1 to 1 within a change of x by ``width``."""
    z = np.zeros(len(x))
    scale = 2.0 / max(width, 1e-300)
    for i in range(1, len(x)):
        z[i] = min(1.0, max(-1.0, z[i - 1] + scale * (x[i] - x[i - 1])))
    return z


@dataclass(frozen=True)
class TransmissionLine:
    """One periodic part of the transmission error."""

    order: float  # cycles per revolution of the motor
    amplitude: Measured  # of the deflection [rad]


def line_columns(angle: np.ndarray, orders: Sequence[float]) -> np.ndarray:
    """Cosine and sine of each order, shape (samples, 2·orders)."""
    columns = [f(order * angle) for order in orders for f in (np.cos, np.sin)]
    return np.column_stack(columns) if columns else np.empty((len(angle), 0))


def largest_order(angle: np.ndarray, rate: float) -> float:
    """Order whose frequency reaches 80 % of half the sampling rate at the highest speed."""
    fastest = float(np.abs(np.gradient(angle)).max()) * rate
    return 0.8 * math.pi * rate / max(fastest, 1e-12)


def find_orders(residual: np.ndarray, angle: np.ndarray, highest: float) -> list[float]:
    """Orders of the lines in a residual, strongest first.

    One line at a time is found in the spectrum over the motor's angle and subtracted together with
    all earlier ones.
    """
    from scipy.ndimage import median_filter

    period = 2 * math.pi / max(float(np.ptp(angle)), 1e-12)
    lowest, step = MIN_PERIODS * period, 0.5 * period
    if highest <= lowest + 2 * NEIGHBOURS * step:
        return []
    grid = np.arange(lowest, highest, step)
    orders: list[float] = []
    left = residual - residual.mean()
    for _ in range(MAX_LINES):
        power = _power(left, angle, grid)
        background = median_filter(power, 4 * NEIGHBOURS + 1, mode="mirror")
        for order in orders:
            power[np.abs(grid - order) < SEPARATION * period] = 0.0
        best = int(np.argmax(power / background))
        if power[best] < LEAST_POWER * background[best]:
            break
        fine = grid[best] + step * np.linspace(-1, 1, 41)
        orders.append(float(fine[np.argmax(_power(left, angle, fine))]))
        columns = line_columns(angle, orders)
        left = residual - residual.mean()
        left = left - columns @ np.linalg.lstsq(columns, left, rcond=None)[0]
    return orders


def _power(x: np.ndarray, angle: np.ndarray, orders: np.ndarray) -> np.ndarray:
    """|Σ x exp(-i o angle)|² of each order; a raised cosine over the travel keeps lines narrow."""
    low, travel = float(angle.min()), float(np.ptp(angle))
    weighted = x * (0.5 - 0.5 * np.cos(2 * np.pi * (angle - low) / travel))
    power = np.empty(len(orders))
    for k, order in enumerate(orders):
        phase = order * angle
        power[k] = (weighted @ np.cos(phase)) ** 2 + (weighted @ np.sin(phase)) ** 2
    return power


@dataclass(frozen=True, eq=False)
class DeflectionFit:
    """A linear fit of the deflection, with its jackknife."""

    names: tuple[str, ...]  # of the terms; those of the transmission error come last
    columns: np.ndarray  # regressors, shape (samples, terms)
    theta: np.ndarray  # coefficients, shape (terms,)
    replicates: np.ndarray  # coefficients without each block, shape (blocks, terms)
    line_count: int  # number of columns of the transmission error
    by_lag: np.ndarray  # change of each coefficient by one standard error of the known lag

    @property
    def has_stiffness(self) -> bool:
        """Whether the compliance is significantly positive."""
        return self.value("torque") - STUDENT * self.std("torque") > 0

    def value(self, name: str) -> float:
        """Coefficient of a term."""
        return float(self.theta[self.names.index(name)])

    def std(self, name: str) -> float:
        """Its standard error, including that of the known lag."""
        i = self.names.index(name)
        return math.hypot(jackknife_standard_error(self.replicates[:, i]), self.by_lag[i])

    def ratio(self, name: str) -> float:
        """Coefficient over standard error."""
        return self.value(name) / max(self.std(name), 1e-300)

    def measured(
        self, name: str, unit: str, factor: float = 1.0, inverse: str | None = None
    ) -> Measured:
        """A term times ``factor`` with its interval; ``inverse``: unit of 1/coefficient."""
        value, std = self.value(name), self.std(name)
        if inverse is not None:
            return Measured.inverse(value, std, inverse, STUDENT)
        return Measured.around(factor * value, abs(factor) * std, unit, STUDENT)

    def of_lines(self) -> np.ndarray:
        """Part of the deflection that is transmission error, shape (samples,) [rad]."""
        n = self.line_count
        return self.columns[:, len(self.theta) - n :] @ self.theta[len(self.theta) - n :]

    def lines(self, orders: Sequence[float]) -> tuple[TransmissionLine, ...]:
        """Transmission error, largest amplitude first."""
        first = len(self.theta) - self.line_count
        found = []
        for i, order in enumerate(orders):
            pair = slice(first + 2 * i, first + 2 * i + 2)
            amplitude = float(np.hypot(*self.theta[pair]))
            along = self.replicates[:, pair] @ self.theta[pair] / max(amplitude, 1e-300)
            std = jackknife_standard_error(along)
            found.append(TransmissionLine(order, Measured.around(amplitude, std, "rad", STUDENT)))
        return tuple(sorted(found, key=lambda line: -line.amplitude.value))

    def over_compliance(self, name: str, unit: str) -> Measured:
        """-coefficient/compliance, with its own jackknife."""
        i, j = self.names.index(name), self.names.index("torque")
        if not self.has_stiffness:
            return Measured.unknown(unit)
        value = -self.theta[i] / self.theta[j]
        std = jackknife_standard_error(-self.replicates[:, i] / self.replicates[:, j])
        return Measured.around(value, std, unit, STUDENT)


def fit_deflection(
    motion: DeflectionMotion, orders: Sequence[float], optional: Sequence[str]
) -> DeflectionFit:
    """Least squares, or instrumental variables where there is a reference.

    ``optional``: which of damping, hysteresis and backlash are fitted too.
    """
    columns = {
        "torque": motion.torque,
        "speed": motion.speed,
        "sign": motion.sign,
        "offset": np.ones(len(motion.t)),
    }
    if "damping" in optional:
        columns["damping"] = motion.torque_rate
    if "hysteresis" in optional:
        columns["hysteresis"] = motion.direction
    if "backlash" in optional:
        spring = torque_through_spring(motion, fit_deflection(motion, orders, ()), motion.followed)
        columns["backlash"] = np.tanh(spring / (0.5 * TRANSITION * np.ptp(spring)))
    lines = line_columns(motion.angle, orders)
    phi = np.column_stack([*columns.values(), lines])
    z = phi.copy()
    if motion.instruments is not None:
        for name in ("torque", "damping"):
            if name in columns:
                i = list(columns).index(name)
                basis = motion.instruments
                z[:, i] = basis @ np.linalg.lstsq(basis, phi[:, i], rcond=None)[0]
    names = (*columns, *(f"line {i}" for i in range(lines.shape[1])))
    if motion.known_lag is None:
        theta, replicates = solve_with_jackknife(phi, z, motion.deflection)
        return DeflectionFit(names, phi, theta, replicates, lines.shape[1], np.zeros(len(theta)))
    return _with_known_lag(names, phi, z, motion, lines.shape[1])


def _with_known_lag(
    names: tuple[str, ...],
    phi: np.ndarray,
    z: np.ndarray,
    motion: DeflectionMotion,
    line_count: int,
) -> DeflectionFit:
    """The fit with a fixed lag; its standard error is propagated to the other terms."""
    assert motion.known_lag is not None
    lag, lag_std = motion.known_lag
    at = names.index("speed")
    others = [i for i in range(len(names)) if i != at]
    theta, by_lag = np.zeros(len(names)), np.zeros(len(names))
    replicates = np.full((BLOCKS, len(names)), lag)
    y = motion.deflection - lag * motion.speed
    theta[others], replicates[:, others] = solve_with_jackknife(phi[:, others], z[:, others], y)
    moved, _ = solve_with_jackknife(phi[:, others], z[:, others], y - lag_std * motion.speed)
    theta[at], by_lag[at] = lag, lag_std
    by_lag[others] = moved - theta[others]
    return DeflectionFit(names, phi, theta, replicates, line_count, by_lag)


def torque_through_spring(
    motion: DeflectionMotion, fit: DeflectionFit, torque: np.ndarray | None = None
) -> np.ndarray:
    """Torque after the friction before the spring, if the stiffness is known [N m]."""
    torque = motion.torque if torque is None else torque
    compliance = fit.value("torque")
    if not fit.has_stiffness:
        return torque
    return torque + fit.value("sign") / compliance * motion.sign
