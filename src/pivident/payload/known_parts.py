"""Known parts of a load: its mass from a scale, its shape from a drawing.

Each known number is one linear equation in the ten inertial parameters. With m₀, c₀ and I₀ known,

    m = m₀ ± σ,      h - c₀ m = 0 ± σ_c m,      J - 2 S(c₀, h) + m S(c₀, c₀) = I₀ ± σ_I.

The last one is J = I + S(h, h)/m to first order in δ = h/m - c₀. The true centre of mass is not c₀,
but c₀ + δ with δ = 0 ± σ_c, and the inertia is known about the true one; the remainder m S(δ, δ),
with a root mean square of √8 m σ_c² for moments and m σ_c² for products, is added to σ_I. If the
mass is unknown, σ_c is multiplied by the mass of an estimate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.drives.known_payload import check_body
from pivident.errors import ExperimentError
from pivident.robot.inertia import elements, steiner

#: Standard deviation assigned to an exact number, as a share of its natural size.
EXACT = 1e-6

#: Mass [kg] assumed for an unknown one before there is an estimate: a known centre of mass is then
#: weak, and the torques determine the mass.
BEFORE_AN_ESTIMATE = 1e3

#: Root mean square of the elements xx xy xz yy yz zz of S(δ, δ) for δ of unit variance.
SECOND_ORDER = np.sqrt([8.0, 1.0, 1.0, 8.0, 1.0, 8.0])


@dataclass(frozen=True, eq=False)
class KnownParts:
    """Known numbers of a load in one frame; None: to be estimated.

    Attributes:
        mass: m [kg].
        mass_std: its standard deviation [kg]; zero: exact.
        center_of_mass: c [m], shape (3,).
        center_of_mass_std: of each coordinate [m].
        inertia: xx xy xz yy yz zz about the centre of mass [kg m²], shape (6,).
        inertia_std: of each element [kg m²].
    """

    mass: float | None = None
    mass_std: float = 0.0
    center_of_mass: Sequence[float] | None = None
    center_of_mass_std: float = 0.0
    inertia: Sequence[float] | None = None
    inertia_std: float = 0.0

    def __post_init__(self) -> None:
        check_body("load", self.mass, self.center_of_mass, self.inertia)
        for key in ("mass", "center_of_mass", "inertia"):
            std = getattr(self, f"{key}_std")
            if not (np.isfinite(std) and std >= 0):
                raise ExperimentError(
                    f"{key}_std of the load is {std}", advice="it cannot be negative"
                )
            if std > 0 and getattr(self, key) is None:
                raise ExperimentError(
                    f"{key}_std of the load is given without {key}", advice="add it"
                )

    @property
    def needs_mass(self) -> bool:
        """Whether the standard deviations of the equations depend on an unknown mass."""
        return self.mass is None and self.center_of_mass is not None

    def equations(
        self, estimated_mass: float = BEFORE_AN_ESTIMATE
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """H π = y ± σ.

        Args:
            estimated_mass: root mean square of the mass [kg] if it is unknown.

        Returns:
            H, shape (equations, 10); y and σ, shape (equations,).
        """
        rows, right, std = [np.zeros((0, 10))], [np.zeros(0)], [np.zeros(0)]
        size = estimated_mass
        if self.mass is not None:
            size = float(np.hypot(self.mass, self.mass_std))
            rows.append(np.eye(10)[9:])
            right.append(np.array([self.mass]))
            std.append(np.array([max(self.mass_std, EXACT * self.mass)]))
        if self.center_of_mass is not None:
            centre = np.asarray(self.center_of_mass, dtype=float)
            first_moments = np.eye(10)[6:9]
            first_moments[:, 9] = -centre
            rows.append(first_moments)
            right.append(np.zeros(3))
            std.append(np.full(3, size * max(self.center_of_mass_std, EXACT * 0.1)))
            if self.inertia is not None:
                about_centre = np.eye(10)[:6]
                for k in range(3):
                    about_centre[:, 6 + k] = -2.0 * elements(steiner(centre, np.eye(3)[k]))
                about_centre[:, 9] = elements(steiner(centre, centre))
                rows.append(about_centre)
                right.append(np.asarray(self.inertia, dtype=float))
                left_out = SECOND_ORDER * size * self.center_of_mass_std**2
                std.append(np.hypot(max(self.inertia_std, EXACT * 0.01), left_out))
        return np.vstack(rows), np.concatenate(right), np.concatenate(std)
