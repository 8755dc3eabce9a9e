"""Criteria of a design: one number of the information, and its slope by the coefficients.

With P = I⁻¹ the covariance and s_k the size of parameter k that matters to the user,

    d       -log det(S I S) / n           mean logarithm of the variances
    a       log (1/n) Σ_k P_kk/s_k²       mean square of the relative standard errors
    worst   the largest √P_kk/s_k
    cond    condition number of the unweighted observation matrix, √(λ_max/λ_min) of I

Largest and smallest values are smoothed by a norm of high order, so that a gradient exists. Where
only some parameters were asked for, the sums run over them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from pivident.dynamics.regressor_derivatives import RegressorDerivatives
from pivident.foundation.errors import UnusableValue
from pivident.studies.excitation.constraints import Constraints
from pivident.studies.excitation.information import Information

CriterionName = Literal["d", "a", "worst", "cond"]

#: Orders of the norms that stand for a largest value.
WORST_ORDER, COND_ORDER = 8, 6

#: Information below this share of the largest is none: rounding.
SMALLEST = 1e-14


@dataclass(frozen=True, eq=False)
class Criterion:
    """A criterion in the user's units.

    Attributes:
        name: ``d``, ``a``, ``worst`` or ``cond``.
        sizes: s, size of each parameter that matters, shape (parameters,).
        chosen: indices of the parameters that count; None: all.
    """

    name: CriterionName
    sizes: np.ndarray
    chosen: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.name not in get_args(CriterionName):
            raise UnusableValue(
                f"criterion is {self.name!r}", advice=f"choose {get_args(CriterionName)}"
            )

    @property
    def weighted(self) -> bool:
        """Whether it is a criterion of the information rather than of the bare matrix."""
        return self.name != "cond"

    def value_and_slope(self, information: np.ndarray) -> tuple[float, np.ndarray]:
        """The smoothed criterion and ∂J/∂I; infinite where the information is singular.

        Args:
            information: I, shape (parameters, parameters).
        """
        if self.name == "cond":
            return _condition(information)
        scaled = information * np.outer(self.sizes, self.sizes)
        diagonal = np.sqrt(np.diag(scaled))
        if not (diagonal > 0.0).all():
            return np.inf, np.zeros_like(information)
        values, vectors = np.linalg.eigh(scaled / np.outer(diagonal, diagonal))
        if values[0] < SMALLEST * values[-1]:
            return np.inf, np.zeros_like(information)
        covariance = (vectors / values) @ vectors.T / np.outer(diagonal, diagonal)
        value, slope = self._of_covariance(covariance)
        return value, slope * np.outer(self.sizes, self.sizes)

    def _of_covariance(self, covariance: np.ndarray) -> tuple[float, np.ndarray]:
        """The criterion of the scaled covariance, and its slope by the scaled information."""
        chosen = np.arange(len(covariance)) if self.chosen is None else self.chosen
        if self.name == "d":
            own = covariance[np.ix_(chosen, chosen)]
            _sign, logarithm = np.linalg.slogdet(own)
            # d log det P_cc = tr(P_cc⁻¹ dP_cc),  dP = -P dI P
            half = covariance[:, chosen]
            slope = -half @ np.linalg.solve(own, half.T) / chosen.size
            return logarithm / chosen.size, slope
        variances = np.diag(covariance)[chosen]
        if self.name == "a":
            total = variances.sum()
            weights = np.ones(chosen.size) / total
            value = np.log(total / chosen.size)
        else:
            ratio = variances / variances.max()
            powers = ratio**WORST_ORDER
            value = np.log(variances.max()) + np.log(powers.sum()) / WORST_ORDER
            weights = powers / variances / powers.sum()
        half = covariance[:, chosen]
        return float(value), -(half * weights) @ half.T

    def reached(self, information: np.ndarray) -> float:
        """The criterion without smoothing, in the words of `words`.

        Args:
            information: I, shape (parameters, parameters).
        """
        if self.name == "cond":
            return condition_number(information)
        deviation = standard_errors(information) / self.sizes
        if self.chosen is not None:
            deviation = deviation[self.chosen]
        if self.name == "worst":
            return float(deviation.max())
        if self.name == "a":
            return float(np.sqrt(np.mean(deviation**2)))
        value, _ = self.value_and_slope(information)
        return float(np.exp(0.5 * value))

    @property
    def words(self) -> str:
        """What `reached` is."""
        return {
            "d": "geometric mean of the standard errors along independent directions, over the "
            "sizes that matter",
            "a": "root mean square of the standard errors over the sizes that matter",
            "worst": "largest standard error over the size that matters",
            "cond": "condition number of the observation matrix",
        }[self.name]


def standard_errors(information: np.ndarray) -> np.ndarray:
    """√diag(I⁻¹), shape (parameters,); infinite in the directions without information.

    Args:
        information: I, shape (parameters, parameters).
    """
    scale = np.sqrt(np.diag(information))
    known = scale > 0.0
    out = np.full(scale.size, np.inf)
    if not known.any():
        return out
    inner = information[np.ix_(known, known)] / np.outer(scale[known], scale[known])
    values, vectors = np.linalg.eigh(inner)
    informed = values > SMALLEST * values[-1]
    share = (vectors[:, ~informed] ** 2).sum(axis=1)
    variances = (vectors[:, informed] ** 2 / values[informed]).sum(axis=1)
    out[known] = np.where(share > 1e-6, np.inf, np.sqrt(variances) / scale[known])
    return out


def condition_number(information: np.ndarray) -> float:
    """√(λ_max/λ_min), infinite where the information is singular.

    Args:
        information: WᵀW, shape (parameters, parameters).
    """
    values = np.linalg.eigvalsh(information)
    if values[0] <= SMALLEST * values[-1]:
        return float("inf")
    return float(np.sqrt(values[-1] / values[0]))


def _condition(information: np.ndarray) -> tuple[float, np.ndarray]:
    """Log λ_max/λ_min, both by norms of the eigenvalues, and its slope."""
    values, vectors = np.linalg.eigh(information)
    if values[0] <= SMALLEST * values[-1]:
        return np.inf, np.zeros_like(information)
    above, below = values / values[-1], values[0] / values
    large, small = above**COND_ORDER, below**COND_ORDER
    value = np.log(values[-1] / values[0])
    value += (np.log(large.sum()) + np.log(small.sum())) / COND_ORDER
    weights = large / values / large.sum() - small / values / small.sum()
    return float(value), (vectors * weights) @ vectors.T


@dataclass(frozen=True, eq=False)
class Objective:
    """A criterion by the coefficients of a motion.

    Attributes:
        criterion: the criterion.
        information: of the motion.
        constraints: limits of the motion, on the same samples.
    """

    criterion: Criterion
    information: Information
    constraints: Constraints

    def value(self, coefficients: np.ndarray) -> float:
        """The smoothed criterion.

        Args:
            coefficients: shape (size, joints).
        """
        q, dq, ddq, _ = self.constraints.motion(coefficients)
        return self.criterion.value_and_slope(self.information.of((q, dq, ddq)))[0]

    def value_and_gradient(self, coefficients: np.ndarray) -> tuple[float, np.ndarray]:
        """The smoothed criterion and its gradient, shape (size, joints).

            ∂J/∂x = Σ_t Bᵀ Σ_j ∂(Φ_j g_j)/∂(q, dq, ddq),    g = ∂J/∂Φ

        with the functions B of the motion and their derivatives.

        Args:
            coefficients: shape (size, joints).
        """
        q, dq, ddq, _ = self.constraints.motion(coefficients)
        motion = (q, dq, ddq)
        found, rows = self.information.with_rows(motion)
        value, slope = self.criterion.value_and_slope(found)
        weights = self.information.row_weights(motion, rows, slope)
        by_motion = self._derivatives.weighted(*motion, weights).sum(axis=1)
        functions = self.constraints.functions
        gradient = np.zeros(coefficients.shape)
        for quantity in range(3):
            gradient += functions[quantity].T @ by_motion[..., quantity]
        return value, gradient

    @cached_property
    def _derivatives(self) -> RegressorDerivatives:
        return RegressorDerivatives.of(self.information.regressor)
