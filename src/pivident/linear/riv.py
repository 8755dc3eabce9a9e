"""RIV: refined instrumental variables with a Box-Jenkins noise model, in discrete time.

    y_k = Σ_i B_i/A u_i,k-delay_i + (C/D) e_k,    e white

Every iteration of :mod:`pivident.linear.sriv` fits the noise model to ε = y - x and filters
regressors and instruments by D/C. At convergence the estimate is the maximum likelihood estimate,
its covariance s² (Σ ζ ζᵀ)⁻¹ the Cramér-Rao bound, and noise and system parameters are independent.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.errors import IdentificationError
from pivident.linear.discrete import discrete_record
from pivident.linear.estimate import LinearEstimate
from pivident.linear.sriv import refined_estimate
from pivident.signals.arma import Noise, ar, arma

#: Largest order of the AR noise model that is searched; half of it is CAPTAIN's default.
_AR_ORDER_MAX = 64

#: Residuals below this fraction of the output's range are rounding: no noise to model.
_ROUNDING = 1e-11

#: Fits after which the order is fixed: two orders of equal AIC would alternate forever.
_SEARCHES = 8


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
            f"noise_order is {noise_order!r}; expected (p, q), the degrees of D and C, or None"
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
