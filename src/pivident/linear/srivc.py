"""SRIVC and RIVC: refined instrumental variables in continuous time, from their first model on.

y(t_k) = Σ_i B_i(p)/A_i(p) u_i(t_k - delay_i) + ξ_k is estimated directly from samples, without
an intermediate discrete-time model, by iterating (C3) from a state-variable-filter start. With
white ξ the estimate is statistically efficient: its covariance (C4) is the Cramér-Rao bound. With
coloured ξ it stays consistent, but (C4) is then wrong; use :func:`rivc`.

In a closed loop give the external signal. This is CLSRIVC (Gilson, Garnier, Young and Van den
Hof, 2008), whose instruments are the noise-free signals of the loop, with one change: the
controller need not be known, the noise-free input is estimated from the external signal as in
the first stage of the two-stage method (Van den Hof and Schrama, 1993).

Estimates are consistent when ``hold`` is the true behaviour of the input between samples (Pan,
González, Welsh and Rojas, 2020), as with a digital controller and a D/A converter.

RIVC is for the hybrid Box-Jenkins model (Young, Garnier and Gilson, 2008): ξ = C(z⁻¹)/D(z⁻¹) e, a
discrete-time noise model of a continuous-time plant. SRIVC gives the residual ξ = y - x; its noise
model is estimated, everything in (C3) is filtered by D/C, and both are repeated until the plant
converges. Plant and noise parameters are asymptotically independent, so (C4) with the whitened
instruments is the Cramér-Rao bound again.

An initial continuous-time model for the refined iteration.

Filtered by 1/A_f = 1/(p + λ)^n, every model of order n is a linear regression, whatever its
parameters. Least squares is biased by the noise; one instrumental-variable pass, with the
least-squares model as auxiliary model, removes most of that bias. Both need λ near the bandwidth
of the system, which is unknown: a few λ over the sampled band are tried, and the models ranked by
their simulation error.

With separate denominators the inputs are fitted in turn, each to the output less the contributions
of the others (back-fitting).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from pivident.foundation.errors import IdentificationError, OrdersNotSupported, UnstableFit
from pivident.foundation.text.sentences import capital, listed
from pivident.linear.estimate import LinearEstimate
from pivident.linear.model import Hold, Structure, fit_of, structure_of
from pivident.linear.refined_iv import (
    NAMED_SHARE,
    Linearised,
    NoiseFit,
    Refined,
    iv_step,
    linearised,
    offset_of,
    refine,
    share_of_operating_point,
    simulated_parts,
    with_operating_point,
)
from pivident.linear.sampled_data import SampledData, columns_of, sampled_data
from pivident.signals.arma import ar, arma
from pivident.signals.noise_models import fit_ar

#: Starts refined, best first, until one converges.
_STARTS = 3
#: Models that explain less of the output are tried with an operating point.
POOR = 0.9
#: What is said where the operating point lacks.
_OPERATING_POINT = "the signals have an offset, or the record does not begin at rest"
_ESTIMATE_IT = "subtract the operating point from u and y, or estimate it with offset=True"
#: Largest AR order searched (CAPTAIN's default).
_ORDER_MAX = 32
#: Residuals smaller than this fraction of the output are rounding, not noise.
_ROUNDING = 1e-7
#: Number of λ tried.
_POLES = 8
#: Rounds of back-fitting.
_ROUNDS = 3


def srivc(
    u: np.ndarray,
    y: np.ndarray,
    dt: float,
    numerator_order: int | Sequence[int],
    denominator_order: int | Sequence[int],
    *,
    delay: int | Sequence[int] = 0,
    hold: Hold = "zoh",
    external: np.ndarray | None = None,
    tolerance: float = 1e-4,
    max_iterations: int = 50,
    svf_pole: float | None = None,
    common: bool = True,
    offset: bool | None = False,
) -> LinearEstimate:
    """Continuous-time model of sampled data.

    Args:
        u: inputs, shape (samples,) or (samples, inputs).
        y: output, shape (samples,).
        dt: sampling period [s].
        numerator_order: degree of B in p, one for all inputs or one each.
        denominator_order: degree of A; with ``common=False`` one for all inputs or one each.
        delay: delay of the inputs in samples, one for all or one each.
        hold: behaviour of the inputs between samples: ``zoh`` or ``foh``.
        external: in closed loop, the signals that enter the loop from outside, shape (samples,)
            or (samples, signals); None: open loop.
        tolerance: largest change of a parameter at convergence, relative to it or to its
            standard error.
        max_iterations: most iterations.
        svf_pole: pole of the first state-variable filter [rad/s], about the bandwidth; None:
            several are tried.
        common: whether one denominator serves all inputs.
        offset: whether an offset of the signals and the state at the first sample are estimated,
            too; else the record begins at rest, and the output is zero where the inputs are. Of a
            poor model it is then asked whether an offset is what it lacks, and a warning says so;
            None: it is not asked, which takes half of the time.

    Returns:
        The model with its covariance.

    Raises:
        UnusableSignal: NaN, constant signals, shapes that do not belong together.
        DelayTooLong: a delay beyond the record.
        OrdersNotSupported: too few samples, or columns that depend on each other.
        UnstableFit: only an unstable model fits.
    """
    inputs = columns_of("u", u).shape[1]
    structure = structure_of(inputs, numerator_order, denominator_order, delay, hold, common)
    data = sampled_data(u, y, dt, structure, external)

    def refined(data: SampledData, structure: Structure) -> Refined:
        return refined_from_data(data, structure, tolerance, max_iterations, svf_pole)

    return _estimate("SRIVC" if external is None else "CLSRIVC", data, structure, refined, offset)


def _estimate(
    method: str,
    data: SampledData,
    structure: Structure,
    refined: Callable[[SampledData, Structure], Refined],
    offset: bool | None,
) -> LinearEstimate:
    """The estimate; where only the operating point lacks, it is said."""
    if offset:
        found = refined(*with_operating_point(data, structure))
        return continuous_estimate(method, data, structure, found)
    try:
        found = refined(data, structure)
        estimate = continuous_estimate(method, data, structure, found)
    except UnstableFit as error:
        if offset is not None and _explains(data, structure, refined, float(np.mean(data.y**2))):
            raise UnstableFit(error.poles, advice=f"{_OPERATING_POINT}: {_ESTIMATE_IT}") from None
        raise
    share = share_of_operating_point(data, structure, found)
    poor = offset is not None and (not estimate.converged or estimate.fit.r2 < POOR)
    if share < NAMED_SHARE and not (
        poor and _explains(data, structure, refined, float(np.mean(found.residual**2)))
    ):
        return estimate
    return replace(
        estimate, warnings=(*estimate.warnings, f"{capital(_OPERATING_POINT)}; {_ESTIMATE_IT}.")
    )


def _explains(
    data: SampledData,
    structure: Structure,
    refined: Callable[[SampledData, Structure], Refined],
    before: float,
) -> bool:
    """Whether a stable model with an operating point leaves far less of the output."""
    if not structure.common:
        return False
    try:
        found = refined(*with_operating_point(data, structure))
    except IdentificationError:
        return False
    stable = found.converged and not unstable_poles(data, found).size
    return stable and float(np.mean(found.residual**2)) < (1.0 - NAMED_SHARE) * before


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
    filters = np.poly(np.full(structure.denominator_orders[0], -pole)).real
    start = structure.joined([filters], [np.zeros(m + 1) for m in structure.numerator_orders])
    at = linearised(data, structure, start, start)
    least_squares, _ = iv_step(Linearised(at.residual, at.regressors, at.regressors))
    auxiliary, _ = structure.stabilised(start + least_squares)
    step, _ = iv_step(linearised(data, structure, start, auxiliary))
    return structure.stabilised(start + step)[0]


def refined_from_data(
    data: SampledData,
    structure: Structure,
    tolerance: float,
    max_iterations: int,
    svf_pole: float | None,
) -> Refined:
    """The iteration with white noise from the best start from which it converges."""
    best: Refined | None = None
    failure: OrdersNotSupported | None = None
    for _, theta in initial_models(data, structure, svf_pole)[:_STARTS]:
        try:
            refined = refine(
                data, structure, theta, tolerance=tolerance, max_iterations=max_iterations
            )
        except OrdersNotSupported as error:
            failure = error
            continue
        if refined.converged and not unstable_poles(data, refined).size:
            return refined
        if best is None or refined.variance < best.variance:
            best = refined
    if best is None:
        assert failure is not None
        raise failure
    return best


def continuous_estimate(
    method: str, data: SampledData, structure: Structure, refined: Refined
) -> LinearEstimate:
    """The result, or an error where only an unstable model fits."""
    unstable = unstable_poles(data, refined)
    if unstable.size:
        raise UnstableFit(tuple(unstable))
    own = structure.parameters  # those of an operating point come behind
    theta, covariance = refined.theta[:own], refined.covariance[:own, :own]
    groups, numerators = structure.split(theta)
    return LinearEstimate(
        method=method,
        numerators=numerators,
        denominators=structure.per_input(groups),
        dt=data.dt,
        continuous=True,
        delays=structure.delays,
        hold=structure.hold,
        common=structure.common,
        names=structure.names,
        theta=theta,
        covariance=covariance,
        noise=refined.noise,
        residual_variance=refined.variance,
        fit=fit_of(
            data.y,
            data.y - refined.residual,
            refined.variance,
            theta,
            covariance,
        ),
        iterations=refined.iterations,
        converged=refined.converged,
        warnings=(
            *_warnings(data, groups, refined),
            *_undetermined(structure, theta, covariance),
            *(refined.noise.warnings if refined.noise else ()),
        ),
        offset=offset_of(data, structure, refined) if refined.theta.size > own else None,
        resid=refined.residual,
        fittedvalues=data.y - refined.residual,
    )


def unstable_poles(data: SampledData, refined: Refined) -> np.ndarray:
    """Reflected poles that are unstable within the length of the record [rad/s]."""
    return refined.reflected[refined.reflected.real > 1.0 / data.duration]


def _warnings(
    data: SampledData, denominators: Sequence[np.ndarray], refined: Refined
) -> Iterator[str]:
    """Possible faults of the estimate, in sentences."""
    if not refined.converged:
        yield (
            "The iteration did not converge; lower the orders or give svf_pole near the bandwidth."
        )
    if refined.reflected.size:
        yield (
            "A pole slower than the record was reflected to the stable side; if the system "
            "integrates, identify from the integral of the input."
        )
    fastest = max(float(np.abs(np.roots(a)).max()) for a in denominators)
    if fastest > np.pi / data.dt:
        yield (
            f"A pole at {fastest:.4g} rad/s lies beyond the Nyquist frequency of "
            f"{np.pi / data.dt:.4g} rad/s: a sampling period is {fastest * data.dt:.3g} of its "
            "time constants. Sample faster, or lower denominator_order."
        )


def _undetermined(structure: Structure, theta: np.ndarray, covariance: np.ndarray) -> list[str]:
    """Coefficients that the record cannot tell from zero, in a sentence."""
    std = np.sqrt(np.diag(covariance))
    none = [n for n, x, s in zip(structure.names, theta, std, strict=True) if abs(x) < 2.0 * s]
    return [f"The record cannot tell {listed(none)} from zero (2σ)."] if none else []


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
    offset: bool | None = False,
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
        offset: as for `srivc`.

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

    def refined(data: SampledData, structure: Structure) -> Refined:
        white = refined_from_data(data, structure, tolerance, max_iterations, svf_pole)
        if np.std(white.residual) <= _ROUNDING * np.std(data.y):
            return white
        return refine(
            data,
            structure,
            white.theta,
            tolerance=tolerance,
            max_iterations=max_iterations,
            fit_noise=_noise_fit(white.residual, noise_order),
        )

    return _estimate("RIVC" if external is None else "CLRIVC", data, structure, refined, offset)


def _noise_fit(residual: np.ndarray, noise_order: tuple[int, int] | None) -> NoiseFit:
    """The noise model of a residual; an order is searched once, so that the iteration converges."""
    if noise_order is None:
        order = fit_ar(residual, min(_ORDER_MAX, residual.size // 10)).order
        return lambda v: ar(v, order)
    ar_order, ma_order = noise_order
    if ma_order == 0:
        return lambda v: ar(v, ar_order)
    return lambda v: arma(v, ar_order, ma_order)
