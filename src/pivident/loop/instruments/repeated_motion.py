"""Instruments from repetition: the same motion, smoothed, as it was at other times.

Where a motion is repeated, its repetitions differ by noise and disturbances alone, which are
independent from one to the next. The mean of the others at the same instant of the motion,

    z_i(t) = 1/(n-1) Σ_{m≠i} q̂(t + (m-i) p),

is an instrument that needs neither law nor reference. The period p is no whole number of samples,
and a motion is not started at a sample's instant: each repetition is shifted by the fraction that
fits best, and read between its samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.data.recording.repeated_motion import find_repetition
from pivident.loop.instruments.given_motion import (
    GivenMotions,
    InstrumentKind,
    agreement,
    with_valid,
)
from pivident.loop.motion.motion import Kinematics, SimulatedMotion

#: A repetition is looked for this many samples about where whole periods put it.
SEARCHED = 3.0

#: Iterations of Gauss and Newton for its shift; it converges to a millionth of a sample in three.
SHIFT_STEPS = 6


@dataclass(frozen=True)
class Pair:
    """Samples of one record that another stretch repeats."""

    recording: int  # record whose samples are repeated
    span: slice  # its samples
    other: int  # record that repeats them
    shift: float  # sample of the other record less that of this one


def repetition_instruments(kinematics: Sequence[Kinematics]) -> GivenMotions:
    """Mean of the other repetitions, at all samples that are repeated.

    Raises:
        IdentificationError: no motion repeats.
    """
    found = find_repetition([k.recording for k in kinematics])
    if found is None:
        REPETITION.absent("no motion repeats within 1 % of its range")
    pairs = _pairs(kinematics, found.instants, found.period)
    motions = []
    for number, kin in enumerate(kinematics):
        total, times = np.zeros(kin.q.shape), np.zeros(kin.q.shape[1])
        for pair in pairs:
            if pair.recording == number:
                total[:, pair.span] += _between(kinematics[pair.other].q, pair)
                times[pair.span] += 1.0
        valid = times > 0
        q = np.where(valid, total / np.maximum(times, 1.0), kin.q)
        _join(q, valid)
        motions.append(with_valid(SimulatedMotion(q, kin.recording.rate), _inside(valid)))
    return GivenMotions(
        REPETITION, motions, (f"{found.description}",), agreement(kinematics, motions)
    )


def _pairs(
    kinematics: Sequence[Kinematics], instants: Sequence[np.ndarray], period: int | None
) -> list[Pair]:
    """Every two stretches of the same instants, each with the shift that fits best."""
    stretches = []  # record, first sample, one past the last, first instant
    for number, (kin, where) in enumerate(zip(kinematics, instants, strict=True)):
        for part in np.split(np.arange(where.size), np.flatnonzero(np.diff(where) != 1) + 1):
            start, stop = max(part[0], kin.start), min(part[-1] + 1, kin.stop)
            if stop - start > 4:
                stretches.append((number, int(start), int(stop), int(where[start])))
    pairs = []
    for a in stretches:
        for b in stretches:
            if a is not b:
                pair = _pair(kinematics, a, b)
                if pair is not None:
                    pairs.append(pair)
    return pairs


def _pair(kinematics: Sequence[Kinematics], a: tuple, b: tuple) -> Pair | None:
    """The samples of stretch a whose instants b has too, and b's shift; None: there are none."""
    first = max(a[3], b[3])
    last = min(a[3] + a[2] - a[1], b[3] + b[2] - b[1])
    margin = int(SEARCHED) + 2
    if last - first <= 4 * margin:
        return None
    start, length = a[1] + first - a[3], last - first
    shift = float(b[1] + first - b[3] - start)
    span = slice(start + margin, start + length - margin)
    own = Pair(a[0], span, b[0], shift)
    return Pair(a[0], span, b[0], _fitted_shift(kinematics, own))


def _fitted_shift(kinematics: Sequence[Kinematics], pair: Pair) -> float:
    """The shift s that minimises Σ_j ∫ (q_a(t) - q_b(t+s))²/range_j², by Gauss and Newton."""
    kin, other = kinematics[pair.recording], kinematics[pair.other]
    weight = 1.0 / np.maximum(np.ptp(kin.q, axis=1, keepdims=True), 1e-12)
    rate, start, shift = kin.recording.rate, pair.shift, pair.shift
    for _ in range(SHIFT_STEPS):
        here = Pair(pair.recording, pair.span, pair.other, shift)
        error = (kin.q[:, pair.span] - _between(other.q, here)) * weight
        error -= error.mean(axis=1, keepdims=True)
        slope = _between(other.dq, here) * weight / rate
        slope -= slope.mean(axis=1, keepdims=True)
        shift += float(np.sum(slope * error) / max(np.sum(slope**2), 1e-300))
        shift = float(np.clip(shift, start - SEARCHED, start + SEARCHED))
    return shift


def _between(x: np.ndarray, pair: Pair) -> np.ndarray:
    """A signal of the other record at this one's instants, by cubic interpolation (Catmull-Rom)."""
    whole = int(np.floor(pair.shift))
    u = pair.shift - whole
    first, last = pair.span.start + whole, pair.span.stop + whole
    a, b, c, d = (x[:, first + i : last + i] for i in (-1, 0, 1, 2))
    return b + 0.5 * u * ((c - a) + u * ((2 * a - 5 * b + 4 * c - d) + u * (3 * (b - c) + d - a)))


def _join(q: np.ndarray, valid: np.ndarray) -> None:
    """Shift the samples that nothing repeats so that the motion has no steps there, in place."""
    edges = np.flatnonzero(np.diff(valid.astype(int)))
    for edge in edges:
        inside, outside = (edge, edge + 1) if valid[edge] else (edge + 1, edge)
        step = q[:, inside] - q[:, outside]
        if valid[edge]:
            q[:, edge + 1 :][:, ~valid[edge + 1 :]] += step[:, None]
        elif edge == edges[0]:
            q[:, : edge + 1] += step[:, None]


def _inside(valid: np.ndarray) -> np.ndarray:
    """Valid samples whose differences have valid samples only."""
    inside = valid.copy()
    for lag in (1, 2):
        inside[lag:] &= valid[:-lag]
        inside[:-lag] &= valid[lag:]
    inside[:2] = inside[-2:] = False
    return inside


#: Other repetitions of the same motion.
REPETITION = InstrumentKind(
    "repetition",
    "other repetitions of the same motion",
    "noise and disturbances that differ from one repetition to the next",
    "errors that repeat with the motion, such as those of an encoder or of the model",
    exogenous=True,
    make=repetition_instruments,
)
