"""The exact Gaussian likelihood of an ARMA model, its Gauss-Newton step and information.

Setting e = 0 before a record is harmless only while 1/C forgets quickly. Differenced white noise,
(1 - z⁻¹)ⁿ e, does not: its zeros lie on the unit circle. So the q values e* before each stretch
are unknowns with their own variance λ (Box and Jenkins' unconditional sum of squares). With
e = e⁰ + Z e*, Z the transients of 1/C, the likelihood of a stretch given its first p samples is

    -2 ln L = n ln λ + ln det(I + Z'Z) + S/λ,    S = min over e* of |e*|² + |e⁰ + Z e*|²,

n the number of residuals; λ = S/n at its maximum. Stretches add their S and their ln det. The
derivatives of e are the regressors prefiltered by 1/C,

    ∂e_k/∂d_i = (1/C) (v_{k-i} - μ),    ∂e_k/∂c_j = -(1/C) e_{k-j},    ∂e_k/∂μ = -(1/C) D(1),

and e* is eliminated from the normal equations. The mean μ of v is a parameter, not the sample
mean: with a zero at 1 the latter, n^(-1/2) off where the best estimate is n^(-3/2) off, would be
integrated into a ramp.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pivident.foundation.compiled import allocating, compiled
from pivident.signals.burg import dot

#: Level below which a transient has ended and its recursion may stop.
_OVER = 1e-13


@dataclass(frozen=True, eq=False)
class Likelihood:
    """The likelihood of ARMA models on given samples."""

    v: np.ndarray  # residual, (samples,)
    bounds: np.ndarray  # stretches, rows of (start, stop)
    ar_order: int  # degree p of D

    def at(self, theta: np.ndarray) -> Point:
        """The likelihood of D = 1 + d_1 z⁻¹ + …, C = 1 + c_1 z⁻¹ + … and μ, θ = (d, c, μ)."""
        d, c = np.r_[1.0, theta[: self.ar_order]], np.r_[1.0, theta[self.ar_order : -1]]
        e, before, basis, top, log_det = _innovations(self.v - theta[-1], self.bounds, d, c)
        return Point(self, theta, e, before, basis, top, log_det)


@dataclass(frozen=True, eq=False)
class Point:
    """The likelihood at one model.

    ``basis`` and ``top`` are Q of (I, Z) = Q R: its rows beside Z, and those beside I, earliest
    first.
    """

    likelihood: Likelihood
    theta: np.ndarray  # (d_1 … d_p, c_1 … c_q, μ)
    innovations: np.ndarray  # e, zero where there is none, (samples,)
    before: np.ndarray  # e*, (stretches, q)
    basis: np.ndarray  # (q, samples)
    top: np.ndarray  # (stretches, q, q)
    log_det: float  # ln det(I + Z'Z), summed over the stretches

    @property
    def residuals(self) -> int:
        """Number of residuals n."""
        bounds = self.likelihood.bounds
        return int(np.sum(bounds[:, 1] - bounds[:, 0] - self.likelihood.ar_order))

    @property
    def variance(self) -> float:
        """λ = S/n."""
        squares = dot(self.innovations, self.innovations) + float(np.sum(self.before**2))
        return squares / self.residuals

    @property
    def value(self) -> float:
        """-ln L at its maximum over λ, less a constant; infinite where the recursion overflows."""
        value = 0.5 * self.residuals * math.log(self.variance) + 0.5 * self.log_det
        return value if math.isfinite(value) else math.inf

    def gauss_newton(self) -> tuple[np.ndarray, float]:
        """The Gauss-Newton step of θ and the gain in ln L it promises."""
        gradient, information = self._slope()
        step = -np.linalg.lstsq(information, gradient, rcond=1e-14)[0]
        return step, -0.5 * float(gradient @ step)

    @property
    def information(self) -> np.ndarray:
        """Information matrix of θ, the inverse of its covariance."""
        return self._slope()[1]

    def _slope(self) -> tuple[np.ndarray, np.ndarray]:
        """Gradient of -ln L and its Gauss-Newton Hessian."""
        p, bounds = self.likelihood.ar_order, self.likelihood.bounds
        c, mean = np.r_[1.0, self.theta[p:-1]], self.theta[-1]
        information, gradient = _normal_equations(
            self.likelihood.v - mean,
            self.innovations,
            self.before,
            self.basis,
            bounds,
            c,
            self.theta,
        )
        gradient /= self.variance
        gradient[p:-1] += _half_log_det_gradient(self.basis, self.top, bounds, c, p)
        return gradient, information / self.variance


@allocating
def _innovations(v, bounds, d, c):
    """e, e*, an orthonormal basis of the transients, and Σ ln det(I + Z'Z)."""
    p, q = d.size - 1, c.size - 1
    e, basis = np.zeros(v.size), np.zeros((q, v.size))
    before, top = np.zeros((len(bounds), q)), np.zeros((len(bounds), q, q))
    log_det = 0.0
    for s in range(len(bounds)):
        start, stop = bounds[s, 0] + p, bounds[s, 1]
        for k in range(start, stop):
            total = v[k]
            for i in range(1, p + 1):
                total += d[i] * v[k - i]
            for j in range(1, min(q, k - start) + 1):
                total -= c[j] * e[k - j]
            e[k] = total
        z = _transients(stop - start, c)
        over = start + z.shape[1] - q
        for m in range(q):  # of slices would be compiled twice as long
            for other in range(m):
                share = dot(z[other], z[m])
                for t in range(z.shape[1]):
                    z[m, t] -= share * z[other, t]
            norm = np.sqrt(dot(z[m], z[m]))
            log_det += 2.0 * np.log(norm)
            for t in range(z.shape[1]):
                z[m, t] /= norm
            along = dot(z[m, q:], e[start:over])
            for i in range(q):
                along += z[m, q - 1 - i] * before[s, i]
            for k in range(start, over):
                e[k] -= along * z[m, q + k - start]
                basis[m, k] = z[m, q + k - start]
            for i in range(q):
                before[s, i] -= along * z[m, q - 1 - i]
                top[s, m, i] = z[m, i]
    return e, before, basis, top, log_det


@compiled()
def _transients(samples, c):
    """(I, Z)' until the transients are over; row m answers a unit e* m + 1 samples before."""
    q = c.size - 1
    z = np.zeros((q, q + samples))
    for m in range(q):
        z[m, q - 1 - m] = 1.0
    for k in range(q, q + samples):
        largest = 0.0
        for m in range(q):
            for j in range(1, q + 1):
                z[m, k] -= c[j] * z[m, k - j]
            for j in range(q):
                largest = max(largest, abs(z[m, k - j]))
        if largest < _OVER and k >= 2 * q:
            short = np.empty((q, k + 1))
            for m in range(q):
                for t in range(k + 1):
                    short[m, t] = z[m, t]
            return short
    return z


@compiled()
def _half_log_det_gradient(basis, top, bounds, c, p):
    """Gradient of Σ ½ ln det(I + Z'Z) with respect to c, which is Σ tr(Q' ∂Z/∂c R⁻¹)."""
    q = c.size - 1
    gradient = np.zeros(q)
    for s in range(len(bounds)):
        start, stop = bounds[s, 0] + p, bounds[s, 1]
        for m in range(q):
            orthonormal = np.empty(q + stop - start)
            for i in range(q):
                orthonormal[i] = top[s, m, i]
            for k in range(start, stop):
                orthonormal[q + k - start] = basis[m, k]
            over = orthonormal.size
            while orthonormal[over - 1] == 0.0:
                over -= 1
            for j in range(1, q + 1):
                slope = np.zeros(orthonormal.size)
                for k in range(q, over):
                    total = -orthonormal[k - j]
                    for i in range(1, q + 1):
                        total -= c[i] * slope[k - i]
                    slope[k] = total
                gradient[j - 1] += dot(orthonormal, slope)
    return gradient


@compiled()
def _normal_equations(v, e, before, basis, bounds, c, theta):
    """J'J and J'e, J = ∂e/∂θ with e* eliminated, that is without its part along the basis."""
    q = c.size - 1
    p = theta.size - q - 1
    size = theta.size
    total = 0.0
    for i in range(p):
        total += theta[i]
    at_one = -1.0 - total
    square, cross = np.zeros((size, size)), np.zeros(size)
    for s in range(len(bounds)):
        start, stop = bounds[s, 0] + p, bounds[s, 1]
        # slopes[j] is ∂e at the sample j before this one
        slopes, along = np.zeros((q + 1, size)), np.zeros((q, size))
        for k in range(start, stop):
            for j in range(q, 0, -1):
                for i in range(size):
                    slopes[j, i] = slopes[j - 1, i]
            now = slopes[0]
            for i in range(p):
                now[i] = v[k - 1 - i]
            for j in range(q):
                past = k - 1 - j
                now[p + j] = -e[past] if past >= start else -before[s, start - 1 - past]
            now[p + q] = at_one
            for j in range(1, q + 1):
                for i in range(size):
                    now[i] -= c[j] * slopes[j, i]
            for i in range(size):
                cross[i] += now[i] * e[k]
                for j in range(i + 1):
                    square[i, j] += now[i] * now[j]
            for m in range(q):
                if basis[m, k] != 0.0:
                    for i in range(size):
                        along[m, i] += basis[m, k] * now[i]
        for m in range(q):
            for i in range(size):
                for j in range(i + 1):
                    square[i, j] -= along[m, i] * along[m, j]
    for i in range(size):
        for j in range(i):
            square[j, i] = square[i, j]
    return square, cross
