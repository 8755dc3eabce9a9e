"""Contrasts of the joint posterior: features of the friction functions as numbers with intervals.

The speed functions p₊(|dq|) and p₋(|dq|) are split into friction against the motion and offset,

    g(v) = (p₊(v) - p₋(v))/2,     o(v) = (p₊(v) + p₋(v))/2,

and every number is a weighted sum of the functions' values, so its standard error follows from
their joint covariance.
"""

from __future__ import annotations

import numpy as np

from pivident.friction.state_dependent import StateDependentFit, StateDependentParameter

Weights = dict[str, np.ndarray]


def at(parameter: StateDependentParameter, state: float) -> np.ndarray:
    """Weights of a function's value at a state, linear between its points."""
    return np.array(
        [np.interp(state, parameter.state, row) for row in np.eye(parameter.state.size)]
    )


def common_speeds(fit: StateDependentFit) -> tuple[float, float]:
    """Lowest and highest speed recorded in both directions."""
    forward, backward = fit["positive"].state, fit["negative"].state
    return max(forward[0], backward[0]), min(forward[-1], backward[-1])


def against_motion(fit: StateDependentFit, speed: float, sign: float = -1.0) -> Weights:
    """Weights of g(v); of o(v) with ``sign`` 1."""
    return {
        "positive": 0.5 * at(fit["positive"], speed),
        "negative": sign * 0.5 * at(fit["negative"], speed),
    }


def offset(fit: StateDependentFit, speed: float) -> Weights:
    """Weights of o(v)."""
    return against_motion(fit, speed, 1.0)


def combined(parts: list[tuple[float, Weights]]) -> Weights:
    """Σ c_i w_i of several sets of weights."""
    out: Weights = {}
    for factor, weights in parts:
        for name, w in weights.items():
            out[name] = out.get(name, 0.0) + factor * w
    return out


def slope_over_size(parameter: StateDependentParameter) -> np.ndarray:
    """Weights of the slope of p against |x|, points weighted by their independent samples."""
    size, w = np.abs(parameter.state), parameter.density
    away = size - np.average(size, weights=w)
    squares = float(np.sum(w * away**2))
    return w * away / squares if squares > 0.0 else np.zeros(size.size)
