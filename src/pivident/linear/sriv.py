"""SRIV and RIV: refined instrumental variables in discrete time.

    y_k = Σ_i B_i/A u_i,k-delay_i + (C/D) e_k,    e white

With x = Σ_i B_i/A u_i at the current θ, the residual ε = y - x is linear in the change of θ,

    ε - φᵀ(θ̂ - θ) = 0,    φ = (-y_{k-1}/A …, u_{k}/A …)

whose noise enters through y. The instruments ζ are φ with x instead of y, and in a closed loop û
instead of u. Both are filtered by the inverse noise model D/C (Young and Jakeman, 1980):

    θ̂ = θ + (Σ ζ φᵀ)⁻¹ Σ ζ ε

until θ converges. SRIV sets D/C = 1, which is efficient for white ξ and consistent for any; the
prefilter 1/A is part of φ. Poles that leave the unit circle are reflected into it.

Left-out samples of y give no equation; where 1/A needs them, x replaces them.

RIV fits the Box-Jenkins noise model to ε in every iteration. At convergence its estimate is the
maximum likelihood estimate, its covariance s² (Σ ζ ζᵀ)⁻¹ the Cramér-Rao bound, and noise and system
parameters are independent.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from pivident.foundation.errors import IdentificationError, OrdersNotSupported
from pivident.linear.arx import (
    DiscreteRecord,
    discrete_estimate,
    discrete_record,
    lagged,
    least_squares,
)
from pivident.linear.estimate import LinearEstimate
from pivident.linear.refined_iv import Linearised, iv_step
from pivident.signals.arma import Noise, ar, arma, inside

#: Fits a noise model to ε over stretches, rows of (start, stop).
DiscreteNoiseFit = Callable[[np.ndarray, np.ndarray], Noise]

#: Poles are kept within this radius.
_LARGEST_POLE = 1.0 - 1e-6

#: Order of the ARX model whose simulation gives the second start.
_HIGH_ORDER = 20

#: Largest order of the AR noise model that is searched; half of it is CAPTAIN's default.
_AR_ORDER_MAX = 64

#: Residuals below this fraction of the output's range are rounding: no noise to model.
_ROUNDING = 1e-11

#: Fits after which the order is fixed: two orders of equal AIC would alternate forever.
_SEARCHES = 8


def sriv(
    u: np.ndarray,
    y: np.ndarray,
    dt: float,
    numerator_order: int | Sequence[int],
    denominator_order: int,
    *,
    delay: int | Sequence[int] = 0,
    mask: np.ndarray | None = None,
    fixed_poles: Sequence[complex] = (),
    external: np.ndarray | None = None,
    tolerance: float = 1e-4,
    max_iterations: int = 50,
) -> LinearEstimate:
    """Discrete-time model of a record from rest, with white output noise assumed.

    Args:
        u: inputs, shape (samples,) or (samples, inputs).
        y: output, shape (samples,).
        dt: sampling period [s].
        numerator_order: degree of B in z⁻¹, one for all inputs or one each.
        denominator_order: degree of A, which all inputs share; fixed poles count.
        delay: delay of the inputs in samples, one for all or one each.
        mask: True where samples of y are left out, shape (samples,).
        fixed_poles: poles known beforehand, such as (1.0,) for an integrator.
        external: in closed loop, the signals that enter the loop from outside, shape (samples,)
            or (samples, signals); None: open loop.
        tolerance: largest change of a parameter at convergence, relative to it or to its
            standard error.
        max_iterations: most iterations.

    Returns:
        The model with its covariance.

    Raises:
        UnusableSignal: NaN outside the mask, constant signals, shapes that do not fit.
        DelayTooLong: a delay beyond the record.
        OrdersNotSupported: too few samples, or columns that depend on each other.
    """
    record = discrete_record(
        u, y, dt, numerator_order, denominator_order, delay, mask, fixed_poles, external
    )
    return refined_estimate("SRIV", record, tolerance, max_iterations)


def refined_estimate(
    method: str,
    record: DiscreteRecord,
    tolerance: float,
    max_iterations: int,
    fit_noise: DiscreteNoiseFit | None = None,
) -> LinearEstimate:
    """The iteration from the first start from which it converges."""
    best: _Iterate | None = None
    failure: OrdersNotSupported | None = None
    for start in (_by_least_squares, _by_high_order):
        try:
            found = _iterate(record, start(record), tolerance, max_iterations, fit_noise)
        except OrdersNotSupported as error:
            failure = failure or error
            continue
        if best is None or found.rank < best.rank:
            best = found
        if best.converged and not best.reflected:
            break
    if best is None:
        assert failure is not None
        raise failure
    warnings = []
    if not best.converged:
        warnings.append("The iteration did not converge; lower the orders or check the delay.")
    if best.reflected:
        warnings.append(
            "An unstable pole was reflected into the unit circle; lower denominator_order, or "
            "give an integrator as fixed_poles=(1.0,)."
        )
    return discrete_estimate(
        method,
        record,
        best.theta,
        best.covariance,
        best.variance,
        noise=best.noise,
        iterations=best.iterations,
        converged=best.converged,
        warnings=(*warnings, *(best.noise.warnings if best.noise else ())),
    )


@dataclass(frozen=True, eq=False)
class _Iterate:
    """θ with what was computed there."""

    theta: np.ndarray
    covariance: np.ndarray
    variance: float
    noise: Noise | None
    iterations: int
    converged: bool
    reflected: bool

    @property
    def rank(self) -> tuple[bool, bool, float]:
        """Smaller is better."""
        return not self.converged, self.reflected, self.variance


def _iterate(
    record: DiscreteRecord,
    theta: np.ndarray,
    tolerance: float,
    max_iterations: int,
    fit_noise: DiscreteNoiseFit | None,
) -> _Iterate:
    """Iterate until θ converges; if it does not, the iterate of smallest variance."""
    theta, reflected = _stabilised(record, theta)
    best: _Iterate | None = None
    converged = False
    for iteration in range(max_iterations + 1):
        at = _linearised(record, theta)
        noise = fit_noise(at.residual, record.stretches) if fit_noise else None
        white = _whitened(at, record.stretches, noise)
        change, inverse = iv_step(white)
        variance = float(np.sum(white.residual**2)) / max(white.residual.size - theta.size, 1)
        now = _Iterate(theta, variance * inverse, variance, noise, iteration, converged, reflected)
        if best is None or converged or variance < best.variance:
            best = now
        if converged:
            break
        following, reflected = _stabilised(record, theta + change)
        scale = np.maximum(np.abs(theta), np.sqrt(np.diag(now.covariance)))
        converged = bool(np.all(np.abs(following - theta) <= tolerance * scale))
        theta = following
    assert best is not None
    return best


def _linearised(record: DiscreteRecord, theta: np.ndarray) -> Linearised:
    """ε, φ and ζ at θ, over all samples."""
    a, numerators = record.split(theta)
    denominator = np.convolve(record.fixed, a)
    data, orders = record.data, record.structure.numerator_orders

    def of_inputs(inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        filtered = lfilter([1.0], denominator, inputs)
        rows = [lagged(u, range(m + 1)) for u, m in zip(filtered, orders, strict=True)]
        return np.concatenate(rows), np.concatenate(numerators) @ np.concatenate(rows)

    rows, x = of_inputs(data.u)
    clean_rows, clean_x = (rows, x) if data.clean is data.u else of_inputs(data.clean)
    lags = range(1, record.free_order + 1)
    y = np.where(record.mask, x, data.y)
    phi = np.concatenate([-lagged(lfilter([1.0], a, y), lags), rows])
    zeta = np.concatenate([-lagged(lfilter([1.0], a, clean_x), lags), clean_rows])
    return Linearised(y - x, phi, zeta)


def _whitened(at: Linearised, stretches: np.ndarray, noise: Noise | None) -> Linearised:
    """The stretches longer than D between gaps, each filtered by D/C on its own."""
    shortest = 1 if noise is None else noise.ar.size
    parts = [
        Linearised(
            at.residual[start:stop], at.regressors[:, start:stop], at.instruments[:, start:stop]
        ).whitened(noise)
        for start, stop in stretches
        if stop - start >= shortest
    ]
    return Linearised(
        np.concatenate([part.residual for part in parts]),
        np.ascontiguousarray(np.concatenate([part.regressors for part in parts], axis=1)),
        np.ascontiguousarray(np.concatenate([part.instruments for part in parts], axis=1)),
    )


def _stabilised(record: DiscreteRecord, theta: np.ndarray) -> tuple[np.ndarray, bool]:
    """θ with the roots of A_f inside the unit circle (B5), and whether any were not."""
    a, numerators = record.split(theta)
    stable = inside(a, _LARGEST_POLE)
    return np.concatenate([stable[1:], *numerators]), bool(np.any(stable != a))


def _by_least_squares(record: DiscreteRecord) -> np.ndarray:
    """ARX at the requested orders; under noise its poles are too fast."""
    return least_squares(record, record.data.y)[0]


def _by_high_order(record: DiscreteRecord) -> np.ndarray:
    """ARX on the simulation of a high-order ARX model, which has little bias."""
    order = min(_HIGH_ORDER, record.data.y.size // (10 * (record.structure.inputs + 1)))
    structure = record.structure
    high = replace(
        record,
        structure=replace(
            structure,
            denominator_orders=(max(order, record.free_order),),
            numerator_orders=tuple(max(order, m) for m in structure.numerator_orders),
        ),
    )
    theta, _ = _stabilised(high, least_squares(high, high.data.y)[0])
    return least_squares(record, high.simulated(theta, high.data.clean))[0]


def riv(
    u: np.ndarray,
    y: np.ndarray,
    dt: float,
    numerator_order: int | Sequence[int],
    denominator_order: int,
    *,
    noise_order: tuple[int, int] | None = None,
    delay: int | Sequence[int] = 0,
    mask: np.ndarray | None = None,
    fixed_poles: Sequence[complex] = (),
    external: np.ndarray | None = None,
    tolerance: float = 1e-4,
    max_iterations: int = 50,
) -> LinearEstimate:
    """Discrete-time model of a record from rest, with a model of its output noise.

    Args:
        u: inputs, shape (samples,) or (samples, inputs).
        y: output, shape (samples,).
        dt: sampling period [s].
        numerator_order: degree of B in z⁻¹, one for all inputs or one each.
        denominator_order: degree of A, which all inputs share; fixed poles count.
        noise_order: degrees (p, q) of D and C; None: an AR model, order by AIC.
        delay: delay of the inputs in samples, one for all or one each.
        mask: True where samples of y are left out, shape (samples,).
        fixed_poles: poles known beforehand, such as (1.0,) for an integrator.
        external: in closed loop, the signals that enter the loop from outside, shape (samples,)
            or (samples, signals); None: open loop.
        tolerance: largest change of a parameter at convergence, relative to it or to its
            standard error.
        max_iterations: most iterations.

    Returns:
        The model with its covariance and its noise model.

    Raises:
        UnusableSignal: NaN outside the mask, constant signals, shapes that do not fit.
        DelayTooLong: a delay beyond the record.
        OrdersNotSupported: too few samples, or columns that depend on each other.
        IdentificationError: too few samples for the orders of the noise.
    """
    if noise_order is not None and (len(noise_order) != 2 or min(noise_order) < 0):
        raise IdentificationError(
            f"noise_order is {noise_order!r}",
            advice="expected (p, q), the degrees of D and C, or None",
        )
    record = discrete_record(
        u, y, dt, numerator_order, denominator_order, delay, mask, fixed_poles, external
    )

    orders: list[int] = []
    rounding = _ROUNDING * float(np.ptp(record.data.y))

    def fit_noise(residual: np.ndarray, stretches: np.ndarray) -> Noise:
        if np.abs(residual).max() <= rounding:
            return Noise(np.ones(1), np.ones(1), float(np.var(residual)))
        if noise_order is not None:
            return arma(residual, *noise_order, segments=stretches)
        longest = int((stretches[:, 1] - stretches[:, 0]).max())
        order = orders[-1] if len(orders) >= _SEARCHES else None
        noise = ar(residual, order, min(_AR_ORDER_MAX, longest // 10), segments=stretches)
        orders.append(noise.ar.size - 1)
        return noise

    return refined_estimate("RIV", record, tolerance, max_iterations, fit_noise)
