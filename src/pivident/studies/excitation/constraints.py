"""Limits of a motion and its torques as constraints of its coefficients, with their gradients.

Each constraint is a ratio that must not exceed one: the largest position, speed, acceleration, jerk
and torque of a joint over its limit, its rms torque over its, and one for each pair of bodies. The
largest of N ratios r_t is bounded by the smooth function (Kreisselmeier and Steinhauser 1979)

    K(r) = max r + (1/ρ) log Σ_t exp(ρ (r_t - max r)),      max r ≤ K ≤ max r + (log N)/ρ

Torques that a motion will need, by the present model, with its uncertainty.

    |Φ_j θ| + 2 √(Φ_j P Φ_jᵀ)

P is the covariance of an earlier estimate; without one the bound is the torque itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.dynamics.regressor_derivatives import RegressorDerivatives
from pivident.studies.collision.clearances import Clearances
from pivident.studies.excitation.information import Samples
from pivident.studies.excitation.limits import JointLimits
from pivident.studies.excitation.motions import MotionFamily

#: ρ: a thousand samples at the limit would be taken for 2 % more than it.
SHARPNESS = 350.0
#: Way over which a clearance counts as from none to enough [m]: the ratio falls by one over it.
CLEARANCE_SCALE = 0.1
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
        weights = np.where(torque < 0.0, -1.0, 1.0)[:, :, None] * self.values
        if spread is not None:
            # d(2 √(φ P φᵀ)) = 2 φ P dφᵀ / √(φ P φᵀ)
            weights = weights + MARGIN**2 * spread / np.maximum(margin, 1e-12)[:, :, None]
        return torque, np.abs(torque) + margin, weights

    @cached_property
    def derivatives(self) -> RegressorDerivatives:
        """Derivatives of the observation matrix."""
        return RegressorDerivatives.of(self.regressor)

    def _matrix(self, motion: Samples) -> np.ndarray:
        return self.regressor.matrix(*motion, inner=self.regressor.levels(motion[1].T))

    def _margin(self, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """2 √(φ P φᵀ) of each row, and P φᵀ."""
        if self.covariance is None:
            return np.zeros(phi.shape[:2]), None
        spread = phi @ self.covariance
        return MARGIN * np.sqrt(np.maximum(np.einsum("tjp,tjp->tj", spread, phi), 0.0)), spread


@dataclass(frozen=True, eq=False)
class Constraints:
    """All limits of one family of motions.

    Attributes:
        family: the functions that motions are made of.
        rate: of the samples at which limits are checked [Hz].
        limits: of the joints.
        torques: models of the torques of all runs of the motion; none where no masses are known.
        clearances: of the bodies, or None where none are known.
        functions: of ``family`` at the samples, shape (4, samples, size).
    """

    family: MotionFamily
    rate: float
    limits: JointLimits
    torques: tuple[TorqueModel, ...]
    clearances: Clearances | None
    functions: np.ndarray

    @classmethod
    def of(
        cls,
        family: MotionFamily,
        rate: float,
        limits: JointLimits,
        torques: tuple[TorqueModel, ...],
        clearances: Clearances | None,
    ) -> Constraints:
        """Constraints of a family on samples at a rate [Hz]."""
        t = np.linspace(0.0, family.duration, int(np.ceil(family.duration * rate)) + 1)
        limited = np.isfinite(limits.torque).any() or np.isfinite(limits.rms_torque).any()
        used = torques if limited else ()
        return cls(family, rate, limits, used, clearances, family.functions(t))

    def motion(self, coefficients: np.ndarray) -> np.ndarray:
        """Positions, speeds, accelerations and jerks, shape (4, samples, joints)."""
        return self.functions @ coefficients

    def largest_ratio(self, coefficients: np.ndarray) -> float:
        """Largest ratio of all, without smoothing: one or less keeps every limit here."""
        moved = self.motion(coefficients)
        worst = float(self._kinematic(moved).max())
        if worst > 1.0 or not np.isfinite(worst):
            return worst
        motion = (moved[0], moved[1], moved[2])
        for model in self.torques:
            worst = max(worst, float(self._torque_ratios(model, motion).max()))
        if self.clearances is not None and worst <= 1.0:
            ratio = self._clearance_ratio(self.clearances.distances(moved[0]))
            worst = max(worst, float(ratio.max(initial=-np.inf)))
        return worst

    def _kinematic(self, moved: np.ndarray) -> np.ndarray:
        """Ratios by quantity, sample and joint."""
        limits = self.limits
        return np.stack(
            [
                np.abs(moved[0] - limits.middle) / limits.half,
                np.abs(moved[1]) / limits.speed,
                np.abs(moved[2]) / limits.acceleration,
                np.abs(moved[3]) / limits.jerk,
            ]
        )

    def _torque_ratios(self, model: TorqueModel, motion: Samples) -> np.ndarray:
        """Largest torque with its margin and rms torque of each joint, over their limits."""
        torque, margin = model.torque_and_margin(motion)
        peak = (np.abs(torque) + margin).max(axis=0) / self.limits.torque
        heat = np.sqrt(np.mean(torque**2, axis=0)) / self.limits.rms_torque
        return np.concatenate([peak, heat])

    def _clearance_ratio(self, distances: np.ndarray) -> np.ndarray:
        assert self.clearances is not None
        return 1.0 - (distances - self.clearances.needed[:, None]) / CLEARANCE_SCALE

    def ratios_and_gradients(self, coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Smooth ratios, shape (constraints,), and their gradients by the coefficients.

        The gradients have the shape (constraints, size, joints).
        """
        moved = self.motion(coefficients)
        parts = [self._kinematic_constraints(moved)]
        motion = (moved[0], moved[1], moved[2])
        parts += [self._torque_constraints(model, motion) for model in self.torques]
        if self.clearances is not None:
            parts.append(self._clearance_constraints(moved[0]))
        ratios = np.concatenate([ratio for ratio, _ in parts])
        return ratios, np.concatenate([gradient for _, gradient in parts])

    def _kinematic_constraints(self, moved: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions, speeds, accelerations, and jerks where they are limited."""
        limits, joints = self.limits, moved.shape[2]
        scales = [limits.half, limits.speed, limits.acceleration, limits.jerk]
        ratios, gradients = [], []
        for quantity, scale in enumerate(scales):
            if np.isinf(scale).all():
                continue
            shifted = moved[quantity] - (limits.middle if quantity == 0 else 0.0)
            ratio = shifted / scale
            largest, weights = smooth_maximum(np.concatenate([ratio, -ratio]))
            net = (weights[: len(ratio)] - weights[len(ratio) :]) / scale
            gradient = np.zeros((joints, self.family.size, joints))
            by_coefficient = self.functions[quantity].T @ net
            gradient[np.arange(joints), :, np.arange(joints)] = by_coefficient.T
            ratios.append(largest)
            gradients.append(gradient)
        return np.concatenate(ratios), np.concatenate(gradients)

    def _torque_constraints(
        self, model: TorqueModel, motion: Samples
    ) -> tuple[np.ndarray, np.ndarray]:
        """Largest torques with their margins, and rms torques where they are limited."""
        torque, bound, weights = model.bound_and_weights(motion)
        derivatives = model.derivatives
        ratios, share = smooth_maximum(bound / self.limits.torque)
        scaled = weights * (share / self.limits.torque)[:, :, None]
        gradients = self._by_coefficient(derivatives.weighted(*motion, scaled))
        hot = np.flatnonzero(np.isfinite(self.limits.rms_torque))
        if hot.size == 0:
            return ratios, gradients
        rms = np.maximum(np.sqrt(np.mean(torque**2, axis=0)), 1e-12)
        share = torque / (len(torque) * rms * self.limits.rms_torque)
        scaled = share[:, :, None] * model.values
        heating = self._by_coefficient(derivatives.weighted(*motion, scaled))
        return (
            np.concatenate([ratios, (rms / self.limits.rms_torque)[hot]]),
            np.concatenate([gradients, heating[hot]]),
        )

    def _by_coefficient(self, derivatives: np.ndarray) -> np.ndarray:
        """Sum over the samples of ∂r_j/∂(q, dq, ddq), by coefficient: (joints, size, joints)."""
        samples, joints = derivatives.shape[:2]
        out = np.zeros((self.family.size, joints * joints))
        for quantity in range(3):
            own = derivatives[..., quantity].reshape(samples, joints * joints)
            out += self.functions[quantity].T @ own
        return out.reshape(self.family.size, joints, joints).transpose(1, 0, 2)

    def _clearance_constraints(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """One for each pair of bodies."""
        assert self.clearances is not None
        distances, slopes = self.clearances.with_gradients(q)
        ratios, weights = smooth_maximum(self._clearance_ratio(distances).T)
        net = -weights.T[:, :, None] * slopes / CLEARANCE_SCALE
        return ratios, np.einsum("tk,ctj->ckj", self.functions[0], net, optimize=True)


def smooth_maximum(ratios: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """K of each column, and its derivatives by the ratios, shape (samples, columns).

    Args:
        ratios: shape (samples, columns).
    """
    largest = ratios.max(axis=0)
    powers = np.exp(SHARPNESS * (ratios - largest))
    total = powers.sum(axis=0)
    return largest + np.log(total) / SHARPNESS, powers / total
