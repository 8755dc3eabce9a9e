"""Signals on disk for drawing: millions of samples, of which a window shows fifteen hundred.

Each channel of a recording is an array of float32, one row for each line, so that a window is read
where it lies. Beside it stands, for each block of 128 samples, where the smallest and the largest
is: a wide window takes its extremes from these,

    extremes of a stretch = extremes of the extremes of its blocks,

so that every peak stays at its place and height.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pivident.foundation.document.plot import kept_samples

#: Content of the folder, beside the arrays.
SIGNALS = "signals.json"

#: Samples whose extremes are known; a place in it fits into a byte.
BLOCK = 128

#: Samples for each point that is drawn, up to which they are looked at one by one: beyond, the two
#: extremes of each block are at least as many as the points.
FEW = BLOCK // 2

#: Significant digits of a value that is drawn.
DIGITS = 6


def write_channel(folder: Path, recording: int, channel: str, values: np.ndarray) -> None:
    """Write a channel, values of shape (samples, lines), and where the extremes of blocks are."""
    lines = np.ascontiguousarray(values.T, dtype=np.float32)
    np.save(folder / _file(recording, channel), lines)
    np.save(folder / _file(recording, f"{channel}.extremes"), _extremes(lines))


def write_times(folder: Path, recording: int, t: np.ndarray) -> None:
    """Write the times of all samples, which never go backward [s]."""
    np.save(folder / _file(recording, "t"), np.asarray(t, dtype=np.float64))


def window(
    folder: Path,
    recording: int,
    channel: str,
    joints: Sequence[int],
    start: float | None,
    stop: float | None,
    points: int = 1500,
) -> dict[str, list[list[float | None]]]:
    """Times ``t`` and values ``y`` to draw, a list for each joint; None where nothing was logged.

    Args:
        folder: where the signals are.
        recording: its number.
        channel: its name.
        joints: numbers of the lines.
        start: first time on the log's clock, None: the beginning [s].
        stop: last time, None: the end [s].
        points: most points of a line.

    Raises:
        KeyError: there is no such recording, channel or line.
    """
    t, lines, extremes = _arrays(folder, recording, channel)
    first = 0 if start is None else int(np.searchsorted(t, start, "left"))
    last = len(t) if stop is None else int(np.searchsorted(t, stop, "right"))
    first, last = max(first - 1, 0), min(last + 1, len(t))  # lines go on beyond the borders
    times: list[list[float | None]] = []
    values: list[list[float | None]] = []
    for joint in joints:
        if not 0 <= joint < len(lines):
            raise KeyError(f"{channel} has {len(lines)} line(s), none of number {joint}")
        kept = _kept(lines[joint], extremes[joint], first, last, max(points, 4))
        times.append([float(x) for x in np.round(t[kept], DIGITS)])
        values.append(_listed(lines[joint][kept]))
    return {"t": times, "y": values}


def _kept(y: np.ndarray, extremes: np.ndarray, first: int, last: int, points: int) -> np.ndarray:
    """Indices of the samples to draw between two others."""
    if last - first <= FEW * points:
        return first + kept_samples(np.asarray(y[first:last]), points)
    begin, end = -(-first // BLOCK), last // BLOCK  # whole blocks
    within = extremes[:, begin:end].T.astype(np.int64)
    within.sort(axis=1)
    within += BLOCK * np.arange(begin, end)[:, None]
    candidates = np.r_[first : begin * BLOCK, within.ravel(), end * BLOCK : last]
    return np.unique(candidates[kept_samples(y[candidates], points)])


def _extremes(lines: np.ndarray) -> np.ndarray:
    """Places of the smallest and the largest value within each block, shape (lines, 2, blocks).

    NaN is neither, unless there is nothing else.
    """
    blocks = lines.shape[1] // BLOCK
    found = np.zeros((len(lines), 2, blocks), dtype=np.uint8)
    for own, line in zip(found, lines, strict=True):
        block = line[: blocks * BLOCK].reshape(blocks, BLOCK)
        missing = np.isnan(block)
        own[0] = np.where(missing, np.inf, block).argmin(axis=1)
        own[1] = np.where(missing, -np.inf, block).argmax(axis=1)
    return found


def _listed(values: np.ndarray) -> list[float | None]:
    """Numbers with few digits, None for those that are not finite."""
    exact = values.astype(np.float64)
    finite = np.isfinite(exact)
    largest = np.abs(exact[finite]).max(initial=0.0)
    if largest > 0.0:
        exact = np.round(exact, int(np.clip(DIGITS - np.floor(np.log10(largest)), 0, 300)))
    return [x if ok else None for x, ok in zip(exact.tolist(), finite.tolist(), strict=True)]


def _arrays(
    folder: Path, recording: int, channel: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, lines and places of extremes, none of them in memory."""
    names = ("t", channel, f"{channel}.extremes")
    try:
        times, lines, extremes = (
            np.load(folder / _file(recording, name), mmap_mode="r", allow_pickle=False)
            for name in names
        )
    except FileNotFoundError:
        raise KeyError(f"recording {recording} has no channel {channel!r}") from None
    return times, lines, extremes


def _file(recording: int, channel: str) -> str:
    """Name of the file of a channel, whatever is asked for."""
    clean = "".join(c if c.isalnum() or c in "_." else "-" for c in channel).lstrip(".")
    return f"{recording:03d}-{clean}.npy"
