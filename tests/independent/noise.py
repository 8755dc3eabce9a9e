"""Sections 4.1 and 4.4: noise models of the joints and the prefilters that follow from them."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter, lfilter_zi, oaconvolve


@dataclass(frozen=True)
class Noise:
    """Noise of one joint: H = 1/A(z⁻¹) with white noise of variance λ."""

    a: np.ndarray
    variance: float


def autoregression(
    y: np.ndarray, max_order: int, order: int | None = None, used: np.ndarray | None = None
) -> Noise:
    """AR model by least squares, of the order of smallest AIC = n log λ + 2 p among 0 … max_order.

    All orders are fitted to the same samples: one triangular factor, of the sums of products of all
    lags, holds the residuals of all. Only products of used samples count, where some are not.
    """
    lags = np.column_stack([y[max_order - k : len(y) - k] for k in (*range(1, max_order + 1), 0)])
    if used is not None:
        stretch = np.convolve(used, np.ones(max_order + 1), "valid")
        lags = lags[stretch > max_order + 0.5]
    n = len(lags)
    factor = np.linalg.cholesky(lags.T @ lags).T
    left = np.cumsum(factor[:, -1][::-1] ** 2)[::-1]  # squares that the orders 0 … max_order leave
    if order is None:
        order = int(np.argmin(n * np.log(left / n) + 2 * np.arange(max_order + 1)))
    coefficients = np.linalg.solve(factor[:order, :order], factor[:order, -1])
    return Noise(np.r_[1.0, -coefficients], left[order] / n)


def burg(y: np.ndarray, max_order: int, order: int | None = None) -> Noise:
    """The same, about the mean, by Burg's lattice, whose cost grows with the order alone."""
    forward = backward = y - y.mean()
    left, models = [float(np.mean(forward**2))], [np.ones(1)]
    for _ in range(max_order if order is None else order):
        forward, backward = forward[1:], backward[:-1]
        reflection = -2 * (forward @ backward) / (forward @ forward + backward @ backward)
        longer = np.r_[models[-1], 0.0]
        models.append(longer + reflection * longer[::-1])
        left.append(left[-1] * (1 - reflection**2))
        forward, backward = forward + reflection * backward, backward + reflection * forward
    if order is None:
        order = int(np.argmin(len(y) * np.log(left) + 2 * np.arange(max_order + 1)))
    return Noise(models[order], left[order])


def controller(
    kp: float, kd: float, ki: float, lag: float, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """C(z⁻¹) as held over the sampling period: numerator and denominator, backward differences."""
    slower = np.array([lag + step, -lag])  # times the speed is the difference
    numerator = kp * slower + kd * np.array([1.0, -1.0])
    if not ki:
        return numerator, slower
    sums = np.array([1.0, -1.0])  # times the integral is the error in one step
    return np.convolve(numerator, sums) + ki * step * np.r_[slower, 0.0], np.convolve(slower, sums)


def settled(numerator: np.ndarray, denominator: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Filter along the last axis, at rest at the first sample."""
    if max(len(numerator), len(denominator)) == 1:
        return numerator[0] / denominator[0] * x
    start = lfilter_zi(numerator, denominator) * x[..., :1]
    return lfilter(numerator, denominator, x, zi=start)[0]


def convolved(a: np.ndarray, x: np.ndarray) -> np.ndarray:
    """A(z⁻¹) x along the last axis, with x before the first sample as it is there."""
    before = np.repeat(x[..., :1], len(a) - 1, axis=-1)
    whole = np.concatenate([before, x], axis=-1)
    return oaconvolve(whole, np.broadcast_to(a, (*x.shape[:-1], len(a))), "valid", axes=-1)
