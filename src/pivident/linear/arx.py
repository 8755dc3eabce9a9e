"""ARX: a discrete-time model by least squares, and what discrete-time estimators share.

    A(z⁻¹) y_k = Σ_i B_i(z⁻¹) u_i,k-delay_i + e_k

is linear in its coefficients. The estimate is consistent only when the equation error e is white:
it suits a controller, whose input and output are both exact signals of its computer. A measured
output biases A; use :func:`pivident.linear.sriv.sriv` then.

Columns of slow signals sampled fast are nearly parallel: a condition number of 10⁷ is usual. The
regression is therefore solved by QR of the columns scaled to unit length, never by its normal
equations, which would square that number.

Shared by the discrete-time estimators: the record, its regressors, the form of the result.

    y_k = Σ_i B_i(z⁻¹)/A(z⁻¹) u_i,k-delay_i + ξ_k,    A = F A_f

with one denominator for all inputs. F holds poles that are known, such as 1 for an integrator;
A_f is estimated. A pole at 1 that is estimated under noise becomes a leak.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.signal import lfilter

from pivident.foundation.errors import IdentificationError, OrdersNotSupported, UnusableSignal
from pivident.linear.estimate import LinearEstimate
from pivident.linear.model import Structure, fit_of, structure_of
from pivident.linear.sampled_data import SampledData, columns_of, sampled_data
from pivident.signals.arma import Noise
from pivident.signals.noise_models import unmasked_stretches


@dataclass(frozen=True, eq=False)
class DiscreteRecord:
    """A record and the orders of its model; the denominator counts the estimated poles only."""

    data: SampledData  # inputs shifted by their delays; left-out samples of y interpolated
    structure: Structure
    fixed: np.ndarray  # F, coefficients of z⁰, z⁻¹, …
    mask: np.ndarray  # True where samples are left out, (samples,)

    @property
    def stretches(self) -> np.ndarray:
        """Rows (start, stop) of the samples between gaps."""
        return unmasked_stretches(self.mask)

    @property
    def free_order(self) -> int:
        """Degree of A_f."""
        return self.structure.denominator_orders[0]

    def split(self, theta: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
        """A_f and the numerators of θ."""
        denominators, numerators = self.structure.split(theta)
        return denominators[0], numerators

    def simulated(self, theta: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Σ_i B_i/A u_i from rest, shape (samples,)."""
        a, numerators = self.split(theta)
        terms = (lfilter(b, [1.0], u) for b, u in zip(numerators, inputs, strict=True))
        return lfilter([1.0], np.convolve(self.fixed, a), sum(terms))


def discrete_record(
    u: np.ndarray,
    y: np.ndarray,
    dt: float,
    numerator_order: int | Sequence[int],
    denominator_order: int,
    delay: int | Sequence[int],
    mask: np.ndarray | None,
    fixed_poles: Sequence[complex],
    external: np.ndarray | None = None,
) -> DiscreteRecord:
    """Check the arguments of an estimator."""
    fixed = np.poly(np.asarray(fixed_poles)) if len(fixed_poles) else np.ones(1)
    if np.abs(np.imag(fixed)).max() > 1e-12:
        raise IdentificationError(
            f"fixed_poles {tuple(fixed_poles)} do not give a real polynomial",
            advice="give complex poles in conjugate pairs",
        )
    free = denominator_order - len(fixed_poles)
    if free < 0:
        raise IdentificationError(
            f"denominator_order is {denominator_order}, below the number of fixed poles, "
            f"{len(fixed_poles)}",
            advice="it counts all poles, the fixed ones included",
        )
    inputs = columns_of("u", u)
    highest = max(1, denominator_order, int(np.max(numerator_order)))
    structure = structure_of(inputs.shape[1], numerator_order, highest, delay, "zoh", True)
    structure = replace(structure, denominator_orders=(free,))
    output = columns_of("y", y)
    left_out = np.zeros(len(output), dtype=bool) if mask is None else np.asarray(mask, dtype=bool)
    if left_out.shape != (len(output),) or left_out.all():
        raise UnusableSignal(
            "mask",
            f"has shape {left_out.shape} and leaves out {np.count_nonzero(left_out)} samples",
            f"give {len(output)} flags, True for the samples to leave out",
        )
    if left_out.any():
        output = output.copy()
        kept = np.flatnonzero(~left_out)
        output[left_out, 0] = np.interp(np.flatnonzero(left_out), kept, output[kept, 0])
    data = sampled_data(inputs, output, dt, structure, external)
    return DiscreteRecord(data, structure, np.real(fixed), left_out)


def lagged(signal: np.ndarray, lags: Sequence[int]) -> np.ndarray:
    """Rows x_{k-lag}, zero before the record, shape (lags, samples)."""
    rows = np.zeros((len(lags), signal.size))
    for row, lag in zip(rows, lags, strict=True):
        row[lag:] = signal[: signal.size - lag]
    return rows


def discrete_estimate(
    method: str,
    record: DiscreteRecord,
    theta: np.ndarray,
    covariance: np.ndarray,
    variance: float,
    *,
    noise: Noise | None = None,
    iterations: int = 1,
    converged: bool = True,
    warnings: Sequence[str] = (),
) -> LinearEstimate:
    """The result: A = F A_f expanded, all polynomials with equally many coefficients."""
    structure, fixed = record.structure, record.fixed
    a_free, numerators = record.split(theta)
    a = np.convolve(fixed, a_free)
    with np.errstate(over="ignore", invalid="ignore"):
        x = record.simulated(theta, record.data.u)
        kept = ~record.mask & np.isfinite(x)
        fit = fit_of(record.data.y[kept], x[kept], variance, theta, covariance)
        known = np.where(kept, x, np.nan)
    full = replace(structure, denominator_orders=(a.size - 1,))
    # a is linear in the estimated coefficients: one shifted copy of F for each
    expand = np.zeros((full.parameters, theta.size))
    for i in range(record.free_order):
        expand[i : i + fixed.size, i] = fixed
    for i in range(theta.size - record.free_order):
        expand[a.size - 1 + i, record.free_order + i] = 1.0
    size = max(a.size, *(b.size for b in numerators))

    def padded(b: np.ndarray) -> np.ndarray:
        return np.r_[b, np.zeros(size - b.size)]

    return LinearEstimate(
        method=method,
        numerators=tuple(padded(b) for b in numerators),
        denominators=structure.per_input([padded(a)]),
        dt=record.data.dt,
        continuous=False,
        delays=structure.delays,
        hold="zoh",
        common=True,
        names=full.names,
        theta=np.concatenate([a[1:], *numerators]),
        covariance=expand @ covariance @ expand.T,
        noise=noise,
        residual_variance=variance,
        fit=fit,
        iterations=iterations,
        converged=converged,
        warnings=tuple(warnings),
        resid=record.data.y - known,
        fittedvalues=known,
    )


def require_rank(parameters: int, singular: np.ndarray, what: str) -> None:
    """Refuse linearly dependent columns: the smallest singular value is rounding."""
    rank = int(np.sum(singular > 1e-13 * singular[0]))
    if rank < parameters:
        raise OrdersNotSupported(parameters, f"its {what} have numerical rank {rank}")


def arx(
    u: np.ndarray,
    y: np.ndarray,
    dt: float,
    numerator_order: int | Sequence[int],
    denominator_order: int,
    *,
    delay: int | Sequence[int] = 0,
    mask: np.ndarray | None = None,
    fixed_poles: Sequence[complex] = (),
) -> LinearEstimate:
    """Discrete-time model by least squares; the record need not begin at rest.

    Args:
        u: inputs, shape (samples,) or (samples, inputs).
        y: output, shape (samples,).
        dt: sampling period [s].
        numerator_order: degree of B in z⁻¹, so one less than its coefficients; one for all
            inputs or one each.
        denominator_order: degree of A, which all inputs share; fixed poles count.
        delay: delay of the inputs in samples, one for all or one each.
        mask: True where samples are left out, shape (samples,); equations that would touch one
            of them, u or y, are dropped.
        fixed_poles: poles known beforehand, such as (1.0,) for an integrator.

    Returns:
        The model with its covariance.

    Raises:
        UnusableSignal: NaN outside the mask, constant signals, shapes that do not fit.
        DelayTooLong: a delay beyond the record.
        OrdersNotSupported: too few equations, or columns that depend on each other.
    """
    record = discrete_record(
        _without_masked(u, mask),
        y,
        dt,
        numerator_order,
        denominator_order,
        delay,
        mask,
        fixed_poles,
    )
    theta, inverse, variance = least_squares(record, record.data.y)
    return discrete_estimate("ARX", record, theta, variance * inverse, variance)


def least_squares(record: DiscreteRecord, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """θ, (ΦᵀΦ)⁻¹ and the variance of the equation error, for the output y."""
    structure, samples = record.structure, y.size
    output = lfilter(record.fixed, [1.0], y)
    rows = [-lagged(output, range(1, record.free_order + 1))]
    rows += [
        lagged(u, range(m + 1))
        for u, m in zip(record.data.u, structure.numerator_orders, strict=True)
    ]
    usable = ~_touched(record)
    phi, right = np.concatenate(rows)[:, usable].T, output[usable]
    size = structure.parameters
    if len(phi) <= size:
        raise OrdersNotSupported(
            size, f"{len(phi)} of {samples} samples have a complete past that is not left out"
        )
    scale = np.linalg.norm(phi, axis=0)
    if scale.min() == 0:
        raise OrdersNotSupported(size, "a delayed input is zero in all equations")
    orthonormal, root = qr(phi / scale, mode="economic")
    require_rank(size, np.linalg.svd(root, compute_uv=False), "regressors")
    theta = solve_triangular(root, orthonormal.T @ right) / scale
    inverse = solve_triangular(root, np.eye(size)) / scale[:, None]
    residual = right - phi @ theta
    return theta, inverse @ inverse.T, float(residual @ residual) / (len(phi) - size)


def _without_masked(u: np.ndarray, mask: np.ndarray | None) -> np.ndarray:
    """The inputs with zeros for NaN where samples are left out."""
    columns = np.array(u, dtype=float)
    if mask is not None and len(columns) == len(mask):
        left_out = np.asarray(mask, dtype=bool)
        columns[left_out] = np.nan_to_num(columns[left_out], posinf=0.0, neginf=0.0)
    return columns


def _touched(record: DiscreteRecord) -> np.ndarray:
    """Whether the equation of a sample needs one that is left out or lies before the record."""
    structure = record.structure
    outputs = record.free_order + record.fixed.size - 1
    needed = [(0, outputs)] + [
        (delay, delay + m)
        for delay, m in zip(structure.delays, structure.numerator_orders, strict=True)
    ]
    touched = np.zeros(record.mask.size, dtype=bool)
    for first, last in needed:
        for lag in range(first, last + 1):
            touched[:lag] = True
            touched[lag:] |= record.mask[: record.mask.size - lag]
    return touched
