"""A drive that is given a speed: its law, from how the axis follows its speed setpoint.

    s = D q_ref + K e + i/k_v,     u = k_v (w + k_i ∫w),     w = s(t - T) - D q

e = q_ref - q; i are the known inputs, which enter before the integrator; T is the way of the
setpoint to the drive. Least squares on u fails here: the integrator is so stiff (1/(k_v k_i) is of
the order of 10 µrad per unit of u) that errors of that size in positions and times outweigh
the output, and gains come out with the wrong sign. Positions are then what the law commands to the
last digit. Integrated over time the law is

    q_ref(t - T) - q(t) - u/(k_v k_i) = -K ∫e(t - T) - 1/k_v ∫i(t - T) + c + b t

but for w/k_i, with c from the integrator's state and b from an offset between encoders: linear save
for T, over which the fit is projected. The small u/(k_v k_i) is that of the pass before. The
integrator follows from the output beyond the band of the motion,

    H u = k_v H w + k_v k_i H ∫w,     H a band-pass

where the small errors of the setpoint do not matter any more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.control_law.law_equations import Channel

#: Ways of the setpoint to the drive, and of the speed into the output, tried [sampling periods].
DELAYS = np.arange(0.0, 21.0)
LAGS = np.arange(0.0, 1.6, 0.25)

#: The band-pass H: from how many times the frequency below which this share of the reference
#: speed's power lies, to which share of the sampling rate.
BEYOND, MOTION = 8.0, 0.999
UPPER = 0.25

#: Passes between the two equations, and standard errors that k_v k_i must have to be used there.
PASSES, STIFF = 3, 2.0

#: Windows of the jackknife in each recording: the residual is slow.
WINDOWS = 8

#: Share of the position error's variance that a speed setpoint must explain to be believed.
EXPLAINED = 0.99


@dataclass(frozen=True, eq=False)
class SpeedSetpoint:
    """The law of one joint as a cascade with a speed setpoint."""

    position_gain: float  # K [1/s]
    #: k_v [u per rad/s or m/s], from the known inputs; without them, from the noise.
    speed_gain: float
    noise_gain: float  # k_v from the output beyond the band of the motion
    integral_gain: float  # k_i [1/s], from k_v k_i of the output beyond the motion's band
    delay: float  # T [s]
    std: np.ndarray  # robust standard errors of these five, same order
    explained: float  # share of the position error's variance that the setpoint explains
    #: Share of the output's variance beyond ``cutoff`` that the speed loop does.
    loop_explained: float
    cutoff: float  # of the high-pass H [Hz]
    #: Recorded q_ref(t - T) - q of the first recording [rad or m], shape (samples,).
    error: np.ndarray
    model: np.ndarray  # what the law makes of it
    rms: float  # of the difference over all recordings [rad or m]
    samples: int  # samples used

    @property
    def believable(self) -> bool:
        """Whether the position error is explained and all gains are significantly positive."""
        gains = (self.position_gain, self.speed_gain, self.noise_gain, self.integral_gain)
        return self.explained > EXPLAINED and bool(np.all(gains > 2.0 * self.std[:4]))


def speed_setpoint(channels: Sequence[Channel], inputs: Sequence[np.ndarray]) -> SpeedSetpoint:
    """Find the speed setpoint and the speed loop of one joint.

    ``inputs``: sum of the known inputs in each recording, shape (samples,) [u].
    """
    known = any(np.ptp(i) > 0.0 for i in inputs)
    cutoff = BEYOND * _motion_band(channels)
    output = [c.u + i for c, i in zip(channels, inputs, strict=True)]
    compliance = 0.0
    for _ in range(PASSES):
        outer = _outer_loop(channels, inputs if known else None, [compliance * u for u in output])
        per_input = outer.gains[1] if known else 0.0
        setpoints = [
            _setpoint(c, i, outer.gains[0], per_input, outer.delay)
            for c, i in zip(channels, inputs, strict=True)
        ]
        inner, inner_std, loop_explained = _speed_loop(channels, setpoints, output, cutoff)
        compliance = 1.0 / inner[1] if inner[1] > STIFF * inner_std[1] else 0.0
    kv, kv_std = float(inner[0]), float(inner_std[0])
    if known:
        kv, kv_std = 1.0 / outer.gains[1], outer.std[1] / outer.gains[1] ** 2
    integral = inner[1] / kv
    integral_std = abs(integral) * float(np.hypot(inner_std[1] / inner[1], kv_std / kv))
    first, use = int(channels[0].use.sum()), channels[0].use
    measured, model = np.full((2, use.size), np.nan)
    measured[use], model[use] = outer.error[:first], outer.model[:first]
    left = outer.error - outer.model
    centred = np.concatenate([x - x.mean() for x in _split(outer.error, channels)])
    return SpeedSetpoint(
        position_gain=float(outer.gains[0]),
        speed_gain=kv,
        noise_gain=float(inner[0]),
        integral_gain=float(integral),
        delay=outer.delay,
        std=np.array([outer.std[0], kv_std, inner_std[0], integral_std, outer.std[-1]]),
        explained=1.0 - float(left @ left) / float(centred @ centred),
        loop_explained=loop_explained,
        cutoff=cutoff,
        error=measured,
        model=model,
        rms=float(np.sqrt(np.mean(left**2))),
        samples=left.size,
    )


def as_seen_by_the_drive(recording: Recording, laws: Sequence[SpeedSetpoint]) -> Recording:
    """The recording with the reference as it arrives: T later, known inputs part of its speed."""
    assert recording.q_ref is not None
    t = np.arange(recording.samples) / recording.rate
    inputs = sum(recording.inputs.values(), np.zeros(recording.q.shape))
    q_ref, dq_ref = np.empty_like(recording.q), np.empty_like(recording.q)
    for j, law in enumerate(laws):
        q_ref[:, j] = _spline(recording.q_ref[:, j], recording.rate)(t - law.delay)
        speed = _reference_speed(recording.q_ref[:, j], recording.dq_ref, j, recording.rate)
        wanted = speed + inputs[:, j] / law.speed_gain
        dq_ref[:, j] = _spline(wanted, recording.rate)(t - law.delay)
    return replace(recording, q_ref=q_ref, dq_ref=dq_ref, ddq_ref=None, inputs={})


class _OuterLoop(NamedTuple):
    """Gains [K, 1/k_v if there are inputs, offsets], T, standard errors (T last), and fit."""

    gains: np.ndarray
    delay: float
    std: np.ndarray
    error: np.ndarray
    model: np.ndarray


def _outer_loop(
    channels: Sequence[Channel],
    inputs: Sequence[np.ndarray] | None,
    wound: Sequence[np.ndarray],
) -> _OuterLoop:
    """The law integrated over time, fitted to positions; ``wound`` is u/(k_v k_i)."""
    h = 1.0 / channels[0].rate
    signals = [
        (
            _spline(c.q_ref, c.rate),
            [
                _spline(x, c.rate).antiderivative()
                for x in (c.q_ref - c.q, *(() if inputs is None else (inputs[k],)))
            ],
        )
        for k, c in enumerate(channels)
    ]

    def equations(delay: float) -> tuple[np.ndarray, np.ndarray]:
        return _position_equations(channels, signals, wound, delay)

    delay = _smallest(lambda T: _fit(*equations(T))[1], DELAYS * h)
    columns, error = equations(delay)
    gains, _ = _fit(columns, error)
    step = 0.01 * h
    ahead, behind = equations(delay + step), equations(delay - step)
    slope = ((ahead[0] - behind[0]) @ gains - (ahead[1] - behind[1])) / (2.0 * step)
    std = _deviations(np.column_stack([columns, slope]), error - columns @ gains, channels)
    return _OuterLoop(gains, delay, std, error, columns @ gains)


def _position_equations(
    channels: Sequence[Channel],
    signals: Sequence[tuple[Any, Sequence[Any]]],
    wound: Sequence[np.ndarray],
    delay: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Columns [-∫e, -∫i, 1 and t of each recording] and the error, on the samples that count.

    ``signals``: splines of the reference and of the integrals, for each recording.
    """
    columns, error = [], []
    for k, (c, (reference, integrals)) in enumerate(zip(channels, signals, strict=True)):
        t = _time(c)[c.use]
        late = np.maximum(t - delay, 0.0)
        offsets = np.zeros((t.size, 2 * len(channels)))
        offsets[:, 2 * k], offsets[:, 2 * k + 1] = 1.0, t - t.mean()
        columns.append(np.column_stack([*(-integral(late) for integral in integrals), offsets]))
        error.append(reference(t - delay) - (c.q + wound[k])[c.use])
    return np.concatenate(columns), np.concatenate(error)


def _speed_loop(
    channels: Sequence[Channel],
    setpoints: Sequence[np.ndarray],
    output: Sequence[np.ndarray],
    cutoff: float,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Gains [k_v, k_v k_i], their standard errors, and the share of the output explained."""
    from scipy.signal import butter, sosfiltfilt

    rate = channels[0].rate
    band = butter(3, (cutoff, UPPER * rate), btype="band", fs=rate, output="sos")
    u = np.concatenate([sosfiltfilt(band, x)[c.use] for c, x in zip(channels, output, strict=True)])
    passed = []
    for c, s in zip(channels, setpoints, strict=True):
        w = _spline(s - _spline(c.q, rate).derivative()(_time(c)), rate)
        pair = (w(_time(c)), w.antiderivative()(_time(c)))
        passed.append([_spline(sosfiltfilt(band, x), rate) for x in pair])

    def columns_of(lag: float) -> np.ndarray:
        late = [_time(c)[c.use] - lag for c in channels]
        return np.concatenate(
            [np.column_stack([x(t) for x in pair]) for t, pair in zip(late, passed, strict=True)]
        )

    columns = columns_of(_smallest(lambda lag: _fit(columns_of(lag), u)[1], LAGS / rate))
    gains, left = _fit(columns, u)
    return gains, _deviations(columns, u - columns @ gains, channels), 1.0 - left / float(u @ u)


def _motion_band(channels: Sequence[Channel]) -> float:
    """Frequency below which nearly all power of the reference speed is [Hz].

    At least one step of the spectrum: a reference that stays where it is has no power.
    """
    from scipy.signal import periodogram

    bands = []
    for c in channels:
        frequency, power = periodogram(np.diff(c.q_ref), c.rate, window="hann")
        within = np.cumsum(power) / max(float(np.sum(power)), 1e-300)
        highest = int(np.searchsorted(within, MOTION)) if power.any() else 1
        bands.append(float(frequency[np.clip(highest, 1, frequency.size - 1)]))
    return min(max(bands), 0.5 * UPPER * channels[0].rate / BEYOND)


def _setpoint(
    channel: Channel, inputs: np.ndarray, position_gain: float, per_input: float, delay: float
) -> np.ndarray:
    """s(t - T), shape (samples,)."""
    c = channel
    speed = c.dq_ref if c.dq_ref is not None else _spline(c.q_ref, c.rate).derivative()(_time(c))
    s = speed + position_gain * (c.q_ref - c.q) + per_input * inputs
    return _spline(s, c.rate)(_time(c) - delay)


def _fit(columns: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, float]:
    """Least squares on columns of unit length: gains and residual sum of squares."""
    scale = np.sqrt(np.sum(columns**2, axis=0))
    scale[scale == 0.0] = 1.0
    gains = np.linalg.lstsq(columns / scale, y, rcond=1e-13)[0] / scale
    return gains, float(np.sum((y - columns @ gains) ** 2))


def _smallest(cost: Callable[[float], float], tried: np.ndarray) -> float:
    """The delay of the smallest cost, found between neighbours of the best one tried [s]."""
    from scipy.optimize import minimize_scalar

    best = int(np.argmin([cost(float(delay)) for delay in tried]))
    bounds = tried[max(best - 1, 0)], tried[min(best + 1, tried.size - 1)]
    return float(minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 1e-7}).x)


def _deviations(
    columns: np.ndarray, residual: np.ndarray, channels: Sequence[Channel]
) -> np.ndarray:
    """Robust standard errors of the linear fit with these columns, a jackknife over windows."""
    from pivident.estimation.covariance.sandwich import sandwich
    from pivident.estimation.covariance.windows import Windows
    from pivident.estimation.normal_equations import JointSums

    scale = np.sqrt(np.mean(columns**2, axis=0))
    scale[scale == 0.0] = 1.0
    sums = JointSums.empty("", np.arange(scale.size), WINDOWS * len(channels))
    start = 0
    for k, own in enumerate(_split(residual, channels)):
        windows = Windows(own.size, WINDOWS, k * WINDOWS)
        part = slice(start, start + own.size)
        shares = list(windows.shares(slice(0, own.size)))
        sums.add((columns[part] / scale).T, None, own, None, shares)
        start += own.size
    return np.sqrt(np.diag(sandwich([sums], np.zeros(scale.size), np.ones(1)))) / scale


def _split(x: np.ndarray, channels: Sequence[Channel]) -> list[np.ndarray]:
    """A concatenated signal by recording."""
    return np.split(x, np.cumsum([int(c.use.sum()) for c in channels])[:-1])


def _time(channel: Channel) -> np.ndarray:
    return np.arange(channel.q.size) / channel.rate


def _spline(x: np.ndarray, rate: float) -> Any:
    """Cubic spline through samples."""
    from scipy.interpolate import CubicSpline

    return CubicSpline(np.arange(x.size) / rate, x)


def _reference_speed(
    q_ref: np.ndarray, dq_ref: np.ndarray | None, j: int, rate: float
) -> np.ndarray:
    """Recorded speed of the reference, or its derivative."""
    if dq_ref is not None:
        return dq_ref[:, j]
    return np.asarray(_spline(q_ref, rate).derivative()(np.arange(q_ref.size) / rate))
