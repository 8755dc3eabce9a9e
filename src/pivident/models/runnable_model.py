"""A model that other programs can run: a value for every parameter, possible as a body or not.

The record determines base parameters; simulators and URDF need the mass, the centre of mass and
the inertia of each link. A `RunnableModel` has them, either those of the physically consistent set
nearest to the estimate, or the free estimate expressed as standard parameters, which has the same
torques but links that may not be physical.

Bodies of links for file formats, and whether the values of a model are physically possible.

Standard parameters with the torques of given base parameters: a shift in the null space.

    β = φ_kept + K φ_dropped        (see `pivident.dynamics.base_parameters`)

holds for every φ_dropped. Other engines need a mass on every link, so the undetermined parameters
are chosen to bring φ as close as possible to a reference, in its own scales,

    min Σ ((φ - φ₀)/scale)²   subject to   B φ = β .

The links have masses, and their torques are those of β, but they need not be possible bodies: for
that see `make_consistent`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, base_parameters
from pivident.dynamics.inverse_dynamics import InverseDynamics
from pivident.dynamics.parameters import Parameter, nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.identification import Identification
from pivident.foundation.errors import ExportError
from pivident.foundation.text.display import Printed
from pivident.foundation.text.plain_values import Name
from pivident.models.consistency.constraints import coupled_joints
from pivident.models.consistency.pseudo_inertia import pseudo_inertia
from pivident.models.consistency.reference import density_of_estimate, make_reference
from pivident.robot.description import INERTIAL, Robot
from pivident.robot.inertia import Body

if TYPE_CHECKING:
    from pivident.models.consistency.consistent_model import ConsistentModel

#: Confidence of the intervals of standard parameters.
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Origin:
    """Where a model comes from."""

    method: Name  # ``PC-IDIM-PIV`` if consistent, ``nominal`` for the description's values
    version: Name = ""  # of pivident that identified it
    sources: Mapping[str, str] = field(default_factory=dict)  # SHA-256 of input files by name
    identification: Name = ""  # SHA-256 of its file, or empty


@dataclass(frozen=True, eq=False)
class RunnableModel(Printed):
    """A robot with a value for each of its standard parameters.

    Attributes:
        robot: the robot.
        parameters: all its standard parameters, in order.
        values: their values, shape (standard,).
        consistent: whether the values are physically consistent.
        origin: where they come from.
        notes: reservations, complete sentences.
        intervals: lower and upper end of each value's 95 % interval, shape (standard, 2); infinite
            where the record has no information on it, None where they were not requested.
        estimate: the identification that they come from, or None.
    """

    robot: Robot
    parameters: tuple[Parameter, ...]
    values: np.ndarray
    consistent: bool
    origin: Origin
    notes: tuple[str, ...] = ()
    intervals: np.ndarray | None = None
    estimate: Identification | None = None

    def __post_init__(self) -> None:
        if np.shape(self.values) != (len(self.parameters),):
            raise ExportError(
                f"the model has {len(self.parameters)} standard parameters and values of shape "
                f"{np.shape(self.values)}",
                advice="give one value for each",
            )
        if not np.isfinite(self.values).all():
            worst = self.parameters[int(np.argmin(np.isfinite(self.values)))].name
            raise ExportError(f"the value of {worst} is not finite", advice="identify again")

    @cached_property
    def regressor(self) -> Regressor:
        """Observation matrix of all standard parameters."""
        return regressor_of(self.robot, self.parameters)

    @cached_property
    def base(self) -> BaseParameters:
        """Base parameters of the robot."""
        return base_parameters(self.robot)

    @property
    def base_values(self) -> np.ndarray:
        """The base parameters of these values, shape (base,)."""
        return self.base.values(self.values)

    @cached_property
    def torque(self) -> InverseDynamics:
        """Torque Φ(q, dq, ddq) θ with friction, of one state (joints,) or of samples [N m or N]."""
        return InverseDynamics(self.robot, self.parameters, self.values)

    def inertial(self, joint: int) -> np.ndarray:
        """``xx xy xz yy yz zz mx my mz m`` of a link in its frame, shape (10,); zeros of no body.

        Args:
            joint: index of the link's joint in `Robot.tree`.
        """
        value = {(p.joint, p.stem): v for p, v in zip(self.parameters, self.values, strict=True)}
        return np.array([value.get((joint, stem), 0.0) for stem in INERTIAL])

    def link(self, joint: int) -> Body:
        """A link's mass, centre of mass, and inertia about it, in the link's frame.

        Args:
            joint: index of the link's joint in `Robot.tree`.
        """
        return Body.of_parameters(self.inertial(joint))


def runnable_model(
    source: Identification | ConsistentModel | Robot,
    *,
    identification: str = "",
    intervals: bool = False,
) -> RunnableModel:
    """Values for every standard parameter, from an estimate or from the robot's description.

    Args:
        source: a consistent model; a free identification, whose base parameters are expressed as
            standard ones of the same torques; or a robot with nominal (CAD) values.
        identification: SHA-256 of the identification's file, stored with the model.
        intervals: whether a consistent model's profile intervals are computed (a second or two).

    Returns:
        The model; its ``values`` are in the order of its ``parameters``.

    Raises:
        ExportError: the values are not finite, or the object is none of these.
    """
    if isinstance(source, Robot):
        return _nominal(source)
    if isinstance(source, Identification):
        return _lifted(source, identification)
    from pivident.models.consistency.consistent_model import ConsistentModel

    if not isinstance(source, ConsistentModel):
        raise ExportError(
            f"a model cannot be made of an object of type {type(source).__name__}",
            advice="give an Identification, or what make_consistent returns",
        )
    found = None
    if intervals:
        profile = source.intervals(CONFIDENCE, "standard")
        found = np.column_stack([profile.low, profile.high])
    return RunnableModel(
        robot=source.robot,
        parameters=source.parameters,
        values=source.values,
        consistent=True,
        origin=origin_of(source.free, source.method, identification),
        notes=source.notes,
        intervals=found,
        estimate=source.free,
    )


def origin_of(free: Identification, method: str, digest: str = "") -> Origin:
    """Where the values of an identification, or of a stage after it, come from."""
    return Origin(method, free.version, dict(free.sources), digest)


def _lifted(free: Identification, digest: str) -> RunnableModel:
    """The free estimate on standard parameters of the same torques."""
    base = base_parameters(free.robot)
    values = np.zeros(len(base))
    place = {name: k for k, name in enumerate(base.names)}
    values[[place[name] for name in free.names]] = free.theta
    notes = (
        "The values are the free estimate, expressed as standard parameters of the same torques; "
        "single values are not determined by the record, and links need not be physical.",
        *free.scale_warnings,
    )
    return RunnableModel(
        robot=free.robot,
        parameters=base.standard,
        values=standard_from_base(base, values),
        consistent=False,
        origin=origin_of(free, free.method, digest),
        notes=notes,
        estimate=free,
    )


def _nominal(robot: Robot) -> RunnableModel:
    """The values of the robot's description."""
    standard = standard_parameters(robot)
    return RunnableModel(
        robot=robot,
        parameters=standard,
        values=nominal_values(robot, standard),
        consistent=False,
        origin=Origin("nominal"),
        notes=("The values are those of the robot's description; nothing was identified.",),
    )


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
    weight[[k for k, p in enumerate(base.standard) if p.stem == "m"]] *= MASS_WEIGHT
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
