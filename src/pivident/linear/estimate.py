"""An identified linear model that simulates, prints and draws itself."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.signal import TransferFunction

from pivident.extras import require
from pivident.linear.model import LinearModel
from pivident.linear.printing import printed
from pivident.linear.simulation import simulate

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

    def __str__(self) -> str:
        return printed(self)
