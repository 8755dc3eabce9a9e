"""Which samples of a log may stand in a joint's equation, and what is put in place of the others.

A torque that is not known costs the equation of its joint, a position those of all joints, whose
torques depend on it. What is filled in its place keeps filters from ringing; where it lasts longer
than a few samples, filters carry it to the samples beside it, which are left out as well. Motion
that is not known for longer is not guessed: there the log is cut.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pivident.data.logs.bad_samples import TOLERATED, WORDS, BadSamples
from pivident.data.logs.misplaced_positions import cuts
from pivident.data.logs.timestamps import (
    BRIDGED_PERIODS,
    clear_of_unusable,
    long_stretches,
    runs_of,
    stretches_of,
)
from pivident.data.recording import checks
from pivident.data.recording.checks import CHANNELS
from pivident.foundation.errors import BrokenMotion
from pivident.foundation.text.sentences import capital
from pivident.signals.bandpass import EDGE

#: Longest time over which positions are filled [s].
MAX_FILLED = 0.25

#: Numbers of samples that are listed one by one.
LISTED = 4


@dataclass(frozen=True, eq=False)
class Usable:
    """True for samples of the log that may be used, by the channel on whose clock they are."""

    positions: np.ndarray  # of all channels but the torque, shape (samples,)
    torque: np.ndarray  # shape (samples, joints)

    def on(
        self, grid: np.ndarray, stamps: Mapping[str, np.ndarray], mixing: np.ndarray | None
    ) -> np.ndarray | None:
        """Samples of a recording that may be used, shape (samples, joints); None: all of them.

        Args:
            grid: its times, shape (samples,) [s].
            stamps: of ``q`` and ``tau`` as they were logged [s].
            mixing: reduction of the motors whose torques were logged, or None.
        """
        torque = self.torque
        if mixing is not None:
            torque = ~((~torque).astype(float) @ (mixing[: torque.shape[1]] != 0.0)).astype(bool)
        if self.positions.all() and torque.all():
            return None
        return _at(grid, stamps["q"], self.positions[:, None]) & _at(grid, stamps["tau"], torque)


def fill_unusable(logged: dict[str, np.ndarray], joint_names: Sequence[str], joints: int) -> Usable:
    """Fill what is NaN in channels with a column for each joint.

    Args:
        logged: channels by name, shape (samples, joints); changed in place.
        joint_names: names of the joints.
        joints: their number.

    Raises:
        NonFiniteSamples: most samples of a channel are NaN.
    """
    positions = np.ones(len(logged["q"]), bool)
    torque = np.ones((len(logged.get("tau", positions)), joints), bool)
    for channel in CHANNELS:
        if channel not in logged:
            continue
        values = logged[channel]
        finite = np.isfinite(values)
        if finite.all():
            continue
        if (finite.mean(axis=0) < 1.0 - TOLERATED).any():
            checks.check_finite(channel, values, joint_names)
        logged[channel] = filled(values, channel != "tau")
        if channel == "tau":
            torque = finite
        elif len(values) == len(positions):
            positions &= _beside_long(finite.all(axis=1))
    return Usable(positions, torque)


def leave_out_missing(
    channels: dict[str, np.ndarray], joint_names: Sequence[str], rate: float
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Fill what is NaN in arrays of one clock.

    Args:
        channels: by name, shape (samples, joints); changed in place.
        joint_names: names of the joints.
        rate: sampling rate [Hz].

    Returns:
        Samples that may stand in a joint's equation, shape (samples, joints), and what was left
        out, in sentences.

    Raises:
        NonFiniteSamples: most samples of a channel are NaN.
        BrokenMotion: positions are not known for longer than `MAX_FILLED`.
    """
    channels["tau"] = tau = np.array(channels["tau"], float)
    silent = ~np.isfinite(tau).any(axis=0)
    tau[:, silent] = 0.0
    check_unbroken(channels["q"], np.arange(len(tau)) / rate, None)
    notes = [
        f"The torque of {joint_names[j]} is not known." for j in np.flatnonzero(silent).tolist()
    ]
    for name, values in channels.items():
        for j in np.flatnonzero(~np.isfinite(values).all(axis=0)).tolist():
            fault = BadSamples("missing", name, j, np.flatnonzero(~np.isfinite(values[:, j])))
            notes += left_out_sentences([fault], joint_names, len(tau))
    usable = fill_unusable(channels, joint_names, len(joint_names))
    return usable.positions[:, None] & usable.torque & ~silent, tuple(notes)


def check_unbroken(q: np.ndarray, t: np.ndarray, part: Sequence[float] | None) -> None:
    """Refuse positions that jump or are not known for long.

    Args:
        q: positions, NaN where they are not known, shape (samples, joints).
        t: their stamps, shape (samples,) [s].
        part: times to keep to [s]; None: all of them.

    Raises:
        BrokenMotion: names the first place and the stretches between such places.
    """
    if not (np.isfinite(t).all() and (np.diff(t) > 0).all()):
        return  # the clock is refused
    if part is not None:
        inside = (t >= part[0]) & (t < part[1])
        q, t = q[inside], t[inside]
    if len(t) < 2:
        return
    breaks = [(int(k) - 1, int(k), "the positions jump and do not come back") for k in cuts(q, t)]
    for start, stop in runs_of(~np.isfinite(q).all(axis=1)).tolist():
        if 0 < start and stop < len(t) and t[stop] - t[start - 1] > MAX_FILLED:
            lasts = f"the positions are not known for {t[stop] - t[start - 1]:.3g} s"
            breaks.append((start - 1, stop, lasts))
    if not breaks:
        return
    breaks.sort()
    period = float(np.median(np.diff(t)))
    ends = [0, *(behind for _, behind, _ in breaks)], [*(last for last, _, _ in breaks), len(t) - 1]
    between = [(float(t[a]), float(t[b])) for a, b in zip(*ends, strict=True) if b > a]
    # a part ends before its second time: half a period more keeps the last sample
    between = [(start, stop + 0.5 * period) for start, stop in between]
    first = breaks[0]
    kept = stretches_of(between, period, resample=False)
    raise BrokenMotion(first[2], first[1], float(t[first[1]]), len(breaks), kept)


def left_out_sentences(
    bad: Sequence[BadSamples], joint_names: Sequence[str], samples: int
) -> tuple[str, ...]:
    """What was left out, a sentence for each fault."""
    return tuple(
        f"{left_out(fault, joint_names, samples)}; left out of the equations of "
        f"{joint_names[fault.joint] if fault.channel == 'tau' else 'all joints'}."
        for fault in bad
    )


def left_out(fault: BadSamples, joint_names: Sequence[str], samples: int) -> str:
    """What is wrong where, a clause; ``samples``: number of samples of the log."""
    name = fault.name(joint_names)
    name = capital(name) if fault.joint < 0 else name
    return f"{name} {WORDS[fault.kind]} at {_listed(fault.rows, samples)}"


def _listed(rows: np.ndarray, samples: int) -> str:
    """Numbers of samples, such as ``samples 398, 1373, 1482, 1652 and 5 more``."""
    if len(rows) == 1:
        return f"sample {rows[0]}"
    if np.ptp(rows) + 1 == len(rows):
        return f"samples {rows[0]} to {rows[-1]}"
    more = len(rows) - LISTED
    text = f"samples {', '.join(map(str, rows[:LISTED].tolist()))}"
    return f"{text} and {more} more, {100 * len(rows) / samples:.2g} %" if more > 0 else text


def _beside_long(usable: np.ndarray) -> np.ndarray:
    """Samples in use that no filter mixes with a long stretch of others, shape (samples,)."""
    return usable & clear_of_unusable(~long_stretches(usable), EDGE, EDGE)


def _at(grid: np.ndarray, t: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """A mask at other instants: that of the sample there, or of both samples beside it."""
    place = np.interp(grid, t, np.arange(len(t), dtype=float))
    low, high = np.floor(place + 0.25).astype(int), np.ceil(place - 0.25).astype(int)
    return np.asarray(mask[low.clip(0, len(t) - 1)] & mask[high.clip(0, len(t) - 1)])


def filled(values: np.ndarray, positions: bool) -> np.ndarray:
    """Values in place of NaN, which nobody uses: they only keep filters from ringing.

    Between the samples on both sides lies a straight line, of positions the cubic that continues
    them with their speeds. At the ends the nearest value holds.

    Args:
        values: channel, shape (samples, joints); itself where nothing is NaN. A column of
            nothing else stays.
        positions: whether it moves smoothly.
    """
    bad = ~np.isfinite(values)
    if not bad.any():
        return values
    made = np.array(values)
    for j in np.flatnonzero(bad.any(axis=0)):
        x, good = made[:, j], np.flatnonzero(~bad[:, j])
        rows = np.flatnonzero(bad[:, j])
        if not good.size:
            continue
        x[rows] = np.interp(rows, good, x[good])
        if not positions:
            continue
        for start, stop in runs_of(bad[:, j]):
            if start > 0 and stop < len(x):
                x[start:stop] = _continued(x, good, start, stop)
    return made


def _continued(x: np.ndarray, good: np.ndarray, start: int, stop: int) -> np.ndarray:
    """Cubic through two samples on either side, or between parabolas through a quarter as many.

    Over a long gap two samples would continue their noise, not their speed.
    """
    k = int(np.searchsorted(good, start))
    if stop - start <= BRIDGED_PERIODS and 2 <= k <= len(good) - 2:
        near = good[k - 2 : k + 2]
        cubic = np.polynomial.Polynomial.fit(near - start, x[near], 3)
        return np.asarray(cubic(np.arange(stop - start)))
    length = max(4, (stop - start) // 4)
    ends = []
    for at, own in ((start - 1, good[max(0, k - length) : k]), (stop, good[k : k + length])):
        degree = min(2, len(own) - 1)
        fit = np.polynomial.Polynomial.fit(own - at, x[own], degree, domain=[-1.0, 1.0])
        ends.append((float(fit(0.0)), float(fit.deriv()(0.0)) if degree else 0.0))
    (a, va), (b, vb) = ends
    length = stop - start + 1
    s = np.arange(1, length) / length
    return (
        a * (1 + 2 * s) * (1 - s) ** 2
        + b * s**2 * (3 - 2 * s)
        + length * (va * s * (1 - s) ** 2 - vb * s**2 * (1 - s))
    )
