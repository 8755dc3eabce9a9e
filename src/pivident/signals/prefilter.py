"""The prefilter L = λ^(-1/2) A(z⁻¹) N(z⁻¹)/D(z⁻¹), run block by block.

N/D is usually the stable inverse of the controller's proportional-derivative part and A whitens
the remaining noise, (P-28) and (P-29); λ is the variance of the whitened noise, so that its
root on both sides of the equation gives every joint its weight. All columns, instruments and the
torque pass the same causal filter. Filters keep their state: a record that is processed in blocks
gives the numbers of the whole.

In this module time is the *last* axis: each row is one column of the observation matrix,
contiguous in memory.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit

from pivident.compiled import section
from pivident.errors import IdentificationError

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


@dataclass(frozen=True, eq=False)
class Prefilter:
    """One joint's prefilter; coefficients of z⁻¹, earliest first."""

    numerator: Sequence[float] | np.ndarray = (1.0,)  # N
    denominator: Sequence[float] | np.ndarray = (1.0,)  # D, all poles inside the unit circle
    fir: Sequence[float] | np.ndarray = (1.0,)  # A, monic whitening polynomial; (1,) for none
    variance: float = 1.0  # λ, variance of the whitened noise

    def stream(self, rows: int, threads: int = 2) -> StreamingFilter:
        """A filter at rest for that many rows."""
        taps = np.asarray(self.fir, dtype=float) / math.sqrt(self.variance)
        return StreamingFilter(self.numerator, self.denominator, taps, rows, threads)

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

    def reset(self) -> None:
        """Return to rest, as at the start of another record."""
        self._state[:] = 0.0
        self._history[:] = 0.0

    def process(self, x: np.ndarray, out: np.ndarray | None = None) -> np.ndarray:
        """Filter the next block (rows, block) into ``out``, which may be x itself."""
        rows = len(self._state)
        x = np.ascontiguousarray(x, dtype=float)
        if x.shape[0] != rows:
            raise ValueError(f"block of {x.shape[0]} rows for a filter of {rows} rows")
        out = np.empty_like(x) if out is None else out

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
            f"the prefilter has a pole of modulus {slowest:.6g}; it must be below one. Leave the "
            "integrator out of the controller's inverse and reflect zeros outside the unit circle"
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


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True, fastmath={"contract"})
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
