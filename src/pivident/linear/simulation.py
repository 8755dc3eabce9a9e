"""Noise-free output of a linear model.

In continuous time the inputs are known at the samples and, by their hold, between them, so that

    x(t_k) = Σ_i B_i(p)/A_i(p) u_i(t_k - delay_i)

has an exact discretisation: x is an output of the chain (C2). In discrete time the model itself is
the recursion. Both start from rest, with zero inputs before the record.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from pivident.foundation.errors import UnusableSignal
from pivident.linear.model import Hold, LinearModel
from pivident.linear.state_variable_filter import combined, filtered_derivatives


def simulate(model: LinearModel, u: np.ndarray) -> np.ndarray:
    """Noise-free output from rest, shape (samples,).

    Args:
        model: the model.
        u: inputs, shape (samples,) or (samples, inputs), at the model's sampling period.

    Raises:
        UnusableSignal: the inputs are not as many as the model's.
    """
    columns = np.asarray(u, dtype=float)
    columns = columns[:, None] if columns.ndim == 1 else columns
    inputs = len(model.numerators)
    if columns.ndim != 2 or columns.shape[1] != inputs:
        raise UnusableSignal(
            "u", f"has shape {np.shape(u)}", f"give (samples, {inputs}), one column for each input"
        )
    x = np.zeros(len(columns))
    terms = zip(model.numerators, model.denominators, model.delays, columns.T, strict=True)
    for b, a, delay, column in terms:
        shifted = delayed(column, delay)
        if model.continuous:
            x += continuous_response(b, a, shifted, model.dt, model.hold)
        else:
            x += lfilter(b, a, shifted)
    return x


def continuous_response(
    numerator: np.ndarray, denominator: np.ndarray, u: np.ndarray, dt: float, hold: Hold
) -> np.ndarray:
    """B(p)/A(p) u at the samples, from rest, shape (samples,)."""
    rows = filtered_derivatives(u, denominator, dt, hold)[-len(numerator) :]
    return combined(np.asarray(numerator, dtype=float), rows)


def delayed(u: np.ndarray, delay: int) -> np.ndarray:
    """The signal shifted by whole samples, zero before its beginning, shape of ``u``."""
    return np.r_[np.zeros(min(delay, u.size)), u[: max(u.size - delay, 0)]]
