"""Standstill that is noisier than motion, and is excluded.

Near standstill the friction law is steep, Coulomb's term multiplies what noise the smoothed speed
has left, and the residual is not the encoder noise that prefilters and standard errors are made
for. Its weight by inverse variance would be small, and most of what it adds is bias. On measured
records the mask excludes those samples, for the sake of the friction model; on simulated ones,
where standstill may be worth as much as motion, the residual decides joint by joint.

A prefilter that inverts a controller carries what it has seen of the excluded samples into those
after them, where an arm held by dry friction may have a residual many times that of its motion.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.estimation.equation_record import EquationRecord
from pivident.estimation.full_rate import BLOCK
from pivident.estimation.problem import Problem
from pivident.motion.kinematics import MOTION_BAND
from pivident.signals.prefilter import Prefilter
from pivident.threads import run_in_threads

#: Ratio of variances, standstill to motion, from which on slow samples are excluded: their weight
#: by inverse variance would be below a tenth.
NOISY_STANDSTILL = 10.0

#: Samples that either side of that comparison needs.
MIN_ROWS = 200


def decided_by_residual(problem: Problem) -> bool:
    """Whether the residual decides: on simulated records for which no mask is given."""
    return problem.mask == "auto" and all(r.simulated for r in problem.recordings)


def noisy_standstill(
    problem: Problem,
    filters: Sequence[Prefilter],
    records: Sequence[EquationRecord],
    residuals: Sequence[np.ndarray],
) -> np.ndarray:
    """Joints whose filtered residual is much larger at standstill than in motion.

    Only frequencies of the motion count: the rest does not touch the estimate.

    ``residuals``: τ - Φθ of each recording, shape (joints, samples). Result: true where the
    variances differ by more than ``NOISY_STANDSTILL``, shape (joints,).
    """
    sums = np.zeros((2, 2, len(filters)))  # standstill or motion; rows, squares
    for record, residual in zip(records, residuals, strict=True):
        kin, slow = record.kinematics, slow_samples(problem, record)

        def add(j: int, kin=kin, residual=residual, slow=slow) -> None:
            usable = slice(kin.start, kin.stop)
            whitened = filters[j].stream(1).process(residual[j : j + 1, usable])[0]
            settled = slice(filters[j].transient(), None)
            squares = _squares_in_band(whitened, kin.recording.rate)[settled]
            still = slow[j, usable][settled]
            moving = without_recent(~still, filters[j].transient())
            for i, group in enumerate((still, moving)):
                sums[i, :, j] += group.sum(), squares[group].sum()

        run_in_threads(add, range(len(filters)))
    rows, squares = sums[:, 0], sums[:, 1]
    enough = (rows > MIN_ROWS).all(axis=0)
    still, moving = squares / np.maximum(rows, 1.0)
    return enough & (still > NOISY_STANDSTILL * moving)


def remembers_standstill(
    filters: Sequence[Prefilter],
    records: Sequence[EquationRecord],
    residuals: Sequence[np.ndarray],
) -> np.ndarray:
    """Joints whose samples with standstill in the filter's memory cost more than they are worth.

    Of c + m samples, m have r times the mean square of the other c in the motion's band. An
    estimate from all of them, weighted alike, has the variance (c + r m)/(c + m)² of one sample's,
    and one from the c alone 1/c: the m are left out where r > 2 + m/c.

    ``residuals``: τ - Φθ of each recording, shape (joints, samples). Result: shape (joints,).
    """
    sums = np.zeros((2, 2, len(filters)))  # settled or not; rows, squares
    for record, residual in zip(records, residuals, strict=True):

        def add(j: int, record=record, residual=residual) -> None:
            used, rate = record.used[j], record.kinematics.recording.rate
            whitened = filters[j].stream(1).process(residual[j : j + 1])[0]
            squares = _squares_in_band(np.where(used, whitened, 0.0), rate)
            settled = without_recent(used, filters[j].transient())
            for i, group in enumerate((used & settled, used & ~settled)):
                sums[i, :, j] += group.sum(), squares[group].sum()

        run_in_threads(add, range(len(filters)))
    (clean, after), squares = sums[:, 0], sums[:, 1]
    remembers = np.array([not prefilter.begins_anew for prefilter in filters])
    enough = remembers & (clean > MIN_ROWS) & (after > 0)
    ratio = squares[1] * clean / np.maximum(squares[0] * after, 1e-300)
    return enough & (ratio > 2.0 + after / np.maximum(clean, 1.0))


def slow_samples(problem: Problem, record: EquationRecord) -> np.ndarray:
    """Samples at which the instruments stand still, shape (joints, samples)."""
    source = record.kinematics if record.motion is None else record.motion
    low = problem.low_speeds(record.kinematics.recording)
    samples = record.used.shape[1]
    slow = np.empty((len(low), samples), bool)
    for first in range(0, samples, BLOCK):
        span = slice(first, min(first + BLOCK, samples))
        slow[:, span] = np.abs(source.stretch(span)[1]) < low[:, None]
    return slow


def without_recent(used: np.ndarray, length: int) -> np.ndarray:
    """Samples in use that have none but such among the ``length`` samples before them.

    ``used``: shape (samples,); before the first sample none is.
    """
    index = np.arange(used.size)
    latest = np.maximum.accumulate(np.where(used, -1, index))
    return index - latest > length


def _squares_in_band(signal: np.ndarray, rate: float) -> np.ndarray:
    """Squares of a signal within the motion's band, shape (samples,)."""
    from scipy.signal import butter, sosfiltfilt

    low_pass = butter(2, min(MOTION_BAND, rate / 8.0), fs=rate, output="sos")
    return np.asarray(sosfiltfilt(low_pass, signal) ** 2)
