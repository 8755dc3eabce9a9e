"""An identified linear model: orders, polynomials with their covariance, and how well they fit.

The covariance P of θ gives any function f(θ) the variance (∂f/∂θ)ᵀ P (∂f/∂θ). For the frequency
response G = B/A of an input, with s the power of the operator that multiplies a coefficient,

    ∂G/∂b = s/A,    ∂G/∂a = -G s/A.

Orders of a continuous-time model: which parameters there are and in which order.

Noise models of the linear subject: AR and ARMA, found in ``pivident.signals``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from pivident.foundation.document.document import Accounted
from pivident.foundation.document.estimated import Estimated
from pivident.foundation.errors import IdentificationError
from pivident.foundation.text.display import Displayed
from pivident.signals.arma import Noise as Noise, ar as ar, arma as arma, select_arma as select_arma

Hold = Literal["zoh", "foh"]
#: Poles on the imaginary axis are moved this far to the left, relative to their modulus.
_MARGIN = 1e-6


@dataclass(frozen=True)
class Fit:
    """How well a model fits, (C5).

    Attributes:
        r2: R_T² = 1 - var(y - x)/var(y), x the simulated output.
        yic: Young's information criterion, ln(s²/var y) + ln(mean of P_ii/θ_i²).
        aic: n ln s² + 2 n_p.
        bic: n ln s² + n_p ln n.
        samples: samples used.
    """

    r2: float
    yic: float
    aic: float
    bic: float
    samples: int


@dataclass(frozen=True, eq=False)
class LinearModel(Estimated, Accounted):
    """y = Σ_i B_i/A_i u_i(t - delay_i) + ξ with the fields of `LinearEstimate`."""

    method: str
    numerators: tuple[np.ndarray, ...]
    denominators: tuple[np.ndarray, ...]
    dt: float
    continuous: bool
    delays: tuple[int, ...]
    hold: Hold
    common: bool
    names: tuple[str, ...]
    theta: np.ndarray
    covariance: np.ndarray
    noise: Noise | None
    residual_variance: float
    fit: Fit
    iterations: int = 1
    converged: bool = True
    warnings: tuple[str, ...] = ()
    offset: tuple[float, float] | None = None
    resid: np.ndarray | None = field(default=None, repr=False)
    fittedvalues: np.ndarray | None = field(default=None, repr=False)

    @property
    def numerator(self) -> np.ndarray:
        """B of a model with one input.

        Raises:
            IdentificationError: there are several inputs.
        """
        return self._only(self.numerators)

    @property
    def denominator(self) -> np.ndarray:
        """A of a model with one input, or the common one.

        Raises:
            IdentificationError: there are several.
        """
        return self.denominators[0] if self.common else self._only(self.denominators)

    def _only(self, polynomials: tuple[np.ndarray, ...]) -> np.ndarray:
        if len(polynomials) != 1:
            raise IdentificationError(
                f"the model has {len(polynomials)} inputs", advice="use numerators and denominators"
            )
        return polynomials[0]

    def cov_params(self) -> np.ndarray:
        """Covariance of θ, shape (parameters, parameters)."""
        return self.covariance

    @property
    def nobs(self) -> int:
        """Number of samples that the estimate was made of."""
        return self.fit.samples

    @property
    def rsquared(self) -> float:
        """R_T² of the simulated output, about the mean of the measured one."""
        return self.fit.r2

    @property
    def poles(self) -> tuple[np.ndarray, ...]:
        """Poles of each input's transfer function [rad/s in continuous time]."""
        return tuple(np.roots(a) for a in self.denominators)

    def response(self, frequency: np.ndarray, which: int = 0) -> np.ndarray:
        """Frequency response of one input at the frequencies [Hz], delay included.

        Args:
            frequency: shape (frequencies,).
            which: index of the input.
        """
        omega = 2.0 * np.pi * np.asarray(frequency, dtype=float)
        b, a = self.numerators[which], self.denominators[which]
        delay = np.exp(-1j * omega * self.delays[which] * self.dt)
        at = 1j * omega if self.continuous else np.exp(1j * omega * self.dt)
        return np.polyval(b, at) / np.polyval(a, at) * delay


def fit_of(
    y: np.ndarray, x: np.ndarray, s2: float, theta: np.ndarray, covariance: np.ndarray
) -> Fit:
    """Criteria of a model, (C5).

    Args:
        y: measured output, shape (samples,).
        x: simulated output.
        s2: variance of the (whitened) residual.
        theta: parameters.
        covariance: of them.
    """
    n, size = y.size, theta.size
    total = float(np.var(y))
    relative = np.diag(covariance) / np.maximum(np.square(theta), 1e-300)
    s2 = max(s2, 1e-300)
    return Fit(
        r2=1.0 - float(np.var(y - x)) / max(total, 1e-300),
        yic=math.log(s2 / max(total, 1e-300)) + math.log(max(float(relative.mean()), 1e-300)),
        aic=n * math.log(s2) + 2 * size,
        bic=n * math.log(s2) + math.log(n) * size,
        samples=n,
    )


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


def poles_with_std(model: LinearModel, which: int) -> list[tuple[complex, float]]:
    """Poles of an input and the standard errors of their moduli, by ∂p/∂a_k = -p^(n-k)/A'(p)."""
    a = model.denominators[which]
    found = []
    for pole in np.roots(a):
        slopes = np.zeros(model.theta.size)
        for k, role in enumerate(roles(model, which)):
            if role is not None and role[0] == "a":
                slope = -(pole ** (a.size - 1 - role[1])) / np.polyval(np.polyder(a), pole)
                slopes[k] = (np.conj(pole) * slope).real / max(abs(pole), 1e-300)
        found.append((pole, float(np.sqrt(max(slopes @ model.covariance @ slopes, 0.0)))))
    return found


def polynomials(model: LinearModel, theta: np.ndarray, which: int) -> tuple[np.ndarray, np.ndarray]:
    """Numerator and denominator of an input at other parameters."""
    b, a = model.numerators[which].copy(), model.denominators[which].copy()
    for value, role in zip(theta, roles(model, which), strict=True):
        if role is not None:
            (a if role[0] == "a" else b)[role[1]] = value
    return b, a


@dataclass(frozen=True)
class Structure(Displayed):
    """Orders, delays and hold of y = Σ_i B_i/A_i u_i(t - delay_i).

    θ holds the denominators without their ones, then the numerators, highest power first.
    """

    numerator_orders: tuple[int, ...]
    denominator_orders: tuple[int, ...]  # a single one when the denominator is common
    delays: tuple[int, ...]  # [samples]
    hold: Hold

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return len(self.numerator_orders)

    @property
    def common(self) -> bool:
        """Whether one denominator serves all inputs."""
        return len(self.denominator_orders) == 1

    @property
    def parameters(self) -> int:
        """Length of θ."""
        return sum(self.denominator_orders) + sum(m + 1 for m in self.numerator_orders)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of θ: a1 …, b0 …; with several inputs b0_u1 …, and a1_u1 … if not common."""

        def suffix(which: int, several: bool) -> str:
            return f"_u{which + 1}" if several else ""

        denominators = (
            f"a{k}{suffix(i, not self.common)}"
            for i, n in enumerate(self.denominator_orders)
            for k in range(1, n + 1)
        )
        numerators = (
            f"b{k}{suffix(i, self.inputs > 1)}"
            for i, m in enumerate(self.numerator_orders)
            for k in range(m + 1)
        )
        return (*denominators, *numerators)

    def split(self, theta: np.ndarray) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
        """Monic denominators (one, if common) and numerators of θ."""
        sizes = [*self.denominator_orders, *(m + 1 for m in self.numerator_orders)]
        parts = np.split(np.asarray(theta, dtype=float), np.cumsum(sizes)[:-1])
        count = len(self.denominator_orders)
        return tuple(np.r_[1.0, a] for a in parts[:count]), tuple(parts[count:])

    def per_input(self, denominators: Sequence[np.ndarray]) -> tuple[np.ndarray, ...]:
        """The denominator of every input, also where they share one."""
        return tuple(denominators) * self.inputs if self.common else tuple(denominators)

    def of_input(self, which: int) -> Structure:
        """Structure of one input alone."""
        denominator = self.denominator_orders[0 if self.common else which]
        return Structure(
            (self.numerator_orders[which],), (denominator,), (self.delays[which],), self.hold
        )

    def joined(
        self, denominators: Sequence[np.ndarray], numerators: Sequence[np.ndarray]
    ) -> np.ndarray:
        """θ of monic denominators and numerators."""
        return np.concatenate([*(a[1:] for a in denominators), *numerators])

    def stabilised(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """θ with unstable poles reflected at the imaginary axis (C1), and those poles."""
        denominators, numerators = self.split(theta)
        moved, unstable = [], []
        for a in denominators:
            poles = np.roots(a)
            wrong = poles.real >= 0
            if wrong.any():
                unstable.append(poles[wrong])
                real = np.maximum(poles.real, _MARGIN * np.maximum(np.abs(poles), 1e-300))
                a = np.poly(np.where(wrong, -real + 1j * poles.imag, poles)).real
            moved.append(a)
        found = np.concatenate(unstable) if unstable else np.zeros(0, dtype=complex)
        return self.joined(moved, numerators), found


def structure_of(
    inputs: int,
    numerator_order: int | Sequence[int],
    denominator_order: int | Sequence[int],
    delay: int | Sequence[int],
    hold: Hold,
    common: bool,
) -> Structure:
    """Structure from the arguments of the estimators."""
    if hold not in ("zoh", "foh"):
        raise IdentificationError(f"hold is {hold!r}", advice="expected 'zoh' or 'foh'")
    common = common or inputs == 1
    numerators = _each("numerator_order", numerator_order, inputs, 0)
    denominators = _each("denominator_order", denominator_order, 1 if common else inputs, 1)
    structure = Structure(numerators, denominators, _each("delay", delay, inputs, 0), hold)
    for i, m in enumerate(numerators):
        n = denominators[0 if common else i]
        if m > n:
            raise IdentificationError(
                f"the numerator of input {i + 1} has degree {m}, above its denominator's {n}: the "
                "derivatives of sampled signals are not defined",
                advice="raise denominator_order, or lower numerator_order",
            )
    return structure


def _each(name: str, value: int | Sequence[int], count: int, least: int) -> tuple[int, ...]:
    """One integer for each of ``count``, from one for all or a sequence."""
    given = np.atleast_1d(np.asarray(value))
    values = np.repeat(given, count) if given.size == 1 else given
    if values.shape != (count,) or not np.issubdtype(values.dtype, np.integer):
        raise IdentificationError(
            f"{name} is {value!r}",
            advice=f"expected one integer, or {count} (one for each "
            f"input{')' if name != 'denominator_order' else ', with common=False)'}",
        )
    if values.min() < least:
        raise IdentificationError(f"{name} is {value!r}", advice=f"expected at least {least}")
    return tuple(int(v) for v in values)
