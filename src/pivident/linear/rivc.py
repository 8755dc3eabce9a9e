"""RIVC: refined instrumental variables for the hybrid Box-Jenkins model.

    y(t_k) = Σ_i B_i(p)/A_i(p) u_i(t_k - delay_i) + C(z⁻¹)/D(z⁻¹) e_k

has a continuous-time plant and a discrete-time noise model (Young, Garnier and Gilson, 2008).
SRIVC gives the residual ξ = y - x; its noise model is estimated, everything in (C3) is filtered
by D/C, and both are repeated until the plant converges. Plant and noise parameters are
asymptotically independent, so (C4) with the whitened instruments is the Cramér-Rao bound again.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.linear.estimate import LinearEstimate
from pivident.linear.model import Hold
from pivident.linear.refined_iv import NoiseFit, refine
from pivident.linear.sampled_data import columns_of, sampled_data
from pivident.linear.srivc import continuous_estimate, refined_from_data
from pivident.linear.structure import structure_of
from pivident.signals.arma import ar, arma
from pivident.signals.noise_models import fit_ar

#: Largest AR order searched (CAPTAIN's default).
_ORDER_MAX = 32

#: Residuals smaller than this fraction of the output are rounding, not noise.
_ROUNDING = 1e-7


def rivc(
    u: np.ndarray,
    y: np.ndarray,
    dt: float,
    numerator_order: int | Sequence[int],
    denominator_order: int | Sequence[int],
    *,
    noise_order: tuple[int, int] | None = None,
    delay: int | Sequence[int] = 0,
    hold: Hold = "zoh",
    external: np.ndarray | None = None,
    tolerance: float = 1e-4,
    max_iterations: int = 50,
    svf_pole: float | None = None,
    common: bool = True,
) -> LinearEstimate:
    """Continuous-time model of sampled data with coloured noise.

    Args:
        u: inputs, shape (samples,) or (samples, inputs).
        y: output, shape (samples,).
        dt: sampling period [s].
        numerator_order: degree of B in p, one for all inputs or one each.
        denominator_order: degree of A; with ``common=False`` one for all inputs or one each.
        noise_order: degrees of D (AR) and C (MA) in z⁻¹; None: AR, its order by AIC.
        delay: delay of the inputs in samples, one for all or one each.
        hold: behaviour of the inputs between samples: ``zoh`` or ``foh``.
        external: in closed loop, the signals that enter the loop from outside, shape (samples,)
            or (samples, signals); None: open loop.
        tolerance: largest change of a parameter at convergence, relative to it or to its
            standard error.
        max_iterations: most iterations, of SRIVC and of the refinement each.
        svf_pole: pole of the first state-variable filter [rad/s], about the bandwidth; None:
            several are tried.
        common: whether one denominator serves all inputs.

    Returns:
        The model with its covariance and its noise model.

    Raises:
        UnusableSignal: NaN, constant signals, shapes that do not belong together.
        DelayTooLong: a delay beyond the record.
        OrdersNotSupported: too few samples, or columns that depend on each other.
        UnstableFit: only an unstable model fits.
        IdentificationError: the residual does not support a noise model of these orders.
    """
    inputs = columns_of("u", u).shape[1]
    structure = structure_of(inputs, numerator_order, denominator_order, delay, hold, common)
    data = sampled_data(u, y, dt, structure, external)
    white = refined_from_data(data, structure, tolerance, max_iterations, svf_pole)
    refined = white
    if np.std(white.residual) > _ROUNDING * np.std(data.y):
        refined = refine(
            data,
            structure,
            white.theta,
            tolerance=tolerance,
            max_iterations=max_iterations,
            fit_noise=_noise_fit(white.residual, noise_order),
        )
    method = "RIVC" if external is None else "CLRIVC"
    return continuous_estimate(method, data, structure, refined)


def _noise_fit(residual: np.ndarray, noise_order: tuple[int, int] | None) -> NoiseFit:
    """The noise model of a residual; an order is searched once, so that the iteration converges."""
    if noise_order is None:
        order = fit_ar(residual, min(_ORDER_MAX, residual.size // 10)).order
        return lambda v: ar(v, order)
    ar_order, ma_order = noise_order
    if ma_order == 0:
        return lambda v: ar(v, ar_order)
    return lambda v: arma(v, ar_order, ma_order)
