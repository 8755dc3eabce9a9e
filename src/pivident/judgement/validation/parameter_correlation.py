"""Which parameters an estimate confuses with one another: correlations of their errors.

    ρ_ik = P_ik / (σ_i σ_k)

near ±1 says that the motion determines only a sum or a difference of the two; a motion that moves
them apart makes both certain. For the map, parameters are put next to those that they are
correlated with: the order of the leaves of a tree that joins the nearest first, by the distance 1 -
|ρ|.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.estimation.identification import Identification

#: From here on two parameters count as hardly distinguishable.
STRONG_CORRELATION = 0.9


@dataclass(frozen=True, eq=False)
class ParameterCorrelation:
    """Correlations of the estimates."""

    names: tuple[str, ...]  # parameters in the order of the map
    matrix: np.ndarray  # ρ in that order, shape (parameters, parameters)

    def largest(self, count: int) -> list[tuple[str, str, float]]:
        """The pairs of the largest |ρ|, the largest first."""
        i, k = np.triu_indices(len(self.names), 1)
        order = np.argsort(-np.abs(self.matrix[i, k]), kind="stable")[:count]
        return [(self.names[i[o]], self.names[k[o]], float(self.matrix[i[o], k[o]])) for o in order]

    @property
    def strong(self) -> int:
        """Number of pairs with |ρ| ≥ 0.9."""
        upper = self.matrix[np.triu_indices(len(self.names), 1)]
        return int(np.sum(np.abs(upper) >= STRONG_CORRELATION))


def parameter_correlation(identification: Identification) -> ParameterCorrelation | None:
    """Correlations by the covariance of the estimate, ordered for a map.

    Result: the correlations of the parameters whose variance is known and not zero; None where
    fewer than two are.
    """
    std = identification.method_std
    kept = np.flatnonzero(np.isfinite(std) & (std > 0.0))
    if kept.size < 2:
        return None
    covariance = identification.covariance[np.ix_(kept, kept)]
    if not np.isfinite(covariance).all():
        return None
    matrix = np.clip(covariance / np.outer(std[kept], std[kept]), -1.0, 1.0)
    order = _neighbours_first(matrix)
    names = tuple(identification.names[kept[k]] for k in order)
    return ParameterCorrelation(names, matrix[np.ix_(order, order)])


def _neighbours_first(matrix: np.ndarray) -> np.ndarray:
    """Order of the leaves of an average-linkage tree, shape (parameters,)."""
    from scipy.cluster.hierarchy import leaves_list, linkage
    from scipy.spatial.distance import squareform

    distance = 1.0 - np.abs(matrix)
    distance = 0.5 * (distance + distance.T)
    np.fill_diagonal(distance, 0.0)
    tree = linkage(squareform(distance, checks=False), "average", optimal_ordering=True)
    return leaves_list(tree)
