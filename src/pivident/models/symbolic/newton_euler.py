"""Customised Newton–Euler: inverse model and observation matrix of one robot, without zero terms.

The method is that of Khalil and Kleinfinger (1987; Khalil and Dombre, *Modeling, Identification
and Control of Robots*, chapter 9.6): the recursion of Newton and Euler is carried out once in
symbols, linear in the inertial parameters (inertia J at the frame's origin, first moments h), with
base parameters, so that most of them are zero. Products with zero are never written, unused
quantities are dropped, and common subexpressions are computed once.

    f_i = m a + U h,     n_i = J dω + ω × J ω + h × a            of each link
    f_j += R f_i,        n_j += R n_i + p × R f_i                 from the tip to the base
    tau_i = z·n_i (revolute) or z·f_i (prismatic), plus rotor and friction of the joint

The observation matrix of a robot as a program: tau = Φ(q, dq, ddq) θ.

A column of link i is the force and moment (f, n) of one unit parameter, at the origin of the link's
frame. Its entry in the row of joint j is the power of this wrench at a unit speed of that joint,
v·f + w·n, with (v, w) the velocity that the joint gives to the link's origin and frame. Wrench and
velocity have many structural zeros. Of a mechanism with closed loops the rows are those of its
independent joints, and a unit speed of one of them moves all joints by a column of N.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pivident.dynamics.grouping.expression_graph import symbol
from pivident.dynamics.grouping.expressions import (
    ONE,
    ZERO,
    Constant,
    Expression,
    Multiply,
    Symbol,
    operation_count,
)
from pivident.dynamics.parameters import Parameter
from pivident.models.symbolic.assignments import Input, Output, output_array
from pivident.models.symbolic.link_motion import LinkMotion, given_velocities, link_motion
from pivident.models.symbolic.model_symbols import (
    Columns,
    LinkInertia,
    ModelSymbols,
    depends_on_load,
    has_memory,
    inner_name,
    joint_column,
    joints_of,
)
from pivident.models.symbolic.program import Program
from pivident.models.symbolic.robot_symbols import on_given_joints, robot_symbols
from pivident.models.symbolic.sums import NULL, Vector, cross, dot, is_null, plus, scaled
from pivident.robot.description import INERTIAL, Robot

Hints = list[tuple[str, Expression]]
Wrench = tuple[Vector, Vector]


def inverse_model(
    robot: Robot,
    parameters: Columns = "base",
    values: np.ndarray | None = None,
    *,
    rotors: bool = True,
    friction: bool = True,
) -> Program:
    """Inverse dynamic model tau(q, dq, ddq), as a program.

    Args:
        robot: the robot.
        parameters: parameters of the model (base, standard or chosen ones); others are zero.
        values: their values, shape (parameters,), folded into the program; None: they are its
            argument ``theta``.
        rotors: whether rotor inertias ``ia`` and their couplings are in it.
        friction: whether friction, springs and coupled friction are in it.

    Returns:
        A program of ``q dq ddq`` (and of ``inner``, the columns of friction with memory, where
        there is such friction) and ``theta`` with the output ``tau``.
    """
    model = robot_symbols(robot, parameters, values)
    inner = inner_symbols(model, load=False) if friction else {}
    body, hints = cheapest(model, (rigid_torques(model, combine=c) for c in (True, False)))
    own = joint_torques(model, body, inner, rotors, friction)
    total = on_given_joints(model, [a + b for a, b in zip(body, own, strict=True)])
    notes = [
        f"{p.name}: its friction has a memory; give its column as {inner[key].name}."
        for key, p in _inner_parameters(model)
        if key in inner
    ]
    inputs = [*model.inputs("q", "dq", "ddq"), *inner_input(inner)]
    return Program.build(
        "inverse_model",
        inputs,
        model.argument,
        [Output("tau", output_array(total), "joint torques or forces [N m or N]")],
        title=f"Inverse dynamic model of {robot.name}",
        hints=[*model.hints, *hints],
        notes=notes,
        closing=model.closing,
    )


def coriolis_vector(
    robot: Robot, parameters: Columns = "base", values: np.ndarray | None = None
) -> Program:
    """Torques of Coriolis and centrifugal forces c(q, dq), without gravity and friction.

    Joints that closed loops move along are accelerated by γ, at constant speeds of the others.
    """
    model = robot_symbols(robot, parameters, values)
    steady = replace(model, ddq=model.drift)
    torques, hints = cheapest(
        model, (rigid_torques(steady, combine=c, gravity=False) for c in (True, False))
    )
    return Program.build(
        "coriolis_vector",
        model.inputs("q", "dq"),
        model.argument,
        [
            Output(
                "c",
                output_array(on_given_joints(model, torques)),
                "torques of Coriolis and centrifugal forces [N m]",
            )
        ],
        title=f"Coriolis and centrifugal torques of {robot.name}",
        hints=[*model.hints, *hints],
        closing=model.closing,
    )


def rigid_torques(
    model: ModelSymbols,
    *,
    combine: bool,
    speeds: bool = True,
    accelerations: bool = True,
    gravity: bool = True,
) -> tuple[list[Expression], Hints]:
    """Torques of the links, without rotors and friction, and names of intermediate quantities."""
    motions = link_motion(
        model, speeds=speeds, accelerations=accelerations, gravity=gravity, combine=combine
    )
    forces: list[Vector] = []
    moments: list[Vector] = []
    hints: Hints = []
    for i, (motion, inertia) in enumerate(zip(motions, model.inertias(), strict=True)):
        hints.extend(motion.hints(i + 1))
        force, moment = link_wrench(motion, inertia)
        hints.extend(_named("f", i, force))
        hints.extend(_named("n", i, moment))
        forces.append(force)
        moments.append(moment)
    joints = model.robot.joints
    torques = [ZERO] * model.robot.size
    for i in range(model.robot.size - 1, -1, -1):
        hints.extend(_named("ft", i, forces[i]))
        hints.extend(_named("nt", i, moments[i]))
        torques[i] = moments[i][2] if joints[i].kind == "revolute" else forces[i][2]
        parent = joints[i].parent
        if parent >= 0:
            frame = motions[i].frame
            force, moment = frame.back(forces[i]), frame.back(moments[i])
            forces[parent] = plus(forces[parent], force)
            moments[parent] = plus(moments[parent], moment, cross(frame.origin, force))
    return torques, hints


def link_wrench(motion: LinkMotion, inertia: LinkInertia) -> tuple[Vector, Vector]:
    """Force and moment (f, n) that move a link, at its frame's origin.

    With the products of the speeds, n = J dω + ω × J ω is

        n_x = xx dω_x + (zz - yy) ω_y ω_z - xy U_31 + xz U_21 + yz (ω_y² - ω_z²)

    and cyclically.
    """
    w, dw, u, a = motion.squares, motion.dw, motion.u, motion.a
    j, h = inertia.tensor, inertia.moments
    xy, xz, yz = motion.products
    moment = (
        j.xx * dw[0] + (j.zz - j.yy) * yz - j.xy * u[2][0] + j.xz * u[1][0] + j.yz * (w[1] - w[2]),
        j.yy * dw[1] + (j.xx - j.zz) * xz - j.yz * u[0][1] + j.xy * u[2][1] + j.xz * (w[2] - w[0]),
        j.zz * dw[2] + (j.yy - j.xx) * xy - j.xz * u[1][2] + j.yz * u[0][2] + j.xy * (w[0] - w[1]),
    )
    force = plus(scaled(inertia.mass, a), (dot(u[0], h), dot(u[1], h), dot(u[2], h)))
    return force, plus(moment, cross(h, a))


def joint_torques(
    model: ModelSymbols,
    body: Sequence[Expression],
    inner: Mapping[tuple[int, int], Expression],
    rotors: bool = True,
    friction: bool = True,
) -> list[Expression]:
    """Torques of rotors, friction, springs and couplings.

    ``body`` are the torques of the links, the load of load-dependent friction; ``inner`` the
    columns of friction with memory, by joint and parameter.
    """
    torques = [ZERO] * model.robot.size
    load = list(body)
    for late in (False, True):  # load-dependent friction comes last
        for k, (p, value) in enumerate(zip(model.parameters, model.theta, strict=True)):
            wanted = rotors if p.stem in ("ia", "iam") else friction
            if p.is_inertial or not wanted or depends_on_load(p) != late:
                continue
            for joint in joints_of(p):
                known = load[joint] if late else inner.get((joint, k))
                torque = _weighted(value, joint_column(model, p, joint, known))
                torques[joint] = torques[joint] + torque
                if p.carries_load:
                    load[joint] = load[joint] + torque
    return torques


def _weighted(value: Expression, column: Expression) -> Expression:
    """A parameter times a column, with the column's constant factor on the parameter."""
    if isinstance(column, Multiply) and isinstance(column.operands[0], Constant):
        return (value * column.operands[0]) * column.operands[1]
    return value * column


def inner_symbols(model: ModelSymbols, load: bool) -> dict[tuple[int, int], Symbol]:
    """Symbols of memory (and load) by joint and number of the parameter, as in the regressor."""
    return {
        key: symbol(inner_name(p)) for key, p in _inner_parameters(model) if has_memory(p) or load
    }


def inner_input(inner: Mapping[tuple[int, int], Symbol]) -> list[Input]:
    """The inner signals as an argument of a program, none if there are none."""
    if not inner:
        return []
    return [Input("inner", tuple(inner.values()), "columns of friction with memory or load")]


def _inner_parameters(model: ModelSymbols) -> list[tuple[tuple[int, int], Parameter]]:
    found = [
        ((p.joint, k), p)
        for k, p in enumerate(model.parameters)
        if has_memory(p) or depends_on_load(p)
    ]
    return sorted(found, key=lambda item: item[0])


def cheapest(
    model: ModelSymbols, candidates: Iterable[tuple[list[Expression], Hints]]
) -> tuple[list[Expression], Hints]:
    """The form of a model's torques with the fewest operations; the first of equal ones."""
    return min(candidates, key=lambda c: operation_count(on_given_joints(model, c[0])).price)


def _named(stem: str, link: int, vector: Vector) -> Hints:
    if is_null(vector):
        return []
    return [(f"{stem}{x}{link + 1}", v) for x, v in zip("xyz", vector, strict=True)]


def observation_matrix(robot: Robot, parameters: Columns = "base") -> Program:
    """Observation matrix Φ(q, dq, ddq), shape (joints, parameters), as a program.

    Its arguments are ``q dq ddq`` and ``inner``, the columns of friction with memory and the loads
    of load-dependent friction in the order of `Regressor.inner_entries`; the output is ``phi``.

    Args:
        robot: the robot.
        parameters: columns: ``base``, ``standard``, or chosen base parameters.

    Returns:
        The program.
    """
    model = robot_symbols(robot, parameters)
    inner = inner_symbols(model, load=True)
    candidates = [_matrix(model, inner, combine) for combine in (True, False)]
    matrix, hints = min(
        candidates, key=lambda candidate: operation_count(candidate[0].ravel()).price
    )
    notes = ["Columns: " + " ".join(s.name for s in model.argument.symbols)]
    if inner:
        notes.append(
            "inner: columns of friction with memory or load, in this order: "
            + " ".join(model.parameters[k].name for _, k in inner)
        )
    return Program.build(
        "observation_matrix",
        [*model.inputs("q", "dq", "ddq"), *inner_input(inner)],
        Input("theta", (), ""),
        [Output("phi", output_array(matrix), "observation matrix, row by row")],
        title=f"Observation matrix of {robot.name}",
        hints=[*model.hints, *hints],
        notes=notes,
        closing=model.closing,
    )


def _matrix(
    model: ModelSymbols, inner: Mapping[tuple[int, int], Expression], combine: bool
) -> tuple[np.ndarray, Hints]:
    motions = link_motion(model, combine=combine)
    matrix = np.full((len(model.places), len(model.parameters)), ZERO, dtype=object)
    hints: Hints = []
    for i, motion in enumerate(motions):
        hints.extend(motion.hints(i + 1))
        columns = {k: p for k, p in enumerate(model.parameters) if p.is_inertial and p.joint == i}
        wrenches = {k: unit_wrench(motion, p) for k, p in columns.items()}
        for j, (v, w) in given_velocities(model, motions, i):
            for name, vector in (("v", v), ("t", w)):
                hints.extend(
                    (f"{name}{x}{j + 1}_{i + 1}", e) for x, e in zip("xyz", vector, strict=True)
                )
            for k, (force, moment) in wrenches.items():
                matrix[j, k] = dot(v, force) + dot(w, moment)
    for k, p in enumerate(model.parameters):
        if not p.is_inertial:
            for joint in joints_of(p):
                entry = _joint_entry(model, p, joint, inner.get((joint, k)))
                if model.gain is None:
                    matrix[joint, k] = entry
                else:
                    matrix[:, k] += model.gain[joint] * entry
    return matrix, hints


def _joint_entry(
    model: ModelSymbols, p: Parameter, joint: int, inner: Expression | None
) -> Expression:
    """Entry of a rotor or of friction; an inner signal is the entry itself."""
    return joint_column(model, p, joint) if inner is None else inner


def unit_wrench(motion: LinkMotion, p: Parameter) -> Wrench:
    """Force and moment of one inertial parameter of 1, at the link's origin."""
    w, dw, u, a = motion.squares, motion.dw, motion.u, motion.a
    xy, xz, yz = motion.products
    column = INERTIAL.index(p.stem)
    if column < 6:
        moments: tuple[Vector, ...] = (
            (dw[0], xz, -xy),
            (-u[2][0], u[2][1], w[0] - w[1]),
            (u[1][0], w[2] - w[0], -u[1][2]),
            (-yz, dw[1], xy),
            (w[1] - w[2], -u[0][1], u[0][2]),
            (yz, -xz, dw[2]),
        )
        return NULL, moments[column]
    if p.stem == "m":
        return a, NULL
    k = column - 6
    axis = tuple(ONE if i == k else ZERO for i in range(3))
    return (u[0][k], u[1][k], u[2][k]), cross((axis[0], axis[1], axis[2]), a)
