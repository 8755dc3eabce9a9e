"""A criterion of a motion's information as a function of the motion's coefficients."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pivident.dynamics.regressor_derivatives import RegressorDerivatives
from pivident.excitation.constraints import Constraints
from pivident.excitation.criteria import Criterion
from pivident.excitation.information import Information


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
