"""Stiffness of a joint from encoders on both sides of its gear, in slow motion.

The deflection, motor angle over gear ratio less link angle, is

    δ = q_m - q_l = T/k - (d/k²) dT + ϑ dq_m - (f/k) s(dq_m) - h z + (b/2) s(T) + ε(N q_m) + δ₀
    T = tau - Jm ddq_m

k stiffness, d damping, ϑ how much later the link encoder is read, f Coulomb friction before the
spring, 2h width of the hysteresis loop with z the direction in which the torque moves, b backlash,
ε transmission error (see `transmission_error`), δ₀ the difference of the encoders' zeros. Viscous
friction before the spring looks like ϑ, a delay of the torque like d. The link
encoder is moved back by a first estimate of ϑ, since the lag's second order, -ϑ²/2 ddq, would look
like a stiffer spring.

Torque and acceleration are low-passed without phase. Where the reference was recorded, they are
instrumented with their part that follows from it, so that noise of the torque cannot make the
spring look stiff. Deviations come from leaving out blocks of the motion in turn (jackknife): they
hold what the model does not explain, too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from pivident.errors import IdentificationError
from pivident.flexibility.measured import Measured
from pivident.flexibility.transmission_error import (
    TransmissionLine,
    find_orders,
    largest_order,
    line_columns,
)
from pivident.recording.recording import Recording
from pivident.signals.bandpass import butterworth, central_difference

#: Blocks of the jackknife, and the 97.5 % point of Student's t with one degree fewer.
BLOCKS, STUDENT = 10, 2.262

#: Cut-off of torque and acceleration [Hz].
CUTOFF = 10.0

#: Joints below this share of their highest speed stand still: the sign of friction is not known.
STANDSTILL = 0.02

#: Share of the torque's range over which hysteresis and backlash change sides.
TRANSITION = 0.1

#: Samples by which an encoder may be late; more is viscous friction.
MOST_LAG = 20.0

#: A term that may or may not be there is kept beyond this many deviations.
CLEAR = 3.0

#: Share of the torque that must lie on each side of zero for backlash to show.
BOTH_SIDES = 0.1


@dataclass(frozen=True, eq=False)
class Compliance:
    """What the deflection of one joint is made of.

    Attributes:
        recording: name of the run.
        joint: name of the joint.
        stiffness: k [N m/rad].
        motor_inertia: Jm that was taken off the torque [kg m²].
        stiffness_change: change of k if Jm were a tenth larger [%].
        friction: Coulomb friction before the spring [N m].
        encoder_lag: how much later the link encoder is read [s]; holds the viscous friction before
            the spring, too.
        offset: difference of the encoders' zeros [rad].
        hysteresis: width of the loop of deflection over torque [rad].
        backlash: gap without torque, or None where the torque does not change its sign [rad].
        damping: d, with the torque's delay in it [N m s/rad].
        lines: transmission error.
        transmitted: lowest and highest torque through the spring [N m].
        deflection: lowest and highest part of the deflection that is due to it [rad].
        recorded: lowest and highest recorded difference of the encoders [rad].
        residual: rms of what is left [rad].
        unexplained: the same over the deflection's standard deviation.
        instrumented: whether instruments from the reference were used.
        notes: what to know, in sentences.
        fitted: deflection and model without lines over the torque, shape (3, samples), to draw.
    """

    recording: str
    joint: str
    stiffness: Measured
    motor_inertia: float
    stiffness_change: float
    friction: Measured
    encoder_lag: Measured
    offset: Measured
    hysteresis: Measured
    backlash: Measured | None
    damping: Measured
    lines: tuple[TransmissionLine, ...]
    transmitted: tuple[float, float]
    deflection: tuple[float, float]
    recorded: tuple[float, float]
    residual: float
    unexplained: float
    instrumented: bool
    notes: tuple[str, ...]
    fitted: np.ndarray = field(repr=False)


@dataclass(frozen=True, eq=False)
class _Motion:
    """Moving samples of one joint; ``followed`` is the torque that follows from the reference."""

    t: np.ndarray
    angle: np.ndarray
    deflection: np.ndarray
    torque: np.ndarray
    followed: np.ndarray
    torque_rate: np.ndarray
    speed: np.ndarray
    sign: np.ndarray
    direction: np.ndarray
    instruments: np.ndarray | None
    known_lag: tuple[float, float] | None
    retimed: float
    recorded: tuple[float, float]


def identify_compliance(
    recording: Recording,
    joint: int = 0,
    *,
    motor_inertia: float = 0.0,
    reduction: float = 1.0,
    cutoff: float = CUTOFF,
    encoder_lag: tuple[float, float] | None = None,
    gamma: float | None = None,
) -> Compliance:
    """Stiffness and its companions of one joint, from both its encoders.

    Args:
        recording: has ``q_link``.
        joint: index of the joint.
        motor_inertia: Jm on the joint side [kg m²]; 0 leaves the motor's inertia in the torque.
        reduction: N, for orders of the transmission error per revolution of the motor.
        cutoff: of torque and acceleration [Hz].
        encoder_lag: how much later the link encoder is read, and the deviation of that [s], where
            it is known; None: it is estimated.
        gamma: slope of the smoothed sign of friction [s/rad]; None: it changes within 2 % of the
            highest speed.

    Raises:
        IdentificationError: there is no link encoder, or too little motion.
    """
    name = recording.joint_names[joint]
    settings = (reduction, cutoff, encoder_lag, gamma)
    motion = _motion(recording, joint, motor_inertia, *settings)
    retimed = _fit(motion, (), ()).value("speed")
    if abs(retimed) * recording.rate < MOST_LAG:
        motion = _motion(recording, joint, motor_inertia, *settings, retimed)
    orders = _orders(motion, recording, joint, reduction)
    plain = _fit(motion, orders, ())
    backlash = _torque_changes_sides(_through_spring(motion, plain))
    optional = ["hysteresis", "damping"] + (["backlash"] if backlash else [])
    tried = {term: _fit(motion, orders, (term,)) for term in optional}
    kept = tuple(term for term in optional if abs(tried[term].ratio(term)) > CLEAR)
    final = _fit(motion, orders, kept) if kept else plain
    tried |= {term: final for term in kept}
    notes = _notes(recording, motion, final, kept, motor_inertia)
    k = final.measured("torque", "", inverse="N m/rad")
    compliance = final.value("torque")
    torque = _through_spring(motion, final)
    strained = torque * compliance
    left = motion.deflection - final.columns @ final.theta
    without_lines = motion.deflection - final.of_lines()
    slope = tried["damping"]
    damping = Measured(math.nan, -math.inf, math.inf, "N m s/rad")
    if slope.tells_stiffness:
        of_one = compliance**2
        value, std = -slope.value("damping") / of_one, slope.std("damping") / of_one
        damping = Measured.around(value, std, "N m s/rad", STUDENT)
    other = _fit(
        _motion(recording, joint, 1.1 * motor_inertia, *settings, motion.retimed), orders, kept
    ).value("torque")
    return Compliance(
        recording=recording.name,
        joint=name,
        stiffness=k,
        motor_inertia=motor_inertia,
        stiffness_change=100 * (compliance / other - 1) if final.tells_stiffness else math.nan,
        friction=_ratio(final, "sign", "N m"),
        encoder_lag=_lag(final, motion),
        offset=final.measured("offset", "rad"),
        hysteresis=tried["hysteresis"].measured("hysteresis", "rad", -2.0),
        backlash=tried["backlash"].measured("backlash", "rad", 2.0) if backlash else None,
        damping=damping,
        lines=final.lines(orders),
        transmitted=(float(torque.min()), float(torque.max())),
        deflection=(float(strained.min()), float(strained.max())),
        recorded=motion.recorded,
        residual=float(np.sqrt(np.mean(left**2))),
        unexplained=float(np.std(left) / np.std(motion.deflection)),
        instrumented=motion.instruments is not None,
        notes=notes,
        fitted=np.vstack([torque, without_lines, without_lines - left]),
    )


def identify_compliances(
    recording: Recording,
    motor_inertia: np.ndarray,
    reduction: np.ndarray,
    *,
    cutoff: float = CUTOFF,
) -> tuple[Compliance, ...]:
    """All joints of a record; a joint that leaves its stiffness open takes the others' lag.

    The encoders behind the gears are read together, so joints share their lag up to the viscous
    friction before the spring, which the spread of the lags holds.

    Args:
        recording: has ``q_link``.
        motor_inertia: of each joint, on the joint side, shape (joints,) [kg m²].
        reduction: N of each joint, shape (joints,).
        cutoff: of torque and acceleration [Hz].

    Raises:
        IdentificationError: there is no link encoder, or too little motion.
    """

    def one(joint: int, lag: tuple[float, float] | None) -> Compliance:
        return identify_compliance(
            recording,
            joint,
            motor_inertia=float(motor_inertia[joint]),
            reduction=float(reduction[joint]),
            cutoff=cutoff,
            encoder_lag=lag,
        )

    found = [one(joint, None) for joint in range(recording.joints)]
    known = [c.encoder_lag for c in found if math.isfinite(c.stiffness.high)]
    if len(known) >= 2:
        deviations = [(lag.high - lag.low) / (2 * STUDENT) for lag in known]
        weights = 1 / np.square(deviations)
        mean = float(np.average([lag.value for lag in known], weights=weights))
        spread = float(np.std([lag.value for lag in known], ddof=1))
        common = (mean, math.hypot(spread, float(weights.sum() ** -0.5)))
        for joint, compliance in enumerate(found):
            if not math.isfinite(compliance.stiffness.high):
                found[joint] = one(joint, common)
    return tuple(found)


@dataclass(frozen=True, eq=False)
class _Fit:
    """A linear fit of the deflection, with its jackknife."""

    names: tuple[str, ...]
    columns: np.ndarray
    theta: np.ndarray
    replicates: np.ndarray
    line_count: int
    by_lag: np.ndarray

    @property
    def tells_stiffness(self) -> bool:
        """Whether the compliance is clearly positive."""
        return self.value("torque") - STUDENT * self.std("torque") > 0

    def value(self, name: str) -> float:
        return float(self.theta[self.names.index(name)])

    def std(self, name: str) -> float:
        i = self.names.index(name)
        return math.hypot(_jackknife(self.replicates[:, i]), self.by_lag[i])

    def ratio(self, name: str) -> float:
        return self.value(name) / max(self.std(name), 1e-300)

    def measured(
        self, name: str, unit: str, factor: float = 1.0, inverse: str | None = None
    ) -> Measured:
        value, std = self.value(name), self.std(name)
        if inverse is not None:
            return Measured.inverse(value, std, inverse, STUDENT)
        return Measured.around(factor * value, abs(factor) * std, unit, STUDENT)

    def of_lines(self) -> np.ndarray:
        n = self.line_count
        return self.columns[:, len(self.theta) - n :] @ self.theta[len(self.theta) - n :]

    def lines(self, orders: Sequence[float]) -> tuple[TransmissionLine, ...]:
        first = len(self.theta) - self.line_count
        found = []
        for i, order in enumerate(orders):
            pair = slice(first + 2 * i, first + 2 * i + 2)
            amplitude = float(np.hypot(*self.theta[pair]))
            along = self.replicates[:, pair] @ self.theta[pair] / max(amplitude, 1e-300)
            std = _jackknife(along)
            found.append(TransmissionLine(order, Measured.around(amplitude, std, "rad", STUDENT)))
        return tuple(sorted(found, key=lambda line: -line.amplitude.value))


def _jackknife(replicates: np.ndarray) -> float:
    """Standard deviation from the estimates without each block."""
    n = len(replicates)
    return float(np.sqrt((n - 1) / n * np.sum((replicates - replicates.mean()) ** 2)))


def _lag(fit: _Fit, motion: _Motion) -> Measured:
    """How much later the link encoder is read: what was moved and what is left [s]."""
    lag = motion.retimed + fit.value("speed")
    return Measured.around(lag, fit.std("speed"), "s", STUDENT)


def _ratio(fit: _Fit, name: str, unit: str) -> Measured:
    """-coefficient/compliance, with its own jackknife."""
    i, j = fit.names.index(name), fit.names.index("torque")
    if not fit.tells_stiffness:
        return Measured(math.nan, -math.inf, math.inf, unit)
    value = -fit.theta[i] / fit.theta[j]
    std = _jackknife(-fit.replicates[:, i] / fit.replicates[:, j])
    return Measured.around(value, std, unit, STUDENT)


def _motion(
    recording: Recording,
    joint: int,
    motor_inertia: float,
    reduction: float,
    cutoff: float,
    known_lag: tuple[float, float] | None,
    gamma: float | None,
    retimed: float = 0.0,
) -> _Motion:
    """Signals of the samples in motion."""
    if recording.q_link is None:
        raise IdentificationError(
            f"recording {recording.name!r} has no link encoder; name its columns as q_link, or use "
            "the resonance in the loop (pivident.flexibility.resonance)"
        )
    rate = recording.rate
    cutoff = min(cutoff, 0.4 * rate)
    q, tau = recording.q[:, joint], recording.tau[:, joint]
    if recording.torque_timing == "held" and recording.control_rate <= 1.01 * rate:
        tau = 0.5 * (tau + np.concatenate([tau[:1], tau[:-1]]))
    smooth = butterworth(q, rate, cutoff, 2)
    speed = central_difference(smooth, rate)
    acceleration = central_difference(speed, rate)
    torque = butterworth(tau, rate, cutoff, 2) - motor_inertia * acceleration
    fastest = float(np.abs(speed).max())
    kept = np.abs(speed) > STANDSTILL * fastest
    edge = math.ceil(rate / cutoff)
    kept[:edge] = kept[-edge:] = False
    if kept.sum() < 20 * BLOCKS:
        raise IdentificationError(
            f"joint {recording.joint_names[joint]!r} of recording {recording.name!r} moves for "
            f"{kept.sum()} samples; {20 * BLOCKS} are needed: record a longer motion"
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
    return _Motion(
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
    from scipy.interpolate import CubicSpline

    if lag == 0.0:
        return x
    at = np.arange(len(x), dtype=float)
    return CubicSpline(at, x)(np.clip(at + lag * rate, 0, len(x) - 1))


def _reference_functions(recording: Recording) -> np.ndarray | None:
    """What the torque of a moving arm follows from, of the reference: free of the log's noise."""
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


def _orders(
    motion: _Motion, recording: Recording, joint: int, reduction: float
) -> tuple[float, ...]:
    """Orders of the transmission error, from what the other terms leave of the deflection."""
    plain = _fit(motion, (), ())
    highest = largest_order(reduction * recording.q[:, joint], recording.rate)
    return tuple(
        find_orders(motion.deflection - plain.columns @ plain.theta, motion.angle, highest)
    )


def _fit(motion: _Motion, orders: Sequence[float], optional: Sequence[str]) -> _Fit:
    """Least squares, or instrumental variables where the reference is there."""
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
        spring = _through_spring(motion, _fit(motion, orders, ()), motion.followed)
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
        theta, replicates = _solve_with_jackknife(phi, z, motion.deflection)
        return _Fit(names, phi, theta, replicates, lines.shape[1], np.zeros(len(theta)))
    return _with_known_lag(names, phi, z, motion, lines.shape[1])


def _with_known_lag(
    names: tuple[str, ...], phi: np.ndarray, z: np.ndarray, motion: _Motion, line_count: int
) -> _Fit:
    """The fit with the lag held at its value; its deviation is handed on to the others."""
    assert motion.known_lag is not None
    lag, deviation = motion.known_lag
    at = names.index("speed")
    others = [i for i in range(len(names)) if i != at]
    theta, by_lag = np.zeros(len(names)), np.zeros(len(names))
    replicates = np.full((BLOCKS, len(names)), lag)
    y = motion.deflection - lag * motion.speed
    theta[others], replicates[:, others] = _solve_with_jackknife(phi[:, others], z[:, others], y)
    moved, _ = _solve_with_jackknife(phi[:, others], z[:, others], y - deviation * motion.speed)
    theta[at], by_lag[at] = lag, deviation
    by_lag[others] = moved - theta[others]
    return _Fit(names, phi, theta, replicates, line_count, by_lag)


def _solve_with_jackknife(
    phi: np.ndarray, z: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(ZᵀΦ)⁻¹Zᵀy, of all samples and without each block."""
    bounds = np.linspace(0, len(y), BLOCKS + 1).astype(int)
    parts = [slice(a, b) for a, b in pairwise(bounds)]
    scale = np.maximum(np.linalg.norm(phi, axis=0), 1e-300)
    phi, z = phi / scale, z / np.maximum(np.linalg.norm(z, axis=0), 1e-300)
    moments = np.array([z[p].T @ phi[p] for p in parts])
    right = np.array([z[p].T @ y[p] for p in parts])
    whole, all_right = moments.sum(axis=0), right.sum(axis=0)
    theta = np.linalg.lstsq(whole, all_right, rcond=1e-10)[0] / scale
    without = [
        np.linalg.lstsq(whole - m, all_right - r, rcond=1e-10)[0] / scale
        for m, r in zip(moments, right, strict=True)
    ]
    return theta, np.array(without)


def _through_spring(motion: _Motion, fit: _Fit, torque: np.ndarray | None = None) -> np.ndarray:
    """Torque behind the friction before the spring, as far as that is known [N m]."""
    torque = motion.torque if torque is None else torque
    compliance = fit.value("torque")
    if not fit.tells_stiffness:
        return torque
    return torque + fit.value("sign") / compliance * motion.sign


def _torque_changes_sides(torque: np.ndarray) -> bool:
    """Whether a gap would be crossed, and stayed beyond on both sides."""
    share = float(np.mean(torque > 0))
    return min(share, 1 - share) > BOTH_SIDES


def _notes(
    recording: Recording,
    motion: _Motion,
    fit: _Fit,
    kept: Sequence[str],
    motor_inertia: float,
) -> tuple[str, ...]:
    """What to know about this estimate."""
    notes = []
    if motion.instruments is None:
        notes.append(
            "no reference was recorded: noise of the torque makes the spring look stiffer, by its "
            f"share of the torque's variance below {CUTOFF:g} Hz"
        )
    if motor_inertia == 0.0:
        notes.append("the motor's inertia is not known: its torque counts as transmitted")
    lag = (motion.retimed + fit.value("speed")) * float(np.abs(motion.speed).max())
    strain = fit.value("torque") * float(np.ptp(motion.torque))
    late = _lag(fit, motion)
    if late.clear and abs(lag) > 0.1 * abs(strain):
        notes.append(
            f"{1e3 * abs(lag):.2g} mrad of the recorded difference at the highest speed are the "
            f"encoders' different instants ({1e3 * late.value:.3g} ms), not deflection"
        )
    if motion.known_lag is not None:
        notes.append("the link encoder's lag is that of the other joints")
    if fit.value("torque") + STUDENT * fit.std("torque") <= 0:
        notes.append(
            "the deflection moves against the torque, which no spring does: torque, speed and "
            "direction change together in this motion, or the deflection has another cause"
        )
    elif fit.value("torque") - STUDENT * fit.std("torque") <= 0:
        notes.append(
            "the record does not bound the stiffness from above: the torque changes too little, or "
            "only together with friction or backlash"
        )
    if kept:
        notes.append(f"clear terms: {', '.join(kept)}")
    return tuple(notes)
