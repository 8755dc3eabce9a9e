"""Parallel decimation: observation matrix and torque through one and the same low-pass.

The columns of the observation matrix and the torque are filtered alike and every r-th sample is
kept, so that the linear relation between them survives while everything above the decimated rate
is dropped. A stage is MATLAB's ``decimate``: Chebyshev type I of order 8, ripple 0.05 dB, edge
0.8/r of half the rate, forwards and backwards; large factors are split into stages.
``scipy.signal.decimate`` has the same filter, but other ends: it keeps the first sample where
MATLAB keeps the last, and extends the record by three samples more. A Chebyshev filter of even
order scales constants by its ripple (-0.1 dB in a stage); both sides of the
equation carry the same factor, so the estimates do not see it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np

from pivident.errors import RecordingError, RecordingTooShort

ORDER = 8
RIPPLE_DB = 0.05
EDGE_OF_BAND = 0.8

Convention = Literal["matlab", "scipy"]

#: Odd extension at each end of a stage: three times the order, or the number of coefficients.
PADLEN: dict[Convention, int] = {"matlab": 3 * ORDER, "scipy": 3 * (ORDER + 1)}

#: Largest factor of one stage; beyond it the filter's poles crowd at z = 1.
MAX_STAGE = 13

#: Impulse responses count as ended below this, relative to a unit step's response of one.
NEGLIGIBLE = 1e-12


@dataclass(frozen=True)
class DecimationBlock:
    """One of several overlapping blocks of a record that is decimated piece by piece.

    With ``part = parallel_decimation(x[block.source], factor, offsets=block.offsets)`` the rows
    ``part[block.keep]`` are rows ``block.target`` of the decimated record.

    Attributes:
        source: samples to read.
        keep: rows of the decimated block that are far enough from its ends.
        target: rows of the decimated record that they are.
        offsets: first sample kept by every stage, the same in all blocks.
    """

    source: slice
    keep: slice
    target: slice
    offsets: tuple[int, ...]


def parallel_decimation(
    x: np.ndarray,
    factor: int | Sequence[int],
    *,
    convention: Convention = "matlab",
    offsets: Sequence[int] | None = None,
) -> np.ndarray:
    """Low-pass x along time without phase and keep every ``factor``-th sample.

    Args:
        x: samples along axis 0, any number of columns.
        factor: total factor, or the factors of the stages.
        convention: whose ``decimate`` is followed at the ends: ``matlab`` keeps samples
            r - (r·⌈n/r⌉ - n) + i·r, counted from one, of each stage, so that the last sample is
            kept; ``scipy`` keeps the first one.
        offsets: index of the first sample kept by each stage, instead of the convention's.

    Returns:
        ⌈samples/factor⌉ rows (stage by stage) with either convention.

    Raises:
        RecordingError: the factor is below one.
        RecordingTooShort: too few samples are left for a stage.
    """
    from scipy.signal import sosfiltfilt

    factors = decimation_stages(factor)
    if offsets is None:
        offsets = decimation_offsets(len(x), factors, convention)
    padlen = PADLEN[convention]
    for stage, offset in zip(factors, offsets, strict=True):
        if len(x) <= padlen:
            raise RecordingTooShort(len(x), padlen + 1)
        x = sosfiltfilt(_sections(stage), x, axis=0, padlen=padlen)[offset::stage]
    return np.ascontiguousarray(x)


def decimation_stages(factor: int | Sequence[int]) -> tuple[int, ...]:
    """Split a factor into as few stages as possible, the largest of them as small as possible.

    100 becomes 10·10 and 125 becomes 5·5·5. A prime factor above 13 keeps a stage of its own, a
    sequence of stages is returned as it is, and a factor of one has no stage at all.
    """
    if not isinstance(factor, int | np.integer):
        return tuple(int(stage) for stage in factor)
    if factor < 1:
        raise RecordingError(f"decimation by {factor}; expected a factor of one or more")
    return min(_factorisations(int(factor)), key=lambda stages: (len(stages), stages))


def decimation_offsets(
    samples: int, factor: int | Sequence[int], convention: Convention = "matlab"
) -> tuple[int, ...]:
    """Index of the first sample that each stage keeps.

    Args:
        samples: length of the record.
        factor: total factor, or the factors of the stages.
        convention: see :func:`parallel_decimation`.
    """
    offsets = []
    for stage in decimation_stages(factor):
        kept = math.ceil(samples / stage)
        offsets.append(0 if convention == "scipy" else stage - 1 - (stage * kept - samples))
        samples = kept
    return tuple(offsets)


def decimation_gain(frequency: np.ndarray, rate: float, factor: int | Sequence[int]) -> np.ndarray:
    """Gain of all stages for a component of the record, Π |H_r(f)|², without phase.

    A stage runs at the rate that the stages before it left. A component above half the last rate
    appears at another frequency after decimation; this is the gain with which it gets there.

    Args:
        frequency: frequencies before decimation [Hz], shape (points,).
        rate: sampling rate before decimation [Hz].
        factor: total factor, or the factors of the stages.

    Returns:
        Gain, shape (points,).
    """
    from scipy.signal import freqz_sos

    gain = np.ones(np.shape(frequency))
    for stage in decimation_stages(factor):
        omega = 2.0 * np.pi * np.asarray(frequency, dtype=float) / rate
        gain *= np.abs(freqz_sos(_sections(stage), worN=omega)[1]) ** 2
        rate = rate / stage
    return gain


def decimation_overlap(factor: int | Sequence[int]) -> int:
    """Samples after which an end of the record is forgotten, to 1e-12 of a unit step.

    Later stages reach further by the factors before them.

    Args:
        factor: total factor, or the factors of the stages.
    """
    overlap, scale = 0, 1
    for stage in decimation_stages(factor):
        overlap += scale * _reach(stage)
        scale *= stage
    return overlap


def decimation_blocks(
    samples: int, factor: int | Sequence[int], block: int, convention: Convention = "matlab"
) -> Iterator[DecimationBlock]:
    """Cut a record into overlapping blocks whose decimation equals that of the whole.

    Every block starts at a multiple of the total factor, so all of them lie on the grid of the
    decimated record, and overlaps its neighbours by :func:`decimation_overlap`.

    Args:
        samples: length of the record.
        factor: total factor, or the factors of the stages.
        block: samples that a block contributes, rounded up to a multiple of the factor; the
            overlap comes on top on both sides.
        convention: see :func:`parallel_decimation`.

    Yields:
        The blocks from first to last; their targets cover the decimated record without gaps.
    """
    stages = decimation_stages(factor)
    total = math.prod(stages)
    offsets = decimation_offsets(samples, stages, convention)
    rows = samples
    for stage, offset in zip(stages, offsets, strict=True):
        rows = math.ceil((rows - offset) / stage)
    margin = math.ceil(decimation_overlap(stages) / total)
    step = max(1, math.ceil(block / total))
    for first in range(0, rows, step):
        last = min(first + step, rows)
        # A row is fed from offset (< total) samples behind its multiple of the total factor.
        start = max(0, first - margin)
        stop = last + margin + 1
        yield DecimationBlock(
            source=slice(start * total, min(stop * total, samples)),
            keep=slice(first - start, last - start),
            target=slice(first, last),
            offsets=offsets,
        )


def _factorisations(factor: int, smallest: int = 2) -> Iterator[tuple[int, ...]]:
    """All ways to write the factor as a product of stages, largest first, none too large."""
    if factor == 1:
        yield ()
    for stage in range(smallest, factor + 1):
        prime = all(stage % divisor for divisor in range(2, math.isqrt(stage) + 1))
        if factor % stage == 0 and (stage <= MAX_STAGE or prime):
            for rest in _factorisations(factor // stage, stage):
                yield (*rest, stage)


@cache
def _sections(stage: int) -> np.ndarray:
    """Second-order sections of one stage; the transfer function itself would lose its digits."""
    from scipy.signal import cheby1

    return cheby1(ORDER, RIPPLE_DB, EDGE_OF_BAND / stage, output="sos")


@cache
def _reach(stage: int) -> int:
    """Samples until the step response of one run stays within 1e-12 of its end.

    One run is enough: what the forward run gets wrong at the start, the backward run carries
    towards the start only, and the end is the mirror image.
    """
    from scipy.signal import sosfilt

    length = 4000 * stage
    impulse = np.zeros(length)
    impulse[0] = 1
    response = sosfilt(_sections(stage), impulse)
    tail = np.cumsum(np.abs(response[::-1]))[::-1]
    return int(np.argmax(tail < NEGLIGIBLE))
