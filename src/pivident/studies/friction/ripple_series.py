"""Residuals in time with their motion, and waves fitted to them after whitening."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.data.recording.joint_order import in_order_of
from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.problem import LOW_SPEED
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import IdentificationError
from pivident.signals.noise_models import ArModel, fit_ar, unmasked_stretches
from pivident.studies.friction.order_spectrum import WhiteRows

#: Largest order of the noise model: a longer one would fit the lines themselves.
MAX_NOISE_ORDER = 20

#: Peaks of the spectrum above this many running medians over this many bins are cut before the
#: noise is modelled; noise exceeds this once in a thousand bins.
_PEAK, _PEAK_NEIGHBOURS = 10.0, 121

#: Maximum number of steps that refine orders and frequencies.
_REFINEMENTS = 8

#: A smaller step, in half resolutions, is the last one: the error falls with its square.
_SETTLED = 0.01


@dataclass(frozen=True, eq=False)
class ResidualSeries:
    """Residual of one recording; arrays (samples, joints) at equal intervals."""

    name: str  # of the recording
    t: np.ndarray  # time [s], shape (samples,)
    rate: float  # [Hz]
    q: np.ndarray  # positions [rad or m]
    dq: np.ndarray  # speeds [rad/s or m/s]
    error: np.ndarray  # τ - Φθ [N m or N]
    load: np.ndarray  # |Φθ| [N m or N]
    used: np.ndarray  # rows in use
    # half-power frequency of the position smoother [Hz], shape (joints,); NaN: unknown
    f50: np.ndarray


def residual_series(
    identification: Identification, recordings: Sequence[Recording] | None
) -> tuple[ResidualSeries, ...]:
    """Residuals of the fitted rows, or of recordings at their full rate."""
    if recordings is None:
        series = tuple(
            ResidualSeries(
                r.name, r.t, float(1.0 / np.median(np.diff(r.t))), r.q, r.dq,
                r.tau - r.tau_model, np.abs(r.tau_model), r.used,
                np.array([fit.f50 for fit in identification.joints]),
            )
            for r in identification.recordings
        )  # fmt: skip
    else:
        series = tuple(_predicted(identification, recording) for recording in recordings)
    if not series:
        raise IdentificationError("no residual to search for ripple", advice="give a recording")
    if np.ptp([s.rate for s in series]) > 1e-6 * series[0].rate:
        listed = ", ".join(f"{s.name} {s.rate:g} Hz" for s in series)
        raise IdentificationError(
            f"recordings have different sampling rates ({listed})", advice="search them one by one"
        )
    return series


def _predicted(identification: Identification, recording: Recording) -> ResidualSeries:
    robot = identification.robot
    recording = in_order_of(robot, recording)
    k = estimate_kinematics(recording, RandomWalk())
    part = slice(k.start, k.stop)
    q, dq, ddq, tau = (x[:, part].T for x in (k.q, k.dq, k.ddq, k.tau))
    model = identification.predict(q, dq, ddq)
    rated = np.where(np.isfinite(robot.rated_speeds), robot.rated_speeds, np.abs(dq).max(axis=0))
    used = np.abs(dq) >= LOW_SPEED * rated
    return ResidualSeries(
        recording.name, recording.t[part], recording.rate, q, dq, tau - model, np.abs(model), used,
        k.f50,
    )  # fmt: skip


def delayed(series: ResidualSeries, lag: float) -> ResidualSeries:
    """The same residual with the motion ``lag`` seconds earlier, linear between samples."""
    if lag == 0.0:
        return series
    samples = np.arange(series.t.size)
    then = samples - lag * series.rate
    q, dq = (
        np.column_stack([np.interp(then, samples, column) for column in x.T])
        for x in (series.q, series.dq)
    )
    return replace(series, q=q, dq=dq)


@dataclass(frozen=True, eq=False)
class Wave:
    """A wave a cos(nφ) + b sin(nφ) of an angle, or of the time of one recording."""

    coefficients: np.ndarray | None  # c of φ = c·q; None: φ is the time in ``record``
    order: float  # n [per angle, or rad/s]
    record: int = -1  # the recording; -1: all of them

    def angle(self, s: ResidualSeries) -> np.ndarray:
        """φ of a recording, shape (samples,)."""
        return s.t - s.t[0] if self.coefficients is None else s.q @ self.coefficients


@dataclass(frozen=True, eq=False)
class WaveFit:
    """Waves fitted together by generalised least squares."""

    waves: tuple[Wave, ...]  # with their orders refined
    coefficients: np.ndarray  # a, b of each wave, shape (waves, 2) [N m or N]
    # of a, b with known orders, shape (waves, 2, 2), for white noise of the model's variance,
    # without the local floor
    covariance: np.ndarray
    order_std: np.ndarray  # standard error of the orders, likewise, shape (waves,)
    left: tuple[np.ndarray, ...]  # residual without the waves, one array per recording
    noise: ArModel  # model of that residual
    scale: float  # standard deviation of its innovations

    @property
    def filter(self) -> np.ndarray:
        """A / s."""
        return self.noise.coefficients / self.scale


def whitened(coefficients: np.ndarray, x: np.ndarray) -> np.ndarray:
    """A x along axis 0, from rest."""
    from scipy.signal import lfilter

    return lfilter(coefficients, [1.0], x, axis=0)


def settled_rows(used: np.ndarray, order: int) -> np.ndarray:
    """Rows in use without the transient of the filter."""
    out = used.copy()
    out[:order] = False
    return out


def fit_noise(errors: Sequence[np.ndarray], used: Sequence[np.ndarray]) -> tuple[ArModel, float]:
    """Autoregressive model of a residual over the rows in use, and s of its innovations."""
    mask = np.concatenate([part for v in used for part in (~v, np.ones(1, bool))])
    joined = np.concatenate([part for e in errors for part in (_without_peaks(e), np.zeros(1))])
    stretches = unmasked_stretches(mask)
    lengths = stretches[:, 1] - stretches[:, 0]
    # half of the rows lie in stretches at least this long: shorter ones do not lower the order
    typical = int(np.sort(lengths)[np.searchsorted(np.cumsum(np.sort(lengths)), lengths.sum() / 2)])
    p_max = max(1, min(MAX_NOISE_ORDER, typical // 4))
    model = fit_ar(joined, p_max, "bic", segments=stretches, shortest=2 * p_max + 2)
    white = _white_rows(model, 1.0, [e - model.mean for e in errors], used)
    return model, float(white.std())


def _without_peaks(error: np.ndarray) -> np.ndarray:
    """The residual with the narrow peaks of its spectrum clipped.

    A noise model would fit a line of constant frequency and hide it, so it is fitted to a residual
    without lines. Ripple at constant speed is such a line too.
    """
    from scipy.ndimage import median_filter

    transformed = np.fft.rfft(error - error.mean())
    power = np.abs(transformed) ** 2
    level = median_filter(power, _PEAK_NEIGHBOURS, mode="nearest")
    cut = np.sqrt(np.minimum(1.0, _PEAK * level / np.maximum(power, 1e-300)))
    return np.fft.irfft(transformed * cut, error.size) + error.mean()


def fit_waves(
    series: Sequence[ResidualSeries],
    joint: int,
    waves: Sequence[Wave],
    noise: tuple[ArModel, float] | None = None,
) -> WaveFit:
    """Amplitudes of all waves, their orders refined by Gauss–Newton steps.

    ``noise``: model to start from; None: that of the residual itself.
    """
    errors = [s.error[:, joint] for s in series]
    used = [s.used[:, joint] for s in series]
    model, scale = noise or fit_noise(errors, used)
    if not waves:
        empty = np.zeros((0, 2))
        return WaveFit((), empty, np.zeros((0, 2, 2)), np.zeros(0), tuple(errors), model, scale)
    angles = [[wave.angle(s) for wave in waves] for s in series]
    orders = np.array([wave.order for wave in waves])
    reach = np.array(
        [np.pi / max(max(np.ptp(a[k]) for a in angles), 1e-12) for k in range(len(waves))]
    )
    right = _white_rows(model, scale, [e - model.mean for e in errors], used)
    beta = np.zeros(2 * len(waves))
    for step in range(_REFINEMENTS):
        columns, slopes = _columns(waves, orders, angles, beta)
        left = _white_rows(model, scale, columns, used)
        if step == 0:
            beta = _solved(left, right)
            continue
        both = np.hstack([left, _white_rows(model, scale, slopes, used)])
        solution = _solved(both, right)
        beta = solution[: beta.size]
        change = np.clip(solution[beta.size :], -reach / 2, reach / 2)
        orders = orders + change
        if np.all(np.abs(change) < _SETTLED * reach):
            break
    columns, slopes = _columns(waves, orders, angles, beta)
    left = _white_rows(model, scale, columns, used)
    both = np.hstack([left, _white_rows(model, scale, slopes, used)])
    spread = np.linalg.pinv(both.T @ both)
    fixed = np.linalg.pinv(left.T @ left)
    beta = _solved(left, right)
    remaining = tuple(e - c @ beta for e, c in zip(errors, columns, strict=True))
    count = len(waves)
    blocks = np.array([fixed[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] for k in range(count)])
    found = tuple(
        Wave(wave.coefficients, float(order), wave.record)
        for wave, order in zip(waves, orders, strict=True)
    )
    std = np.sqrt(np.maximum(np.diag(spread)[2 * count :], 0.0))
    model, scale = fit_noise(remaining, used)
    return WaveFit(found, beta.reshape(count, 2), blocks, std, remaining, model, scale)


def _solved(columns: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Least squares by the normal equations; whitened waves are well conditioned."""
    return np.linalg.pinv(columns.T @ columns, hermitian=True) @ (columns.T @ right)


def _columns(
    waves: Sequence[Wave], orders: np.ndarray, angles: list[list[np.ndarray]], beta: np.ndarray
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Cosines and sines of all waves, and their derivatives with respect to the orders."""
    columns, slopes = [], []
    for r, own in enumerate(angles):
        parts, turned = [], []
        for k, wave in enumerate(waves):
            present = 1.0 if wave.record in (-1, r) else 0.0
            c, s = np.cos(orders[k] * own[k]) * present, np.sin(orders[k] * own[k]) * present
            parts += [c, s]
            turned.append(own[k] * (beta[2 * k + 1] * c - beta[2 * k] * s))
        columns.append(np.column_stack(parts))
        slopes.append(np.column_stack(turned))
    return columns, slopes


def _white_rows(
    model: ArModel, scale: float, signals: Sequence[np.ndarray], used: Sequence[np.ndarray]
) -> np.ndarray:
    """Rows in use of signals, or of columns, of all recordings behind the filter."""
    return np.concatenate(
        [
            whitened(model.coefficients / scale, x)[settled_rows(v, model.order)]
            for x, v in zip(signals, used, strict=True)
        ]
    )


def white_rows(
    series: Sequence[ResidualSeries], joint: int, coefficients: np.ndarray, fit: WaveFit
) -> WhiteRows:
    """Residual of a joint after the waves of ``fit``, whitened, over the angle φ = c·q."""
    used = [settled_rows(s.used[:, joint], fit.noise.order) for s in series]
    return WhiteRows(
        _white_rows(
            fit.noise,
            fit.scale,
            [left - fit.noise.mean for left in fit.left],
            [s.used[:, joint] for s in series],
        ),
        np.concatenate([(s.q @ coefficients)[v] for s, v in zip(series, used, strict=True)]),
        np.concatenate(
            [(s.dq @ coefficients)[v] / s.rate for s, v in zip(series, used, strict=True)]
        ),
        fit.filter,
    )
