"""Normal equations of all joints, accumulated block by block.

Everything that LS, IV and PIV need of a record are, per joint j and summed over its samples,

    Zᵀ Φ,  Zᵀ Z,  Φᵀ Φ,  Zᵀ τ,  Φᵀ τ,  τᵀ τ          (Z = Φ for least squares)

on the joint's structurally non-zero columns only. They have the size of the parameters, not of
the record, add over blocks and over recordings, and every weighting of the joints is applied
afterwards:

    θ = (Σ_j Zᵀ Φ / λ_j)⁻¹ Σ_j Zᵀ τ / λ_j             (D5)
    P = (Σ_j Zᵀ Z / λ_j)⁻¹                            (P-31), summed over samples

What is known of the parameters beforehand restricts them, see `pivident.estimation.restrictions`.

Products of few rows over many samples are too thin for libraries of linear algebra, which are made
for large matrices. Here sixteen sums are formed at a time, four rows by four, so that each sample
that is loaded serves four products; of a symmetric result only the lower half is formed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.separation import is_separated, refusal, weakest_direction
from pivident.estimation.covariance import white_noise_covariance
from pivident.estimation.covariance.windows import Share
from pivident.estimation.restrictions import Freedom, Restrictions
from pivident.foundation.compiled import compiled
from pivident.foundation.errors import IdentificationError

#: Rows that are multiplied with each other at a time.
_SIDE = 4

#: Samples of a tile, whose rows stay in the first-level cache.
_TILE = 512


def gram(rows: np.ndarray, part: slice) -> np.ndarray:
    """Σ_t x_i x_j of all pairs of rows, shape (rows, rows), symmetric.

    ``rows``: time last, shape (rows, samples), C order.
    """
    start, stop, _ = part.indices(rows.shape[1])
    out = np.zeros((len(rows), len(rows)))
    _add_products(rows, rows, start, start, stop - start, True, out)
    return out


def products(left: np.ndarray, right: np.ndarray, part: slice) -> np.ndarray:
    """Σ_t x_i y_j of the rows of two signals, shape (rows of left, rows of right).

    ``left``: x, time last, shape (rows, samples of the part), C order; ``right``: y, time last,
    shape (rows, samples), C order.
    """
    start, stop, _ = part.indices(right.shape[1])
    out = np.zeros((len(left), len(right)))
    _add_products(left, right, 0, start, stop - start, False, out)
    return out


@compiled(fastmath={"contract", "reassoc"})
def _add_products(left, right, left_start, right_start, samples, lower, out):
    """Add the products; with ``lower`` only those of the lower half, of which the upper is a copy.

    Sums may be formed in another order than written, so that they become vectors; nothing else of
    fast arithmetic is allowed, NaN is kept.
    """
    for first in range(0, samples, _TILE):
        count = min(_TILE, samples - first)
        t, u = left_start + first, right_start + first
        for i in range(0, left.shape[0], _SIDE):
            for j in range(0, i + 1 if lower else right.shape[0], _SIDE):
                if i + _SIDE <= left.shape[0] and j + _SIDE <= right.shape[0]:
                    _add_block(left, right, i, j, t, u, count, out)
                    continue
                for a in range(i, min(i + _SIDE, left.shape[0])):
                    x = left[a, t : t + count]
                    for b in range(j, min(j + _SIDE, right.shape[0])):
                        y = right[b, u : u + count]
                        total = 0.0
                        for k in range(count):
                            total += x[k] * y[k]
                        out[a, b] += total

    if lower:
        for a in range(out.shape[0]):
            for b in range(a):
                out[b, a] = out[a, b]


@compiled(fastmath={"contract", "reassoc"})
def _add_block(left, right, i, j, t, u, count, out):
    """Four rows by four over a tile; views that begin at zero, or nothing becomes a vector."""
    a0, a1 = left[i, t : t + count], left[i + 1, t : t + count]
    a2, a3 = left[i + 2, t : t + count], left[i + 3, t : t + count]
    b0, b1 = right[j, u : u + count], right[j + 1, u : u + count]
    b2, b3 = right[j + 2, u : u + count], right[j + 3, u : u + count]
    s00 = s01 = s02 = s03 = s10 = s11 = s12 = s13 = 0.0
    s20 = s21 = s22 = s23 = s30 = s31 = s32 = s33 = 0.0
    for k in range(count):
        x0, x1, x2, x3 = a0[k], a1[k], a2[k], a3[k]
        y0, y1, y2, y3 = b0[k], b1[k], b2[k], b3[k]
        s00 += x0 * y0
        s01 += x0 * y1
        s02 += x0 * y2
        s03 += x0 * y3
        s10 += x1 * y0
        s11 += x1 * y1
        s12 += x1 * y2
        s13 += x1 * y3
        s20 += x2 * y0
        s21 += x2 * y1
        s22 += x2 * y2
        s23 += x2 * y3
        s30 += x3 * y0
        s31 += x3 * y1
        s32 += x3 * y2
        s33 += x3 * y3
    for a, row in enumerate(
        (
            (s00, s01, s02, s03),
            (s10, s11, s12, s13),
            (s20, s21, s22, s23),
            (s30, s31, s32, s33),
        )
    ):
        for b, total in enumerate(row):
            out[i + a, j + b] += total


@dataclass(eq=False)
class JointSums:
    """Sums of one joint over samples, on its own columns."""

    name: str  # name of the joint
    columns: np.ndarray  # parameters that act on the joint, shape (k,)
    zf: np.ndarray  # Zᵀ Φ, shape (k, k); ``zz`` Zᵀ Z and ``ff`` Φᵀ Φ likewise
    zz: np.ndarray  # Zᵀ Z
    ff: np.ndarray  # Φᵀ Φ
    zt: np.ndarray  # Zᵀ τ, shape (k,); ``ft`` Φᵀ τ likewise
    ft: np.ndarray  # Φᵀ τ
    window_zf: np.ndarray  # Zᵀ Φ of each window of time, shape (windows, k, k), see ``sandwich``
    window_zt: np.ndarray  # Zᵀ τ likewise, shape (windows, k)
    tt: float = 0.0  # τᵀ τ
    rows: int = 0  # number of samples used
    surplus: float = 0.0  # sum of their weights beyond their number; zero where none are given
    left_out: bool = False  # whether no torque of the joint was measured

    @classmethod
    def empty(cls, name: str, columns: np.ndarray, windows: int = 0) -> JointSums:
        """No samples yet."""
        k = columns.size
        zf, zz, ff = np.zeros((3, k, k))
        zt, ft = np.zeros((2, k))
        return cls(
            name, columns, zf, zz, ff, zt, ft, np.zeros((windows, k, k)), np.zeros((windows, k))
        )

    def add(
        self,
        phi: np.ndarray,
        z: np.ndarray | None,
        tau: np.ndarray,
        used: np.ndarray | None,
        shares: Sequence[Share] = (),
        weights: np.ndarray | None = None,
    ) -> None:
        """Add samples, time last.

        ``phi``: the joint's columns, shape (k, samples); ``z``: instruments of the same shape;
        None: Z = Φ; ``used``: True where a sample is used, shape (samples,); None: all are;
        ``weights``: of the samples, likewise.
        """
        parts = [phi, tau[None]] if z is None else [phi, z, tau[None]]
        self.add_stack(np.concatenate(parts), used, shares, weights)

    def add_stack(
        self,
        stack: np.ndarray,
        used: np.ndarray | None,
        shares: Sequence[Share] = (),
        weights: np.ndarray | None = None,
    ) -> None:
        """Add samples whose columns, instruments and torque stand in one array.

        ``stack``: the joint's columns, its instruments (none: Z = Φ) and the torque, one below the
        other, shape (k + 1, samples) or (2 k + 1, samples); overwritten; ``used``: True where a
        sample is used, shape (samples,); None: all are; ``weights``: of the samples, likewise.
        """
        k, rows = self.columns.size, stack.shape[1]
        if used is not None and not used.all():
            # zeros add nothing to any sum, and cost less than picking the samples that are used
            stack *= used.astype(float)
            rows = int(np.count_nonzero(used))
        if weights is not None:
            self.surplus += float(np.sum(weights, where=True if used is None else used)) - rows
            stack *= np.sqrt(weights)
        least_squares = len(stack) == k + 1
        phi, z = slice(0, k), slice(0, k) if least_squares else slice(k, 2 * k)
        parts = [share.part for share in shares] or [slice(None)]
        stretches = [gram(stack, part) for part in parts]
        for share, sums in zip(shares, stretches, strict=False):
            rising = products(stack[z, share.part] * share.rising, stack, share.part)
            falling = sums[z] - rising
            for window, part in ((share.window, falling), (share.window + 1, rising)):
                self.window_zf[window] += part[:, phi]
                self.window_zt[window] += part[:, -1]
        total = sum(stretches[1:], start=stretches[0])
        self.zf += total[z, phi]
        self.zt += total[z, -1]
        if least_squares:
            self.ff, self.zz, self.ft = self.zf, self.zf, self.zt
        else:
            self.ff += total[phi, phi]
            self.zz += total[z, z]
            self.ft += total[phi, -1]
        self.tt += float(total[-1, -1])
        self.rows += rows

    @property
    def weight(self) -> float:
        """Sum of the weights of all samples."""
        return self.rows + self.surplus

    def residual_sum(self, theta: np.ndarray) -> float:
        """‖τ - Φθ‖² for all parameters ``theta``, from the sums."""
        own = theta[self.columns]
        return max(float(self.tt - 2.0 * own @ self.ft + own @ self.ff @ own), 0.0)

    def own_variance(self) -> float:
        """Residual variance of the joint's own least squares, with its degrees of freedom."""
        scale = _scales(self.ff)
        values, vectors = np.linalg.eigh(self.ff / np.outer(scale, scale))
        some = values > 1e-12 * values[-1]
        # direction by direction: an inverse first rounds what nearly dependent columns explain
        explained = (vectors[:, some].T @ (self.ft / scale)) ** 2 / values[some]
        return self._variance(self.tt - float(explained.sum()))

    def variance(self, theta: np.ndarray) -> float:
        """λ: residual variance for all parameters ``theta``, with its degrees of freedom."""
        return self._variance(self.residual_sum(theta))

    def _variance(self, square: float) -> float:
        """That of a row of weight one; one where there are no rows."""
        if not self.rows:
            return 1.0
        freedom = max(self.rows - self.columns.size, 1) * self.weight / self.rows
        return max(square, 1e-30 * max(self.tt, 1e-300)) / freedom


@dataclass(frozen=True, eq=False)
class Solution:
    """Solved normal equations."""

    theta: np.ndarray  # parameters, shape (parameters,)
    covariance: np.ndarray  # (Σ ZᵀZ/λ)⁻¹, shape (parameters, parameters)
    condition: float  # condition number of the column-scaled observation matrix
    weakest: tuple[str, ...] = ()  # parameters in the least excited direction


def solve(
    sums: Sequence[JointSums],
    variance: np.ndarray,
    known: Restrictions | Sequence[str],
    weight_power: float = 1.0,
    checked: bool = False,
) -> Solution:
    """θ = (Σ ZᵀΦ λ^-w)⁻¹ Σ Zᵀτ λ^-w and its covariance (Σ ZᵀZ/λ)⁻¹, as far as it is free.

    ``known``: restrictions of the parameters, or their names where there are none. The covariance
    is that without bounds. ``checked``: what only noise separates is refused too, see
    `pivident.dynamics.separation`.
    """
    if not isinstance(known, Restrictions):
        known = Restrictions.none(known)
    for joint in sums:
        if joint.rows <= joint.columns.size and not joint.left_out:
            raise IdentificationError(
                f"joint {joint.name!r} has {joint.rows} usable rows for {joint.columns.size} "
                "parameters: it hardly moves faster than the low-speed mask, or the record is "
                "too short",
                advice="lower the mask, take a longer record, or freeze the joint",
            )
    size = len(known.names)
    zf, ff, zz = np.zeros((3, size, size))
    zt = np.zeros(size)
    for joint, lam in zip(sums, variance, strict=True):
        grid = np.ix_(joint.columns, joint.columns)
        zf[grid] += joint.zf / lam**weight_power
        zt[joint.columns] += joint.zt / lam**weight_power
        ff[grid] += joint.ff / lam
        zz[grid] += joint.zz / lam
    freedom = known.freedom
    own = freedom.reduced(ff + known.information)
    scale = _scales(own)
    outer = np.outer(scale, scale)
    names = [known.names[k] for k in freedom.free]
    weak = weakest_direction(own / outer, names)
    if weak is None:  # with these weights
        raise refusal(own / outer, _evidence(sums, freedom)[1], names)
    if checked and not is_separated(*_evidence(sums, freedom)):
        raise refusal(*_evidence(sums, freedom), names)
    condition, weakest = weak
    squares = freedom.reduced(zz + known.information)
    covariance = white_noise_covariance(squares, outer, freedom.basis)
    return Solution(known.solve(zf, zt), covariance, condition, weakest)


def joint_variances(sums: Sequence[JointSums], theta: np.ndarray) -> np.ndarray:
    """λ_j: residual variance of each joint at θ, with its degrees of freedom, shape (joints,)."""
    return np.array([s.variance(theta) for s in sums])


def weighted_solution(
    sums: Sequence[JointSums], known: Restrictions, start: np.ndarray, weight_power: float
) -> tuple[Solution, np.ndarray]:
    """Solve with weights from the residual, twice, so that weights and estimate agree."""
    theta = start
    for number in range(3):
        variance = joint_variances(sums, theta)
        solution = solve(sums, variance, known, weight_power, checked=number == 0)
        theta = solution.theta
    return solution, joint_variances(sums, theta)


def relative_residual(sums: Sequence[JointSums], theta: np.ndarray, variance: np.ndarray) -> float:
    """‖τ - Φθ‖/‖τ‖ over all joints, each weighted by 1/λ_j."""
    error = sum(s.residual_sum(theta) / v for s, v in zip(sums, variance, strict=True))
    total = sum(s.tt / v for s, v in zip(sums, variance, strict=True))
    return float(np.sqrt(error / total)) if total > 0 else 0.0


def _scales(gram: np.ndarray) -> np.ndarray:
    """Length of each column, one where a column is empty."""
    length = np.sqrt(np.diag(gram))
    return np.where(length > 0, length, 1.0)


def _evidence(sums: Sequence[JointSums], freedom: Freedom) -> tuple[np.ndarray, np.ndarray]:
    """Gram matrix of instruments of length one, weighted by the noise, and the torque in noise.

    Both of the directions that are free.
    """
    gram, square = freedom.information.copy(), np.zeros(freedom.free.size)
    for joint in sums:
        if joint.rows:
            noise = joint.own_variance()
            gram[np.ix_(joint.columns, joint.columns)] += joint.zz / noise
            square[freedom.basis[joint.columns].any(axis=0)] += joint.tt / noise
    gram = freedom.reduced(gram)
    scale = _scales(gram)
    return gram / np.outer(scale, scale), np.sqrt(square)
