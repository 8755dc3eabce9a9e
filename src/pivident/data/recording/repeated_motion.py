"""Noise from repetition: what does not repeat when a motion is repeated.

The residual of a real machine is mostly model error, and model error repeats: the same joint at
the same place and speed misses the same torque. Where a reference is periodic, or was run twice,
the residual at one instant of the motion, ε_{i,k} in repetition i = 1 … n, splits into

    ε_{i,k} = m_k + v_{i,k},   m̂_k = mean_i ε_{i,k},   v̂_{i,k} = (ε_{i,k} - m̂_k) √(n/(n-1))

with m the model error and v the noise; the root makes up for what the mean took from v. A noise
model for the prefilter of IDIM-PIV is then fitted to v̂ alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.foundation.errors import IdentificationError
from pivident.signals.noise_models import lagged_products, unmasked_stretches

#: Largest difference of two repetitions of a reference, as a share of its range …
SAME_REFERENCE = 1e-3

#: … and of measured positions, where there is no reference.
SAME_MOTION = 1e-2

#: A signal has left its starting point when its variance of differences exceeds this share of
#: what unrelated values would have.
_LEFT = 0.1


@dataclass(frozen=True, eq=False)
class RepeatedMotion:
    """Which samples belong to the same instant of a motion."""

    instants: tuple[np.ndarray, ...]  # of each sample by recording, (samples,), or -1
    count: int  # number of instants
    period: int | None  # samples of a period, None where whole recordings repeat each other
    description: str  # where the repetition was found, in words

    def split(
        self, signals: Sequence[np.ndarray], usable: Sequence[np.ndarray]
    ) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
        """Split signals into what repeats and what does not; signals (joints, samples)."""
        joints = signals[0].shape[0]
        total, times = np.zeros((2, joints, self.count + 1))  # the last one is nobody's
        for signal, counts, where in zip(signals, usable, self.instants, strict=True):
            for j in range(joints):
                total[j] += np.bincount(where, counts[j] * signal[j], self.count + 1)
                times[j] += np.bincount(where, counts[j], self.count + 1)
        times[:, -1] = 0.0
        mean = total / np.maximum(times, 1.0)
        repeating, rest, repetitions = [], [], []
        for signal, counts, where in zip(signals, usable, self.instants, strict=True):
            n = np.where(counts, times[:, where], 0.0)
            known = n > 1
            m = np.where(known, mean[:, where], 0.0)
            scale = np.sqrt(n / np.maximum(n - 1.0, 1.0))
            repeating.append(m)
            rest.append(np.where(known, (signal - m) * scale, 0.0))
            repetitions.append(n)
        return repeating, rest, repetitions


def repeated_motion(recordings: Sequence[Recording], period: int | None = None) -> RepeatedMotion:
    """Find the repetition, or say that there is none; see :func:`find_repetition`."""
    found = find_repetition(recordings, period)
    if found is None:
        raise IdentificationError(
            "no motion repeats: the reference is not periodic over two periods at least, and no "
            "two recordings follow the same one. Repeat the motion once, or judge the model error "
            "by held-out blocks"
        )
    return found


def find_repetition(
    recordings: Sequence[Recording], period: int | None = None
) -> RepeatedMotion | None:
    """Recordings of one motion, by reference or position and inputs, or a periodic motion."""
    instants: list[np.ndarray] = []
    offset, period_found, sentences = 0, None, []
    leaders: list[tuple[int, int]] = []  # recordings that others may repeat, their first instant
    twins: dict[int, int] = {}
    for k, recording in enumerate(recordings):
        leader = next((x for x in leaders if _same(recordings[x[0]], recording)), None)
        if leader is not None:
            twins[k] = leader[0]
            shared = min(recording.samples, recordings[leader[0]].samples)
            own = np.full(recording.samples, -1)
            own[:shared] = leader[1] + np.arange(shared)
            instants.append(own)
            continue
        leaders.append((k, offset))
        instants.append(offset + np.arange(recording.samples))
        offset += recording.samples
    sentences += [
        f"recordings {recordings[a].name!r} and {recordings[b].name!r} follow the same motion"
        for b, a in twins.items()
    ]
    for k, first in leaders:
        recording = recordings[k]
        if k in twins.values():
            continue
        length = period or find_period(recording)
        if length is None or 2 * length > recording.samples:
            continue
        instants[k] = first + np.arange(recording.samples) % length
        period_found = length
        sentences.append(
            f"the motion of {recording.name!r} has a period of {length} samples "
            f"({length / recording.rate:.4g} s), {recording.samples / length:.1f} of them"
        )
    if not sentences:
        return None
    placed = tuple(np.where(own < 0, offset, own) for own in instants)
    return RepeatedMotion(placed, offset, period_found, "; ".join(sentences))


def find_period(recording: Recording) -> int | None:
    """Shortest p [samples] at a dip of d(p) = mean_k (x_{k+p} - x_k)² where x repeats, or None."""
    signals, tolerance = _motion_signals(recording)
    signals = signals[:, np.ptp(signals, axis=0) > 0]
    if signals.shape[1] == 0:
        return None
    difference = np.max(
        [_squared_differences(x) / max(2.0 * x.var(), 1e-300) for x in signals.T], axis=0
    )
    away = difference > _LEFT
    away[: int(np.argmax(away))] = True  # the signal has not left its starting point yet
    for start, stop in unmasked_stretches(away) if away.any() else ():
        lag = start + int(np.argmin(difference[start:stop]))
        if lag > 0 and _repeats(signals, lag, tolerance):
            return lag
    return None


def _squared_differences(x: np.ndarray) -> np.ndarray:
    """mean_k (x_{k+p} - x_k)² for p = 0 … half the samples."""
    n, lags = x.size, np.arange(x.size // 2 + 1)
    x = x - x.mean()
    products = lagged_products(x, n // 2)
    squares = np.r_[0.0, np.cumsum(x**2)]
    overlap = squares[n - lags] + squares[n] - squares[lags]
    return np.maximum(overlap - 2.0 * products, 0.0) / (n - lags)


def _repeats(signals: np.ndarray, lag: int, tolerance: float) -> bool:
    """Whether no sample differs from the one a lag earlier by more than its share of the range."""
    change = np.abs(signals[lag:] - signals[:-lag]).max(axis=0)
    return bool((change <= tolerance * np.ptp(signals, axis=0)).all())


def _same(a: Recording, b: Recording) -> bool:
    """Whether two recordings follow the same motion, over at least half of the longer one."""
    shared = min(a.samples, b.samples)
    if a.rate != b.rate or a.joint_names != b.joint_names:
        return False
    if 2 * shared < max(a.samples, b.samples) or (a.q_ref is None) != (b.q_ref is None):
        return False
    x, tolerance = _motion_signals(a)
    y, _ = _motion_signals(b)
    if x.shape[1] != y.shape[1]:
        return False
    change = np.abs(x[:shared] - y[:shared]).max(axis=0)
    return bool((change <= tolerance * np.ptp(x, axis=0)).all())


def _motion_signals(recording: Recording) -> tuple[np.ndarray, float]:
    """What has to repeat, shape (samples, signals), and within which share of its range."""
    motion = recording.q if recording.q_ref is None else recording.q_ref
    tolerance = SAME_MOTION if recording.q_ref is None else SAME_REFERENCE
    return np.column_stack([motion, *recording.inputs.values()]), tolerance
