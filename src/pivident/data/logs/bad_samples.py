"""Samples of a log that are no measurement: missing, impossible, repeated, frozen, out of place.

Each fault belongs to one channel of one joint, or to whole rows. Its samples become NaN, so that
whoever reads on leaves them out of that joint's equations and uses the rest.

Torques that keep a value for a while though their joint moves: a logger that lost its source.

No threshold in units can tell this from a coarse channel, whose value stays as well. The channel
itself can: where it is fine enough to change in half of the samples of every other stretch, it does
not keep one value through a whole one by chance. A logged speed may: axes move evenly.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pivident.data.logs.misplaced_positions import MIN_ROWS, excursions, frozen_positions
from pivident.data.logs.timestamps import moves, runs_of

#: Values above this are no measurement in any unit, and overflow a spline; nor are values so many
#: times as large as nearly all others.
LARGEST, BEYOND_OTHERS = 1e100, 1e6
#: Share of the travel of a fast joint from which on rows count as motion.
IN_MOTION = 0.05
#: Samples over which that travel is measured.
TRAVEL = 20
#: Step behind repeated rows, over those around it, from which on they hide motion.
CATCHES_UP = 1.4
#: Share of repeated rows from which on the source is taken for slower than the log.
MOSTLY = 0.45
#: Share of the new rows that come at equal distances, where the source is slower.
REGULAR = 0.95
#: Largest share of a channel that may be left out.
TOLERATED = 0.5
#: What each kind of fault is, behind the name of the channel.
WORDS = {
    "missing": "is empty, NaN or infinite",
    "impossible": "is no measurement",
    "zero rows": "is zero at every joint, away from the motion on both sides,",
    "repeated rows": "repeats the one before while the arm moves",
    "frozen position": "keeps its value while its joint moves on, which one step then makes good,",
    "outlier": "leaves the motion and comes back",
    "frozen torque": "stays the same while its joint moves, as it never does elsewhere,",
}
#: Share of the samples below which one end of a record is filled up.
END = 0.01
#: Shortest stretch [samples] that is asked about, less does no harm, and fewest others to compare
#: with.
SHORTEST, FEWEST = 20, 5
#: It is compared with stretches of its own length, but no longer than the record over this.
COMPARED = 20
#: Share of the samples of each other stretch at which the value changes.
USUAL_CHANGES = 0.5


@dataclass(frozen=True, eq=False)
class BadSamples:
    """One fault of a log."""

    kind: str  # one of `WORDS`
    channel: str  # the channel that has it, empty: whole rows
    joint: int  # column of that channel, -1: all of them
    rows: np.ndarray  # numbers of the samples, shape (bad samples,)

    def name(self, joint_names: Sequence[str]) -> str:
        """The signal, such as ``q of elbow``, or ``the row``."""
        if self.joint < 0:
            return f"{self.channel} of all joints" if self.channel else "the row"
        return f"{self.channel} of {joint_names[self.joint]}"

    def within(self, start: int, stop: int) -> BadSamples:
        """The fault in a part of the log, by the numbers of its samples."""
        return replace(self, rows=self.rows[(self.rows >= start) & (self.rows < stop)] - start)


def bad_samples(
    channels: Mapping[str, np.ndarray], t: np.ndarray | None = None
) -> tuple[BadSamples, ...]:
    """Find what is no measurement.

    Args:
        channels: channels as they were logged, shape (samples, joints).
        t: stamps of the positions, shape (samples,), where they are known.

    Returns:
        The faults; of each sample of a channel the first one counts.
    """
    faults: list[BadSamples] = []
    clean = dict(channels)
    for channel, values in channels.items():
        for j, x in enumerate(values.T):
            missing = ~np.isfinite(x)
            known = np.abs(x[~missing])
            usual = float(np.quantile(known, 0.99)) if known.size else 0.0
            limit = min(LARGEST, BEYOND_OTHERS * usual) if usual > 0.0 else LARGEST
            impossible = ~missing & (np.abs(x) > limit)
            faults += [
                BadSamples(kind, channel, j, np.flatnonzero(wrong))
                for kind, wrong in (("missing", missing), ("impossible", impossible))
                if wrong.any()
            ]
        clean[channel] = without(values, [f for f in faults if f.channel == channel])
    q = clean.get("q")
    if q is None or len(q) < MIN_ROWS:
        return tuple(faults)
    for kind, rows in (("zero rows", _at_zero(q, t)), ("repeated rows", None)):
        rows = _repeated(clean) if rows is None else rows
        if rows.any():
            faults.append(BadSamples(kind, "", -1, np.flatnonzero(rows)))
            clean = marked(clean, faults[-1:])
    tau = clean.get("tau")
    if tau is not None and tau.shape == q.shape:
        faults += _frozen_torques(tau, clean["q"])
    return (*faults, *_of_positions(clean["q"], t))


def without(values: np.ndarray, faults: Sequence[BadSamples]) -> np.ndarray:
    """A channel with NaN in place of bad samples, itself where there are none."""
    if not faults:
        return values
    values = np.array(values, dtype=float)
    for fault in faults:
        inside = fault.rows[fault.rows < len(values)]
        values[inside, slice(None) if fault.joint < 0 else fault.joint] = np.nan
    return values


def marked(
    channels: Mapping[str, np.ndarray], faults: Sequence[BadSamples]
) -> dict[str, np.ndarray]:
    """Channels with NaN in place of all bad samples; whole rows are those of positions."""
    samples = len(channels["q"]) if "q" in channels else 0
    return {
        key: without(
            values,
            [f for f in faults if f.channel == key or (not f.channel and len(values) == samples)],
        )
        for key, values in channels.items()
    }


def fresh_rows(channels: Mapping[str, np.ndarray]) -> tuple[np.ndarray, int] | None:
    """Rows with new values where most rows repeat the one before, because the source is slower.

    Args:
        channels: channels as they were logged, shape (samples, joints).

    Returns:
        The rows to keep, shape (samples,), and how many rows there are for each of them; None where
        the source is as fast as the log, or its samples do not come regularly.
    """
    q = channels.get("q")
    if q is None or len(q) < MIN_ROWS:
        return None
    again, moving = _repeated(channels), _moving(q)
    if again.sum() <= MOSTLY * moving.sum():
        return None
    fresh = np.flatnonzero(moving & ~again)
    if fresh.size < MIN_ROWS // 2:
        return None
    every = round(float(np.median(np.diff(fresh))))
    phases = np.bincount(fresh % every, minlength=every)
    keep = np.zeros(len(q), bool)
    keep[int(phases.argmax()) :: every] = True
    return (keep, every) if every > 1 and phases.max() >= REGULAR * fresh.size else None


def _at_zero(q: np.ndarray, t: np.ndarray | None) -> np.ndarray:
    """Rows at which several joints jump to zero and back at once, shape (samples,)."""
    zero = (q == 0.0).all(axis=1)
    if q.shape[1] == 1 or not zero.any():
        return np.zeros(len(q), bool)
    apart = np.zeros(len(q), bool)
    for x in q.T:
        for start, stop in excursions(x, t)[0]:
            apart[start:stop] = True
    return apart & zero


def _repeated(channels: Mapping[str, np.ndarray]) -> np.ndarray:
    """Rows that repeat the one before in every measured channel while the arm moves, (samples,).

    Without a channel beside the positions a coarse encoder would look the same.
    """
    q = channels["q"]
    own = [x for k, x in channels.items() if k in ("q", "dq", "tau") and len(x) == len(q)]
    again = np.zeros(len(q), bool)
    if len(own) < 2:
        return again
    again[1:] = np.logical_and.reduce([(x[1:] == x[:-1]).all(axis=1) for x in own])
    moving = _moving(q)
    again &= moving
    if not again.any() or again.sum() > MOSTLY * moving.sum():
        return again  # a source that is slower throughout catches up at every new sample
    late = []
    for start, stop in runs_of(again)[:1000]:
        beside = np.abs(np.diff(q[max(0, start - 4) : stop + 4], axis=0))
        if stop + 3 < len(q) and start > 3:
            j = int(np.nanargmax(np.nan_to_num(beside).sum(axis=0)))
            usual = np.median(np.r_[beside[:3, j], beside[-3:, j]])
            if usual > 0.0 and np.isfinite(q[[stop - 1, stop], j]).all():
                late.append(abs(q[stop, j] - q[stop - 1, j]) / usual)
    if not late or not np.median(late) > CATCHES_UP:
        again[:] = False
    return again


def _moving(q: np.ndarray) -> np.ndarray:
    """Rows around which some joint travels, shape (samples,)."""
    span = min(TRAVEL, len(q) // 4)
    travel = np.abs(np.nan_to_num(q[span:] - q[:-span]))
    moving = (travel > IN_MOTION * np.maximum(travel.max(axis=0), 1e-300)).any(axis=1)
    half = span // 2
    return np.pad(moving, (half, len(q) - len(moving) - half), mode="edge")


def _of_positions(q: np.ndarray, t: np.ndarray | None) -> Iterator[BadSamples]:
    """Frozen encoders and excursions, joint by joint."""
    for j, x in enumerate(q.T):
        frozen = frozen_positions(x)
        if frozen.size:
            yield BadSamples("frozen position", "q", j, frozen)
            x = x.copy()
            x[frozen] = np.nan
        out = excursions(x, t)[0]
        if out:
            rows = np.concatenate([np.arange(start, stop) for start, stop in out])
            yield BadSamples("outlier", "q", j, rows)


def frozen_samples(x: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Samples at which a torque keeps its value as it never does elsewhere.

    Args:
        x: torque of a joint, shape (samples,).
        q: position of the joint, shape (samples,).

    Returns:
        Truth values, shape (samples,).
    """
    frozen = np.zeros(x.size, bool)
    same = np.diff(x) == 0.0
    kept = [
        (first, last + 1)
        for first, last in runs_of(same).tolist()
        if last + 1 - first >= _shortest(first, last + 1, x.size) and moves(q, first, last + 1)
    ]
    longest = max((stop - start for start, stop in kept), default=0)
    if 2 * longest > x.size:
        return frozen
    kept = [(start, stop) for start, stop in kept if 2 * (stop - start) >= longest]
    for start, stop in kept:
        frozen[start:stop] = True
    length = min(longest, max(SHORTEST, x.size // COMPARED))
    fewest = _fewest_changes(~same, frozen, q, length) if kept else 0
    return frozen if fewest >= USUAL_CHANGES * length else np.zeros(x.size, bool)


def _shortest(start: int, stop: int, samples: int) -> float:
    """Shortest stretch that counts: at the ends of a record a shifted channel is filled up."""
    return SHORTEST if start > 0 and stop < samples else max(SHORTEST, END * samples)


def _fewest_changes(changes: np.ndarray, left_out: np.ndarray, q: np.ndarray, length: int) -> int:
    """Fewest changes within so many samples anywhere else while the joint moves."""
    starts = np.arange(0, q.size - length, max(1, length // 2))
    clean = ~sliding_window_view(left_out, length)[starts].any(axis=1)
    starts = np.array([k for k in starts[clean].tolist() if moves(q, k, k + length)], int)
    if starts.size < FEWEST:
        return 0
    return int(sliding_window_view(changes, length - 1)[starts].sum(axis=1).min())


def _frozen_torques(tau: np.ndarray, q: np.ndarray) -> Iterator[BadSamples]:
    """Torques that keep their value although the joint moves."""
    for j, (x, position) in enumerate(zip(tau.T, q.T, strict=True)):
        known = np.flatnonzero(np.isfinite(x) & np.isfinite(position))
        if known.size >= MIN_ROWS:
            frozen = known[frozen_samples(x[known], position[known])]
            # one that stays at a limit is cut off
            frozen = frozen[(x[frozen] > np.min(x[known])) & (x[frozen] < np.max(x[known]))]
            if frozen.size:
                yield BadSamples("frozen torque", "tau", j, frozen)
