"""A reference for records that do not hold one.

Instruments must not know the noise of the record. A reference of few parameters, fitted to the
whole motion, hardly does: smoothed trapezoidal moves from point to point, where the motion is of
that kind. Where it is not, a smoothing spline stands for it (the random walk smoother of order
two is the cubic one, with the smoothness of maximum likelihood); it follows slow noise, and an
identification that uses it says so.

Robot controllers move from point to point with a trapezoid of speed, rounded by a moving average
of length w that limits the jerk. With ( )₊ the positive part and t from the start of the move,

    s̈(t) = [v(t) - v(t - w)]/w,   v(t) = c [(t)₊ - (t - ta)₊ - (t - ta - tc)₊ + (t - 2 ta - tc)₊]

where v is the trapezoid (acceleration time ta, cruise tc, c = 1/(ta (ta + tc))): positions and
derivatives are sums of truncated powers. Research robots often move on a quintic polynomial
instead; each move is fitted with both. All joints share the timing of a move.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pivident.signals.random_walk import smooth_channels

#: Speed below which a joint rests, relative to its largest.
REST = 0.02

#: Shortest move and shortest rest between two [s].
MIN_MOVE = 0.05
MIN_REST = 0.004

#: Samples per move that the fit of its timing uses; more would not make it better.
FIT_SAMPLES = 250

#: Mean square of a relative error below which other starts need not be tried.
GOOD_FIT = 1e-7


@dataclass(frozen=True)
class Move:
    """Timing of one move."""

    start: float  # [s]
    acceleration: float  # ta [s]
    cruise: float  # tc [s]
    rounding: float  # w [s]

    @property
    def duration(self) -> float:
        """From rest to rest [s]."""
        return 2.0 * self.acceleration + self.cruise + self.rounding

    def shape(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """S from 0 to 1, its speed [1/s] and acceleration [1/s²], each of the shape of t."""
        ta, tc, w = self.acceleration, self.cruise, self.rounding
        knots = np.array([0.0, ta, ta + tc, 2.0 * ta + tc])
        signs = np.array([1.0, -1.0, -1.0, 1.0])
        c = 1.0 / (ta * (ta + tc))
        at = np.asarray(t)[..., None] - self.start - knots
        now, before = np.maximum(at, 0.0), np.maximum(at - w, 0.0)
        s, speed, acceleration = (
            c * ((now**n - before**n) @ signs) / (divisor * w)
            for n, divisor in ((3, 6.0), (2, 2.0), (1, 1.0))
        )
        return s, speed, acceleration


@dataclass(frozen=True)
class QuinticMove:
    """A move on the polynomial of degree five, s = 10x³ - 15x⁴ + 6x⁵ with x = (t - start)/T."""

    start: float  # [s]
    duration: float  # T [s]

    def shape(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """S from 0 to 1, its speed [1/s] and acceleration [1/s²], each of the shape of t."""
        x = np.clip((np.asarray(t) - self.start) / self.duration, 0.0, 1.0)
        s = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        speed = 30.0 * x**2 * (1.0 - x) ** 2 / self.duration
        return s, speed, 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / self.duration**2


@dataclass(frozen=True, eq=False)
class PointToPoint:
    """A motion of several moves."""

    moves: tuple[Move | QuinticMove, ...]  # their timing
    points: np.ndarray  # via points, one more than moves, shape (moves + 1, joints) [rad or m]

    def reference(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, dq, ddq at the times, each of shape (samples, joints)."""
        shapes = np.stack([np.stack(m.shape(t), axis=0) for m in self.moves], axis=-1)
        q, dq, ddq = shapes @ np.diff(self.points, axis=0)
        return q + self.points[0], dq, ddq

    @property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Largest speeds and accelerations of each move and joint, each (moves, joints)."""
        peaks = []
        for move in self.moves:
            t = move.start + np.linspace(0.0, move.duration, 2001)
            peaks.append([np.abs(x).max() for x in move.shape(t)[1:]])
        way, peak = np.abs(np.diff(self.points, axis=0)), np.array(peaks)
        return way * peak[:, :1], way * peak[:, 1:]


def fit_point_to_point(q: np.ndarray, dq: np.ndarray, rate: float) -> PointToPoint | None:
    """The moves of a motion, or None where there is no rest between moves to separate them.

    ``q``: smoothed positions, shape (samples, joints) [rad or m].
    """
    spans = moving_spans(dq, rate)
    if not spans:
        return None
    points = _via_points(q, spans)
    moves = []
    for k, span in enumerate(spans):
        # the rests around the move show where it starts and ends
        before = (spans[k - 1].stop + span.start) // 2 if k else max(0, span.start - 50)
        after = (span.stop + spans[k + 1].start) // 2 if k + 1 < len(spans) else span.stop + 50
        window = slice(before, min(after, len(q)))
        complete = span.stop < len(q)
        ends = points[k : k + 2]
        move, reached = _fit_move(q[window], window.start / rate, rate, span, ends, complete)
        moves.append(move)
        # a move that the record cuts off would have gone on to its end
        points[k + 1] = points[k] + (points[k + 1] - points[k]) / reached
    return PointToPoint(tuple(moves), points)


def moving_spans(dq: np.ndarray, rate: float) -> list[slice]:
    """Samples of each move: where some joint is faster than a rest."""
    largest = np.abs(dq).max(axis=0)
    moving = (np.abs(dq) > REST * np.where(largest > 0, largest, 1.0)).any(axis=1)
    edges = np.flatnonzero(np.diff(np.r_[False, moving, False].astype(np.int8)))
    spans: list[slice] = []
    for start, stop in edges.reshape(-1, 2):
        if spans and start - spans[-1].stop < MIN_REST * rate:
            spans[-1] = slice(spans[-1].start, int(stop))
        else:
            spans.append(slice(int(start), int(stop)))
    return [s for s in spans if s.stop - s.start >= MIN_MOVE * rate]


def _via_points(q: np.ndarray, spans: Sequence[slice]) -> np.ndarray:
    """Mean position of each rest, shape (moves + 1, joints)."""
    bounds = [0] + [edge for s in spans for edge in (s.start, s.stop)] + [len(q)]
    rests = [
        slice(bounds[2 * k], max(bounds[2 * k + 1], bounds[2 * k] + 1))
        for k in range(len(spans) + 1)
    ]
    # the last sample stands for a rest that the record does not reach
    return np.stack([np.median(q[min(r.start, len(q) - 1) : r.stop], axis=0) for r in rests])


def _fit_move(
    q: np.ndarray, first: float, rate: float, span: slice, points: np.ndarray, complete: bool
) -> tuple[Move | QuinticMove, float]:
    """Timing of one move by least squares on all joints, and how much of its way is recorded."""
    from scipy.optimize import least_squares

    way = np.diff(points, axis=0)[0]
    used = np.abs(way) > 0.05 * np.abs(way).max()
    step = max(1, len(q) // FIT_SAMPLES)
    t = first + np.arange(0, len(q), step) / rate
    progress = ((q[::step, used] - points[0, used]) / way[used]) @ np.square(way[used])
    progress /= np.sum(np.square(way[used]))
    begin, length = span.start / rate, (span.stop - span.start) / rate

    def reached(s: np.ndarray) -> float:
        """Share of the way at the end: the scale between s and the recorded progress."""
        return 1.0 if complete else float(s @ s / max(s @ progress, 1e-12))

    def quintic(x: np.ndarray) -> QuinticMove:
        return QuinticMove(begin + length * x[0], length * np.exp(x[1]))

    def trapezoid(x: np.ndarray) -> Move:
        return Move(begin + length * x[0], *(length * np.exp(x[1:])))

    best: tuple[float, Move | QuinticMove] | None = None
    for make, *times in (
        (quintic, 1.05),
        (trapezoid, 0.25, 0.4, 0.1),
        (trapezoid, 0.4, 0.05, 0.15),
        (trapezoid, 0.1, 0.7, 0.1),
    ):
        start = np.r_[0.0, np.log(times)]
        bounds = (np.r_[-0.5, np.full(len(times), -7.0)], np.r_[0.5, np.full(len(times), 0.7)])
        scale = np.r_[0.05, np.ones(len(times))]

        def error(x: np.ndarray, make=make) -> np.ndarray:
            s = make(x).shape(t)[0]
            return s / reached(s) - progress

        found = least_squares(error, start, bounds=bounds, x_scale=scale)
        if best is None or found.cost < best[0]:
            best = found.cost, make(found.x)
        if best[0] < GOOD_FIT * t.size:
            break
    assert best is not None
    move = _ordered(best[1]) if isinstance(best[1], Move) else best[1]
    return move, reached(move.shape(t)[0])


def _ordered(move: Move) -> Move:
    """The same motion with the rounding no longer than the acceleration.

    The motion is a step averaged over ta, ta + tc and w one after the other, in any order.
    """
    w, ta, longest = sorted((move.rounding, move.acceleration, move.acceleration + move.cruise))
    return Move(move.start, ta, longest - ta, w)


#: Largest deviation, rms relative to the range of a joint, at which moves are believed: what a loop
#: of moderate gains leaves between its reference and its motion.
BELIEVED = 5e-3

#: Samples per parameter that a reference must be fitted to.
MIN_SAMPLES = 50


@dataclass(frozen=True, eq=False)
class ReconstructedReference:
    """A reference and how far it can be trusted."""

    kind: str  # ``point_to_point`` or ``spline``
    q: np.ndarray  # positions, shape (samples, joints) [rad or m]; ``dq ddq`` likewise
    dq: np.ndarray  # speeds
    ddq: np.ndarray  # accelerations
    moves: PointToPoint | None  # the moves, where it is made of such
    rms: np.ndarray  # deviation of the signal that it was fitted to, shape (joints,) [rad or m]
    relative: np.ndarray  # that over the joint's range, shape (joints,)
    freedom: float  # parameters per sample: what share of the noise it can follow

    def to_values(self) -> dict[str, Any]:
        """Kind and fit as plain values, for the file of a result."""
        return {
            "kind": self.kind,
            "moves": None if self.moves is None else len(self.moves.moves),
            "rms": self.rms,
            "relative": self.relative,
            "freedom": self.freedom,
        }

    def __str__(self) -> str:
        worst = int(np.argmax(self.relative))
        what = (
            f"{len(self.moves.moves)} moves from point to point"
            if self.moves is not None
            else "a smoothing spline"
        )
        return (
            f"{what}; the motion deviates by at most {self.relative[worst]:.2g} of its range (rms, "
            f"joint {worst + 1}), and the reference can follow {100 * self.freedom:.2g} % of the "
            "noise"
        )


def reconstruct_reference(signal: np.ndarray, rate: float) -> ReconstructedReference:
    """The simplest reference that a motion allows.

    ``signal``: positions, or what a control law says its reference was, (samples, joints)
    [rad or m].
    """
    smoothed = smooth_channels(signal, rate)
    span = np.maximum(np.ptp(signal, axis=0), 1e-12)
    moves = fit_point_to_point(smoothed.q, smoothed.dq, rate)
    if moves is not None:
        q, dq, ddq = moves.reference(np.arange(len(signal)) / rate)
        rms = np.sqrt(np.mean((signal - q) ** 2, axis=0))
        size = 4 * len(moves.moves) / signal.shape[1] + len(moves.points)
        if (rms / span).max() < BELIEVED and len(signal) > MIN_SAMPLES * size:
            freedom = size / len(signal)
            return ReconstructedReference(
                "point_to_point", q, dq, ddq, moves, rms, rms / span, freedom
            )
    spline = smooth_channels(signal, rate, order=2)
    rms = np.sqrt(np.mean((signal - spline.q) ** 2, axis=0))
    # a low-pass of half-power frequency f50 keeps that share of white noise's samples
    freedom = float(min(1.0, np.max(2.0 * np.atleast_1d(spline.f50) / rate)))
    return ReconstructedReference(
        "spline", spline.q, spline.dq, spline.ddq, None, rms, rms / span, freedom
    )
