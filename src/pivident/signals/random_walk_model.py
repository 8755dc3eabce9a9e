"""The noise-to-variance ratio (NVR) of an integrated random walk: bandwidth, noise, accuracy.

The model of order m drives the m-th difference of a trajectory T with white noise and observes
T in white noise (Young 2011; Harvey and Peters 1990):

    Δᵐ T_k = η_k,     y_k = T_k + ξ_k,     var ξ = r,     var η = NVR · r

m = 1 is the random walk, m = 2 the integrated random walk, (P-27), m = 3 the double integrated
one. The NVR is per *sample*: it has no unit and belongs to one sampling rate. Smoothing
over an infinite record is a zero-phase filter with the gain

    F(ω) = NVR / (NVR + (2 sin(ω/2))²ᵐ),     ω = 2π f / rate

from which everything of this module follows.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

#: Orders that the smoother offers.
ORDERS = (1, 2, 3, 4)

#: Points of the logarithmic frequency grid on which spectral means are taken.
_GRID_POINTS = 2000


def difference_coefficients(order: int) -> tuple[float, ...]:
    """Coefficients of Δᵐ x_k = Σ_l d_l x_{k+l}, d_l = (-1)^(m-l) binomial(m, l), earliest first."""
    return tuple(float((-1) ** (order - i) * math.comb(order, i)) for i in range(order + 1))


def nvr_from_f50(f50: float, order: int, rate: float) -> float:
    """NVR = (2 sin(π f50 / rate))²ᵐ: the ratio whose gain is one half at f50."""
    return (2 * math.sin(math.pi * f50 / rate)) ** (2 * order)


def f50_from_nvr(nvr: float, order: int, rate: float) -> float:
    """f50 = (rate/π) asin(NVR^(1/2m) / 2) [Hz], infinite where no frequency is halved."""
    half = nvr ** (1 / (2 * order)) / 2
    return rate / math.pi * math.asin(half) if half <= 1 else math.inf


def gain(omega: np.ndarray, nvr: float, order: int) -> np.ndarray:
    """F(ω) = NVR / (NVR + (2 sin(ω/2))²ᵐ), ω in radians per sample."""
    return nvr / (nvr + (2 * np.sin(omega / 2)) ** (2 * order))


def required_f50(dynamic_frequency: float, order: int, loss: float = 1e-3) -> float:
    """f50 ≥ f_dyn · loss^(-1/2m): the bandwidth that preserves the motion.

    The smoother removes 1 - F ≈ (f/f50)²ᵐ of a component at f, so this f50 loses at most ``loss``
    of everything up to the dynamic frequency: 5.6 f_dyn for m = 2 and 3.2 f_dyn for m = 3 at 1e-3.
    """
    return float(dynamic_frequency * loss ** (-1 / (2 * order)))


def derivative_noise(nvr: float, order: int, rate: float, noise_std: float) -> tuple[float, float]:
    """Standard deviations of dq and ddq that are due to white measurement noise √r.

    With S(ω) the gain of the central difference (sin ω for dq, (2 sin(ω/2))² for ddq),

        std = √r · rateⁿ · √( (1/π) ∫₀^π S(ω)² F(ω)² dω ),     n = 1, 2.

    The bias of smoothing is not included: see :func:`required_f50`.
    """
    dq = _spectral_mean(lambda w: (np.sin(w) * gain(w, nvr, order)) ** 2, nvr, order)
    ddq = _spectral_mean(
        lambda w: ((2 * np.sin(w / 2)) ** 2 * gain(w, nvr, order)) ** 2, nvr, order
    )
    return noise_std * rate * math.sqrt(dq), noise_std * rate**2 * math.sqrt(ddq)


def log_nvr_std(nvr: float, order: int, samples: int) -> float:
    """Standard error of ln NVR from the expected information of the likelihood.

    Whittle's approximation replaces traces by spectral means, and the information of ln NVR after r
    has been eliminated becomes the variance of the gain over frequency:

        I = (n/2) · ( mean F² - (mean F)² ),     n = samples - m,     std = I^(-1/2)
    """
    mean = _spectral_mean(lambda w: gain(w, nvr, order), nvr, order)
    square = _spectral_mean(lambda w: gain(w, nvr, order) ** 2, nvr, order)
    information = (samples - order) / 2 * (square - mean**2)
    return 1 / math.sqrt(information) if information > 0 else math.inf


def _spectral_mean(function: Callable[[np.ndarray], np.ndarray], nvr: float, order: int) -> float:
    """(1/π) ∫₀^π f(ω) dω by the trapezoidal rule in ln ω, which resolves a narrow passband."""
    passband = min(nvr ** (1 / (2 * order)), math.pi)
    omega = np.geomspace(1e-4 * passband, math.pi, _GRID_POINTS)
    values = function(omega)
    return float((np.trapezoid(values * omega, np.log(omega)) + values[0] * omega[0]) / math.pi)
