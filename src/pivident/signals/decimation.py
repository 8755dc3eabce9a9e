"""Parallel decimation: observation matrix and torque through the same low-pass.

The columns of the observation matrix and the torque are filtered alike and every r-th sample is
kept, so that the linear relation between them is preserved while everything above the decimated
rate is removed. A stage is MATLAB's ``decimate``: Chebyshev type I of order 8, ripple 0.05 dB, edge
0.8/r of half the rate, forwards and backwards; large factors are split into stages.
``scipy.signal.decimate`` has the same filter but other ends: it keeps the first sample where
MATLAB keeps the last, and extends the record by three samples more. A Chebyshev filter of even
order scales constants by its ripple (-0.1 dB in a stage); both sides of the equation carry the
same factor, which cancels from the estimates.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np

from pivident.foundation.errors import RecordingError, RecordingTooShort
from pivident.signals.filters import (
    chebyshev_sections,
    forwards_and_backwards,
    run_sections,
    sections_response,
)

ORDER = 8
RIPPLE_DB = 0.05
EDGE_OF_BAND = 0.8

Convention = Literal["matlab", "scipy"]

#: Odd extension at each end of a stage: three times the order, or the number of coefficients.
PADLEN: dict[Convention, int] = {"matlab": 3 * ORDER, "scipy": 3 * (ORDER + 1)}

#: Largest factor of one stage; beyond it the filter's poles cluster at z = 1.
MAX_STAGE = 13

#: Largest factor: no record has as many samples for each that would be kept.
LARGEST_FACTOR = 100_000

#: Level below which an impulse response has ended, relative to the unit step response.
NEGLIGIBLE = 1e-12


@dataclass(frozen=True)
class DecimationBlock:
    """One of several overlapping blocks of a record that is decimated block by block.

    With ``part = parallel_decimation(x[block.source], factor, offsets=block.offsets)`` the rows
    ``part[block.keep]`` are rows ``block.target`` of the decimated record. ``keep`` leaves out the
    rows near the ends; ``offsets`` are the first samples kept by each stage, equal in all blocks.
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
    """Low-pass x along axis 0 without phase and keep every ``factor``-th sample.

    ``factor`` is the total or those of the stages. At the ends ``matlab`` keeps samples
    r - (r·⌈n/r⌉ - n) + i·r, counted from one, of each stage, so that the last sample is kept;
    ``scipy`` keeps the first one. Both give ⌈samples/factor⌉ rows (stage by stage).
    """
    factors = decimation_stages(factor)
    if offsets is None:
        offsets = decimation_offsets(len(x), factors, convention)
    padlen = PADLEN[convention]
    for stage, offset in zip(factors, offsets, strict=True):
        if len(x) <= padlen:
            raise RecordingTooShort(len(x), padlen + 1)
        x = forwards_and_backwards(_sections(stage), x, padlen)[offset::stage]
    return np.ascontiguousarray(x)


def decimation_stages(factor: int | Sequence[int]) -> tuple[int, ...]:
    """Split a factor into as few stages as possible, the largest of them as small as possible.

    100 becomes 10·10 and 125 becomes 5·5·5. A prime factor above 13 is one stage, a sequence
    of stages is returned unchanged, and a factor of one has no stage.
    """
    if not isinstance(factor, int | np.integer):
        return tuple(int(stage) for stage in factor)
    if factor < 1:
        raise RecordingError(f"decimation by {factor}", advice="expected a factor of one or more")
    if factor > LARGEST_FACTOR:
        raise RecordingError(
            f"decimation by {factor} leaves nothing of any record",
            advice="expected the rate over twice the highest frequency to keep",
        )
    return min(_factorisations(int(factor)), key=lambda stages: (len(stages), stages))


def decimation_offsets(
    samples: int, factor: int | Sequence[int], convention: Convention = "matlab"
) -> tuple[int, ...]:
    """Index of the first sample that each stage keeps."""
    offsets = []
    for stage in decimation_stages(factor):
        kept = math.ceil(samples / stage)
        offsets.append(0 if convention == "scipy" else stage - 1 - (stage * kept - samples))
        samples = kept
    return tuple(offsets)


def fewest_samples(factor: int | Sequence[int], convention: Convention = "matlab") -> int:
    """Samples of which the filters of all stages have enough."""
    fewest = 1
    for stage in reversed(decimation_stages(factor)):
        fewest = max(PADLEN[convention] + 1, (fewest - 1) * stage + 1)
    return fewest


def decimation_gain(frequency: np.ndarray, rate: float, factor: int | Sequence[int]) -> np.ndarray:
    """Gain of all stages for a component of the record at a frequency [Hz], Π |H_r(f)|².

    A stage runs at the rate left by the stages before it. A component above half the last rate is
    aliased by decimation; this is its gain there.
    """
    gain = np.ones(np.shape(frequency))
    for stage in decimation_stages(factor):
        omega = 2.0 * np.pi * np.asarray(frequency, dtype=float) / rate
        gain *= np.abs(sections_response(_sections(stage), omega)) ** 2
        rate = rate / stage
    return gain


def decimation_overlap(factor: int | Sequence[int]) -> int:
    """Samples after which an end of the record is forgotten, to 1e-12 of a unit step.

    The reach of later stages is multiplied by the factors before them.
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
    decimated record, and overlaps its neighbours by :func:`decimation_overlap`. It contributes
    ``block`` samples, rounded up to a multiple of the factor; the targets cover the decimated
    record without gaps.
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
        # A row lies offset (< total) samples after its multiple of the total factor.
        start = max(0, first - margin)
        stop = last + margin + 1
        yield DecimationBlock(
            source=slice(start * total, min(stop * total, samples)),
            keep=slice(first - start, last - start),
            target=slice(first, last),
            offsets=offsets,
        )


def _factorisations(factor: int, smallest: int = 2) -> Iterator[tuple[int, ...]]:
    """All factorisations into stages, largest first, none above MAX_STAGE unless prime."""
    if factor == 1:
        yield ()
    for stage in range(smallest, factor + 1):
        prime = all(stage % divisor for divisor in range(2, math.isqrt(stage) + 1))
        if factor % stage == 0 and (stage <= MAX_STAGE or prime):
            for rest in _factorisations(factor // stage, stage):
                yield (*rest, stage)


@cache
def _sections(stage: int) -> np.ndarray:
    """Second-order sections of one stage; the transfer function would be inaccurate."""
    return chebyshev_sections(ORDER, RIPPLE_DB, EDGE_OF_BAND / stage)


@cache
def _reach(stage: int) -> int:
    """Samples until the step response of one run stays within 1e-12 of its end.

    One run suffices: the backward run carries the error of the forward run at the start towards
    the start only, and the end is the mirror image.
    """
    impulse = np.zeros(4000 * stage)
    impulse[0] = 1
    response = run_sections(_sections(stage), impulse)
    tail = np.cumsum(np.abs(response[::-1]))[::-1]
    return int(np.argmax(tail < NEGLIGIBLE))
