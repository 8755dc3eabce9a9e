"""Standard parameters with the torques of given base parameters: a shift in the null space.

    β = φ_kept + K φ_dropped        (see `pivident.dynamics.base_parameters`)

holds for every φ_dropped. Other engines need a mass on every link, so the undetermined parameters
are chosen to bring φ as close as possible to a reference, in its own scales,

    min Σ ((φ - φ₀)/scale)²   subject to   B φ = β .

The links have masses, and their torques are those of β, but they need not be possible bodies: for
that see `make_consistent`.
"""

from __future__ import annotations

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters
from pivident.dynamics.parameters import Parameter
from pivident.models.consistency.reference import density_of_estimate, make_reference
from pivident.robot.description import Robot

#: Weight of undetermined masses relative to other parameters: engines need masses.
MASS_WEIGHT = 100.0


def standard_from_base(
    base: BaseParameters, values: np.ndarray, reference: Robot | np.ndarray | None = None
) -> np.ndarray:
    """Standard parameters with exactly the torques of base parameters, masses near a reference.

    Args:
        base: base parameters of the robot.
        values: β, shape (base,).
        reference: description or standard parameters, shape (standard,), to be close to; None:
            the nominal ones, and solid cylinders for links without nominal inertia.

    Returns:
        φ, shape (standard,), with B φ = β up to rounding.

    Raises:
        ExperimentError: a reference that does not fit the robot.
    """
    density = density_of_estimate(base, values)
    near = make_reference(base.robot, base.standard, 0.01, reference, density)
    weight = 1.0 / near.scales
    weight[_masses(base.standard)] *= MASS_WEIGHT
    start = near.values.copy()
    start[base.kept] = values - base.regrouping @ start[base.dropped]
    # shift = (−K, 1) z changes no torque; z makes the weighted distance from the reference least
    shift = np.zeros((start.size, base.dropped.size))
    shift[base.kept] = -base.regrouping
    shift[base.dropped, np.arange(base.dropped.size)] = 1.0
    z = np.linalg.lstsq(weight[:, None] * shift, weight * (near.values - start), rcond=None)[0]
    standard = start + shift @ z
    standard[base.kept] = values - base.regrouping @ standard[base.dropped]
    return standard


def _masses(standard: tuple[Parameter, ...]) -> list[int]:
    return [k for k, p in enumerate(standard) if p.stem == "m"]
