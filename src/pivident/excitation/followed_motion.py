"""Did the robot run the motion that was designed? Its recorded positions beside the design.

The record begins at any time before or within the motion. The start s is where the squared
difference of the positions, each joint over its variance in the motion, is least,

    J(s) = Σ_j Σ_t (q_j(t + s) - d_j(t))² / var d_j,

over all s by the cross-correlation of q and d, and then between samples by Newton steps. Before its
first and after its last sample the record counts as resting.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.excitation.motions import ExcitingMotion
from pivident.recording.recording import Recording

#: Rate at which motions are compared [Hz].
RATE = 50.0

#: A joint deviates from the design if the rms of its difference exceeds this share of the rms of
#: its motion; half of the joints beyond the second share make it another motion.
DEVIATES, ANOTHER = 0.1, 0.5

#: A motion of which less than this share was recorded is not the one that was designed.
MIN_COVERED = 0.5

#: A joint moves where its speed exceeds this share of its largest one in the design.
MOVES = 0.05

#: Joints that move less than this share of the one that moves most weigh no more.
MIN_SPREAD = 1e-3


@dataclass(frozen=True, eq=False)
class FollowedMotion:
    """How a recorded motion compares with a designed one.

    Attributes:
        recording: name of the recording.
        joint_names: names of the joints.
        starts: when the motion begins, once for each time that it was run, in seconds after the
            first sample of the recording.
        rms: rms of the difference of the positions, shape (joints,) [rad or m].
        share: the same over the rms of the designed motion about its mean, shape (joints,).
        covered: share of the duration of the designed motion that was recorded, the mean over
            ``starts``.
        other: how long the record moves before or after the designed motion [s].
    """

    recording: str
    joint_names: tuple[str, ...]
    starts: tuple[float, ...]
    rms: np.ndarray
    share: np.ndarray
    covered: float
    other: float

    @property
    def is_same(self) -> bool:
        """Whether the robot ran the designed motion, if not well then at least recognisably."""
        return bool(np.median(self.share) <= ANOTHER and self.covered >= MIN_COVERED)

    @property
    def deviating(self) -> tuple[str, ...]:
        """Joints that did not follow the design."""
        pairs = zip(self.joint_names, self.share, strict=True)
        return tuple(name for name, share in pairs if share > DEVIATES)


def followed_motion(recording: Recording, motion: ExcitingMotion) -> FollowedMotion:
    """Compare a recording with a designed motion of the same joints.

    Args:
        recording: the recording.
        motion: the designed motion.

    Returns:
        When it was run, and how far the positions are from it.
    """
    rate = min(RATE, recording.rate)
    t = np.arange(int(recording.duration * rate) + 1) / rate
    own = np.arange(recording.samples) / recording.rate
    q = np.column_stack([np.interp(t, own, column) for column in recording.q.T])
    design, speed, _ = motion.sampled(rate)
    spread = design.std(axis=0)
    spread = np.maximum(spread, max(MIN_SPREAD * float(spread.max()), 1e-12))
    found = [
        _between_samples(q, t, motion, spread, start) for start in _starts(q, design, spread, rate)
    ]
    squared, count, inside = np.zeros(q.shape[1]), 0, np.zeros(t.size, dtype=bool)
    for start in found:
        here = _within(t, start, motion)
        difference = q[here] - motion.at(t[here] - start)[0]
        squared += (difference**2).sum(axis=0)
        count += int(here.sum())
        inside |= here
    rms = np.sqrt(squared / max(count, 1))
    moving = (np.abs(np.gradient(q, 1.0 / rate, axis=0)) > MOVES * np.abs(speed).max(axis=0)).any(
        axis=1
    )
    return FollowedMotion(
        recording.name,
        recording.joint_names,
        tuple(found),
        rms,
        rms / spread,
        min(1.0, count / (len(found) * len(design))),
        float((moving & ~inside).sum() / rate),
    )


def _starts(q: np.ndarray, design: np.ndarray, spread: np.ndarray, rate: float) -> list[float]:
    """When the motion begins, to a sample: where it fits best, and where it was run again [s]."""
    from scipy.signal import fftconvolve

    length = len(design)
    padded = np.pad(q, ((length - 1, length - 1), (0, 0)), mode="edge")
    middle = design.mean(axis=0)
    p, d = (padded - middle) / spread, (design - middle) / spread
    squares = np.vstack([np.zeros(p.shape[1]), np.cumsum(p**2, axis=0)])
    cross = fftconvolve(p, d[::-1], mode="valid", axes=0)
    cost = squares[length:] - squares[:-length] - 2.0 * cross + (d**2).sum(axis=0)
    shares = np.sqrt(np.maximum(cost, 0.0) / length)
    least = shares.mean(axis=1)
    starts = [int(np.argmin(least))]
    free = np.ones(least.size, dtype=bool)
    while True:
        free[max(0, starts[-1] - int(0.9 * length)) : starts[-1] + int(0.9 * length) + 1] = False
        # another run is recorded as a whole: what is padded would fit a motion that rests
        free[: length - 1], free[len(q) :] = False, False
        fits = free & (np.median(shares, axis=1) <= DEVIATES)
        if not fits.any() or np.median(shares[starts[0]]) > ANOTHER:
            return [(start - length + 1) / rate for start in sorted(starts)]
        starts.append(int(np.argmin(np.where(fits, least, np.inf))))


def _between_samples(
    q: np.ndarray, t: np.ndarray, motion: ExcitingMotion, spread: np.ndarray, start: float
) -> float:
    """A start between samples, by Newton steps; at most one sample away."""
    first, step = start, t[1] - t[0]
    for _ in range(4):
        here = _within(t, start, motion)
        if not here.any():
            return first
        place, speed, _, _ = motion.at(t[here] - start)
        slope = speed / spread
        total = float((slope**2).sum())
        if total == 0.0:
            return first
        start -= float((slope * (q[here] - place) / spread).sum()) / total
        start = float(np.clip(start, first - step, first + step))
    return start


def _within(t: np.ndarray, start: float, motion: ExcitingMotion) -> np.ndarray:
    """Samples that are taken while the motion is run."""
    return (t >= start - 1e-9) & (t <= start + motion.duration + 1e-9)
