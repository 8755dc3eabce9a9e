"""The refined instrumental variable iteration in continuous time.

With x_i = B_i/A_i u_i at the current θ, the residual ε = y - Σ x_i is, exactly at the samples,

    ε - φᵀ(θ̂ - θ) = 0,   φ = (-p^k/A_i (y - Σ_{j≠i} x_j) …, p^k/A_i u_i …)      (C3)

a linear regression in the change of θ whose noise enters through y. The instruments ζ are φ
without noise: x_i instead of the outputs, û_i instead of the inputs. Filtered by the inverse noise
model D/C, they give

    θ̂ = θ + (Σ ζ φᵀ)⁻¹ Σ ζ ε

until θ converges. There Σ ζ ε = 0: the estimate makes the *simulation* error orthogonal to its own
gradient, whatever was interpolated in between. With one denominator for all inputs this is the
algorithm of Young and Jakeman (1980); with separate ones it has the fixed point of the back-fitting
of Garnier, Gilson, Young and Huselstein (2007), all inputs in one solve.

The operating point of a record: offsets of its signals, and a start that is not at rest.

    y = Σ_i B_i(p)/A(p) u_i + c + x_0 + ξ

c is what the output keeps while all inputs are zero, x_0 the free response from the state at the
first sample. An input that is 1 from the first sample on and one that is a pulse there, through the
same 1/A, span both: the response to the first is c less a free response, and the pulse, with a
numerator of the denominator's degree, leaves any state behind and explains the first sample itself.
So they are estimated as two inputs more, jointly with the rest, of signals without their means: an
offset may be thousands of times larger than what moves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from pivident.foundation.compiled import compiled
from pivident.foundation.errors import IdentificationError, OrdersNotSupported
from pivident.linear.model import Structure
from pivident.linear.sampled_data import SampledData, continuous_response
from pivident.linear.state_variable_filter import combined, filtered_derivatives
from pivident.signals.arma import Noise

NoiseFit = Callable[[np.ndarray], Noise]

#: Reciprocal condition number of the normalised sums below which columns count as dependent.
_RANK_TOLERANCE = 1e-13

#: Variance of the residual relative to the output's below which it is rounding.
EXACT = 1e-18

#: Samples per block of a sum.
_STRETCH = 512


@dataclass(frozen=True, eq=False)
class Linearised:
    """The regression in the change of θ."""

    residual: np.ndarray  # ε = y - x, (samples,)
    regressors: np.ndarray  # φ, (parameters, samples)
    instruments: np.ndarray  # ζ, (parameters, samples)

    def whitened(self, noise: Noise | None) -> Linearised:
        """Residual, regressors and instruments filtered by D/C.

        Samples for which D reaches before the record are left out: the noise was not zero
        there, and with nearly integrating noise one of them would dominate the record.
        """
        if noise is None or max(noise.ar.size, noise.ma.size) == 1:
            return self
        start = noise.ar.size - 1

        def filtered(rows: np.ndarray) -> np.ndarray:
            return lfilter([1.0], noise.ma, lfilter(noise.ar, [1.0], rows)[..., start:])

        return Linearised(
            filtered(self.residual), filtered(self.regressors), filtered(self.instruments)
        )


@dataclass(frozen=True, eq=False)
class Refined:
    """Result of the iteration."""

    theta: np.ndarray
    covariance: np.ndarray  # P = s² (Σ ζ ζᵀ)⁻¹, (C4)
    residual: np.ndarray  # y - x, not whitened
    variance: float  # s², of the whitened residual
    noise: Noise | None
    iterations: int
    converged: bool
    reflected: np.ndarray  # unstable poles of the last solution before reflection [rad/s]


def linearised(
    data: SampledData,
    structure: Structure,
    theta: np.ndarray,
    auxiliary: np.ndarray | None = None,
) -> Linearised:
    """Residual, regressors and instruments at θ; those by the ``auxiliary`` model if given."""
    groups, numerators = structure.split(theta)
    denominators = structure.per_input(groups)

    def chains(inputs: np.ndarray) -> list[np.ndarray]:
        return [
            filtered_derivatives(u, a, data.dt, structure.hold)[-b.size :]
            for u, a, b in zip(inputs, denominators, numerators, strict=True)
        ]

    of_u = chains(data.u)
    of_clean = of_u if data.clean is data.u else chains(data.clean)
    parts = [combined(b, rows) for b, rows in zip(numerators, of_u, strict=True)]
    x = np.sum(parts, axis=0)
    if auxiliary is None:
        clean = [combined(b, rows) for b, rows in zip(numerators, of_clean, strict=True)]
    else:
        clean = simulated_parts(data, structure, auxiliary)
    if structure.common:
        outputs, clean = [data.y], [np.sum(clean, axis=0)]
    else:
        outputs = [data.y - x + part for part in parts]

    def rows_of(signals: list[np.ndarray], inputs: list[np.ndarray]) -> np.ndarray:
        derivatives = (
            -filtered_derivatives(v, a, data.dt, "foh")[1:]
            for v, a in zip(signals, groups, strict=True)
        )
        return np.concatenate([*derivatives, *inputs])

    return Linearised(data.y - x, rows_of(outputs, of_u), rows_of(clean, of_clean))


def simulated_parts(data: SampledData, structure: Structure, theta: np.ndarray) -> list[np.ndarray]:
    """x_i of every input, from the noise-free inputs."""
    groups, numerators = structure.split(theta)
    terms = zip(numerators, structure.per_input(groups), data.clean, strict=True)
    return [continuous_response(b, a, u, data.dt, structure.hold) for b, a, u in terms]


def iv_step(at: Linearised) -> tuple[np.ndarray, np.ndarray]:
    """(Σ ζ φᵀ)⁻¹ Σ ζ ε and (Σ ζ ζᵀ)⁻¹.

    Forming the sums squares the condition number. That is harmless here: they give the change of
    θ, and the fixed point of the iteration depends on Σ ζ ε alone.
    """
    size = len(at.regressors)
    of_zeta, cross, right, of_phi = _sums(at.instruments, at.regressors, at.residual)
    if not (np.isfinite(of_zeta).all() and np.isfinite(of_phi).all()):
        raise OrdersNotSupported(size, "the auxiliary model diverges over the record")
    if of_phi.min() <= 0 or np.diag(of_zeta).min() <= 0:
        raise OrdersNotSupported(size, "a filtered derivative is zero over the whole record")
    scale, scale_phi = np.sqrt(np.diag(of_zeta)), np.sqrt(of_phi)
    of_zeta = of_zeta / np.outer(scale, scale)
    cross = cross / np.outer(scale, scale_phi)
    for name, matrix in (("instruments", of_zeta), ("regressors", cross)):
        singular = np.linalg.svd(matrix, compute_uv=False)
        rank = int(np.sum(singular > _RANK_TOLERANCE * singular[0]))
        if rank < size:
            raise OrdersNotSupported(size, f"its {name} have numerical rank {rank}")
    step = np.linalg.solve(cross, right / scale) / scale_phi
    return step, np.linalg.inv(of_zeta) / np.outer(scale, scale)


@compiled(fastmath={"contract", "reassoc"})
def _sums(zeta, phi, residual):
    """Σ ζ ζᵀ, Σ ζ φᵀ, Σ ζ ε and the diagonal of Σ φ φᵀ, in stretches that stay in the cache."""
    size, samples = zeta.shape
    of_zeta, cross = np.zeros((size, size)), np.zeros((size, size))
    right, of_phi = np.zeros(size), np.zeros(size)
    for start in range(0, samples, _STRETCH):
        stop = min(start + _STRETCH, samples)
        for i in range(size):
            for k in range(start, stop):
                right[i] += zeta[i, k] * residual[k]
                of_phi[i] += phi[i, k] * phi[i, k]
            for j in range(size):
                with_phi = 0.0
                for k in range(start, stop):
                    with_phi += zeta[i, k] * phi[j, k]
                cross[i, j] += with_phi
            for j in range(i + 1):
                with_zeta = 0.0
                for k in range(start, stop):
                    with_zeta += zeta[i, k] * zeta[j, k]
                of_zeta[i, j] += with_zeta
                of_zeta[j, i] = of_zeta[i, j]
    return of_zeta, cross, right, of_phi


def refine(
    data: SampledData,
    structure: Structure,
    theta: np.ndarray,
    *,
    tolerance: float,
    max_iterations: int,
    fit_noise: NoiseFit | None = None,
) -> Refined:
    """Iterate until no parameter changes by more than ``tolerance``.

    A change counts relative to the parameter or to its standard error, whichever is larger: a
    parameter whose true value is zero would never converge otherwise. Without convergence the
    iterate of smallest whitened residual is returned.
    """
    best: Refined | None = None
    reflected = np.zeros(0, dtype=complex)
    converged = False
    for iteration in range(max_iterations + 1):
        at = linearised(data, structure, theta)
        noise = fit_noise(at.residual) if fit_noise is not None else None
        white = at.whitened(noise)
        change, inverse = iv_step(white)
        variance = float(np.sum(white.residual**2)) / (white.residual.size - theta.size)
        now = Refined(
            theta, variance * inverse, at.residual, variance, noise, iteration, converged, reflected
        )
        if best is None or converged or variance < best.variance:
            best = now
        if converged:
            break
        following, reflected = structure.stabilised(theta + change)
        scale = np.maximum(np.abs(theta), np.sqrt(np.diag(now.covariance)))
        still = bool(np.all(np.abs(following - theta) <= tolerance * scale))
        # without noise the standard errors are rounding, and so are the changes of a zero
        converged = still or variance < EXACT * float(np.var(data.y))
        theta = following
    assert best is not None
    return best


#: Share of the residual's variance that an operating point must take away to be named.
NAMED_SHARE = 0.5


def with_operating_point(data: SampledData, structure: Structure) -> tuple[SampledData, Structure]:
    """Data and structure with the two inputs of the operating point, whose parameters come last.

    Raises:
        IdentificationError: the inputs have denominators of their own.
    """
    if not structure.common:
        raise IdentificationError(
            "an offset is estimated with one denominator for all inputs",
            advice="give common=True, or subtract the operating point from u and y",
        )
    (order,) = structure.denominator_orders
    more = np.zeros((2, data.y.size))
    more[0], more[1, 0] = 1.0, 1.0
    means = data.u.mean(axis=1, keepdims=True)
    wide = replace(
        data,
        u=np.vstack((data.u - means, more)),
        clean=np.vstack((data.clean - means, more)),
        y=data.y - data.y.mean(),
    )
    return wide, replace(
        structure,
        numerator_orders=(*structure.numerator_orders, 0, order),
        delays=(*structure.delays, 0, 0),
    )


def offset_of(data: SampledData, structure: Structure, refined: Refined) -> tuple[float, float]:
    """The offset c = ȳ + (b_c - Σ_i b_i ū_i)/a_n, of last coefficients, and its standard error.

    Args:
        data: without the operating point.
        structure: likewise.
        refined: the estimate with it.
    """
    last = structure.denominator_orders[0] - 1
    ends = last + np.cumsum([m + 1 for m in structure.numerator_orders])
    slope = np.zeros(refined.theta.size)
    slope[ends], slope[structure.parameters] = -data.u.mean(axis=1), 1.0
    slope /= refined.theta[last]
    moved = float(slope @ refined.theta)
    slope[last] = -moved / refined.theta[last]
    return moved + float(data.y.mean()), float(np.sqrt(slope @ refined.covariance @ slope))


def share_of_operating_point(data: SampledData, structure: Structure, refined: Refined) -> float:
    """Share of the residual's sum of squares that an operating point explains at this estimate."""
    if not structure.common or not np.any(refined.residual):
        return 0.0
    wide, wider = with_operating_point(data, structure)
    theta = np.concatenate([refined.theta, np.zeros(wider.parameters - refined.theta.size)])
    columns = linearised(wide, wider, theta).regressors[structure.parameters :]
    scaled = columns / np.linalg.norm(columns, axis=1, keepdims=True)
    solution = np.linalg.lstsq(scaled.T, refined.residual, rcond=None)[0]
    left = refined.residual - solution @ scaled
    return 1.0 - float(left @ left) / float(refined.residual @ refined.residual)
