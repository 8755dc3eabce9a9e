"""Channels that were logged by clocks of their own, brought onto one uniform clock.

Topics of a bag, or files of two loggers, have stamps of their own at rates of their own. All are
interpolated at the same instants, over the stretch of time that all of them cover: positions,
references and torques by cubic splines, inputs held. Straight lines would damp torques: midway
between two samples by 1 - cos(π f / rate), 1 % at 5 Hz in a log of 100 Hz. A channel that is
reduced to a lower rate is low-passed first, forwards and backwards, so that nothing above the new
half rate folds down and nothing is delayed. Over gaps nothing is interpolated: they are refused,
and the stretches between them are named.

Bringing stamps together does not make good what happened before the stamps were taken. That delay
is a question to the motion, see `pivident.judgement.audit.delay`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.data.logs import timestamps
from pivident.data.logs.bad_samples import LARGEST
from pivident.data.logs.timestamps import bridged_interval, stretches_of
from pivident.foundation.errors import ClocksDisagree, GapInClock, RecordingError

#: A channel that is faster than the grid by this factor is low-passed before it is reduced.
REDUCED = 1.1

#: Cut-off of that low-pass, as share of the new rate.
CUTOFF = 0.4

#: Header stamps of two topics whose lead over their receipt differs by more are two clocks [s].
ONE_CLOCK = 1.0


@dataclass(frozen=True, eq=False)
class ClockedChannel:
    """A channel with the stamps of its own samples."""

    channel: str  # its name, such as ``tau``
    clock: str  # name of the column of stamps, for messages
    t: np.ndarray  # stamps, shape (samples,) [s]
    values: np.ndarray  # shape (samples, joints)
    lead: float | None = None  # of the stamps over the recorder's shared clock [s]
    notes: tuple[str, ...] = ()  # what was done so far, in sentences

    @property
    def rate(self) -> float:
        """Samples per second of recorded time, gaps left out [Hz]."""
        return timestamps.mean_rate(self.t)

    def between(self, start: float, stop: float) -> ClockedChannel:
        """The samples from the last one before ``start`` to the first one behind ``stop``."""
        first = max(int(np.searchsorted(self.t, start, side="right")) - 1, 0)
        last = int(np.searchsorted(self.t, stop, side="left")) + 1
        return replace(self, t=self.t[first:last], values=self.values[first:last])


@dataclass(frozen=True, eq=False)
class Aligned:
    """Channels on one uniform clock."""

    t: np.ndarray  # its times, shape (samples,) [s]
    rate: float  # its rate [Hz]
    values: dict[str, np.ndarray]  # channels by name, shape (samples, joints)
    notes: tuple[str, ...]  # what was done, in sentences


def have_one_clock(channels: Sequence[ClockedChannel]) -> bool:
    """Whether all channels were sampled at the same instants."""
    first = channels[0].t
    return all(c.t is first or np.array_equal(c.t, first) for c in channels[1:])


def in_order(channel: ClockedChannel) -> ClockedChannel:
    """The channel with its stamps in order; a state that a publisher repeats stands once."""
    t, values, notes = channel.t, channel.values, list(channel.notes)
    if (np.diff(t) < 0).any():
        order = np.argsort(t, kind="stable")
        moved = int(np.sum(np.diff(t) < 0))
        notes.append(f"{channel.channel}: {moved} samples came out of order and were sorted.")
        t, values = t[order], values[order]
    again = np.diff(t) == 0  # with other values they stay, to be refused
    again &= ((values[1:] == values[:-1]) | np.isnan(values[1:])).all(axis=1)
    if again.any():
        keep = np.concatenate([[True], ~again])
        notes.append(f"{channel.channel}: {int(again.sum())} repeated samples were left out.")
        t, values = t[keep], values[keep]
    return replace(channel, t=t, values=values, notes=tuple(notes))


def onto_one_clock(
    channels: Sequence[ClockedChannel],
    rate: float | None = None,
    part: Sequence[float] | None = None,
) -> Aligned:
    """Interpolate channels at the same uniform instants; rate [Hz], part [s].

    Stamps beyond the part may be anything; of the samples beside it those on its two sides count.
    """
    if part is not None:
        channels = [_around(channel, part) for channel in channels]
    for channel in channels:
        timestamps.check_increasing(channel.t)
    start, stop = _shared(channels, part)
    channels = [channel.between(start, stop) for channel in channels]
    for channel in channels:
        timestamps.check_increasing(channel.t)
    _check_gaps(channels, start, stop)
    if rate is None:
        rate = min(channel.rate for channel in channels)
    most = max(channels, key=lambda channel: len(channel.t))
    grid, rate = timestamps.uniform_grid(most.t, rate, (start, stop))
    values = {c.channel: resampled(c, grid, rate) for c in channels}
    done = tuple(note for c in channels for note in c.notes)
    return Aligned(grid, rate, values, (*done, *_account(channels, grid, rate)))


def _around(channel: ClockedChannel, part: Sequence[float]) -> ClockedChannel:
    """The samples of a part and one on either side, in the order of the log."""
    inside = np.flatnonzero((channel.t >= part[0]) & (channel.t < part[1]))
    if inside.size < 2:  # refused where it is cut
        return channel
    first, stop = int(inside[0]), int(inside[-1]) + 1
    first -= first > 0 and channel.t[first - 1] < part[0]
    stop += stop < len(channel.t) and channel.t[stop] >= part[1]
    return replace(channel, t=channel.t[first:stop], values=channel.values[first:stop])


def resampled(channel: ClockedChannel, grid: np.ndarray, rate: float) -> np.ndarray:
    """A channel at other instants, in the manner of its kind."""
    t, values = channel.t, channel.values
    if not np.isfinite(values).all():
        k = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
        raise RecordingError(
            f"{channel.channel} is NaN or infinite at {t[k]:.3f} s on the clock {channel.clock}, "
            "and cannot be interpolated",
            advice="cut the recording there, or name another topic",
        ).about("columns", *channel.channel.split("."))
    if np.abs(values).max() > LARGEST:
        raise RecordingError(
            f"{channel.channel} reaches {np.abs(values).max():.3g}, which is no measurement",
            advice=f"check the log on the clock {channel.clock}",
        ).about("columns", *channel.channel.split("."))
    if channel.channel.startswith("inputs."):
        return timestamps.resample_held(t, values, grid)
    if is_reduced(channel, rate):
        t, values = _low_passed(channel, rate)
    return timestamps.resample_smooth(t, values, grid)


def at_instants(channel: ClockedChannel, grid: np.ndarray) -> np.ndarray:
    """A channel at the instants of another, NaN outside of it and in its gaps.

    Args:
        channel: the channel, with increasing stamps.
        grid: the instants [s].

    Returns:
        Values, shape (instants, joints).
    """
    t = channel.t
    after = np.clip(np.searchsorted(t, grid), 1, len(t) - 1)
    longest = bridged_interval(float(np.median(np.diff(t))))
    known = (grid >= t[0]) & (grid <= t[-1]) & (np.diff(t)[after - 1] <= longest)
    values = np.full((len(grid), channel.values.shape[1]), np.nan)
    if known.any():
        # At its own rate nothing is low-passed: this only asks what follows what.
        values[known] = resampled(channel, grid[known], channel.rate)
    return values


def is_reduced(channel: ClockedChannel, rate: float) -> bool:
    """Whether a channel has to be low-passed before it is taken at a rate [Hz]."""
    return channel.rate > REDUCED * rate and not channel.channel.startswith("inputs.")


def onto_sparsest(channels: Sequence[ClockedChannel]) -> ClockedChannel:
    """Joints that came in messages of their own, as one channel on the stamps of the sparsest."""
    for channel in channels:
        timestamps.check_increasing(channel.t)
    start, stop = _shared(channels, None)
    base = min(channels, key=lambda c: len(c.t)).between(start, stop)
    t = base.t[(base.t >= start) & (base.t <= stop)]
    parts = [channel.between(start, stop) for channel in channels]
    _check_gaps(parts, start, stop)
    rate = base.rate
    values = np.hstack([resampled(part, t, rate) for part in parts])
    note = (
        f"{base.channel}: its joints came in messages of their own and were brought onto the "
        f"stamps of the sparsest ({rate:.5g} Hz)."
    )
    return replace(base, t=t, values=values, notes=(*base.notes, note))


def _shared(
    channels: Sequence[ClockedChannel], part: Sequence[float] | None
) -> tuple[float, float]:
    """First and last instant that all channels cover."""
    for channel in channels[1:]:
        leads = (channels[0].lead, channel.lead)
        if None not in leads and abs(leads[0] - leads[1]) > ONE_CLOCK:  # type: ignore[operator]
            raise ClocksDisagree(_span(channels[0]), _span(channel), leads[1] - leads[0])  # type: ignore[operator]
    latest = max(channels, key=lambda c: c.t[0])
    earliest = min(channels, key=lambda c: c.t[-1])
    start, stop = float(latest.t[0]), float(earliest.t[-1])
    if not start < stop:
        raise ClocksDisagree(_span(earliest), _span(latest))
    if part is not None:
        inside = max(start, part[0]), min(stop, part[1])
        if not inside[0] < inside[1]:
            raise RecordingError(
                f"the part from {part[0]:g} to {part[1]:g} s holds no samples of all channels",
                advice=f"they run from {start:g} to {stop:g} s",
            ).about("part")
        start, stop = inside
    return start, stop


def _span(channel: ClockedChannel) -> tuple[str, str, float, float]:
    """What an error says about a channel's clock."""
    return channel.channel, channel.clock, float(channel.t[0]), float(channel.t[-1])


def _check_gaps(channels: Sequence[ClockedChannel], start: float, stop: float) -> None:
    """Refuse channels with gaps."""
    gaps: list[tuple[float, float, ClockedChannel]] = []
    for channel in channels:
        t, intervals = channel.t, np.diff(channel.t)
        at = np.flatnonzero(intervals > bridged_interval(float(np.median(intervals))))
        gaps += [(float(t[k]), float(t[k + 1]), channel) for k in at]
    if not gaps:
        return
    free, begin = [], start
    for left, right, _ in sorted(gaps, key=lambda gap: gap[0]):
        free.append((begin, min(left, stop)))
        begin = max(begin, right)
    free.append((begin, stop))
    free = [(begin, end) for begin, end in free if begin < end]
    left, right, channel = max(gaps, key=lambda gap: gap[1] - gap[0])
    period = min(float(np.median(np.diff(channel.t))) for channel in channels)
    kept = stretches_of(free, period, resample=False)
    number = len({(begin, end) for begin, end, _ in gaps})
    raise GapInClock(channel.channel, channel.clock, left, right - left, number, kept)


def _low_passed(channel: ClockedChannel, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """A channel on a uniform grid at its own rate, without what the new rate cannot hold."""
    from pivident.signals.bandpass import butterworth

    t, own = channel.t, channel.rate
    grid = np.linspace(t[0], t[-1], max(2, round((t[-1] - t[0]) * own) + 1))
    uniform = timestamps.resample_smooth(t, channel.values, grid)
    own = (len(grid) - 1) / float(grid[-1] - grid[0])
    return grid, butterworth(uniform, own, CUTOFF * rate, padlen=min(len(grid) - 1, round(own)))


def _account(channels: Sequence[ClockedChannel], grid: np.ndarray, rate: float) -> list[str]:
    """What was done, in sentences."""
    by_clock: dict[str, list[ClockedChannel]] = {}
    for channel in channels:
        by_clock.setdefault(channel.clock, []).append(channel)
    listed = "; ".join(
        f"{', '.join(c.channel for c in own)} by {clock} ({own[0].rate:.5g} Hz)"
        for clock, own in by_clock.items()
    )
    notes = [
        f"Resampled to {rate:.6g} Hz from {grid[0]:.3f} to {grid[-1]:.3f} s, positions and torques "
        f"by cubic splines: {listed}."
    ]
    reduced = [c.channel for c in channels if is_reduced(c, rate)]
    if reduced:
        notes.append(
            f"{', '.join(reduced)} low-passed at {CUTOFF * rate:.4g} Hz without phase before being "
            "reduced."
        )
    return notes
