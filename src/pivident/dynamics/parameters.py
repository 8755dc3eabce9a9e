"""The standard parameters of a robot: names, order, units; (P-2).

Order: for each link ``xx xy xz yy yz zz mx my mz m``, its rotor inertia ``ia`` (but where torques
are measured behind the gears) and the terms of its friction law (``fv fc off`` …), then for each
declared coupling ``iam fvm fcm``. On a serial arm a parameter is shown with the number of its
joint (``zz1``); on a tree with the joint's name (``zz[left_elbow]``), because a number would not
identify the joint there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pivident.robot.description import INERTIAL, Coupling, JointKind, Robot
from pivident.robot.friction_term import FrictionTerm


@dataclass(frozen=True)
class Parameter:
    """One parameter of the linear dynamic model.

    Attributes:
        name: display name, unique in its robot.
        stem: kind of parameter (``zz``, ``ia``, ``fv``, ``fcm`` …).
        joint: index of the joint (or link) it belongs to.
        unit: unit on the joint side.
        friction: the friction term, for friction parameters.
        coupling: the coupling, for coupling parameters.
    """

    name: str
    stem: str
    joint: int
    unit: str
    friction: FrictionTerm | None = None
    coupling: Coupling | None = None

    @property
    def is_inertial(self) -> bool:
        """Whether it is one of a link's ten inertial parameters."""
        return self.stem in INERTIAL

    @property
    def is_dissipative(self) -> bool:
        """Whether physics demands that it is not negative (friction levels, rotor inertias)."""
        if self.friction is not None:
            return self.friction.is_dissipative
        return self.stem in ("ia", "iam", "fvm", "fcm")

    @property
    def carries_load(self) -> bool:
        """Whether its torque is part of the load that load-dependent friction grows with.

        The load is the torque of inertia, gravity and springs: what a joint carries, without
        friction, offset and ripple.
        """
        if self.friction is not None:
            return self.friction.carries_load
        return self.is_inertial or self.stem in ("ia", "iam")


def standard_parameters(robot: Robot) -> tuple[Parameter, ...]:
    """All parameters of the linear model, in the order of the module's docstring.

    Those of a closed mechanism count joints and links in its tree. Its passive joints, and those of
    a measured base, have no rotor inertia, and links that are no bodies no inertia.
    """
    parameters = []
    driven, robot = robot.with_motors, robot.tree
    for i, joint in enumerate(robot.joints):
        label = robot.label(i)
        for stem in INERTIAL if robot.links[i].is_body else ():
            unit = "kg" if stem == "m" else "kg m" if stem.startswith("m") else "kg m²"
            parameters.append(Parameter(f"{stem}{label}", stem, i, unit))
        rotor_unit = "kg m²" if joint.kind == "revolute" else "kg"
        if robot.torque_side == "motor" and i in driven:
            parameters.append(Parameter(f"ia{label}", "ia", i, rotor_unit))
        for term in joint.friction.terms:
            unit = friction_unit(term, joint.kind)
            parameters.append(Parameter(f"{term.stem}{label}", term.stem, i, unit, friction=term))
    for coupling in robot.couplings:
        parameters.extend(_coupling_parameters(robot, coupling))
    return tuple(parameters)


def on_fixed_base(
    robot: Robot, parameters: tuple[Parameter, ...]
) -> tuple[np.ndarray, tuple[Parameter, ...]]:
    """Those of some parameters that a robot has without its measured base.

    Args:
        robot: the robot with its base.
        parameters: parameters of it.

    Returns:
        Their indices, and the parameters as `Robot.on_fixed_base` counts its joints.
    """
    first = robot.base_joints
    if not first:
        return np.arange(len(parameters)), parameters
    pairs = dict(zip(robot.couplings, robot.on_fixed_base.couplings, strict=True))
    chosen = [k for k, p in enumerate(parameters) if p.joint >= first]
    moved = (
        replace(p, joint=p.joint - first, coupling=pairs[p.coupling] if p.coupling else None)
        for p in (parameters[k] for k in chosen)
    )
    return np.array(chosen, dtype=np.int64), tuple(moved)


def friction_unit(term: FrictionTerm, kind: JointKind) -> str:
    """Unit of a friction parameter: that of the torque over that of its function."""
    torque, position = _units(kind)
    if term.column.grows_with:
        return f"{torque}/{torque if term.column.grows_with == 'load' else position}"
    if term.exponent == 1.0:
        return f"{torque} s/{position}"
    if term.exponent == 0.0:
        return torque
    return f"{torque} (s/{position})^{term.exponent:g}"


def nominal_values(robot: Robot, parameters: tuple[Parameter, ...]) -> np.ndarray:
    """Nominal (CAD) value of each standard parameter, zero where none is known."""
    values, robot = np.zeros(len(parameters)), robot.tree
    for k, p in enumerate(parameters):
        if p.is_inertial:
            values[k] = robot.links[p.joint].inertia[INERTIAL.index(p.stem)]
        elif p.stem == "ia":
            values[k] = robot.rotor_inertia[p.joint]
        else:
            values[k] = robot.friction_nominal.get(p.name, 0.0)
    return values


def _coupling_parameters(robot: Robot, coupling: Coupling) -> list[Parameter]:
    label = robot.label(coupling.motor)
    torque, speed = _units(robot.joints[coupling.motor].kind)
    inertia_unit = "kg m²" if robot.joints[coupling.motor].kind == "revolute" else "kg"
    wanted = (
        ("iam", inertia_unit, coupling.inertia),
        ("fvm", f"{torque} s/{speed}", coupling.viscous),
        ("fcm", torque, coupling.coulomb),
    )
    return [
        Parameter(f"{stem}{label}", stem, coupling.motor, unit, coupling=coupling)
        for stem, unit, present in wanted
        if present
    ]


def _units(kind: str) -> tuple[str, str]:
    return ("N m", "rad") if kind == "revolute" else ("N", "m")
