"""Starts of the iteration: robots with perturbed but physically possible parameters."""

from __future__ import annotations

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters
from pivident.dynamics.parameters import nominal_values
from pivident.models.possible_values import is_possible

#: Maximum number of draws of a physically possible link.
DRAWS = 1000


def perturbed_values(base: BaseParameters, spread: float, rng: np.random.Generator) -> np.ndarray:
    """Base parameters of a robot with perturbed standard parameters, shape (base,).

    Each is multiplied by 1 + spread · N(0, 1). Links that are physical in the description are
    drawn again until they are.
    """
    nominal = nominal_values(base.robot, base.standard)
    drawn = nominal.copy()
    links: dict[tuple[int, bool], list[int]] = {}
    for k, p in enumerate(base.standard):
        links.setdefault((p.joint, p.is_inertial), []).append(k)
    for (_, inertial), own in links.items():
        wanted = inertial and is_possible(nominal[own])
        for _ in range(DRAWS):
            drawn[own] = nominal[own] * (1.0 + spread * rng.standard_normal(len(own)))
            if not wanted or is_possible(drawn[own]):
                break
        else:
            drawn[own] = nominal[own]
    return base.values(drawn)
