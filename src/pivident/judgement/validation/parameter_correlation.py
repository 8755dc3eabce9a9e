"""Which parameters an estimate confuses with one another: correlations of their errors.

    ρ_ik = P_ik / (σ_i σ_k)

near ±1 says that the motion determines only a sum or a difference of the two; a motion that moves
them apart makes both certain. For the map, parameters are put next to those that they are
correlated with, in chains that are joined end to end, the largest |ρ| first.
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
    """Order of the parameters, shape (parameters,): chains joined end to end, the nearest first."""
    chains = {k: [k] for k in range(len(matrix))}  # of each parameter
    i, k = np.triu_indices(len(matrix), 1)
    nearest = np.argsort(-np.abs(matrix[i, k]), kind="stable")
    for one, other in zip(i[nearest].tolist(), k[nearest].tolist(), strict=True):
        first, second = chains[one], chains[other]
        at_ends = one in (first[0], first[-1]) and other in (second[0], second[-1])
        if first is second or not at_ends:
            continue
        if first[-1] != one:
            first.reverse()
        if second[0] != other:
            second.reverse()
        first += second
        chains.update(dict.fromkeys(second, first))
    return np.array(chains[0])
