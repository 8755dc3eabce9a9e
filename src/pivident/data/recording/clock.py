"""The clock of a recording: as it was logged, or new samples on a uniform one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.data.logs import timestamps
from pivident.data.logs.clock_alignment import (
    ClockedChannel,
    have_one_clock,
    is_reduced,
    onto_one_clock,
)
from pivident.foundation.errors import RecordingError, concerning


@dataclass(frozen=True)
class Clock:
    """What the user said about time."""

    rate: float | None  # declared or wanted rate [Hz], or None
    resample: bool  # whether new samples may be made
    unit_given: bool  # whether their unit was given; it is checked otherwise
    part: Sequence[float] | None  # times to keep to [s], or None


@dataclass(frozen=True)
class UniformClock:
    """The clock that all channels were brought onto."""

    rate: float  # its rate [Hz]
    start: float  # time of the first sample [s]
    notes: tuple[str, ...] = ()  # what was done, in sentences
    slowed: str = ""  # why it is slower than the positions were logged, see `Recording`


def beside_torque(
    logged: Mapping[str, np.ndarray], clocked: Mapping[str, ClockedChannel]
) -> np.ndarray:
    """Positions at the instants of the torques, where these have a clock of their own."""
    if "tau" not in clocked or "q" not in clocked or have_one_clock([clocked["q"], clocked["tau"]]):
        return logged["q"]
    t = clocked["q"].t
    order = np.argsort(t, kind="stable")
    return timestamps.resample_linear(t[order], logged["q"][order], clocked["tau"].t)


def on_one_clock(
    logged: dict[str, np.ndarray], clocked: Mapping[str, ClockedChannel], clock: Clock
) -> UniformClock:
    """The one clock of all channels; on demand, new samples on it."""
    t = logged.pop("t", None)
    if clock.rate is not None:
        with concerning("rate"):
            timestamps.check_declared(clock.rate)
    if t is None and not clocked:
        if clock.rate is None or clock.resample:
            alternative = "resampling needs it" if clock.resample else "or give the rate"
            raise RecordingError(
                "no column is named for the time t", advice=f"name it, {alternative}"
            )
        return UniformClock(float(clock.rate), 0.0)
    if clocked:
        _check_clocks(logged, clocked)
        channels = [replace(clocked[name], values=logged[name]) for name in logged]
    else:
        assert t is not None, "without it there are clocks"
        if len(t) != len(logged["q"]):
            raise RecordingError(
                f"t has {len(t)} samples, q has {len(logged['q'])}",
                advice="cut them to the same samples",
            )
        channels = [ClockedChannel(name, "t", t, values) for name, values in logged.items()]
    one = have_one_clock(channels)
    if not clock.unit_given:
        for channel in channels[:1] if one else channels:
            timestamps.check_seconds(channel.t)
    if not one and not clock.resample:
        listed = ", ".join(f"{c.channel} by {c.clock} ({len(c.t)} samples)" for c in channels)
        raise RecordingError(
            f"the channels have clocks of their own: {listed}",
            advice="set resample = true to bring them onto one",
        ).about("resample")
    if one and not clock.resample:
        return _as_it_is(logged, channels, clock)
    return _resampled(logged, channels, clock, one)


def _check_clocks(logged: Mapping[str, np.ndarray], clocked: Mapping[str, ClockedChannel]) -> None:
    """Refuse channels without stamps beside those with stamps of their own."""
    without = [name for name in logged if name not in clocked]
    if without:
        raise RecordingError(
            f"{without[0]} has no time stamps, the other channels have",
            advice=f'name its column of t: t = {{{without[0]} = "time"}}',
        )


def _as_it_is(
    logged: dict[str, np.ndarray], channels: Sequence[ClockedChannel], clock: Clock
) -> UniformClock:
    """The samples as they were logged, where their one clock is regular."""
    t, notes = channels[0].t, tuple(dict.fromkeys(note for c in channels for note in c.notes))
    if clock.part is not None:
        inside = (t >= clock.part[0]) & (t < clock.part[1])
        if inside.sum() > 2:  # an empty part is refused where it is cut
            t = t[inside]
            for name in logged:
                logged[name] = logged[name][inside]
    if clock.rate is None:
        return UniformClock(timestamps.rate_of(t), float(t[0]), notes)
    with concerning("rate"):
        timestamps.check_rate(clock.rate, t)
    return UniformClock(float(clock.rate), float(t[0]), notes)


def _resampled(
    logged: dict[str, np.ndarray], channels: Sequence[ClockedChannel], clock: Clock, one: bool
) -> UniformClock:
    """New samples on a uniform clock."""
    aligned = onto_one_clock(channels, clock.rate, clock.part)
    logged.update(aligned.values)
    slowed = _slowed(channels, aligned.rate) if clock.rate is None and not one else ""
    return UniformClock(aligned.rate, float(aligned.t[0]), aligned.notes, slowed)


def _slowed(channels: Sequence[ClockedChannel], rate: float) -> str:
    """Which channel makes the rate lower than that of the positions, and what keeps theirs."""
    positions = next(channel for channel in channels if channel.channel == "q")
    if not is_reduced(positions, rate):
        return ""
    slowest = min(channels, key=lambda channel: channel.rate)
    kept = float(f"{positions.rate:.3g}")
    return (
        f"the channel {slowest.channel} comes at {slowest.rate:.4g} Hz by the clock "
        f"{slowest.clock} and sets the rate of all channels; write rate = {kept:g} under "
        "[recording] to keep that of the positions"
    )
