"""Torques that a motion will need, by the present model, with its uncertainty.

    |Φ_j θ| + 2 √(Φ_j P Φ_jᵀ)

P is the covariance of an earlier estimate; without one the bound is the torque itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.dynamics.regressor_derivatives import RegressorDerivatives
from pivident.excitation.information import Samples

#: Standard errors of the model that a torque limit has to leave room for.
MARGIN = 2.0


@dataclass(frozen=True, eq=False)
class TorqueModel:
    """The present model of the torques.

    Attributes:
        regressor: the observation matrix.
        values: θ, shape (parameters,).
        covariance: P, shape (parameters, parameters), or None.
    """

    regressor: Regressor
    values: np.ndarray
    covariance: np.ndarray | None = None

    def torque_and_margin(self, motion: Samples) -> tuple[np.ndarray, np.ndarray]:
        """Torque, and two standard errors of it, each (samples, joints) [N m or N].

        Args:
            motion: q, dq, ddq, each (samples, joints).
        """
        phi = self._matrix(motion)
        return phi @ self.values, self._margin(phi)[0]

    def bound_and_weights(self, motion: Samples) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Torque and bound of its size, each (samples, joints), and the weights of the bound.

        A weight is the g of dbound_j = dΦ_j g, shape (samples, joints, parameters), see
        `RegressorDerivatives.weighted`; that of the torque itself is θ.

        Args:
            motion: q, dq, ddq, each (samples, joints).
        """
        phi = self._matrix(motion)
        torque = phi @ self.values
        margin, spread = self._margin(phi)
        sign = np.where(torque < 0.0, -1.0, 1.0)
        weights = sign[:, :, None] * self.values
        if spread is not None:
            # d(2 √(φ P φᵀ)) = 2 φ P dφᵀ / √(φ P φᵀ)
            weights = weights + MARGIN**2 * spread / np.maximum(margin, 1e-12)[:, :, None]
        return torque, np.abs(torque) + margin, weights

    @cached_property
    def derivatives(self) -> RegressorDerivatives:
        """Derivatives of the observation matrix."""
        return RegressorDerivatives.of(self.regressor)

    def _matrix(self, motion: Samples) -> np.ndarray:
        inner = self.regressor.levels(motion[1].T)
        return self.regressor.matrix(*motion, inner=inner)

    def _margin(self, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """2 √(φ P φᵀ) of each row, and P φᵀ."""
        if self.covariance is None:
            return np.zeros(phi.shape[:2]), None
        spread = phi @ self.covariance
        variance = np.einsum("tjp,tjp->tj", spread, phi)
        return MARGIN * np.sqrt(np.maximum(variance, 0.0)), spread
