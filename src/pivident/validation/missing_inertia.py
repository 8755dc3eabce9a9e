"""Inertia that a description lacks, reported where a simulation that starts from it fails.

A URDF has no place for rotors. Behind a gear of ratio r a rotor counts r² times, at the wrist more
than the link it turns; without it the controller's gains, which were tuned on the machine, act on
a much lighter arm, and the sampled loop of that arm diverges.
"""

from __future__ import annotations

import re

import numpy as np

from pivident.dynamics.forward import mass_matrix
from pivident.errors import ExperimentError
from pivident.estimation.problem import Problem
from pivident.simulation.joint_loop import JointFeedback, JointLoop, joint_feedbacks

#: Largest inertia that is tried, relative to that of the links, and how many there are.
REACH, TRIED = 1e4, 81


def missing_inertia(problem: Problem) -> list[str]:
    """What the robot's description lacks, one sentence for links and one for rotors."""
    return [*_links(problem), *_rotors(problem)]


def _links(problem: Problem) -> list[str]:
    """Links without a nominal inertia."""
    tree = problem.robot.tree
    empty = [
        f"{link.name!r} (joint {joint.name!r})"
        for joint, link in zip(tree.joints, tree.links, strict=True)
        if link.is_body and not link.inertia.any()
    ]
    if not empty:
        return []
    return [
        f"the nominal inertia of link {', '.join(empty)} is zero and the simulation starts from "
        "it: give <inertial> in the URDF or link in the table, rotor_inertia under [robot], or "
        "initial values from a least-squares run"
    ]


def _rotors(problem: Problem) -> list[str]:
    """Rotors without a nominal inertia, and how much inertia their loops need."""
    robot = problem.robot
    if robot.torque_side == "link":
        return []  # they are no part of its model
    without = [
        j
        for j in range(robot.size)
        if robot.rotor_inertia[j] == 0.0
        and robot.links[j].inertia.any()
        and not _starts_elsewhere(problem, j)
    ]
    if not without:
        return []
    names = ", ".join(repr(robot.joints[j].name) for j in without)
    table = ", ".join(f"{robot.joints[j].name} = …" for j in without)
    text = (
        f"the rotor inertia of {names} is zero in the robot's description, and the simulation "
        f"starts from it: give rotor_inertia = {{{table}}} under [robot], in kg m² on the joint "
        "side, the motor's times the gear ratio squared; a least-squares run (-m ls) estimates "
        "it as ia"
    )
    wanted = _wanted(problem, without)
    if wanted:
        text += f". With these gains {'; '.join(wanted)}"
    return [text]


def _starts_elsewhere(problem: Problem, j: int) -> bool:
    """Whether an initial value stands for the rotor of a joint, alone or in a group."""
    name = f"ia{problem.robot.label(problem.robot.places[j])}"
    rotor = re.compile(rf"(?<!\w){re.escape(name)}(?!\w)")
    given = {name.lower().removesuffix("r") for name in problem.initial}
    return any(
        head.name.lower() in given and rotor.search(group)
        for head, group in zip(problem.base.parameters, problem.base.expressions, strict=True)
    )


def _wanted(problem: Problem, joints: list[int]) -> list[str]:
    """How much inertia is missing at least where the linear loop of the bare links is unstable.

    The inertia against which a drive works, with the other joints free, is 1/(M⁻¹)_jj.
    """
    loop, recording, robot = problem.loop, problem.recordings[0], problem.robot
    assert loop is not None, "a simulation has one"
    if robot.base_joints:
        return []  # whose mass matrix is not that of the arm alone
    try:
        feedbacks = joint_feedbacks(loop.controller, recording.control_rate, robot.size)
        mass = mass_matrix(
            robot, problem.regressor.parameters, problem.initial_values(), recording.q[:1]
        )[0]
        own = 1.0 / np.diag(np.linalg.inv(mass))
    except (ExperimentError, np.linalg.LinAlgError):
        return []  # a law that is a function, or a link without any inertia
    gains = np.broadcast_to(np.asarray(loop.drive_gain, float), (robot.size,))
    found = []
    for j in joints:
        least = _least_inertia(own[j], feedbacks[j], float(gains[j]), recording.drive_delay)
        if least > own[j]:
            unit = "kg m²" if robot.joints[j].kind == "revolute" else "kg"
            found.append(
                f"the loop of {robot.joints[j].name!r} is unstable at {recording.control_rate:.5g} "
                f"Hz below about {least:.2g} {unit}, of which its links give {own[j]:.2g} {unit}"
            )
    return found


def _least_inertia(links: float, feedback: JointFeedback, gain: float, delay: float) -> float:
    """Smallest inertia at or above that of the links with which the loop is stable.

    NaN where there is none.
    """
    if not links > 0.0:
        return np.nan
    for inertia in links * np.geomspace(1.0, REACH, TRIED):
        if JointLoop(float(inertia), 0.0, feedback, gain, delay).is_stable:
            return float(inertia)
    return np.nan
