"""The observation matrix of a robot as a program: tau = Φ(q, dq, ddq) θ.

A column of link i is the force and moment (f, n) of one unit parameter, at the origin of the link's
frame. Its entry in the row of joint j is the power of this wrench at a unit speed of that joint,
v·f + w·n, with (v, w) the velocity that the joint gives to the link's origin and frame. Wrench and
velocity have many structural zeros. Of a mechanism with closed loops the rows are those of its
independent joints, and a unit speed of one of them moves all joints by a column of N.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pivident.dynamics.grouping.expressions import ONE, ZERO, Expression, operation_count
from pivident.dynamics.parameters import Parameter
from pivident.robot.description import INERTIAL, Robot
from pivident.symbolic.assignments import Input, Output, output_array
from pivident.symbolic.joint_terms import joint_column, joints_of
from pivident.symbolic.link_motion import LinkMotion, given_velocities, link_motion
from pivident.symbolic.model_symbols import Columns, ModelSymbols
from pivident.symbolic.newton_euler import Hints, inner_input, inner_symbols
from pivident.symbolic.program import Program
from pivident.symbolic.robot_symbols import robot_symbols
from pivident.symbolic.vectors import NULL, Vector, cross, dot

Wrench = tuple[Vector, Vector]


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
