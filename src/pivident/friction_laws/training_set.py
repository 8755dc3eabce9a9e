"""Least squares and instrumental variables on a training set, for many laws of one joint.

The parameters that stay have the same equations whatever the law. With K, r their normal equations
over the training set, and C, B, D, s the blocks that the law's terms add,

    (D - B K⁻¹ C) θ_law = s - B K⁻¹ r,    θ_rest = K⁻¹ (r - C θ_law)

so that K is inverted once and a law costs the size of its terms.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from pivident.friction_laws.filtered_rows import LastPass
from pivident.validation.held_out.segment_sums import SegmentSums

_RCOND = 1e-12


@dataclass(frozen=True, eq=False)
class _Rest:
    """Normal equations of the parameters that stay, solved."""

    inverse: np.ndarray  # K⁻¹
    solution: np.ndarray  # K⁻¹ r

    @classmethod
    def of(cls, gram: np.ndarray, right: np.ndarray) -> _Rest:
        scale = np.sqrt(np.abs(np.diag(gram)))
        scale = np.where(scale > 0.0, scale, 1.0)
        scaled = gram / np.outer(scale, scale)
        inverse = np.linalg.pinv(scaled, rcond=_RCOND) / np.outer(scale, scale)
        return cls(inverse, inverse @ right)


class TrainingSet:
    """Some segments of the motion, on which laws of one joint are fitted.

    ``others`` are the weighted sums of all other joints, ``fixed`` those of the joint's columns
    that stay, ``columns`` where these are among the parameters that stay, ``which`` the segments,
    ``lam`` the variance by which the joint is weighted.
    """

    def __init__(
        self,
        others: SegmentSums,
        fixed: SegmentSums,
        columns: np.ndarray,
        which: np.ndarray,
        lam: float,
        weight_power: float,
    ) -> None:
        self.columns, self.which, self.lam = columns, which, lam
        self.weight = lam**weight_power
        self.size, self.fixed = others.ft.shape[1], columns.size
        self._right = self._total(others.ft, fixed.ft, lam)
        self._ff = self._zf = _Rest.of(self._gram(others.ff, fixed.ff, lam), self._right)
        if fixed.zf is not fixed.ff:
            right = self._total(others.zt, fixed.zt, self.weight)
            self._zf = _Rest.of(self._gram(others.zf, fixed.zf, self.weight), right)
        self._tt = float(others.tt[which].sum() + fixed.tt[which].sum() / lam)

    def criterion(self, sums: SegmentSums) -> float:
        """Weighted squares of the least-squares fit with a law."""
        theta = self._solution(sums.ff, sums.ft, self._ff, self.lam)
        law = sums.ft[self.which, self.fixed :].sum(axis=0) / self.lam
        n = self.size
        return float(self._tt - theta[:n] @ self._right - theta[n:] @ law)

    def solve(self, sums: SegmentSums) -> np.ndarray:
        """Parameters that stay, then those of the law."""
        return self._solution(sums.zf, sums.zt, self._zf, self.weight)

    def estimate(self, sums: SegmentSums) -> tuple[np.ndarray, np.ndarray]:
        """The same, and the standard errors of the law's parameters for white residuals."""
        theta = self.solve(sums)
        _, _, schur = self._blocks(sums.ff, self._ff, self.lam)
        own = np.r_[theta[self.columns], theta[self.size :]]
        left = sums.squares(own)[self.which].sum() / max(sums.rows[self.which].sum(), 1.0)
        covariance = np.linalg.pinv(schur, hermitian=True) * left / self.lam
        return theta, np.sqrt(np.maximum(np.diag(covariance), 0.0))

    def _solution(
        self, gram: np.ndarray, right: np.ndarray, rest: _Rest, weight: float
    ) -> np.ndarray:
        above, below, schur = self._blocks(gram, rest, weight)
        law = right[self.which, self.fixed :].sum(axis=0) / weight
        # a term without effect on the training set may have one on the rest of the motion
        scale = np.sqrt(np.abs(np.diagonal(gram.sum(axis=0))[self.fixed :]) / weight)
        scale = np.where(scale > 0.0, scale, 1.0)
        law = (law - below @ rest.solution[self.columns]) / scale
        law = np.linalg.lstsq(schur / np.outer(scale, scale), law, rcond=_RCOND)[0] / scale
        theta = rest.solution - rest.inverse[:, self.columns] @ (above @ law)
        return np.r_[theta, law]

    def _blocks(
        self, gram: np.ndarray, rest: _Rest, weight: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """C and B on the joint's own columns, and D - B K⁻¹ C."""
        total = gram[self.which].sum(axis=0) / weight
        k = self.fixed
        above, below = total[:k, k:], total[k:, :k]
        inverse = rest.inverse[np.ix_(self.columns, self.columns)]
        return above, below, total[k:, k:] - below @ inverse @ above

    def _gram(self, others: np.ndarray, own: np.ndarray, weight: float) -> np.ndarray:
        gram = others[self.which].sum(axis=0)
        gram[np.ix_(self.columns, self.columns)] += own[self.which].sum(axis=0) / weight
        return gram

    def _total(self, others: np.ndarray, own: np.ndarray, weight: float) -> np.ndarray:
        right = others[self.which].sum(axis=0)
        right[self.columns] += own[self.which].sum(axis=0) / weight
        return right


def weighted_sums(
    last: LastPass,
    without: Collection[int],
    count: int,
    rest: np.ndarray,
    by_joint: Sequence[SegmentSums],
) -> SegmentSums:
    """Weighted sums of all joints but some on the parameters ``rest``, in ``count`` segments."""
    eq, n, size = last.equations, count, rest.size
    place = np.full(eq.size, -1)
    place[rest] = np.arange(size)
    total = SegmentSums(
        np.zeros((n, size, size)), np.zeros((n, size, size)), np.zeros((n, size)),
        np.zeros((n, size)), np.zeros(n), np.zeros(n),
    )  # fmt: skip
    for i, sums in enumerate(by_joint):
        if i in without:
            continue
        own, lam = place[eq.regressor.columns_of(i)], float(eq.variance[i])
        total.zf[:, own[:, None], own] += sums.zf / lam**eq.weight_power
        total.zt[:, own] += sums.zt / lam**eq.weight_power
        total.ff[:, own[:, None], own] += sums.ff / lam
        total.ft[:, own] += sums.ft / lam
        total.tt += sums.tt / lam
    return total
