"""Did the robot run the motion that was designed? Its recorded positions beside the design.

The record begins at any time before or within the motion. For a start s, the rms of the difference
of joint j over the samples that both have, relative to its spread in the motion, is

    e_j(s)² = mean_t (q_j(t + s) - d_j(t))² / var d_j.

Sums over all s come from cross-correlations of q, q² and d with each other and with the samples
that there are. The start has the least mean of all e_j, each bounded, so that a joint that
went elsewhere leaves it to the others; it is then refined between samples by Newton steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.foundation.text.display import Displayed
from pivident.studies.excitation.motions import ExcitingMotion

#: Rate at which motions are compared [Hz].
RATE = 50.0

#: A joint deviates from the design if the rms of its difference exceeds this share of the rms of
#: its motion; half of the joints beyond the second share make it another motion.
DEVIATES, ANOTHER = 0.1, 0.5

#: A motion of which less than this share was recorded is not the one that was designed.
MIN_COVERED = 0.5

#: A joint moves where its speed exceeds this share of its largest one in the design.
MOVES = 0.05

#: The spread of a joint counts as at least this share of that of the one that moves most.
MIN_SPREAD = 0.01

#: A start must leave this share of the motion to compare; what is missing counts like so much
#: relative difference.
MIN_COMMON, MISSING = 0.2, 1.0

#: Largest relative difference of a joint that counts for the start.
MAX_SHARE = 1.2


@dataclass(frozen=True, eq=False)
class FollowedMotion(Displayed):
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
    middle = design.mean(axis=0)
    p, d = (q - middle) / spread, (design - middle) / spread
    reversed_d, ones = d[::-1], np.ones((length, 1))
    # full correlations: entry k belongs to the start at sample k - length + 1
    common = np.rint(fftconvolve(np.ones((len(q), 1)), ones, axes=0))
    squares = (
        fftconvolve(p**2, np.broadcast_to(ones, d.shape), axes=0)
        - 2.0 * fftconvolve(p, reversed_d, axes=0)
        + fftconvolve(np.ones_like(p), reversed_d**2, axes=0)
    )
    shares = np.minimum(np.sqrt(np.maximum(squares, 0.0) / common), MAX_SHARE)
    covered = common[:, 0] / length
    least = np.where(
        covered >= min(MIN_COMMON, covered.max()),
        shares.mean(axis=1) + MISSING * (1.0 - covered),
        np.inf,
    )
    starts = [int(np.argmin(least))]
    free = (covered > 1.0 - 0.5 / length) & (np.median(shares, axis=1) <= DEVIATES)
    while True:
        # one run after the other; those after the best one are recorded as a whole
        free[max(0, starts[-1] - int(0.9 * length)) : starts[-1] + int(0.9 * length) + 1] = False
        if not free.any() or np.median(shares[starts[0]]) > ANOTHER:
            return [(start - length + 1) / rate for start in sorted(starts)]
        starts.append(int(np.argmin(np.where(free, least, np.inf))))


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
