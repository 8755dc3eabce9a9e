"""Order analysis: waves over the position, not over time, in a residual.

A ripple a cos(nφ) + b sin(nφ) of an angle φ(t) has the instantaneous frequency ω = n dφ/dt. After
the whitening filter A(z⁻¹) of an autoregressive noise model it is, as long as the speed changes
little over the length of the filter,

    A(e^-iω) e^inφ,   so that   A e = Re[(a - ib) A(e^-iω) e^inφ] + white noise

is generalised least squares order by order, on positions visited at any speed. The gain of two
columns in log-likelihood, gain(n) = ½ bᵀM⁻¹b, is exponential with mean 1 if there is only noise.
Model error is not such noise: the floor is the running median of the gain over neighbouring orders,
and the ratio F to it has the tail (1 + F/K)⁻ᴷ, where K is the number of independent values behind
the floor. Over all orders tried, the false-alarm probability follows from the rate at which an
envelope crosses a level (Rice 1945; Davies 1987; Baluev 2008 for periodograms),

    P = 1 - exp[-(1 + √F ∫ √(var φ / π) dn) (1 + F/K')^-K'],   K' = 3.5 K.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pivident.foundation.compiled import compiled

#: Orders per independent order.
OVERSAMPLING = 4

#: Highest instantaneous frequency of a ripple at which a sample is used, as a share of half the
#: sampling rate.
HIGHEST_FREQUENCY = 0.8

#: Smallest share of the rows that must be slow enough for an order to be tried.
MIN_SHARE = 0.1

#: Half the neighbourhood of an order: a share of the order, within bounds [independent orders].
_SHARE, _FEWEST, _MOST = 0.5, 8.0, 60.0

#: Independent values behind a running median, as a share of the independent orders under it: the
#: variance of a median of exponential variables is 1/ln²2 times that of their mean.
_MEDIAN = math.log(2.0) ** 2

#: Degrees of freedom of the tail over all orders, in K. The union over orders counts a low floor
#: once for each order above it, so (1 + F/K)⁻ᴷ would give 1 to 2 % for 5 %. Set by simulation of
#: three kinds of records of coloured noise, 150 to 400 each: 3 to 7 % with 3 K, 4 to 9 % with 4 K.
_TAIL = 3.5

#: Points of the table of the whitening filter's frequency response.
_TABLE = 4096

#: Width of an independent order times the standard deviation of uniformly visited positions.
_CELL = 2.0 * math.pi / math.sqrt(12.0)


@dataclass(frozen=True, eq=False)
class WhiteRows:
    """Whitened residual of one joint on the rows in use, with the angle φ of the analysis."""

    white: np.ndarray  # A e / s, of unit variance, shape (rows,)
    angle: np.ndarray  # φ, shape (rows,) [rad or m]
    step: np.ndarray  # its change per sample, shape (rows,) [rad or m]
    filter: np.ndarray  # A / s, shape (order + 1,)


@dataclass(frozen=True, eq=False)
class OrderSpectrum:
    """Gain in log-likelihood of each order; arrays (orders,)."""

    orders: np.ndarray  # n, phase per angle [rad/rad or rad/m]
    gain: np.ndarray  # log-likelihood gained by a wave of that order
    floor: np.ndarray  # average gain from noise and model error at that order
    freedom: np.ndarray  # K, independent values behind the floor
    information: np.ndarray  # Σ|A|²/s² over the rows used; a wave of amplitude a gains a²/4 of it
    spread: np.ndarray  # standard deviation of the angle over the rows used [rad or m]
    share: np.ndarray  # share of the rows used: those slow enough for the sampling
    searched: np.ndarray  # orders with enough cycles and rows
    trials: float  # ∫ √(var φ/π) dn over all orders searched, with this angle and others

    @property
    def amplitude(self) -> np.ndarray:
        """Amplitude with that gain [N m or N]."""
        return 2.0 * np.sqrt(self.gain / np.maximum(self.information, 1e-300))

    def false_alarm(self, k: int) -> float:
        """Probability that noise produces such a line anywhere among the orders searched."""
        return false_alarm(float(self.gain[k] / self.floor[k]), float(self.freedom[k]), self.trials)

    def significance(self, k: int) -> float:
        """-log of the probability of such a gain at this order."""
        return self.significance_of(float(self.gain[k]), k)

    def significance_of(self, gain: float, k: int) -> float:
        """-log of the probability of another gain at this order."""
        freedom = _TAIL * float(self.freedom[k])
        return freedom * math.log1p(gain / float(self.floor[k]) / freedom)

    def resolution(self, k: int) -> float:
        """Width of an independent order [rad/rad or rad/m]."""
        return _CELL / max(float(self.spread[k]), 1e-12)

    def single(self, k: int) -> float:
        """Probability of such a gain at an order named beforehand."""
        freedom = float(self.freedom[k])
        return math.exp(-freedom * math.log1p(float(self.gain[k] / self.floor[k]) / freedom))

    def smallest_visible(self, level: float = 0.05) -> np.ndarray:
        """Smallest amplitude that counts as a line at this false-alarm probability [N m or N]."""
        freedom = _TAIL * self.freedom
        low, high = np.zeros(self.orders.size), np.full(self.orders.size, 1e4)
        for _ in range(50):
            middle = 0.5 * (low + high)
            tail = (1.0 + self.trials * np.sqrt(middle)) * np.exp(
                -freedom * np.log1p(middle / freedom)
            )
            above = tail > -math.log1p(-level)
            low, high = np.where(above, middle, low), np.where(above, high, middle)
        size = 2.0 * np.sqrt(high * self.floor / np.maximum(self.information, 1e-300))
        return np.where(self.searched, size, np.nan)

    def best(self) -> int | None:
        """Index of the most significant order; None if none could be searched."""
        if not self.searched.any():
            return None
        freedom = _TAIL * self.freedom
        ratio = freedom * np.log1p(self.gain / self.floor / freedom)
        return int(np.argmax(np.where(self.searched, ratio, -1.0)))


def false_alarm(ratio: float, freedom: float, trials: float) -> float:
    """P of the module's docstring: F = ratio, K = freedom, ∫ √(var φ/π) dn = trials."""
    freedom = _TAIL * freedom
    expected = (1.0 + trials * math.sqrt(ratio)) * math.exp(-freedom * math.log1p(ratio / freedom))
    return -math.expm1(-expected)


def order_grid(angle: np.ndarray, highest: float, most: int = 24000) -> np.ndarray:
    """At most ``most`` equally spaced orders, from one cycle over the range of the angle up."""
    reach = float(np.ptp(angle))
    if reach <= 0.0:
        return np.empty(0)
    spacing = 2.0 * math.pi / reach / OVERSAMPLING
    count = int(highest / spacing) - OVERSAMPLING + 1
    return spacing * (OVERSAMPLING + np.arange(min(max(count, 0), most)))


def order_spectrum(rows: WhiteRows, orders: np.ndarray, cycles: float) -> OrderSpectrum:
    """Gain and floor of the orders with at least ``cycles`` over the visited positions."""
    if orders.size < 2 or rows.white.size == 0:
        return OrderSpectrum(*(np.zeros(0),) * 7, np.zeros(0, bool), 0.0)
    centre = float(rows.angle.mean())
    sums = _scan(
        float(orders[0]),
        float(orders[1] - orders[0]),
        orders.size,
        rows.white,
        rows.angle - centre,
        rows.step,
        _response(rows.filter),
        HIGHEST_FREQUENCY * math.pi,
    )
    right, cc, ss, cs, weight, first, second, used = sums
    gain = 0.5 * _quadratic(right, cc, ss, cs)
    safe = np.maximum(weight, 1e-300)
    spread = np.sqrt(np.maximum(second / safe - (first / safe) ** 2, 0.0))
    share = used / rows.white.size
    enough = orders * spread * math.sqrt(12.0) / (2.0 * math.pi)
    possible = (share >= MIN_SHARE) & (used >= 50)
    searched = possible & (enough >= cycles)
    floor, freedom = _floor(orders, gain, spread, possible)
    trials = float(np.sum(spread[searched]) / math.sqrt(math.pi) * (orders[1] - orders[0]))
    return OrderSpectrum(orders, gain, floor, freedom, weight, spread, share, searched, trials)


def _floor(
    orders: np.ndarray, gain: np.ndarray, spread: np.ndarray, possible: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Running median of the gain, scaled to a mean, and the number of independent values in it."""
    spacing = orders[1] - orders[0]
    cell = _CELL / np.maximum(spread, 1e-12)
    half = np.clip(_SHARE * orders / cell, _FEWEST, _MOST) * cell / spacing
    floor, freedom = np.ones(orders.size), np.ones(orders.size)
    where = np.flatnonzero(possible)
    if not where.size:
        return floor, freedom
    first, last = int(where[0]), int(where[-1]) + 1
    some = where[np.unique(np.r_[0 : where.size : OVERSAMPLING, where.size - 1])]
    for k in some:
        reach = int(half[k]) + 1
        below = gain[max(k - reach, first) : max(k - OVERSAMPLING, first)]
        above = gain[min(k + OVERSAMPLING + 1, last) : min(k + reach + 1, last)]
        near = np.concatenate([below, above])
        floor[k] = np.median(near) / math.log(2.0)
        freedom[k] = max(_MEDIAN * near.size * spacing / cell[k], 1.0)
    floor[where] = np.interp(where, some, floor[some])
    freedom[where] = np.interp(where, some, freedom[some])
    return np.maximum(floor, 1e-12), freedom


def _quadratic(b: np.ndarray, cc: np.ndarray, ss: np.ndarray, cs: np.ndarray) -> np.ndarray:
    """bᵀM⁻¹b of the two columns of every order; zero if they are not independent."""
    determinant = cc * ss - cs**2
    good = determinant > 1e-9 * cc * ss
    value = ss * b[0] ** 2 - 2.0 * cs * b[0] * b[1] + cc * b[1] ** 2
    return np.where(good, value / np.where(good, determinant, 1.0), 0.0)


def _response(coefficients: np.ndarray) -> np.ndarray:
    """A(e^-iω)/s on a grid of ω from 0 to π."""
    omega = np.linspace(0.0, math.pi, _TABLE)
    return np.polyval(coefficients[::-1], np.exp(-1j * omega)).astype(complex)


@compiled(fastmath=True)
def _scan(lowest, spacing, count, white, angle, step, response, top):
    """Normal equations of cosine and sine at each order, and moments of the angle."""
    rows = white.size
    points = (response.size - 1) / np.pi
    right = np.zeros((2, count))
    cc, ss, cs = np.zeros(count), np.zeros(count), np.zeros(count)
    weight, first, second = np.zeros(count), np.zeros(count), np.zeros(count)
    used = np.zeros(count)
    wave, turn = np.empty(rows, np.complex128), np.empty(rows, np.complex128)
    for i in range(rows):
        wave[i] = np.exp(1j * lowest * angle[i])
        turn[i] = np.exp(1j * spacing * angle[i])
    for k in range(count):
        order = lowest + k * spacing
        for i in range(rows):
            z = wave[i]
            wave[i] = z * turn[i]
            omega = order * step[i]
            if abs(omega) > top:
                continue
            a = response[int(abs(omega) * points + 0.5)]
            if omega < 0.0:
                a = np.conj(a)
            x = a * z
            c, s = x.real, x.imag
            right[0, k] += c * white[i]
            right[1, k] += s * white[i]
            cc[k] += c * c
            ss[k] += s * s
            cs[k] += c * s
            power = c * c + s * s
            weight[k] += power
            first[k] += power * angle[i]
            second[k] += power * angle[i] * angle[i]
            used[k] += 1.0
    return right, cc, ss, cs, weight, first, second, used
