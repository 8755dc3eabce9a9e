"""Bodies of links for file formats, and whether the values of a model are physically possible."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pivident.consistency.constraints import coupled_joints
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
            "which is first moments over mass",
            advice="export the physically consistent parameters, or shift the estimate along the "
            "directions without torque until every mass is positive",
        )
    return Body.of_parameters(inertia)


def is_possible(inertia: np.ndarray) -> bool:
    """Whether some distribution of mass has these ten parameters: pseudo-inertia positive."""
    return bool(np.linalg.eigvalsh(pseudo_inertia(inertia))[0] > 0.0)


#: Negative friction, inertia or eigenvalue within the rounding of a solver, in SI units.
ROUNDING = 1e-9


def impossible_value(model: RunnableModel) -> str:
    """The first physically impossible value as the rest of a sentence, or nothing.

    Links need a positive definite pseudo-inertia matrix; friction levels and rotor inertias are not
    negative, nor are the matrices of those of coupled motors.
    """
    for i, link in enumerate(model.robot.tree.links):
        if link.is_body and not is_possible(model.inertial(i)):
            return (
                f"no body has the inertial parameters of the link {link.name!r} "
                f"({model.inertial(i)[9]:.4g} kg)"
            )
    for p, value in zip(model.parameters, model.values.tolist(), strict=True):
        if p.is_dissipative and value < -ROUNDING:
            return f"{p.name} = {value:.4g} {p.unit} is negative"
    for own, coupled, what in (("ia", "iam", "rotor inertias"), ("fv", "fvm", "viscous friction")):
        for names, matrix in _coupled(model, own, coupled):
            lowest = float(np.linalg.eigvalsh(matrix)[0])
            if lowest < -ROUNDING:
                return (
                    f"the matrix of the {what} of the coupled joints {names} has the eigenvalue "
                    f"{lowest:.3g}"
                )
    return ""


def _coupled(model: RunnableModel, own: str, coupled: str) -> Iterator[tuple[str, np.ndarray]]:
    """Names of joints whose motors are coupled, and the matrix of their shared parameters."""
    values = list(zip(model.parameters, model.values.tolist(), strict=True))
    diagonal = {p.joint: value for p, value in values if p.stem == own}
    for joints in coupled_joints(model.robot.tree):
        if not all(joint in diagonal for joint in joints):
            continue  # another friction law, whose levels are checked one by one
        matrix = np.diag([diagonal[joint] for joint in joints])
        for p, value in values:
            c = p.coupling
            if p.stem == coupled and c is not None and c.motor in joints:
                a, b = joints.index(c.motor), joints.index(c.joint)
                matrix[a, b] = matrix[b, a] = c.ratio * value
        yield ", ".join(repr(model.robot.tree.joints[joint].name) for joint in joints), matrix
