"""From the tree of an MJCF file and its constraints to a robot of independent joints.

A file says which joints have motors by its actuators. Where their number is not that of the
freedoms, a joint that an equality makes a function of another one follows it; else the user says
which joints have none.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pivident.errors import RobotDescriptionError
from pivident.robot.closed_chains import assembled, closed_robot, equations
from pivident.robot.constraints import Closure, Constraints, LinearConstraint
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionLaw
from pivident.robot.mjcf_loops import Equalities
from pivident.robot.mjcf_model import actuated_joints
from pivident.robot.naming import find_joint
from pivident.robot.proportions import proportions

#: Gap of a posture in which loops count as drawn closed [m, rad].
DRAWN_CLOSED = 1e-3

#: Relative size of a singular value that counts as zero.
RANK = 1e-7


def closed_mjcf(
    tree: Robot,
    model: Any,
    names: Sequence[str],
    constraints: tuple[Sequence[Closure], Sequence[LinearConstraint], Equalities],
    joints: Sequence[str] | None,
    passive: Sequence[str] | None,
) -> Robot:
    """The robot of a tree in the order of the file, its loops closed.

    Args:
        tree: all joints that move, with nominal friction.
        model: the compiled model.
        names: of all joints of the file.
        constraints: closures and proportions of the tree, and the equalities that they come from.
        joints: order of the independent joints; None: that of the file.
        passive: joints without motors; None: as the actuators say.

    Raises:
        RobotDescriptionError: loops that do not close; joints without motors that neither
            actuators nor the user name.
    """
    loops, linear, equalities = constraints
    postures = _postures(tree, model, names, Constraints((), tuple(loops), tuple(linear)))
    if passive is None:
        dependent = _dependent(tree, loops, linear, postures)
        passive = _undriven(tree, model, names, equalities, dependent)
    passive = [tree.joint_names[find_joint(tree.joint_names, name)] for name in passive]
    order = [*(name for name in joints or () if name in tree.joint_names)]
    order += [name for name in tree.joint_names if name not in order]
    independent = [name for name in order if name not in passive]
    failure: RobotDescriptionError | None = None
    for posture in postures:
        try:
            robot = closed_robot(tree, independent, loops, linear, posture)
        except RobotDescriptionError as error:
            failure = failure or error
            continue
        return _with_rotors(_with_own_friction(robot), tree.rotor_inertia)
    assert failure is not None
    raise RobotDescriptionError(
        f"{failure}. Joints without motors are {', '.join(passive) or 'missing'}",
        advice="passive = […] under [robot] names others, a <key> of the file another posture to "
        "start from",
    ) from failure


def _postures(
    tree: Robot, model: Any, names: Sequence[str], constraints: Constraints
) -> list[np.ndarray]:
    """The drawn pose and the keyframes, those first in which the loops are closed."""
    at = [int(model.jnt_qposadr[names.index(name)]) for name in tree.joint_names]
    found = [np.array(q[at], dtype=float) for q in (model.qpos0, *model.key_qpos)]
    return sorted(
        found, key=lambda q: bool(np.abs(equations(tree, constraints, q)[0]).max() > DRAWN_CLOSED)
    )


def _dependent(
    tree: Robot,
    loops: Sequence[Closure],
    linear: Sequence[LinearConstraint],
    postures: Sequence[np.ndarray],
) -> int:
    """How many joints the others determine: the rank of A where the loops are closed."""
    free = Constraints((), tuple(loops), tuple(linear))
    largest, failure = 0, None
    for posture in postures:
        try:
            slope = equations(tree, free, assembled(tree, free, posture))[1]
        except RobotDescriptionError as error:
            failure = failure or error
            continue
        sizes = np.linalg.svd(slope, compute_uv=False)
        largest = max(largest, int((sizes > RANK * sizes.max(initial=1.0)).sum()))
    if not largest and failure is not None:
        raise RobotDescriptionError(f"{failure}: add a <key> in which it is closed") from failure
    return largest


def _undriven(
    tree: Robot, model: Any, names: Sequence[str], equalities: Equalities, dependent: int
) -> list[str]:
    """Joints of loops and proportions that have no motor.

    Raises:
        RobotDescriptionError: their number is not that of the dependent joints.
    """
    driven = actuated_joints(model)
    on_loops = {k for one in equalities.meetings for k in one.joints}
    geared = {k for one in equalities.proportions for k in one.joints}
    follow = {one.follower for one in equalities.proportions if one.follower is not None}
    moving = {k for k, name in enumerate(names) if name in tree.joint_names}
    for choice in ((on_loops | geared) - driven, (on_loops - driven) | follow):
        if len(choice & moving) == dependent:
            return [names[k] for k in sorted(choice & moving)]
    touched = (on_loops | geared) & moving

    def listed(joints: Iterable[int]) -> str:
        return ", ".join(names[k] for k in sorted(joints)) or "none"

    raise RobotDescriptionError(
        f"its equality constraints couple the joints {listed(touched)}, of which {dependent} "
        "follow the others",
        advice=f"actuators, on {listed(touched & driven)}, do not tell which: name those without "
        "a motor, passive = […] under [robot]",
    )


def _with_own_friction(robot: Robot) -> Robot:
    """Passive joints have only the terms of friction that the file has values for."""
    label = {joint.name: robot.label(i) for i, joint in enumerate(robot.tree.joints)}
    laws = {
        joint.name: FrictionLaw(
            tuple(
                term
                for term in joint.friction.terms
                if f"{term.stem}{label[joint.name]}" in robot.friction_nominal
            )
        )
        for joint in robot.passive_joints
    }
    return robot.with_friction(laws)


def _with_rotors(robot: Robot, rotor: np.ndarray) -> Robot:
    """Rotors of followers, J_a + Σ n² J where one joint moves them in proportion."""
    others = [i for i in range(rotor.size) if i not in robot.places]
    own = rotor[list(robot.places)].copy()
    loaded = [i for i in others if rotor[i]]
    if not loaded:
        return robot
    found = proportions(robot)
    for i in loaded:
        moved_by = [] if found is None else np.flatnonzero(found[0][i]).tolist()
        if found is None or len(moved_by) > 1:
            raise RobotDescriptionError(
                f"joint {robot.tree.joints[i].name!r} has armature = {rotor[i]:g} but no motor, "
                "and a loop moves it",
                advice="rotor inertias are in the model of joints with motors only: remove its "
                "armature, or add it to the inertia of its body",
            )
        for a in moved_by:
            own[a] += found[0][i, a] ** 2 * rotor[i]
    return replace(robot, rotor_inertia=own)
