"""Linear response of one signal to another, as a short series of Laguerre filters.

    y = Σ_i c_i L_i(z) x + e,   L_0 = √(1-a²)/(1 - a z⁻¹),   L_i = L_{i-1} (z⁻¹ - a)/(1 - a z⁻¹)

Laguerre filters are orthonormal for white x, and a few of them describe any well-damped response
once their time constant T, a = exp(-1/(T rate)), is about right (Wahlberg 1991). T and the number
of terms are those of the smallest BIC. The response is linear in c: a fit needs no iteration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Time constants tried [sampling periods], and the largest number of terms.
TIME_CONSTANTS = (1.5, 3.0, 6.0, 12.0, 25.0, 50.0, 100.0, 200.0, 400.0)
MAX_TERMS = 8

#: A further column must be new by this much of its length, or its coefficient is arbitrary.
NEW_SHARE = 1e-3

#: Time constants of the slowest term after which a response has forgotten where it started.
FORGOTTEN = 6.0


@dataclass(frozen=True, eq=False)
class LinearResponse:
    """How one signal follows another.

    Attributes:
        time_constant: T [sampling periods].
        coefficients: of x one sample ahead, of x itself, then c_i, shape (2 + terms,).
        explained: share of the variance of y.
    """

    time_constant: float
    coefficients: np.ndarray
    explained: float

    @property
    def settling(self) -> int:
        """Samples until the start of the record is forgotten."""
        terms = len(self.coefficients) - 2
        return int(np.ceil(FORGOTTEN * self.time_constant * max(terms, 1) ** 0.5))

    def of(self, x: np.ndarray) -> np.ndarray:
        """The response to a signal that was mirrored at its first value before, (samples,)."""
        margin, terms = min(self.settling, x.size - 1), len(self.coefficients) - 2
        extended = odd_extension(x, margin)
        first = extended[0]
        columns = _columns(extended - first, self.time_constant, terms)[:, margin:][:, : x.size]
        gain = float(self.coefficients @ _gains(self.time_constant, terms))
        return self.coefficients @ columns + gain * first


def odd_extension(x: np.ndarray, margin: int) -> np.ndarray:
    """A signal with so many samples more at both ends, mirrored at the end points."""
    before = 2.0 * x[0] - x[margin:0:-1]
    after = 2.0 * x[-1] - x[-2 : -2 - margin : -1]
    return np.concatenate([before, x, after])


def fit_response(x: np.ndarray, y: np.ndarray, used: slice) -> LinearResponse:
    """The response of y to x with the smallest BIC.

    Args:
        x: signal that is followed, shape (samples,).
        y: signal that follows it, shape (samples,).
        used: samples of y that are fitted.

    Returns:
        The response; that of a signal x without any motion explains nothing.
    """
    from scipy.linalg import qr, solve_triangular

    target = y[used]
    total, best = float(target @ target), None
    for time_constant in TIME_CONSTANTS:
        if FORGOTTEN * time_constant > 0.1 * target.size:
            break
        columns = _columns(x, time_constant, MAX_TERMS)[:, used].T
        scale = np.sqrt(np.sum(columns**2, axis=0))
        if not scale.all():
            break
        q, r = qr(columns / scale, mode="economic")
        shares = q.T @ target
        left = total - np.cumsum(shares**2)
        for terms in range(MAX_TERMS + 1):
            count = 2 + terms
            if abs(r[count - 1, count - 1]) < NEW_SHARE:
                break  # the columns so far say all that there is
            variance = max(left[count - 1], 1e-12 * total) / target.size
            score = target.size * np.log(variance) + count * np.log(target.size)
            if best is None or score < best[0]:
                own = solve_triangular(r[:count, :count], shares[:count]) / scale[:count]
                best = (score, time_constant, own, 1.0 - left[count - 1] / total)
    if best is None:
        return LinearResponse(TIME_CONSTANTS[0], np.zeros(2), 0.0)
    return LinearResponse(best[1], best[2], float(np.clip(best[3], 0.0, 1.0)))


def _columns(x: np.ndarray, time_constant: float, terms: int) -> np.ndarray:
    """X ahead, x, L_0 x, L_1 x, …, shape (2 + terms, samples)."""
    from scipy.signal import lfilter

    a = np.exp(-1.0 / time_constant)
    out = np.empty((2 + terms, x.size))
    out[0, :-1], out[0, -1] = x[1:], 2.0 * x[-1] - x[-2]
    out[1] = x
    for i in range(terms):
        numerator = [np.sqrt(1.0 - a**2)] if i == 0 else [-a, 1.0]
        out[2 + i] = lfilter(numerator, [1.0, -a], x if i == 0 else out[1 + i])
    return out


def _gains(time_constant: float, terms: int) -> np.ndarray:
    """What each column makes of a constant, shape (2 + terms,): all-pass stages keep it."""
    a = np.exp(-1.0 / time_constant)
    return np.r_[1.0, 1.0, np.full(terms, np.sqrt(1.0 - a**2) / (1.0 - a))]
