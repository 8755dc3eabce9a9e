"""Noise models of a residual: AR by Burg, ARMA by exact maximum likelihood.

A residual v is filtered white noise, D(z⁻¹) v = C(z⁻¹) e with var e = λ: the AR part D has degree
p, the MA part C degree q. ARMA follows the refined iteration of (B4):

1. a high-order AR model, order by AIC, gives a first ê;
2. Hannan and Rissanen: v_k is regressed on v_{k-1…k-p} and ê_{k-1…k-q};
3. Gauss-Newton on e, whose derivatives are the regressors prefiltered by 1/C,
   ∂e_k/∂d_i = (1/C) v_{k-i},  ∂e_k/∂c_j = -(1/C) e_{k-j}; a step is shortened until L grows.

The likelihood is exact even for zeros on the unit circle, as those of differenced white noise (see
`arma_likelihood`). Likelihoods of the stretches between gaps add up; no product spans a gap.

Poles and zeros stay inside the circle of radius `MAX_ROOT` (reflection (B5), then a limit):
a reflection does not change the likelihood, and the whitener D/C must forget its start within a
record. A zero at 1 that is moved to 0.9999 costs 5e-5 of λ.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from pivident.foundation.errors import IdentificationError
from pivident.foundation.text.display import Displayed
from pivident.signals.arma_likelihood import Likelihood, Point
from pivident.signals.noise_models import ArModel, Criterion, fit_ar

#: Largest modulus of a pole or zero of a noise model.
MAX_ROOT = 0.9999

#: Largest order of the AR model that starts the iteration, where none is given.
_START_ORDER = 100

#: Samples for each coefficient, and for the mean.
_SAMPLES = 10

#: The iteration ends when a step gains less than this in ln L: a hundredth of a standard error.
_GAIN = 1e-4

#: Shorter steps, each 0.3 of the last, before the iteration stops.
_SHORTER = 7

#: Condition of the parameters' correlation beyond which a pole and a zero cancel.
_CANCELLING = 1e13


@dataclass(frozen=True, eq=False)
class Noise(Displayed):
    """ξ = (C(z⁻¹)/D(z⁻¹)) e, var e = λ.

    Attributes:
        ar: D, monic, coefficients of z⁰, z⁻¹, …, shape (order + 1,).
        ma: C, monic, likewise.
        variance: λ [squared units of ξ].
        covariance: of (D without its one, C without its one); empty where not estimated.
        warnings: whole sentences.
    """

    ar: np.ndarray
    ma: np.ndarray
    variance: float
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    warnings: tuple[str, ...] = ()


def ar(
    v: np.ndarray,
    order: int | None = None,
    p_max: int = 150,
    criterion: Criterion = "aic",
    *,
    segments: np.ndarray | None = None,
) -> Noise:
    """AR noise model by Burg's method, v = e/D.

    Args:
        v: residual, shape (samples,); its mean is removed.
        order: degree of D; None: searched up to ``p_max``.
        p_max: largest order searched.
        criterion: ``aic``, ``aicc`` or ``bic``.
        segments: stretches to use, rows of (start, stop); None: all samples.

    Returns:
        The noise model.

    Raises:
        IdentificationError: too few samples, NaN, or a constant residual.
    """
    return _noise_of(fit_ar(_vector(v), p_max, criterion, order=order, segments=segments))


def arma(
    v: np.ndarray,
    ar_order: int,
    ma_order: int,
    *,
    start_order: int | None = None,
    iterations: int = 100,
    segments: np.ndarray | None = None,
) -> Noise:
    """ARMA noise model v = (C/D) e by exact maximum likelihood from Hannan and Rissanen's start.

    Args:
        v: residual, shape (samples,); its mean is estimated too.
        ar_order: degree p of D.
        ma_order: degree q of C; 0 gives Burg's AR model of that order.
        start_order: order of the AR model that gives the first ê; None: by AIC up to 100.
        iterations: largest number of Gauss-Newton steps.
        segments: stretches to use, rows of (start, stop); None: all samples.

    Returns:
        The model with the covariance of (d_1 … d_p, c_1 … c_q). If the iteration does not
        converge, or poles and zeros cancel, it is the AR model of the start, with an entry in
        ``warnings``.

    Raises:
        IdentificationError: too few samples for these orders, NaN, or a constant residual.
    """
    v = _vector(v)
    if ar_order < 0 or ma_order < 0:
        raise IdentificationError(
            f"ARMA orders ({ar_order}, {ma_order}) are negative", advice="use zero or more"
        )
    if ma_order == 0:
        return ar(v, ar_order, segments=segments)
    bounds = _bounds(v, ar_order, ma_order, segments)
    shortest = int((bounds[:, 1] - bounds[:, 0]).min())
    longest = int((bounds[:, 1] - bounds[:, 0]).max())
    start_max = min(_START_ORDER, longest // 4) if start_order is None else start_order
    start = fit_ar(v, start_max, order=start_order, segments=bounds, shortest=shortest)
    theta = np.r_[_hannan_rissanen(v - start.mean, bounds, start, ar_order, ma_order), start.mean]
    theta = _inside(theta, ar_order)
    point = Likelihood(v, bounds, ar_order).at(theta)
    for _ in range(iterations):
        step, gain = point.gauss_newton()
        following = _shortened(point, step) if gain > _GAIN else None
        if following is None or point.value - following.value < _GAIN:
            return _settled(point if following is None else following, start)
        point = following
    return _fallback(start, ar_order, ma_order)


def select_arma(
    v: np.ndarray,
    ar_orders: Iterable[int],
    ma_orders: Iterable[int],
    criterion: Criterion = "aic",
    *,
    segments: np.ndarray | None = None,
) -> Noise:
    """The ARMA model of least information criterion among pairs of orders.

    Args:
        v: residual, shape (samples,).
        ar_orders: degrees of D to try.
        ma_orders: degrees of C to try.
        criterion: ``aic``: n ln λ + 2 (p + q); ``aicc``; or ``bic``: n ln λ + (p + q) ln n.
        segments: stretches to use, rows of (start, stop); None: all samples.

    Returns:
        The noise model of the best orders.

    Raises:
        IdentificationError: no pair of orders gave a model.
    """
    if criterion not in ("aic", "aicc", "bic"):
        raise IdentificationError(f"criterion {criterion!r}", advice="expected aic, aicc or bic")
    v, tried = _vector(v), [(p, q) for q in sorted(set(ma_orders)) for p in sorted(set(ar_orders))]
    n = v.size if segments is None else int(np.diff(np.reshape(segments, (-1, 2))).sum())
    best: tuple[float, Noise] | None = None
    for p, q in tried:
        noise = arma(v, p, q, segments=segments)
        if noise.warnings:
            continue
        cost = {"aic": 2.0, "bic": math.log(n), "aicc": 2.0 * n / max(n - p - q - 2, 1)}[criterion]
        value = n * math.log(noise.variance) + cost * (p + q)
        if best is None or value < best[0]:
            best = (value, noise)
    if best is None:
        raise IdentificationError(
            f"none of the ARMA orders {tried} gave a model that converges",
            advice="try lower orders",
        )
    return best[1]


def inside(
    polynomial: np.ndarray, largest: float = MAX_ROOT, *, reflect: bool = True
) -> np.ndarray:
    """A monic polynomial in z⁻¹, roots reflected into the unit circle (B5), |root| ≤ largest."""
    roots = np.roots(polynomial)
    modulus = np.abs(roots)
    if not np.any(modulus > largest):
        return np.asarray(polynomial, dtype=float)
    outside = (modulus > 1.0) & reflect
    roots[outside] = 1.0 / roots[outside].conj()
    modulus = np.abs(roots)
    far = modulus > largest
    roots[far] *= largest / modulus[far]
    moved = np.real(np.poly(roots))
    return np.r_[moved, np.zeros(len(polynomial) - moved.size)]


def _vector(v: np.ndarray) -> np.ndarray:
    v = np.ascontiguousarray(v, dtype=float)
    if v.ndim != 1:
        raise IdentificationError(
            f"the residual has shape {v.shape}",
            advice="(samples,) is needed, one noise model at a time",
        )
    return v


def _noise_of(model: ArModel) -> Noise:
    """A Burg model with its covariance Γ⁻¹λ/n.

    Siddiqui: λΓ⁻¹ = L L' - M M' with lower triangular Toeplitz matrices of first columns
    (1, d_1 … d_{p-1}) and (d_p … d_1).
    """
    from scipy.linalg import toeplitz

    d, nothing = model.coefficients, np.zeros(model.order)
    low, high = toeplitz(d[:-1], nothing), toeplitz(d[:0:-1], nothing)
    return Noise(
        d, np.ones(1), model.innovation_variance, (low @ low.T - high @ high.T) / model.samples
    )


def _bounds(v: np.ndarray, p: int, q: int, segments: np.ndarray | None) -> np.ndarray:
    """Rows (start, stop) of the stretches that are long enough for the model."""
    rows = [[0, v.size]] if segments is None else segments
    bounds = np.array(rows, dtype=np.int64).reshape(-1, 2)
    used = bounds[bounds[:, 1] - bounds[:, 0] > 2 * (p + q)]
    if not carries(used, p, q):
        samples, needed = int(np.diff(used).sum()), _SAMPLES * (p + q + 1)
        raise IdentificationError(
            f"there are {samples} sample(s) of residual in stretches long enough for an ARMA({p}, "
            f"{q}) model, at least {needed} are needed",
            advice="lower the orders or use a longer record",
        )
    return used


def carries(segments: np.ndarray, ar_order: int, ma_order: int) -> bool:
    """Whether stretches, rows of (start, stop), hold enough samples for a model of these orders."""
    return int(np.diff(segments).sum()) >= _SAMPLES * (ar_order + ma_order + 1)


def _hannan_rissanen(
    v: np.ndarray, bounds: np.ndarray, start: ArModel, p: int, q: int
) -> np.ndarray:
    """(d, c) by regression of v on its own past and on that of the start model's ê."""
    from scipy.signal import lfilter

    moments = np.zeros((p + q + 1, p + q + 1))
    for first, stop in bounds:
        part = v[first:stop]
        e = lfilter(start.coefficients, 1.0, part)
        # The first residuals are a transient; a short stretch keeps its better half.
        skip = max(p, q) + min(start.order, part.size // 2)
        columns = [-part[skip - i : part.size - i] for i in range(1, p + 1)]
        columns += [e[skip - j : part.size - j] for j in range(1, q + 1)]
        rows = np.column_stack([*columns, part[skip:]])
        moments += rows.T @ rows
    return np.linalg.lstsq(moments[:-1, :-1], moments[:-1, -1], rcond=1e-12)[0]


def _shortened(point: Point, step: np.ndarray) -> Point | None:
    """The best model along a step that is shortened while L grows; None: none is better.

    Roots that leave the circle are moved to its edge, not reflected: the optimum lies there.
    """
    best = None
    for shorter in range(_SHORTER):
        moved = point.theta + 0.3**shorter * step
        theta = _inside(moved, point.likelihood.ar_order, reflect=False)
        following = point.likelihood.at(theta)
        if following.value < (point if best is None else best).value:
            best = following
        if best is not None and (best is not following or np.array_equal(moved, theta)):
            break
    return best


def _inside(theta: np.ndarray, ar_order: int, reflect: bool = True) -> np.ndarray:
    """(d, c, μ) with poles and zeros inside the unit circle."""
    d, c = np.r_[1.0, theta[:ar_order]], np.r_[1.0, theta[ar_order:-1]]
    return np.r_[inside(d, reflect=reflect)[1:], inside(c, reflect=reflect)[1:], theta[-1]]


def _settled(point: Point, start: ArModel) -> Noise:
    """The model at the end of the iteration, if its parameters have finite standard errors."""
    p = point.likelihood.ar_order
    information = point.information
    scale = np.sqrt(np.diag(information))
    correlation = information / np.outer(scale, scale)
    if not np.all(np.isfinite(correlation)) or np.linalg.cond(correlation) > _CANCELLING:
        return _fallback(start, p, point.theta.size - 1 - p)
    covariance = np.linalg.inv(correlation) / np.outer(scale, scale)
    d, c = np.r_[1.0, point.theta[:p]], np.r_[1.0, point.theta[p:-1]]
    return Noise(d, c, point.variance, covariance[:-1, :-1])


def _fallback(start: ArModel, p: int, q: int) -> Noise:
    """The AR model of the start, with a warning."""
    return replace(
        _noise_of(start),
        warnings=(
            f"The ARMA({p}, {q}) iteration did not converge, probably because a pole and a zero "
            f"cancel; this is an AR({start.order}) model instead. Lower the orders, or choose "
            "them with select_arma.",
        ),
    )
