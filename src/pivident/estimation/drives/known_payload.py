"""A payload of known mass on a link, and what it adds to the base parameters.

The ten inertial parameters π of a body fixed to link n add to those of the link, so that the base
parameters change by B π with B the columns of the regrouping of Khalil and Gautier. The unknown
parts of the payload are estimated with everything else:

    θ_loaded = θ + B (π_known + unknown parts).

The mass alone suffices: the first moments follow from the motion in the unit of each joint, and the
mass fixes the scale of that unit. A known centre of mass and inertia make the result more
accurate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters
from pivident.foundation.errors import ExperimentError
from pivident.robot.description import INERTIAL
from pivident.robot.inertia import from_center_of_mass, tensor
from pivident.robot.refusals import without_loops


@dataclass(frozen=True, eq=False)
class Payload:
    """A body of known mass fixed to a link.

    Attributes:
        mass: m [kg].
        center_of_mass: c in the frame of the link (modified Denavit-Hartenberg, or the frame rule
            for URDF links) [m], shape (3,); None: unknown.
        inertia: xx, xy, xz, yy, yz, zz about the centre of mass, in axes parallel to that frame
            [kg m²], shape (6,); None: unknown.
        mass_std: standard deviation of the mass [kg]; zero: exact.
        link: index of the link that carries it; -1: the last one.
    """

    mass: float  # [kg]
    center_of_mass: Sequence[float] | None = None  # [m], (3,)
    inertia: Sequence[float] | None = None  # xx xy xz yy yz zz about it [kg m²], (6,)
    mass_std: float = 0.0  # standard deviation of the mass [kg]; zero: exact
    link: int = -1  # index of the link that carries it

    def __post_init__(self) -> None:
        check_body("payload", self.mass, self.center_of_mass, self.inertia)
        if not 0 <= self.mass_std < self.mass:
            raise ExperimentError(
                f"mass_std of the payload is {self.mass_std} kg",
                advice="it lies between 0 and the mass",
            )

    def known(self) -> np.ndarray:
        """Known inertial parameters, zeros elsewhere, shape (10,)."""
        centre = np.zeros(3) if self.center_of_mass is None else np.asarray(self.center_of_mass)
        inertia = np.zeros(6) if self.inertia is None else np.asarray(self.inertia)
        return from_center_of_mass(self.mass, centre, tensor(inertia))

    def per_mass(self) -> np.ndarray:
        """Derivative of `known` with respect to the mass, inertia about c constant, shape (10,)."""
        return replace(self, mass=1.0, mass_std=0.0, inertia=None).known()

    def unknown(self) -> list[str]:
        """Names of the inertial parameters that have to be estimated."""
        names = [] if self.inertia is not None else list(INERTIAL[:6])
        return names + ([] if self.center_of_mass is not None else list(INERTIAL[6:9]))

    def base_columns(self, base: BaseParameters) -> np.ndarray:
        """B: change of the base parameters per inertial parameter of the link, (base, 10).

        Raises:
            RobotDescriptionError: a robot with closed loops.
        """
        without_loops(base.robot, "a payload", "give trusted gains or parameters instead")
        joint = range(base.robot.size)[self.link]
        columns = np.zeros((len(base), len(INERTIAL)))
        for k, p in enumerate(base.standard):
            if p.is_inertial and p.joint == joint:
                unit = np.zeros(len(base.standard))
                unit[k] = 1.0
                columns[:, INERTIAL.index(p.stem)] = base.values(unit)
        return columns


def check_body(
    what: str,
    mass: float | None,
    center_of_mass: Sequence[float] | None,
    inertia: Sequence[float] | None,
) -> None:
    """Refuse physically impossible mass, centre of mass (3,) or inertia (6,); None: unknown."""
    if mass is not None and not (np.isfinite(mass) and mass > 0):
        raise ExperimentError(f"mass of the {what} is {mass} kg", advice="give a positive number")
    for key, value, size in (("center_of_mass", center_of_mass, 3), ("inertia", inertia, 6)):
        if value is not None and not (
            np.shape(value) == (size,) and np.isfinite(np.asarray(value, float)).all()
        ):
            raise ExperimentError(f"{key} of the {what} needs {size} numbers, not {value!r}")
    if inertia is None:
        return
    if center_of_mass is None:
        raise ExperimentError(
            f"the {what}'s inertia is given without the center_of_mass that it refers to",
            advice="give that too, or leave both out to have them estimated",
        )
    smallest = np.linalg.eigvalsh(tensor(np.asarray(inertia, float)))[0]
    if smallest < -1e-12:
        raise ExperimentError(
            f"the {what}'s inertia has a negative principal moment, {smallest:.3g} kg m²",
            advice="give the tensor about the centre of mass, products with the sign of -∫ x y dm",
        )
