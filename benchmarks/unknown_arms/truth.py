"""Machines made from a drawing, and their true base parameters.

The machine differs from the drawing by up to 20 % (its seed decides), and the URDF that comes with
it differs from the machine as vendors' files do: masses by 10 to 30 %, centres of mass by some
millimetres, inertias of plain boxes, no rotors, no friction.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .arms import DRAWINGS, Arm, Box, Shaft

#: Largest relative difference of a machine from its drawing.
SPREAD = 0.2

#: Smallest and largest relative error of the masses in the user's URDF.
MASS_ERROR = (0.1, 0.3)

#: Largest relative error of the data sheet's torque constants.
GAIN_ERROR = 0.03

#: Standard parameters by name.
Standard = dict[str, float]


@dataclass(frozen=True)
class Body:
    """A rigid body in its link's URDF frame.

    Attributes:
        mass: [kg].
        center: centre of mass [m], shape (3,).
        inertia: about the centre of mass, in the axes of the frame [kg m²], shape (3, 3).
    """

    mass: float
    center: np.ndarray
    inertia: np.ndarray


@dataclass(frozen=True)
class Machine:
    """What a machine truly is.

    Attributes:
        arm: its drawing.
        seed: what it was made with.
        bodies: true bodies.
        urdf_bodies: bodies of the user's URDF.
        vendor_bodies: bodies that the controller computes its feed-forward with.
        rotor: rotor inertias on the joint side [kg m² or kg], shape (joints,).
        viscous: friction per speed, motor and bearings together, shape (joints,).
        coulomb: dry friction, likewise.
        shafts: motors that turn with two joints.
        gain: joint torque per ampere [N m/A], shape (joints,); ones where torques are logged.
        sheet_gain: the same as in the data sheet.
        offset: constant part of the logged torque [N m or N], shape (joints,).
    """

    arm: Arm
    seed: int
    bodies: tuple[Body, ...]
    urdf_bodies: tuple[Body, ...]
    vendor_bodies: tuple[Body, ...]
    rotor: np.ndarray
    viscous: np.ndarray
    coulomb: np.ndarray
    shafts: tuple[Shaft, ...]
    gain: np.ndarray
    sheet_gain: np.ndarray
    offset: np.ndarray

    @property
    def bearing_viscous(self) -> np.ndarray:
        """Viscous friction that the logged torque contains, shape (joints,)."""
        return self.arm.bearing_share * self.viscous

    @property
    def bearing_coulomb(self) -> np.ndarray:
        """Dry friction that the logged torque contains, shape (joints,)."""
        return self.arm.bearing_share * self.coulomb

    @property
    def logged_rotor(self) -> np.ndarray:
        """Rotor inertias that the logged torque accelerates, shape (joints,)."""
        return self.rotor if self.arm.bearing_share == 1.0 else np.zeros(self.arm.size)


def machine(name: str, seed: int, exact_sheet: bool = False) -> Machine:
    """A machine and the files that come with it.

    Args:
        name: of the arm.
        seed: decides all differences from the drawing.
        exact_sheet: whether the torque constants of the data sheet are the true ones.
    """
    arm = DRAWINGS[name]
    rng = np.random.default_rng([seed, sorted(DRAWINGS).index(name), 1])

    def spread(values: Any, by: float = SPREAD) -> np.ndarray:
        return np.asarray(values, dtype=float) * rng.uniform(1 - by, 1 + by, np.shape(values))

    bodies = tuple(_made(box, rng) for box in arm.boxes)
    gain = np.ones(arm.size)
    if arm.torque_constant:
        gain = np.array(arm.torque_constant) * np.array(arm.gear_ratio)
    shafts = tuple(
        dataclasses.replace(
            s,
            inertia=float(spread(s.inertia)),
            viscous=float(spread(s.viscous)),
            coulomb=float(spread(s.coulomb)),
        )
        for s in arm.shafts
    )
    made = Machine(
        arm=arm,
        seed=seed,
        bodies=bodies,
        urdf_bodies=tuple(_misdrawn(b, x, rng) for b, x in zip(bodies, arm.boxes, strict=True)),
        vendor_bodies=tuple(
            Body(b.mass * f, b.center, b.inertia * f)
            for b, f in zip(bodies, rng.uniform(0.94, 1.06, arm.size), strict=True)
        ),
        rotor=spread(arm.rotor),
        viscous=spread(arm.viscous),
        coulomb=spread(arm.coulomb),
        shafts=shafts,
        gain=gain,
        sheet_gain=gain,
        offset=np.array(arm.coulomb) * arm.bearing_share * rng.uniform(-0.1, 0.1, arm.size),
    )
    if arm.torque_constant and not exact_sheet:
        made = dataclasses.replace(made, gain=spread(gain, GAIN_ERROR))
    return made


def _made(box: Box, rng: np.random.Generator) -> Body:
    """A body near its drawing: mass and edges ±20 %, centre ±12 mm, axes turned a little."""
    edges = np.array(box.edges) * rng.uniform(1 - SPREAD, 1 + SPREAD, 3)
    turn = _rotation(rng.uniform(-0.15, 0.15, 3))
    mass = box.mass * rng.uniform(1 - SPREAD, 1 + SPREAD)
    center = np.array(box.center) + rng.uniform(-0.012, 0.012, 3)
    return Body(mass, center, turn @ _box_inertia(mass, edges) @ turn.T)


def _misdrawn(body: Body, box: Box, rng: np.random.Generator) -> Body:
    """What a vendor's URDF says of a body: a mass off by 10 to 30 %, the inertia of a box."""
    mass = body.mass * (1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(*MASS_ERROR))
    center = np.round(body.center + rng.uniform(-0.01, 0.01, 3), 3)
    return Body(float(np.round(mass, 2)), center, _box_inertia(mass, np.array(box.edges)))


def _box_inertia(mass: float, edges: np.ndarray) -> np.ndarray:
    """Inertia of a uniform box about its centre [kg m²]: m/12 (b² + c²) and so on."""
    square = edges**2
    return np.diag(mass / 12.0 * (square.sum() - square))


def _rotation(vector: np.ndarray) -> np.ndarray:
    """Rotation matrix of a rotation vector (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def true_standard(made: Machine, names: Sequence[str], frozen: Mapping[str, float]) -> Standard:
    """Standard parameters of the machine by name, as far as the logged torque contains them.

    The true bodies go through the same URDF reader as the user's, so that they stand in the same
    frames; rotors, friction, offsets and shafts are put beside them.

    Args:
        made: the machine.
        names: joints that the user keeps, in order.
        frozen: positions of the others [rad or m].
    """
    from pivident.robot.description import INERTIAL
    from pivident.robot.urdf import parse_urdf

    from .models import urdf

    viscous, rotor = made.bearing_viscous.copy(), made.logged_rotor.copy()
    for s in made.shafts:  # the coupling's own columns hold what goes across only
        rotor[[s.motor, s.joint]] += np.array([s.inertia, s.inertia * s.ratio**2])
        viscous[[s.motor, s.joint]] += np.array([s.viscous, s.viscous * s.ratio**2])
    places = [joint.name for joint in made.arm.joints]
    robot = parse_urdf(urdf(made.arm, made.bodies), joints=names, frozen=frozen)
    standard: Standard = {}
    for i, name in enumerate(names):
        at, label = places.index(name), robot.label(i)
        bodies = zip(INERTIAL, robot.links[i].inertia.tolist(), strict=True)
        standard |= {f"{stem}{label}": value for stem, value in bodies}
        own = {"ia": rotor, "fv": viscous, "fc": made.bearing_coulomb, "off": made.offset}
        standard |= {f"{stem}{label}": float(values[at]) for stem, values in own.items()}
    for s in made.shafts:
        if places[s.motor] in names:
            label = robot.label(list(names).index(places[s.motor]))
            across = {"iam": s.inertia, "fvm": s.viscous, "fcm": s.coulomb}
            standard |= {f"{stem}{label}": value for stem, value in across.items()}
    return standard


def true_base_parameters(made: Machine, robot: Any) -> dict[str, float]:
    """Base parameters of the machine in the grouping of a user's robot.

    Args:
        made: the machine.
        robot: the `pivident.Robot` of the user's experiment, under the default friction law.

    Returns:
        Value by name, as far as the logged torque contains it.
    """
    from pivident.dynamics.base_parameters import base_parameters

    base = base_parameters(robot)
    frozen = robot.urdf.frozen if robot.urdf else {}
    standard = true_standard(made, robot.joint_names, frozen)
    values = np.array([standard[p.name] for p in base.standard])
    return dict(zip(base.names, base.values(values).tolist(), strict=True))


def value_of_group(expression: str, standard: Standard) -> float:
    """Value of a group as results print it, ``zz1 + ia1 + 0.1225 m2``; NaN if it has others.

    Args:
        expression: the group.
        standard: standard parameters by name.
    """
    total, sign, factor = 0.0, 1.0, 1.0
    for word in expression.split():
        if word in "+-":
            sign, factor = (1.0 if word == "+" else -1.0), 1.0
        elif word[0].isdigit():
            factor = float(word)
        else:
            total += sign * factor * standard.get(word, np.nan)
    return total
