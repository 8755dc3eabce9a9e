"""ARX: a discrete-time model by least squares.

    A(z⁻¹) y_k = Σ_i B_i(z⁻¹) u_i,k-delay_i + e_k

is linear in its coefficients. The estimate is consistent only when the equation error e is white:
it suits a controller, whose input and output are both exact signals of its computer. A measured
output biases A; use :func:`pivident.linear.sriv.sriv` then.

Columns of slow signals sampled fast are nearly parallel: a condition number of 10⁷ is usual. The
regression is therefore solved by QR of the columns scaled to unit length, never by its normal
equations, which would square that number.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.signal import lfilter

from pivident.errors import OrdersNotSupported
from pivident.linear.discrete import (
    DiscreteRecord,
    discrete_estimate,
    discrete_record,
    lagged,
    require_rank,
)
from pivident.linear.estimate import LinearEstimate


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
    for u, m in zip(record.data.u, structure.numerator_orders, strict=True):
        rows.append(lagged(u, range(m + 1)))
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
