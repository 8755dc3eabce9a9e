"""What is known of a load before it is moved: its mass from a scale, its shape from a drawing.

Each known number is one linear equation in the ten inertial parameters,

    m = m₀ ± σ,      h_x - c_x m = 0 ± σ_c m₀,      J_xx - (c_y² + c_z²) m = I_xx ± σ_I,

the last two because with a known centre of mass c the parameters are h = c m and J = I + m S(c, c).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.errors import ExperimentError
from pivident.robot.inertia import elements, steiner, tensor

#: Share of a number's natural size that stands for the deviation of one that is exact.
EXACT = 1e-6


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
        if self.mass is not None and not (np.isfinite(self.mass) and self.mass > 0):
            raise ExperimentError(f"mass of the load is {self.mass} kg; give a positive number")
        for key, size in (("center_of_mass", 3), ("inertia", 6)):
            value = getattr(self, key)
            if value is not None and not (
                np.shape(value) == (size,) and np.isfinite(np.asarray(value, float)).all()
            ):
                raise ExperimentError(f"{key} of the load needs {size} numbers, not {value!r}")
        for key in ("mass", "center_of_mass", "inertia"):
            std = getattr(self, f"{key}_std")
            if not (np.isfinite(std) and std >= 0):
                raise ExperimentError(f"{key}_std of the load is {std}; it cannot be negative")
            if std > 0 and getattr(self, key) is None:
                raise ExperimentError(f"{key}_std of the load is given without {key}; add it")
        if self.inertia is not None and self.center_of_mass is None:
            raise ExperimentError(
                "the load's inertia is known, but not its center_of_mass, about which it is; give "
                "that too, or leave both out to have them estimated"
            )
        if self.inertia is not None:
            smallest = np.linalg.eigvalsh(tensor(np.asarray(self.inertia, float)))[0]
            if smallest < -1e-12:
                raise ExperimentError(
                    f"the load's inertia has a negative principal moment, {smallest:.3g} kg m²; "
                    "give the tensor about the centre of mass, products with the sign of -∫ x y dm"
                )

    def equations(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """H π = y ± σ.

        Returns:
            H, shape (equations, 10); y and σ, shape (equations,).
        """
        rows, right, std = [], [], []
        size = 1.0 if self.mass is None else self.mass
        if self.mass is not None:
            rows.append(np.eye(10)[9])
            right.append(self.mass)
            std.append(max(self.mass_std, EXACT * self.mass))
        if self.center_of_mass is not None:
            centre = np.asarray(self.center_of_mass, dtype=float)
            for k in range(3):
                row = np.eye(10)[6 + k]
                row[9] = -centre[k]
                rows.append(row)
                right.append(0.0)
                std.append(size * max(self.center_of_mass_std, EXACT * 0.1))
            if self.inertia is not None:
                per_mass = elements(steiner(centre, centre))
                for k in range(6):
                    row = np.eye(10)[k]
                    row[9] = -per_mass[k]
                    rows.append(row)
                    right.append(float(self.inertia[k]))
                    std.append(max(self.inertia_std, EXACT * 0.01))
        return np.array(rows).reshape(-1, 10), np.array(right), np.array(std)
