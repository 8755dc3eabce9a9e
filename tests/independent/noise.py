"""Sections 4.1 and 4.4: noise models of the joints and the prefilters that follow from them."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter, lfilter_zi


@dataclass(frozen=True)
class Noise:
    """Noise of one joint: H = 1/A(z⁻¹) with white noise of variance λ."""

    a: np.ndarray
    variance: float


def autoregression(y: np.ndarray, max_order: int) -> Noise:
    """AR model by least squares, of the order of smallest AIC = n log λ + 2 p among 0 … max_order.

    All orders are fitted to the same samples: one triangular factor holds the residuals of all.
    """
    n = len(y) - max_order
    lags = np.column_stack([y[max_order - k : len(y) - k] for k in (*range(1, max_order + 1), 0)])
    factor = np.linalg.qr(lags, mode="r")
    left = np.cumsum(factor[:, -1][::-1] ** 2)[::-1]  # squares that the orders 0 … max_order leave
    order = int(np.argmin(n * np.log(left / n) + 2 * np.arange(max_order + 1)))
    coefficients = np.linalg.solve(factor[:order, :order], factor[:order, -1])
    return Noise(np.r_[1.0, -coefficients], left[order] / n)


def controller(kp: float, kd: float, ki: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    """C(z⁻¹) as held over the sampling period: numerator and denominator, backward differences."""
    if not ki:
        return np.array([kp + kd / step, -kd / step]), np.array([1.0])
    return (
        np.array([kp + kd / step + ki * step, -kp - 2 * kd / step, kd / step]),
        np.array([1.0, -1.0]),
    )


def settled(numerator: np.ndarray, denominator: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Filter along the last axis, at rest at the first sample."""
    if max(len(numerator), len(denominator)) == 1:
        return numerator[0] / denominator[0] * x
    start = lfilter_zi(numerator, denominator) * x[..., :1]
    return lfilter(numerator, denominator, x, zi=start)[0]
