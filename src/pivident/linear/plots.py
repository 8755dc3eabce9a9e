"""Frequency and step responses of linear models with ±2σ bands, as plotly figures.

The bands are those of the delta method: the covariance of θ propagated to the curve, to first
order. They do not account for a wrong structure.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from pivident.foundation.document.plot import colour
from pivident.foundation.extras import require
from pivident.linear.model import LinearModel, polynomials, response_and_gradient
from pivident.linear.sampled_data import continuous_response, delayed

if TYPE_CHECKING:
    import plotly.graph_objects as go

#: Points of a curve.
_POINTS = 400

#: Standard errors on each side of a curve.
_BAND = 2.0

#: Step of a parameter for the derivative of a step response, in its standard errors.
_DIFFERENCE = 1e-3


def bode(model: LinearModel) -> go.Figure:
    """Magnitude [dB] and phase [°] of every input over frequency [Hz], delays included.

    Args:
        model: the model.
    """
    frequency = _frequencies(model)
    omega = 2 * np.pi * frequency
    at = 1j * omega if model.continuous else np.exp(1j * omega * model.dt)
    plot = _empty("magnitude [dB]")
    plot.update_xaxes(title_text="frequency [Hz]", type="log", anchor="y2")
    plot.update_layout(
        yaxis={"domain": [0.54, 1.0]},
        yaxis2={"domain": [0.0, 0.46], "title": {"text": "phase [°]", "standoff": 4}},
    )
    for which in range(len(model.numerators)):
        response, gradient = response_and_gradient(model, at, which)
        relative = gradient / response
        decibel = 20 / np.log(10) * _standard_error(model, relative.real)
        degrees = np.degrees(_standard_error(model, relative.imag))
        lag = omega * model.delays[which] * model.dt
        phase = np.degrees(np.unwrap(np.angle(response)) - lag)
        _curve(plot, frequency, 20 * np.log10(np.abs(response)), decibel, model, which, "y")
        _curve(plot, frequency, phase, degrees, model, which, "y2")
    return plot


def step(model: LinearModel) -> go.Figure:
    """Response of the output to a unit step of every input over time [s].

    Args:
        model: the model.
    """
    plot = _empty("step response")
    plot.update_xaxes(title_text="time [s]")
    for which in range(len(model.numerators)):
        dt, samples = _horizon(model, which)
        response = step_response(model, model.theta, which, dt, samples)
        std = model.std
        slopes = np.zeros((model.theta.size, samples))
        for i in np.flatnonzero(std > 0):
            h = np.zeros(model.theta.size)
            h[i] = _DIFFERENCE * std[i]
            above, below = (
                step_response(model, model.theta + sign * h, which, dt, samples)
                for sign in (1.0, -1.0)
            )
            slopes[i] = (above - below) / (2 * h[i])
        time = dt * np.arange(samples)
        _curve(plot, time, response, _standard_error(model, slopes), model, which, "y")
    return plot


def step_response(
    model: LinearModel, theta: np.ndarray, which: int, dt: float, samples: int
) -> np.ndarray:
    """Response to a unit step of one input with the parameters θ, points ``dt`` [s] apart."""
    b, a = polynomials(model, theta, which)
    u = delayed(np.ones(samples), round(model.delays[which] * model.dt / dt))
    return continuous_response(b, a, u, dt, "zoh") if model.continuous else lfilter(b, a, u)


def _standard_error(model: LinearModel, slopes: np.ndarray) -> np.ndarray:
    """σ of a curve whose derivatives are the rows of ``slopes``, shape (points,)."""
    variance = np.einsum("ik,ij,jk->k", slopes, model.covariance, slopes)
    return np.sqrt(np.maximum(variance, 0.0))


def _rates(model: LinearModel, which: int) -> np.ndarray:
    """Poles as continuous-time ones [rad/s]; those at the origin of z are left out."""
    poles = np.roots(model.denominators[which]).astype(complex)
    return poles if model.continuous else np.log(poles[np.abs(poles) > 1e-9]) / model.dt


def _frequencies(model: LinearModel) -> np.ndarray:
    """From a decade below the slowest pole to a decade above the fastest, or to Nyquist [Hz]."""
    nyquist = 0.5 / model.dt
    moduli = np.concatenate([np.abs(_rates(model, i)) for i in range(len(model.denominators))])
    corners = moduli[moduli > 1e-6 / model.dt] / (2 * np.pi)
    slowest = min(corners.min(initial=nyquist), nyquist)
    fastest = 10 * corners.max(initial=0.1 * nyquist)
    highest = min(fastest, nyquist) if model.continuous else nyquist * (1 - 1e-9)
    return np.geomspace(0.1 * slowest, max(highest, slowest), _POINTS)


def _horizon(model: LinearModel, which: int) -> tuple[float, int]:
    """Distance and number of points until the slowest decaying pole has settled."""
    decay = -_rates(model, which).real
    decay = decay[decay > 1e-6 / model.dt]
    slowest = 1.0 / decay.min() if decay.size else 10 * model.dt
    duration = 6 * slowest + model.delays[which] * model.dt
    if model.continuous:
        return duration / (_POINTS - 1), _POINTS
    return model.dt, int(np.clip(np.ceil(duration / model.dt) + 1, 10, 20 * _POINTS))


def _curve(
    plot: go.Figure,
    x: np.ndarray,
    y: np.ndarray,
    std: np.ndarray,
    model: LinearModel,
    which: int,
    axis: str,
) -> None:
    """A line with its band; samples of a discrete-time model are held, except over frequency."""
    several = len(model.numerators) > 1
    name = f"u{which + 1}" if several else model.method
    held = not model.continuous and plot.layout.xaxis.type != "log"
    shape = "hv" if held else "linear"
    if std.any():
        plot.add_scatter(
            x=np.r_[x, x[::-1]],
            y=np.r_[y + _BAND * std, (y - _BAND * std)[::-1]],
            yaxis=axis,
            mode="lines",
            fill="toself",
            line={"width": 0, "color": colour(which)},
            opacity=0.25,
            hoverinfo="skip",
            name=f"{name} ±2σ",
            showlegend=False,
        )
    plot.add_scatter(
        x=x,
        y=y,
        yaxis=axis,
        mode="lines",
        name=name,
        line={"color": colour(which), "width": 1.6, "shape": shape},
        showlegend=several and axis == "y",
    )


def _empty(y_title: str) -> go.Figure:
    """Axes without decoration, as in the report."""
    go = require("plotly.graph_objects", extra="linear", purpose="a plot of a linear model")
    return go.Figure(
        layout={
            "template": "none",
            "margin": {"l": 58, "r": 12, "t": 8, "b": 42},
            "hovermode": "closest",
            "xaxis": {"zeroline": False},
            "yaxis": {"title": {"text": y_title, "standoff": 4}, "zeroline": False},
        }
    )
