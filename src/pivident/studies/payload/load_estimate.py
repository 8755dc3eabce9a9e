"""Mass, centre of mass and inertia of a load, from its ten inertial parameters with covariance.

The torque is linear in the ten parameters π = (xx xy xz yy yz zz mx my mz m), but the usual
quantities are not:

    c = h/m,      J_c = J - m S(c, c) = J - S(h, h)/m,      S(a, a) = (aᵀa) 1 - a aᵀ

with h the first moments and J the inertia at the frame's origin. Standard errors follow from the
derivatives (delta method). This assumes a well-determined mass; otherwise the interval of the
centre of mass is Fieller's: all c for which h - c m is not significantly different from zero,

    (h - c m)² <= z² (σ_h² - 2 c σ_hm + c² σ_m²),

which is unbounded if the mass itself is not significantly different from zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pivident.foundation.text.display import Displayed
from pivident.models.consistency.pseudo_inertia import pseudo_inertia
from pivident.robot.description import INERTIAL
from pivident.robot.frames import Pose
from pivident.robot.inertia import elements, moved, steiner

#: Sizes that make directions of different units comparable: a load of 1 kg and 0.1 m.
NATURAL = np.array([1e-2] * 6 + [1e-1] * 3 + [1.0])

#: Component along an undetermined direction, in natural sizes, that makes a number undetermined.
TOUCHES = 1e-6

#: Half width of a 95 % interval in standard errors.
TWO_SIDED_95 = 1.959964


@dataclass(frozen=True, eq=False)
class LoadEstimate(Displayed):
    """Ten inertial parameters of a load in one frame.

    Attributes:
        values: xx xy xz yy yz zz [kg m²], mx my mz [kg m], m [kg], shape (10,).
        covariance: of the values, shape (10, 10).
        undetermined: directions of the parameter space that the torques do not determine, shape
            (10, k); k = 0 if all are determined.
        frame: description of the frame.
    """

    values: np.ndarray
    covariance: np.ndarray
    undetermined: np.ndarray
    frame: str

    @cached_property
    def std(self) -> np.ndarray:
        """Standard errors of the ten parameters, infinite where not determined, (10,)."""
        return self._standard_errors(np.eye(len(INERTIAL)))

    @property
    def determined(self) -> np.ndarray:
        """Which of the ten parameters are determined, shape (10,)."""
        return np.isfinite(self.std)

    @property
    def rank(self) -> int:
        """Number of directions of the ten-parameter space that are determined."""
        return len(INERTIAL) - self.undetermined.shape[1]

    @property
    def mass(self) -> float:
        """Mass m [kg]."""
        return float(self.values[9])

    @property
    def mass_std(self) -> float:
        """Its standard error [kg]."""
        return float(self.std[9])

    @property
    def is_seen(self) -> bool:
        """Whether the mass is significantly positive (2σ); else there is no centre of mass."""
        return self.mass > 2.0 * self.mass_std

    @property
    def center_of_mass(self) -> np.ndarray:
        """Centre of mass c = h/m [m], shape (3,); NaN where the mass is not positive."""
        return self.values[6:9] / self.mass if self.mass > 0 else np.full(3, np.nan)

    @cached_property
    def center_of_mass_std(self) -> np.ndarray:
        """Standard errors of c by the delta method [m], shape (3,)."""
        if not self.mass > 0:
            return np.full(3, np.inf)
        gradient = np.zeros((3, 10))
        gradient[:, 6:9] = np.eye(3) / self.mass
        gradient[:, 9] = -self.center_of_mass / self.mass
        return self._standard_errors(gradient)

    @property
    def inertia(self) -> np.ndarray:
        """Elements xx xy xz yy yz zz of J_c, about the centre of mass [kg m²], shape (6,)."""
        if not self.mass > 0:
            return np.full(6, np.nan)
        h = self.values[6:9]
        return self.values[:6] - elements(steiner(h, h)) / self.mass

    @cached_property
    def inertia_std(self) -> np.ndarray:
        """Standard errors of J_c by the delta method [kg m²], shape (6,)."""
        if not self.mass > 0:
            return np.full(6, np.inf)
        h = self.values[6:9]
        gradient = np.zeros((6, 10))
        gradient[:, :6] = np.eye(6)
        for k in range(3):
            # S is bilinear and symmetric: dS(h, h) = 2 S(dh, h)
            gradient[:, 6 + k] = -2.0 * elements(steiner(np.eye(3)[k], h)) / self.mass
        gradient[:, 9] = elements(steiner(h, h)) / self.mass**2
        return self._standard_errors(gradient)

    def fieller_interval(self, z: float = TWO_SIDED_95) -> np.ndarray:
        """Fieller's intervals of the centre of mass [m], shape (3, 2).

        Infinite if the mass is not significantly different from zero: the centre of mass is then
        unbounded.

        Args:
            z: half width in standard errors; 1.96 for 95 %.
        """
        made = np.tile([-np.inf, np.inf], (3, 1))
        m, variance = self.mass, self.mass_std**2
        leading = m**2 - z**2 * variance
        if not (np.isfinite(variance) and leading > 0 and m > 0):
            return made
        for k in range(3):
            if not self.determined[6 + k]:
                continue
            h, spread = self.values[6 + k], self.covariance[6 + k, 6 + k]
            half = h * m - z**2 * self.covariance[6 + k, 9]
            root = np.sqrt(max(half**2 - leading * (h**2 - z**2 * spread), 0.0))
            made[k] = (half - root) / leading, (half + root) / leading
        return made

    @property
    def is_possible(self) -> bool:
        """Whether a real body has these ten parameters: its pseudo-inertia is not negative."""
        size = np.array([0.1, 0.1, 0.1, 1.0])
        scaled = pseudo_inertia(self.values) / np.outer(size, size)
        return bool(np.linalg.eigvalsh(scaled)[0] >= 0.0)

    def seen_from(self, pose: Pose, frame: str) -> LoadEstimate:
        """The same load in another frame that is fixed to the link.

        Args:
            pose: of that frame in the present one.
            frame: its name.
        """
        linear = seen_from(pose)
        lost = linear @ self.undetermined
        if lost.size:
            left, _, _ = np.linalg.svd(lost / NATURAL[:, None], full_matrices=False)
            lost = left * NATURAL[:, None]
        return LoadEstimate(linear @ self.values, linear @ self.covariance @ linear.T, lost, frame)

    def _standard_errors(self, gradient: np.ndarray) -> np.ndarray:
        """Standard errors of linear functions, infinite along undetermined directions."""
        std = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", gradient, self.covariance, gradient), 0))
        if self.undetermined.size:
            length = np.linalg.norm(gradient * NATURAL, axis=1)
            touched = np.linalg.norm(gradient @ self.undetermined, axis=1)
            std = np.where(touched > TOUCHES * length, np.inf, std)
        return std


def seen_from(pose: Pose) -> np.ndarray:
    """Ten parameters in another frame of the same body, per present parameter, (10, 10)."""
    back = pose.rotation.T
    return np.column_stack([moved(unit, back, -back @ pose.translation) for unit in np.eye(10)])
