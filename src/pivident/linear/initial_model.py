"""An initial continuous-time model for the refined iteration.

Filtered by 1/A_f = 1/(p + λ)^n, every model of order n is a linear regression, whatever its
parameters. Least squares is biased by the noise; one instrumental-variable pass, with the
least-squares model as auxiliary model, removes most of that bias. Both need λ near the bandwidth
of the system, which is unknown: a few λ over the sampled band are tried, and the models ranked by
their simulation error.

With separate denominators the inputs are fitted in turn, each to the output less the contributions
of the others (back-fitting).
"""

from __future__ import annotations

import numpy as np

from pivident.errors import OrdersNotSupported
from pivident.linear.refined_iv import Linearised, iv_step, linearised, simulated_parts
from pivident.linear.sampled_data import SampledData
from pivident.linear.structure import Structure

#: Number of λ tried.
_POLES = 8

#: Rounds of back-fitting.
_ROUNDS = 3


def initial_models(
    data: SampledData, structure: Structure, svf_pole: float | None
) -> list[tuple[float, np.ndarray]]:
    """Mean square of the simulation error and θ, best first; λ [rad/s] is tried if not given."""
    poles = candidate_poles(data) if svf_pole is None else np.array([svf_pole])
    found: list[tuple[float, np.ndarray]] = []
    failure: OrdersNotSupported | None = None
    for pole in poles:
        try:
            theta = _from_filter(data, structure, float(pole))
        except OrdersNotSupported as error:
            failure = error
            continue
        residual = data.y - np.sum(simulated_parts(data, structure, theta), axis=0)
        loss = float(np.mean(residual**2))
        if np.isfinite(loss):
            found.append((loss, theta))
    if not found:
        raise failure or OrdersNotSupported(
            structure.parameters, "no initial model can be simulated over the record"
        )
    return sorted(found, key=lambda pair: pair[0])


def candidate_poles(data: SampledData) -> np.ndarray:
    """λ from two periods per record to half the Nyquist frequency [rad/s]."""
    return np.geomspace(4 * np.pi / data.duration, 0.5 * np.pi / data.dt, _POLES)


def _from_filter(data: SampledData, structure: Structure, pole: float) -> np.ndarray:
    """θ with one λ: least squares, then one instrumental-variable pass."""
    if structure.common:
        return _least_squares_then_iv(data, structure, pole)
    singles = [structure.of_input(i) for i in range(structure.inputs)]
    parts = [np.zeros_like(data.y) for _ in singles]
    thetas = [np.zeros(0) for _ in singles]
    for _ in range(_ROUNDS):
        for i, single in enumerate(singles):
            others = np.sum(parts, axis=0) - parts[i]
            alone = data.of_input(i, data.y - others)
            thetas[i] = _least_squares_then_iv(alone, single, pole)
            parts[i] = simulated_parts(alone, single, thetas[i])[0]
    polynomials = [s.split(theta) for s, theta in zip(singles, thetas, strict=True)]
    return structure.joined([p[0][0] for p in polynomials], [p[1][0] for p in polynomials])


def _least_squares_then_iv(data: SampledData, structure: Structure, pole: float) -> np.ndarray:
    """Both are steps from (A_f, B = 0), where the residual is y itself."""
    order = structure.denominator_orders[0]
    filters = np.poly(np.full(order, -pole)).real
    zeros = [np.zeros(m + 1) for m in structure.numerator_orders]
    start = structure.joined([filters], zeros)
    at = linearised(data, structure, start, start)
    least_squares, _ = iv_step(Linearised(at.residual, at.regressors, at.regressors))
    auxiliary, _ = structure.stabilised(start + least_squares)
    step, _ = iv_step(linearised(data, structure, start, auxiliary))
    return structure.stabilised(start + step)[0]
