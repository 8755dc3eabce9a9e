"""Mass matrix and gravity of a robot as programs, by composite bodies.

The links behind a joint, taken as one body at rest, have the inertial parameters (J, h, m), which
are transformed from a link's frame to its parent's by

    h' = R h,   J ← J + R J Rᵀ - (p h'ᵀ + h' pᵀ) + 2 (p·h') 1 + m (p·p 1 - p pᵀ),   h ← h + h' + m p

The mass matrix needs all of them (Walker and Orin 1982; Khalil and Dombre, chapter 9.7.1), gravity
the first moments and the mass only: tau = z·(h × a) or m z·a, with a the acceleration that replaces
gravity.
"""

from __future__ import annotations

import numpy as np

from pivident.dynamics.grouping.expressions import ZERO, Expression
from pivident.models.symbolic.assignments import Output, output_array
from pivident.models.symbolic.link_motion import link_motion
from pivident.models.symbolic.model_symbols import Columns, LinkInertia, ModelSymbols
from pivident.models.symbolic.newton_euler import Hints, cheapest, rigid_torques
from pivident.models.symbolic.program import Program
from pivident.models.symbolic.robot_symbols import (
    mass_of_given_joints,
    on_given_joints,
    robot_symbols,
)
from pivident.models.symbolic.sums import JointFrame, Tensor, Vector, cross, plus, scaled
from pivident.robot.description import Robot


def mass_matrix(
    robot: Robot, parameters: Columns = "base", values: np.ndarray | None = None
) -> Program:
    """Mass matrix M(q) with rotor inertias, shape (joints, joints), as a program.

    Parameters that are not among ``parameters`` are zero; without ``values`` they are the argument
    ``theta``. Likewise in the other models.
    """
    model = robot_symbols(robot, parameters, values)
    frames = [m.frame for m in link_motion(model, speeds=False, accelerations=False)]
    bodies = composite_bodies(model, frames)
    robot, n = model.robot, model.robot.size
    matrix = np.full((n, n), ZERO, dtype=object)
    for i, body in enumerate(bodies):
        h, j = body.moments, body.tensor
        revolute = robot.joints[i].kind == "revolute"
        # force and moment of a unit acceleration of joint i
        force: Vector = (-h[1], h[0], ZERO) if revolute else (ZERO, ZERO, body.mass)
        moment: Vector = (j.xz, j.yz, j.zz) if revolute else (h[1], -h[0], ZERO)
        link = i
        while link >= 0:
            along = moment[2] if robot.joints[link].kind == "revolute" else force[2]
            matrix[i, link] = matrix[link, i] = along
            frame, link = frames[link], robot.joints[link].parent
            force, moment = frame.back(force), frame.back(moment)
            moment = plus(moment, cross(frame.origin, force))
    for p, value in zip(model.parameters, model.theta, strict=True):
        if p.stem == "ia":
            matrix[p.joint, p.joint] = matrix[p.joint, p.joint] + value
        elif p.stem == "iam" and p.coupling is not None:
            a, b = p.coupling.motor, p.coupling.joint
            matrix[a, b] = matrix[b, a] = matrix[a, b] + p.coupling.ratio * value
    return Program.build(
        "mass_matrix",
        model.inputs("q"),
        model.argument,
        [
            Output(
                "mass",
                mass_of_given_joints(model, matrix),
                "mass matrix [kg m^2, kg m or kg], row by row",
            )
        ],
        title=f"Mass matrix of {robot.name}",
        hints=[*model.hints, *_hints(frames, bodies)],
        closing=model.closing,
    )


def gravity_vector(
    robot: Robot, parameters: Columns = "base", values: np.ndarray | None = None
) -> Program:
    """Torques g(q) that hold the links against gravity, without springs, as a program."""
    model = robot_symbols(robot, parameters, values)
    candidates = [_gravity_of_composites(model, combine) for combine in (True, False)]
    still = {"speeds": False, "accelerations": False}
    candidates += [rigid_torques(model, combine=combine, **still) for combine in (True, False)]
    torques, hints = cheapest(model, candidates)
    torques = on_given_joints(model, torques)
    return Program.build(
        "gravity_vector",
        model.inputs("q"),
        model.argument,
        [Output("g", output_array(torques), "torques or forces against gravity [N m or N]")],
        title=f"Gravity of {robot.name}",
        hints=[*model.hints, *hints],
        closing=model.closing,
    )


def composite_bodies(model: ModelSymbols, frames: list[JointFrame]) -> list[LinkInertia]:
    """Inertial parameters of each link together with all links that it carries."""
    bodies = model.inertias()
    for i in range(model.robot.size - 1, -1, -1):
        parent = model.robot.joints[i].parent
        if parent >= 0:
            bodies[parent] = _joined(bodies[parent], bodies[i], frames[i])
    return bodies


def _joined(body: LinkInertia, carried: LinkInertia, frame: JointFrame) -> LinkInertia:
    """A body and another one that it carries."""
    h, m, p = frame.back(carried.moments), carried.mass, frame.origin
    x, y, z = (p[k] * (2.0 * h[k] + m * p[k]) for k in range(3))
    along = plus(h, scaled(m, p))
    lever = Tensor(
        y + z,
        -(p[0] * h[1] + p[1] * along[0]),
        -(p[0] * h[2] + p[2] * along[0]),
        x + z,
        -(p[1] * h[2] + p[2] * along[1]),
        x + y,
    )
    tensor = body.tensor.plus(frame.tensor_back(carried.tensor)).plus(lever)
    return LinkInertia(tensor, plus(body.moments, along), body.mass + m)


def _gravity_of_composites(model: ModelSymbols, combine: bool) -> tuple[list[Expression], Hints]:
    motions = link_motion(model, speeds=False, accelerations=False, combine=combine)
    frames = [motion.frame for motion in motions]
    bodies = composite_bodies(model, frames)
    torques = []
    hints = _hints(frames, bodies)
    for i, (motion, body) in enumerate(zip(motions, bodies, strict=True)):
        revolute = model.robot.joints[i].kind == "revolute"
        torques.append(cross(body.moments, motion.a)[2] if revolute else body.mass * motion.a[2])
        hints.extend((f"a{x}{i + 1}", v) for x, v in zip("xyz", motion.a, strict=True))
    return torques, hints


def _hints(frames: list[JointFrame], bodies: list[LinkInertia]) -> Hints:
    hints: Hints = []
    for i, (frame, body) in enumerate(zip(frames, bodies, strict=True), start=1):
        hints += [(f"s{i}", frame.last.sin), (f"c{i}", frame.last.cos)]
        hints += [(f"j{name}{i}", v) for name, v in zip(Tensor._fields, body.tensor, strict=True)]
        hints += [(f"h{x}{i}", v) for x, v in zip("xyz", body.moments, strict=True)]
    return hints
