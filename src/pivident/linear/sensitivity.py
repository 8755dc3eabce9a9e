"""Sensitivity of a linear model to its parameters, for first-order error bands.

The covariance P of θ gives any function f(θ) the variance (∂f/∂θ)ᵀ P (∂f/∂θ). For the frequency
response G = B/A of an input, with s the power of the operator that multiplies a coefficient,

    ∂G/∂b = s/A,    ∂G/∂a = -G s/A.
"""

from __future__ import annotations

import re

import numpy as np

from pivident.linear.model import LinearModel

_NAME = re.compile(r"([ab])(\d+)(?:_u(\d+))?")


def roles(model: LinearModel, which: int) -> list[tuple[str, int] | None]:
    """For every parameter its polynomial, ``a`` or ``b``, and place there; None: another input's.

    Args:
        model: the model, whose parameters are named ``a1``, ``b0`` or ``b0_u2``.
        which: index of the input.
    """
    found: list[tuple[str, int] | None] = []
    for name in model.names:
        match = _NAME.fullmatch(name)
        mine = match is not None and match[3] in (None, str(which + 1))
        found.append((match[1], int(match[2])) if match is not None and mine else None)
    return found


def response_and_gradient(
    model: LinearModel, at: np.ndarray, which: int
) -> tuple[np.ndarray, np.ndarray]:
    """B/A without delay at points of p or z, (points,), and ∂(B/A)/∂θ, (parameters, points)."""
    b, a = model.numerators[which], model.denominators[which]
    at = np.asarray(at, dtype=complex)
    denominator = np.polyval(a, at)
    response = np.polyval(b, at) / denominator
    gradient = np.zeros((model.theta.size, at.size), dtype=complex)
    for row, role in zip(gradient, roles(model, which), strict=True):
        if role is not None:
            kind, place = role
            polynomial = a if kind == "a" else b
            row[:] = at ** (polynomial.size - 1 - place) / denominator
            if kind == "a":
                row *= -response
    return response, gradient


def gain(model: LinearModel, which: int) -> tuple[float, float]:
    """Static gain of an input and its standard deviation; infinite for an integrator."""
    at = np.array([0.0 if model.continuous else 1.0])
    a = model.denominators[which]
    if abs(np.polyval(a, at[0])) < 1e-12 * np.abs(a).sum():
        return np.inf, np.nan
    value, gradient = response_and_gradient(model, at, which)
    slope = gradient[:, 0].real
    return float(value[0].real), float(np.sqrt(max(slope @ model.covariance @ slope, 0.0)))


def polynomials(model: LinearModel, theta: np.ndarray, which: int) -> tuple[np.ndarray, np.ndarray]:
    """Numerator and denominator of an input at other parameters."""
    b, a = model.numerators[which].copy(), model.denominators[which].copy()
    for value, role in zip(theta, roles(model, which), strict=True):
        if role is not None:
            (a if role[0] == "a" else b)[role[1]] = value
    return b, a
