"""A model as programs with its numbers folded in, the source of C and NumPy files.

The programs are customised to the robot (see `pivident.symbolic`) and written in the base
parameters, which give the same torques with fewer operations than the standard ones.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters
from pivident.dynamics.parameters import Parameter
from pivident.dynamics.robot_regressor import regressor_of
from pivident.models.runnable_model import RunnableModel
from pivident.text.identifiers import one_line

if TYPE_CHECKING:
    from pivident.symbolic.program import Program

#: Names of the programs in the exported file.
NAMES = ("inverse_dynamics", "gravity", "mass_matrix", "regressor")


@dataclass(frozen=True, eq=False)
class ModelColumns:
    """The parameters that the programs are written in: base parameters, or standard ones."""

    columns: BaseParameters | tuple[Parameter, ...]
    parameters: tuple[Parameter, ...]  # columns of the observation matrix
    names: tuple[str, ...]
    values: np.ndarray  # (parameters,)


def model_columns(model: RunnableModel) -> ModelColumns:
    """Base parameters; standard ones where friction is grouped with them."""
    if friction_in_groups(model.base):
        names = tuple(p.name for p in model.parameters)
        return ModelColumns(model.parameters, model.parameters, names, model.values)
    base = model.base
    return ModelColumns(base, base.parameters, base.names, model.base_values)


def model_programs(model: RunnableModel) -> tuple[Program, ...]:
    """Inverse dynamics with friction, gravity, mass matrix, and observation matrix."""
    from pivident.symbolic.composite_bodies import gravity_vector, mass_matrix
    from pivident.symbolic.newton_euler import inverse_model
    from pivident.symbolic.observation_matrix import observation_matrix

    robot, own = model.robot, model_columns(model)
    programs = (
        inverse_model(robot, own.columns, own.values),
        gravity_vector(robot, own.columns, own.values),
        mass_matrix(robot, own.columns, own.values),
        observation_matrix(robot, own.columns),
    )
    return tuple(replace(p, name=name) for p, name in zip(programs, NAMES, strict=True))


def friction_in_groups(base: BaseParameters) -> bool:
    """Whether some friction is indistinguishable from gravity, and grouped with it.

    That is so with a ripple of order one, with struts, and with the offset of a joint whose weight
    does not depend on the positions. Gravity alone, and the load of load-dependent friction, then
    need the standard parameters.
    """
    heads = np.array([base.standard[k].friction is not None for k in base.kept], dtype=bool)
    others = np.array([base.standard[k].friction is not None for k in base.dropped], dtype=bool)
    return bool((base.regrouping != 0.0)[heads[:, None] != others].any())


def header_lines(model: RunnableModel) -> list[str]:
    """Header of an exported program: robot, origin, joints with units, frames."""
    origin, robot = model.origin, model.robot
    lines = [
        f"Dynamic model of {one_line(robot.name)}, exported by pivident "
        f"{one_line(origin.version)}".rstrip()
        + ".",
        f"Parameters: {one_line(origin.method)}, "
        + ("physically consistent." if model.consistent else "not made physically consistent."),
    ]
    if origin.identification:
        lines.append(f"SHA-256 of the identification: {one_line(origin.identification)}")
    lines += [f"SHA-256 of {one_line(k)}: {one_line(v)}" for k, v in origin.sources.items()]
    lines.append("Joints, in order, position and torque on the joint side:")
    for i, joint in enumerate(robot.joints):
        units = "rad, N m" if joint.kind == "revolute" else "m, N"
        lines.append(f"  {i + 1} {one_line(joint.name)}: {joint.kind} [{units}]")
    if robot.constraints is not None:
        along = ", ".join(one_line(joint.name) for joint in robot.passive_joints)
        text = f"They move {along} along, whose inertia, weight and friction are in their torques."
        lines += textwrap.wrap(text, 96)
        lines.append("Results are NaN where the loops do not close.")
    gravity = ", ".join(repr(g) for g in robot.gravity.tolist())
    lines.append(f"Gravity in the base frame: ({gravity}) m/s^2. Link frames have the joint's axis")
    lines.append("as z. Torques are those that the drives must give, friction included.")
    return lines


def inner_columns(
    model: RunnableModel, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The argument ``inner`` of inverse dynamics (memory) and observation matrix (memory, load).

    The states (samples, joints) are taken as one path.
    """
    own = model_columns(model)
    regressor = regressor_of(model.robot, own.parameters)
    inner = regressor.inner(q.T, dq.T, ddq.T, own.values).T
    terms = [regressor.parameters[k].friction for k in regressor.column[regressor.inner_entries]]
    memory = np.array([t is not None and t.has_memory for t in terms], dtype=bool)
    return inner[:, memory], inner
