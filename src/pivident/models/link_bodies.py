"""Bodies of links for file formats: mass, centre of mass and inertia about it."""

from __future__ import annotations

import numpy as np

from pivident.consistency.pseudo_inertia import pseudo_inertia
from pivident.errors import ExportError
from pivident.models.runnable_model import RunnableModel
from pivident.robot.inertia import Body


def link_inertias(model: RunnableModel) -> np.ndarray:
    """Ten inertial parameters of every link of the tree, shape (links, 10); zeros of no body."""
    return np.array([model.inertial(i) for i in range(model.robot.tree.size)])


def written_body(name: str, inertia: np.ndarray) -> Body:
    """A link as mass, centre of mass and inertia about it."""
    if not np.isfinite(inertia).all():
        raise ExportError(f"link {name!r}: its inertial parameters are not all finite")
    mass = float(inertia[9])
    if mass <= 0.0:
        raise ExportError(
            f"link {name!r} has a mass of {mass:.4g} kg, and the file stores a centre of mass, "
            "which is first moments over mass; export the physically consistent parameters, or "
            "shift the estimate along the directions without torque until every mass is positive"
        )
    return Body.of_parameters(inertia)


def is_possible(inertia: np.ndarray) -> bool:
    """Whether some distribution of mass has these ten parameters: pseudo-inertia positive."""
    return bool(np.linalg.eigvalsh(pseudo_inertia(inertia))[0] > 0.0)
