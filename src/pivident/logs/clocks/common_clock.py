"""Channels with clocks of their own, brought onto one for whoever judges a log as it is.

Nothing is refused: samples that are NaN are left out, gaps are cut around, and the notes say so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pivident.errors import GapInClock
from pivident.logs.clocks.clock_alignment import ClockedChannel, have_one_clock, onto_one_clock

#: Channels on their clock: values by name, clocks by name [s], and what was done.
OnOneClock = tuple[dict[str, np.ndarray], dict[str, np.ndarray], list[str]]


def on_one_clock(channels: Sequence[ClockedChannel], rate: float | None) -> OnOneClock:
    """Channels as they are where they have one clock, else resampled; gaps are cut around."""
    if have_one_clock(channels):
        done = list(dict.fromkeys(note for c in channels for note in c.notes))
        return {c.channel: c.values for c in channels}, {channels[0].clock: channels[0].t}, done
    whole = [_without_holes(channel) for channel in channels]
    part: tuple[float, float] | None = None
    notes: list[str] = []
    for last in [False] * 8 + [True]:
        try:
            aligned = onto_one_clock(whole, rate, part)
            break
        except GapInClock as gap:
            if last:
                raise
            notes = [f"Only the longest stretch without gaps is used: {gap}."]
            part = gap.stretches.longest
    return aligned.values, {"common clock": aligned.t}, [*notes, *aligned.notes]


def _without_holes(channel: ClockedChannel) -> ClockedChannel:
    """A channel without the samples that are NaN, which no interpolation takes."""
    good = np.isfinite(channel.values).all(axis=1) & np.isfinite(channel.t)
    if good.all():
        return channel
    note = f"{channel.channel}: {int((~good).sum())} samples that are NaN were left out."
    return replace(
        channel, t=channel.t[good], values=channel.values[good], notes=(*channel.notes, note)
    )
