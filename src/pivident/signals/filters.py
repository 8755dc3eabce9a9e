"""Linear filters: Butterworth and Chebyshev low-passes, recursions, convolution.

A low-pass is a chain of second-order sections, each

    y = b₀ x + z₀,     z₀ ← b₁ x - a₁ y + z₁,     z₁ ← b₂ x - a₂ y

(direct form II, transposed). Designs, conventions and the order of all operations are those of
``scipy.signal``, whose import takes as long as an identification; all channels of a record run
side by side here.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import count

import numpy as np
from numpy.polynomial.polynomial import polyval

from pivident.foundation.compiled import kernel


@lru_cache(maxsize=64)
def butterworth_sections(order: int, cutoff: float, rate: float) -> np.ndarray:
    """Second-order sections of a Butterworth low-pass, shape (sections, 6).

    Poles of the analogue one: s_m = -exp(jπ m/(2n)), m = -n + 1, -n + 3, …, n - 1.

    Args:
        order: n.
        cutoff: frequency of -3 dB, in the unit of ``rate``.
        rate: sampling rate.
    """
    poles = -np.exp(1j * np.pi * _indices(order) / (2 * order))
    return _digital(poles, 1.0, 2.0 * cutoff / rate)


def chebyshev_sections(order: int, ripple: float, edge: float) -> np.ndarray:
    """Second-order sections of a Chebyshev low-pass of type I, shape (sections, 6).

    Poles of the analogue one: s_m = -sinh(μ + jπ m/(2n)), μ = asinh(1/ε)/n, m as above, with
    ε² = 10^(ripple/10) - 1.

    Args:
        order: n, even.
        ripple: of the pass band [dB].
        edge: of the pass band, as a share of half the sampling rate.
    """
    epsilon = np.sqrt(10 ** (0.1 * ripple) - 1.0)
    mu = 1.0 / order * np.arcsinh(1 / epsilon)
    poles = -np.sinh(mu + 1j * (np.pi * _indices(order) / (2 * order)))
    gain = np.prod(-poles, axis=0).real / np.sqrt(1 + epsilon * epsilon)
    return _digital(poles, gain, edge)


def _indices(order: int) -> np.ndarray:
    return np.arange(-order + 1, order, 2)


def _digital(poles: np.ndarray, gain: float, edge: float) -> np.ndarray:
    """Sections of an analogue low-pass of unit edge by the bilinear transform; zeros are at -1.

    Sections of poles nearest to the unit circle come last.
    """
    twice = 4.0  # twice the sampling rate, which is two where half of it is one
    warped = twice * np.tan(np.pi * edge / 2.0)
    analogue = warped * poles
    digital = (twice + analogue) / (twice - analogue)
    gain = gain * warped ** len(poles) * np.real(1.0 / np.prod(twice - analogue))
    upper = digital[_indices(len(poles)) >= 0]  # of each pair of poles one, and the real pole
    rows = []
    for pole in upper[np.argsort(-np.abs(1.0 - np.abs(upper)), kind="stable")]:
        if pole.imag == 0.0:
            rows.append([1.0, 1.0, 0.0, 1.0, -pole.real, 0.0])
        else:
            square = (pole * pole.conj()).real
            rows.append([1.0, 2.0, 1.0, 1.0, -(pole + pole.conj()).real, square])
    sections = np.array(rows)
    sections[0, :3] *= gain
    return sections


def run_sections(sections: np.ndarray, x: np.ndarray) -> np.ndarray:
    """X through all sections, from rest, along axis 0."""
    y = np.array(x, dtype=float).reshape(len(x), -1)
    _run_sections(sections, y, np.zeros((len(sections), 2, y.shape[1])))
    return y.reshape(np.shape(x))


def forwards_and_backwards(
    sections: np.ndarray, x: np.ndarray, extension: int, *, held: bool = False
) -> np.ndarray:
    """X through all sections forwards and then backwards along axis 0, without phase.

    Args:
        sections: shape (sections, 6).
        x: shape (samples, …).
        extension: samples by which the record is continued at both ends, each run beginning in the
            steady state of its first sample.
        held: whether it is continued by its end samples, not by its mirror image through them.
    """
    flat = np.asarray(x, dtype=float).reshape(len(x), -1)
    first, last = flat[:1], flat[-1:]
    if held:
        ends = np.repeat(first, extension, axis=0), np.repeat(last, extension, axis=0)
    else:
        ends = (
            2 * first - flat[extension:0:-1],
            2 * last - flat[-2 : -(extension + 2) : -1],
        )
    y = np.concatenate((ends[0], flat, ends[1])) if extension else flat.copy()
    steady = _steady_sections(sections.tobytes())[:, :, None]
    _run_sections(sections, y, steady * y[0])
    y = np.ascontiguousarray(y[::-1])
    _run_sections(sections, y, steady * y[0])
    return np.ascontiguousarray(y[extension : extension + len(flat)][::-1]).reshape(np.shape(x))


def sections_response(sections: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """H(e^jω) of all sections in series at angular frequencies [rad/sample], shape as of omega."""
    backwards = np.exp(-1j * omega)
    response = np.ones(np.shape(omega), complex)
    for section in sections:
        response *= polyval(backwards, section[:3]) / polyval(backwards, section[3:])
    return response


def recursion(
    b: np.ndarray, a: np.ndarray, x: np.ndarray, state: np.ndarray | None = None
) -> np.ndarray:
    """B(z)/A(z) on x, shape (samples,), as ``scipy.signal.lfilter``; a state None is rest."""
    order = max(len(a), len(b))
    b, a = (np.r_[c, np.zeros(order - len(c))] / a[0] for c in (b, a))
    y = np.array(x, dtype=float)
    _recursion(b, a, y, np.zeros(max(order - 1, 1)) if state is None else np.array(state))
    return y


def steady_state(b: np.ndarray, a: np.ndarray) -> np.ndarray:
    """State of `recursion` that a unit step has led to, shape (order,)."""
    order = max(len(a), len(b))
    b, a = (np.r_[c, np.zeros(order - len(c))] / a[0] for c in (b, a))
    feedback = np.eye(order - 1) - np.eye(order - 1, k=1)
    feedback[:, 0] += a[1:]
    return np.linalg.solve(feedback, b[1:] - a[1:] * b[0])


def fast_length(least: int) -> int:
    """Smallest length from some on without prime factors but 2, 3 and 5: its transform is fast."""
    # such numbers below 2⁶⁰, and no others, divide the sixtieth power of 2 · 3 · 5
    return next(n for n in count(max(least, 1)) if 30**60 % n == 0)


def convolution(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Full convolution of two series by their transforms, shape (samples of both less one,)."""
    length = len(x) + len(y) - 1
    fast = fast_length(length)
    return np.fft.irfft(np.fft.rfft(x, fast) * np.fft.rfft(y, fast), fast)[:length]


@lru_cache(maxsize=64)
def _steady_sections(content: bytes) -> np.ndarray:
    """State of each section that a unit step has led to, shape (sections, 2).

    ``content``: numbers of the sections, as they lie in memory.
    """
    sections = np.frombuffer(content).reshape(-1, 6)
    scale, states = 1.0, np.empty((len(sections), 2))
    for section, state in zip(sections, states, strict=True):
        b, a = section[:3], section[3:]
        state[:] = scale * steady_state(b, a)
        scale *= b.sum() / a.sum()
    return states


@kernel
def _run_sections(sections, y, states):
    """Replace y, shape (samples, channels), by what the sections make of it."""
    for i in range(y.shape[0]):
        for s in range(sections.shape[0]):
            b0, b1, b2 = sections[s, 0], sections[s, 1], sections[s, 2]
            a1, a2 = sections[s, 4], sections[s, 5]
            for c in range(y.shape[1]):
                x = y[i, c]
                made = b0 * x + states[s, 0, c]
                states[s, 0, c] = b1 * x - a1 * made + states[s, 1, c]
                states[s, 1, c] = b2 * x - a2 * made
                y[i, c] = made


@kernel
def _recursion(b, a, y, state):
    """Replace y, shape (samples,), by B/A of it; a[0] is one."""
    last = b.size - 2
    for i in range(y.size):
        x = y[i]
        made = state[0] + b[0] * x if last >= 0 else b[0] * x
        for k in range(last):
            state[k] = state[k + 1] + x * b[k + 1] - made * a[k + 1]
        if last >= 0:
            state[last] = x * b[last + 1] - made * a[last + 1]
        y[i] = made
