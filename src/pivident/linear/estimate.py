"""An identified linear model that simulates, prints and draws itself."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.signal import TransferFunction

from pivident.foundation.document.document import Document, Part
from pivident.foundation.extras import require
from pivident.foundation.text.display import Summary
from pivident.linear.model import LinearModel, gain
from pivident.linear.sampled_data import simulate
from pivident.signals.arma import Noise

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


class LinearEstimate(LinearModel):
    """y = Σ_i B_i/A_i u_i(t - delay_i) + ξ, one numerator and denominator for each input.

    Polynomials have the highest power first: of p = d/dt in continuous time, of z in discrete
    time, where both are written with the same number of coefficients (z⁰, z⁻¹, … in order).

    Attributes:
        method: name of the estimator (``SRIVC``).
        numerators: B_i, one for each input.
        denominators: A_i, monic; the same one for all inputs when it is common.
        dt: sampling period [s].
        continuous: whether the polynomials are in p (else in z).
        delays: delay of each input in samples.
        hold: behaviour of the inputs between samples (continuous time).
        common: whether one denominator serves all inputs.
        names: names of the parameters, in the order of the covariance.
        theta: parameters, shape (parameters,): the denominators without their ones, then the
            numerators.
        covariance: of θ, shape (parameters, parameters).
        noise: model of the noise; None: white.
        residual_variance: s², variance of the residual of the noise model.
        fit: criteria.
        iterations: iterations until convergence.
        converged: whether it converged.
        warnings: complete sentences.
        offset: what the output keeps while all inputs are zero, in its unit, and the standard
            error; None: not estimated.
        resid: measured less simulated output, noise included, shape (samples,); NaN where a sample
            was left out. None: the model was given, not estimated.
        fittedvalues: simulated output, likewise.
    """

    def simulate(self, u: np.ndarray) -> np.ndarray:
        """Noise-free output from rest, shape (samples,).

        Args:
            u: inputs, shape (samples,) or (samples, inputs).
        """
        return simulate(self, u)

    def to_scipy(self, which: int = 0) -> Any:
        """``scipy.signal.TransferFunction`` of input number ``which``, without its delay."""
        b, a = self.numerators[which], self.denominators[which]
        return TransferFunction(b, a) if self.continuous else TransferFunction(b, a, dt=self.dt)

    def to_control(self, which: int = 0) -> Any:
        """python-control's transfer function of input number ``which``, without its delay.

        Raises:
            MissingExtra: python-control is not installed.
        """
        control = require("control", extra="linear", purpose="a system of python-control")
        b, a = self.numerators[which], self.denominators[which]
        return control.tf(b, a) if self.continuous else control.tf(b, a, self.dt)

    def bode(self) -> Figure:
        """Magnitude and phase of every input with ±2σ bands, a plotly figure."""
        from pivident.linear.plots import bode

        return bode(self)

    def step(self) -> Figure:
        """Step response of every input, a plotly figure."""
        from pivident.linear.plots import step

        return step(self)

    def account(self) -> Document:
        """The model as a document: its polynomials, parameters, poles, and how well it fits."""
        lines = [" ".join(line.split()) for line in _below(self)]
        above = [_headline(self), *_in_one_line(self)]
        return Document(self.method, [Part("Model", [*above, self.parameter_table(), *lines])])

    def summary(self) -> Summary:
        """The model as text; ``as_html()`` and ``as_latex()`` give it for pages and papers."""
        return Summary(printed(self), self)

    def __str__(self) -> str:
        return printed(self)

    def __repr__(self) -> str:
        size, fit = len(self.names), f", R² = {self.fit.r2:.6g}" if self.fit.samples else ""
        return f"<LinearEstimate: {size} parameters by {_headline(self)}{fit}>"


#: Digits of a value whose standard error is rounding.
_MAX_DIGITS = 9

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def printed(model: LinearModel) -> str:
    """The model as text of several lines.

    Args:
        model: an estimate; ``str(model)`` gives the same.
    """
    lines = [_headline(model), ""]
    for which in range(len(model.numerators)):
        lines += [*_fraction(model, which), ""]
    return "\n".join([*lines, *_parameters(model), "", *_below(model)])


def _headline(model: LinearModel) -> str:
    """Method, kind of time, sampling period and length, on one line."""
    time = "continuous time" if model.continuous else "discrete time"
    samples = f", {model.fit.samples} samples" if model.fit.samples else ""
    return f"{model.method}, {time}, Ts = {model.dt:.6g} s{samples}"


def _in_one_line(model: LinearModel) -> Iterator[str]:
    """Each input's transfer function as ``y = (b0 p + b1)/(p² + a1 p + a2) u``."""
    for which, (b, a) in enumerate(zip(model.numerators, model.denominators, strict=True)):
        above, below = (polynomial_text(part, model.continuous) for part in (b, a))
        delay = model.delays[which]
        after = f"(t - {delay * model.dt:.6g} s)" if delay else ""
        name = f"u{which + 1}" if len(model.numerators) > 1 else "u"
        yield f"{'y =' if which == 0 else '+'} ({above})/({below}) {name}{after}"


def _below(model: LinearModel) -> list[str]:
    """Poles, gains, noise and fit, a line for each."""
    lines: list[str] = []
    common = model.common or len(model.denominators) == 1
    for which in range(1 if common else len(model.denominators)):
        label = "poles" if common else f"poles of u{which + 1}"
        lines += _poles(model, which, label)
    for which in range(len(model.numerators)):
        value, std = gain(model, which)
        label = "gain" if len(model.numerators) == 1 else f"gain of u{which + 1}"
        shown = "infinite (integrator)" if math.isinf(value) else with_standard_error(value, std)
        lines.append(f"{label:<13} {shown}")
    if model.offset is not None:
        lines.append(f"{'offset':<13} {with_standard_error(*model.offset)}")
    if model.noise is not None:
        lines += _noise(model.noise)
    if model.fit.samples:
        fit = model.fit
        lines += [
            f"{'residual':<13} variance {model.residual_variance:.4g}",
            f"{'fit':<13} R² = {fit.r2:.6f}, YIC = {fit.yic:.2f}, "
            f"AIC = {fit.aic:.1f}, BIC = {fit.bic:.1f}",
        ]
    if not model.converged:
        lines.append(f"not converged after {model.iterations} iterations")
    return [*lines, *(f"warning: {sentence}" for sentence in model.warnings)]


def with_standard_error(value: float, std: float) -> str:
    """``-0.8000 ± 0.0021``: two digits of the standard error, as many decimals of the value."""
    if not (math.isfinite(std) and std > 0):
        return f"{value:.6g}"
    digits = 1 - math.floor(math.log10(std))
    if abs(value) < 1e6 and -4 < digits < 8:
        places = max(digits, 0)
        return f"{value:.{places}f} ± {std:.{places}f}"
    significant = max(math.floor(math.log10(max(abs(value), std))) + digits, 1)
    if significant > _MAX_DIGITS:
        return f"{value:.{_MAX_DIGITS}g} ± {std:.1e}"
    return f"{value:.{significant}e} ± {std:.1e}"


def polynomial_text(coefficients: Sequence[float] | np.ndarray, continuous: bool) -> str:
    """``p² + 2.8 p + 4``, or ``1 - 0.8 z⁻¹``; zero coefficients are left out."""
    last = len(coefficients) - 1
    text = ""
    for k, c in enumerate(coefficients):
        if c == 0:
            continue
        power = last - k if continuous else -k
        symbol = "p" if continuous else "z"
        operator = (
            ""
            if power == 0
            else symbol
            if power == 1
            else symbol + str(power).translate(_SUPERSCRIPTS)
        )
        size = f"{abs(c):.5g}"
        term = operator if size == "1" and operator else f"{size} {operator}".strip()
        sign = "-" if c < 0 else "+"
        text += f" {sign} {term}" if text else (f"-{term}" if c < 0 else term)
    return text or "0"


def _fraction(model: LinearModel, which: int) -> list[str]:
    """Three lines: numerator, bar, denominator."""
    above = polynomial_text(model.numerators[which], model.continuous)
    below = polynomial_text(model.denominators[which], model.continuous)
    width = max(len(above), len(below)) + 2
    several = len(model.numerators) > 1
    left = ("y = " if which == 0 else "  + ") if several else "y = "
    name = f"u{which + 1}" if several else "u"
    delay = model.delays[which]
    after = f" {name}(t - {delay * model.dt:.6g} s)" if delay else f" {name}"
    if below == "1":
        return [f"{left}({above}){after}"]
    blank = " " * len(left)
    return [
        (blank + above.center(width)).rstrip(),
        left + "─" * width + after,
        (blank + below.center(width)).rstrip(),
    ]


def _parameters(model: LinearModel) -> list[str]:
    """One line per parameter, decimal points and ± below each other."""
    shown = [with_standard_error(v, s) for v, s in zip(model.theta, model.std, strict=True)]
    parts = [text.partition(" ± ") for text in shown]
    split = [(value.partition(".")[0], value, std) for value, _, std in parts]
    before = max((len(whole) for whole, _, _ in split), default=0)
    aligned = [" " * (before - len(whole)) + value for whole, value, _ in split]
    width = max((len(text) for text in aligned), default=0)
    names = max((len(name) for name in model.names), default=0)
    return [
        f"  {name:<{names}}  {text:<{width}}{f' ± {std}' if std else ''}".rstrip()
        for name, text, (_, _, std) in zip(model.names, aligned, split, strict=True)
    ]


def _poles(model: LinearModel, which: int, label: str) -> list[str]:
    """Poles with time constants or frequency and damping; of a conjugate pair one line."""
    poles = [p for p in np.roots(model.denominators[which]) if p.imag >= 0 and p != 0]
    lines: list[str] = []
    for pole in sorted(poles, key=abs):
        equal = pole if model.continuous else np.log(complex(pole)) / model.dt
        if pole.imag > 0:
            damping = -equal.real / abs(equal)
            text = f"{pole.real:.5g} ± {pole.imag:.5g}i  "
            text += f"({abs(equal) / (2 * math.pi):.4g} Hz, damping {damping:.3g})"
        elif pole.real < 0 and not model.continuous:
            text = f"{pole.real:.5g}  (alternating)"
        elif abs(equal.real) < 1e-9:
            text = f"{pole.real:.5g}  (integrator)"
        else:
            text = f"{pole.real:.5g}  (time constant {-1 / equal.real:.5g} s)"
        lines.append(f"{label if not lines else '':<13} {text}")
    return lines


def _noise(noise: Noise) -> list[str]:
    """The noise model on one or two lines; a long one by its orders only."""
    p, q = noise.ar.size - 1, noise.ma.size - 1
    head = f"{'noise':<13} ARMA({p}, {q})" if q else f"{'noise':<13} AR({p})"
    if p + q == 0:
        return [f"{'noise':<13} white, variance {noise.variance:.4g}"]
    head += f", innovation variance {noise.variance:.4g}"
    if p + q > 8:
        return [head]
    c, d = (polynomial_text(part, False) for part in (noise.ma, noise.ar))
    return [head, f"{'':<13} ξ = ({c})/({d}) e"]
