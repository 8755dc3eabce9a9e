"""The prefilter L = λ^(-1/2) A(z⁻¹) N(z⁻¹)/D(z⁻¹), run block by block.

N/D is usually the stable inverse of the controller's proportional-derivative part and A whitens
the remaining noise, (P-28) and (P-29); λ is the variance of the whitened noise, so that its
root on both sides of the equation gives every joint its weight. All columns, instruments and the
torque pass the same causal filter. Filters keep their state: a record that is processed in blocks
gives the numbers of the whole.

In this module time is the *last* axis: each row is one column of the observation matrix,
contiguous in memory.

Where some samples are excluded, a filter that is A alone begins anew after them: sample d of a
stretch is predicted from the d samples before it, with the predictor of order d that belongs to A
(Levinson's recursion backwards), and weighted by that predictor's own variance. These are the
equations of generalised least squares on separate stretches; nothing of an excluded sample reaches
them, and none of them is lost.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np

from pivident.foundation.compiled import compiled, section
from pivident.foundation.errors import IdentificationError
from pivident.foundation.text.plain_values import As, Limits

#: Taps that the compiled filter adds up in one pass over a tile; filters are padded to it.
_TAPS = 8

#: Rows that are filtered side by side: one vector of the processor. Samples of eight rows are
#: adjacent, so that the next sample begins one vector further: loads that cross cache lines would
#: take twice as long, and they limit a filter of many taps.
_SIDE_BY_SIDE = (0,) * 8

#: Fewer rows than this are filtered one by one.
_FEWEST_SIDE_BY_SIDE = 4

#: Numbers of a tile, whose sums stay in the first-level cache.
_TILE = 1024

#: Samples that are filtered at a time, which stay in the second-level cache.
_STRETCH = 1024

#: Below this many multiplications a pool of threads costs more than it saves.
_WORTH_A_THREAD = 2_000_000


#: Coefficients of z⁻¹, at least one.
Coefficients = Annotated[
    Sequence[float] | np.ndarray,
    As(
        Annotated[tuple[float, ...], Limits(min_length=1)],
        lambda given: np.asarray(given, dtype=float),
        tuple,
    ),
]


@dataclass(frozen=True, eq=False)
class Prefilter:
    """One joint's prefilter; coefficients of z⁻¹, earliest first."""

    numerator: Coefficients = (1.0,)  # N
    denominator: Coefficients = (1.0,)  # D, all poles inside the unit circle
    fir: Coefficients = (1.0,)  # A, monic whitening polynomial; (1,) for none
    variance: Annotated[float, Limits(gt=0.0)] = 1.0  # λ, variance of the whitened noise

    def stream(self, rows: int, threads: int = 2) -> StreamingFilter:
        """A filter at rest for that many rows."""
        taps = np.asarray(self.fir, dtype=float) / math.sqrt(self.variance)
        return StreamingFilter(self.numerator, self.denominator, taps, rows, threads)

    @property
    def begins_anew(self) -> bool:
        """Whether it begins anew after excluded samples: A alone has a predictor of every order."""
        return len(self.numerator) == len(self.denominator) == 1

    def response(self, frequency: np.ndarray, rate: float) -> np.ndarray:
        """L(e^{jω}) = λ^(-1/2) A N/D, ω = 2π f/rate, complex, shape (points,)."""
        back = np.exp(-2j * np.pi * np.asarray(frequency, dtype=float) / rate)
        fir, numerator, denominator = (
            np.polyval(np.asarray(p, dtype=float)[::-1], back)
            for p in (self.fir, self.numerator, self.denominator)
        )
        return fir * numerator / denominator / math.sqrt(self.variance)

    def transient(self, tolerance: float = 1e-4) -> int:
        """Samples until the filter has forgotten its start, see :func:`transient_length`."""
        return transient_length(
            self.numerator, self.denominator, len(self.fir) - 1, tolerance=tolerance
        )


class StreamingFilter:
    """y = FIR(z⁻¹) N(z⁻¹)/D(z⁻¹) x on many rows at once, each with a state carried on."""

    def __init__(
        self,
        numerator: Sequence[float] | np.ndarray,
        denominator: Sequence[float] | np.ndarray,
        fir: Sequence[float] | np.ndarray,
        rows: int,
        threads: int = 2,
    ) -> None:
        numerator = np.asarray(numerator, dtype=float)
        denominator = np.asarray(denominator, dtype=float)
        fir = np.asarray(fir, dtype=float)
        length = max(len(numerator), len(denominator))
        self._numerator = np.zeros(length)
        self._denominator = np.zeros(length)
        self._numerator[: len(numerator)] = numerator / denominator[0]
        self._denominator[: len(denominator)] = denominator / denominator[0]
        self._taps = np.zeros(-(-len(fir) // _TAPS) * _TAPS)
        self._taps[: len(fir)] = fir
        self._state = np.zeros((rows, length - 1))
        self._history = np.zeros((rows, len(self._taps) - 1))
        self._threads = threads
        self._fir = fir if length == 1 else fir[:1]
        self._age = 0  # samples of the present stretch so far
        self._predictors: np.ndarray | None = None

    def reset(self) -> None:
        """Return to rest, as at the start of another record."""
        self._state[:] = 0.0
        self._history[:] = 0.0
        self._age = 0

    def process(
        self, x: np.ndarray, out: np.ndarray | None = None, seen: np.ndarray | None = None
    ) -> np.ndarray:
        """Filter the next block (rows, block) into ``out``, which may be x itself.

        ``seen``: samples that are not excluded, shape (block,): where the filter begins anew after
        excluded ones, what it gives at those themselves means nothing.
        """
        rows = len(self._state)
        x = np.ascontiguousarray(x, dtype=float)
        if x.shape[0] != rows:
            raise ValueError(f"block of {x.shape[0]} rows for a filter of {rows} rows")
        order = len(self._fir) - 1
        if seen is None or order == 0 or (seen.all() and self._age >= order):
            return self._processed(x, np.empty_like(x) if out is None else out)
        before = self._history[:, self._history.shape[1] - order :] / self._numerator[0]
        inputs = np.hstack([before, x])
        out = self._processed(x, np.empty_like(x) if out is None else out)
        if self._predictors is None:
            self._predictors = lower_predictors(self._fir)
        scale = self._numerator[0] * self._taps[0]
        seen = np.ascontiguousarray(seen)
        self._age = _begin_anew(inputs, seen, self._age, self._predictors * scale, out)
        return out

    def _processed(self, x: np.ndarray, out: np.ndarray) -> np.ndarray:
        """The filter without regard to excluded samples."""
        rows = len(self._state)

        def work(part: slice) -> None:
            _filter_rows(
                x[part],
                self._numerator,
                self._denominator,
                self._taps,
                self._state[part],
                self._history[part],
                out[part],
            )

        threads = self._threads if x.size * len(self._taps) > _WORTH_A_THREAD else 1
        if threads == 1:
            work(slice(0, rows))
            return out
        bounds = np.linspace(0, rows, min(threads, rows) + 1).astype(int)
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, [slice(*pair) for pair in pairwise(bounds)]))
        return out


def lower_predictors(fir: np.ndarray) -> np.ndarray:
    """Predictors of the orders 0 to p - 1 that belong to A of order p, weighted to its variance.

    Levinson's recursion backwards: k = a_d, a'_i = (a_i - k a_{d-i})/(1 - k²), λ' = λ/(1 - k²).
    Row d of the result, shape (p, p), holds √(λ_p/λ_d) a_0 … a_d, then zeros.

    Raises:
        IdentificationError: A has a root outside the unit circle.
    """
    a = np.asarray(fir, dtype=float) / fir[0]
    order = len(a) - 1
    made, weight = np.zeros((order, order)), 1.0
    for d in range(order - 1, -1, -1):
        k = a[-1]
        left = 1.0 - k * k
        if left <= 0.0:
            raise IdentificationError(
                f"the noise model of order {order} is not stable: reflection {k:.4g} at order "
                f"{d + 1}",
                advice="use a smaller p_max",
            )
        a = (a[:-1] - k * a[:0:-1]) / left
        weight *= left
        made[d, : d + 1] = math.sqrt(weight) * a
    return made


@compiled()
def _begin_anew(x, seen, age, predictors, out):
    """Samples with fewer than p of their stretch before them, by the predictors of lower orders.

    x has p samples before those of the block; ``age`` counts the samples of the present stretch.
    """
    order = len(predictors)
    for t in range(seen.size):
        if not seen[t]:
            age = 0
            continue
        if age < order:
            for r in range(len(out)):
                total = 0.0
                for i in range(age + 1):
                    total += predictors[age, i] * x[r, order + t - i]
                out[r, t] = total
        age += 1
    return age


def transient_length(
    numerator: Sequence[float] | np.ndarray,
    denominator: Sequence[float] | np.ndarray,
    order: int,
    tolerance: float = 1e-4,
) -> int:
    """Samples until the start is forgotten: p + deg N + ln(tolerance) / ln(max |pole|)."""
    poles = np.abs(np.roots(np.asarray(denominator, dtype=float)))
    slowest = float(poles.max(initial=0.0))
    if slowest >= 1:
        raise IdentificationError(
            f"the prefilter has a pole of modulus {slowest:.6g}",
            advice="it must be below one. Leave the integrator out of the controller's inverse "
            "and reflect zeros outside the unit circle",
        )
    decay = math.ceil(math.log(tolerance) / math.log(slowest)) if slowest > 0 else 0
    return order + len(numerator) - 1 + decay


def _filter_rows(x, numerator, denominator, taps, state, history, out):
    """Recursive part, then taps, on every row; state and history are updated."""
    for first in range(0, x.shape[0], len(_SIDE_BY_SIDE)):
        last = min(first + len(_SIDE_BY_SIDE), x.shape[0])
        if last - first < _FEWEST_SIDE_BY_SIDE:
            for r in range(first, last):
                _filter_group(x, numerator, denominator, taps, state, history, out, r, r + 1, (0,))
        else:
            _filter_group(
                x, numerator, denominator, taps, state, history, out, first, last, _SIDE_BY_SIDE
            )


@compiled()
def _filter_group(x, numerator, denominator, taps, state, history, out, first, last, side):
    """Some rows side by side; the tuple ``side`` makes their number a constant of the code."""
    past, order, lanes = taps.size - 1, state.shape[1], len(side)
    samples = _TILE // lanes
    length = min(_STRETCH, x.shape[1])
    inner, sums = _aligned((past + length) * lanes), _aligned(samples * lanes)
    rest = np.zeros((order, lanes))
    for r in range(last - first):
        for i in range(order):
            rest[i, r] = state[first + r, i]
        for t in range(past):
            inner[t * lanes + r] = history[first + r, t]
    for start in range(0, x.shape[1], _STRETCH):
        length = min(_STRETCH, x.shape[1] - start)
        for t in range(0, length, samples):
            count = min(samples, length - t)
            fresh = inner[(past + t) * lanes : (past + t + count) * lanes]
            table = fresh.reshape(count, lanes)
            for r in range(last - first):
                row = x[first + r, start + t : start + t + count]
                for k in range(count):
                    table[k, r] = row[k]
            _recursive(fresh, numerator, denominator, rest, side)
            y = sums[: count * lanes]
            filtered = y.reshape(count, lanes)
            _convolve(inner[t * lanes : (t + past + count) * lanes], taps, y, side)
            for r in range(last - first):
                row = out[first + r, start + t : start + t + count]
                for k in range(count):
                    row[k] = filtered[k, r]
        for t in range(past * lanes):
            inner[t] = inner[length * lanes + t]
    for r in range(last - first):
        for i in range(order):
            state[first + r, i] = rest[i, r]
        for t in range(past):
            history[first + r, t] = inner[t * lanes + r]


@compiled()
def _aligned(size):
    """Zeros that begin on a cache line of 64 bytes."""
    memory = np.zeros(size + 8)
    begin = (-(memory.ctypes.data // 8)) % 8
    return memory[begin : begin + size]


@section
def _recursive(y, numerator, denominator, state, side):
    """Direct form II transposed of N/D, D monic, in place on rows side by side.

    Within a row each sample depends on the one before; the other rows hide that latency.
    """
    order, lanes = state.shape[0], len(side)
    if order == 0:
        for i in range(y.size):
            y[i] *= numerator[0]
        return
    table = y.reshape(y.size // lanes, lanes)
    for t in range(len(table)):
        for r in range(lanes):
            x = table[t, r]
            now = numerator[0] * x + state[0, r]
            for i in range(1, order):
                state[i - 1, r] = state[i, r] + numerator[i] * x - denominator[i] * now
            state[order - 1, r] = numerator[order] * x - denominator[order] * now
            table[t, r] = now


@compiled(fastmath={"contract"})
def _convolve(x, taps, y, side):
    """y_t = Σ_k taps_k x_{t + past - k}: taps outside, samples inside, so that it vectorises.

    Contraction (fused multiply-add) is the only fast arithmetic allowed; NaN is kept.
    """
    past, lanes = taps.size - 1, len(side)
    y[:] = 0.0
    for k in range(0, taps.size, _TAPS):
        c0, c1, c2, c3, c4, c5, c6, c7 = taps[k : k + _TAPS]
        z = x[(past - k - _TAPS + 1) * lanes :]
        for t in range(y.size):
            y[t] += (
                c0 * z[t + 7 * lanes]
                + c1 * z[t + 6 * lanes]
                + c2 * z[t + 5 * lanes]
                + c3 * z[t + 4 * lanes]
                + c4 * z[t + 3 * lanes]
                + c5 * z[t + 2 * lanes]
                + c6 * z[t + lanes]
                + c7 * z[t]
            )
