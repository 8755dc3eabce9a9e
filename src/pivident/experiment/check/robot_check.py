"""Whether a robot's description can be that of a machine: units, masses, limits, gravity."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Severity, Topic
from pivident.robot.description import INERTIAL, Joint, Link, Robot
from pivident.robot.inertia import Body

#: What this check looks at.
ROBOT = Topic("robot")

#: Limits beyond these are degrees or millimetres that nobody converted.
MAX_ANGLE, MAX_TRAVEL = 30.0, 50.0

#: Rated speeds beyond these likewise [rad/s, m/s].
MAX_TURN_SPEED, MAX_SLIDE_SPEED = 40.0, 20.0

#: Distances between joints, and from a joint to a centre of mass, beyond this are millimetres [m].
MAX_DISTANCE = 20.0

#: Share by which a principal moment may exceed the sum of the other two.
ROUNDING = 1e-3

#: No body heavier than this [kg] has a smaller radius of gyration than that [m].
HEAVY, SMALLEST = 20.0, 0.02

#: No link weighs so many times what all others weigh together, the first one aside.
HEAVIEST = 3.0

#: Gravity on Earth, and how far from it a robot's may be [m/s²].
EARTH, TOLERANCE = 9.81, 0.5


def check_robot(robot: Robot, model: str) -> list[Finding]:
    """Everything about a description that no machine has, or that an identification would miss."""
    file = Path(model).name
    findings = [*_gravity(robot)]
    robot = robot.on_fixed_base  # nobody describes a measured base
    tree = robot.tree
    for joint in tree.joints:
        findings += [*_limits(joint, file), *_distance(joint, file)]
    findings += check_bodies(robot, file)
    massless = [link.name for link in tree.links if link.is_body and not np.any(link.inertia)]
    if massless:
        text = (
            f"These links have no mass in {file}: {', '.join(massless)}."
            if len(massless) < sum(link.is_body for link in tree.links)
            else f"No link in {file} has a mass."
        )
        step = (
            "Least squares does not need them. IV and PIV start from them: give rough values "
            "of mass, centre of mass and inertia. Gains and signs of the torque cannot be "
            "compared with the description."
        )
        findings.append(_finding("warning", "no masses", text, step))
    unrated = [j.name for j in robot.joints if j.rated_speed is None]
    if unrated:
        message = f"The description has no rated speed of {', '.join(unrated)}."
        step = (
            "The mask uses the fastest motion of the record instead, the friction law "
            "5 rad/s; give velocity under <limit> of the URDF, or rated_speed."
        )
        findings.append(_finding("warning", "rated speed", message, step))
    return findings


def check_bodies(robot: Robot, file: str) -> Iterator[Finding]:
    """Links whose masses and inertias no body has.

    Whatever uses the masses of a description has to say this, not only the check of an experiment.

    Args:
        robot: the robot.
        file: what it is called.
    """
    tree = robot.on_fixed_base.tree
    masses = np.array([link.inertia[INERTIAL.index("m")] for link in tree.links])
    for k, (joint, link) in enumerate(zip(tree.joints, tree.links, strict=True)):
        own = [*_body(joint, link, file)]
        others = float(masses.sum() - masses[k])
        heavy = joint.parent >= 0 and np.count_nonzero(masses) > 2
        if not own and heavy and masses[k] > HEAVIEST * others:
            text = (
                f"The mass of link {link.name} in {file} is {masses[k]:.4g} kg, that of all others "
                f"together {others:.4g} kg."
            )
            step = "A decimal point may be lost, or it is in grams; masses are in kg."
            evidence = {"mass": Quantity(float(masses[k]), "kg"), "others": Quantity(others, "kg")}
            own = [_finding("warning", "heavy", text, step, joint.name, evidence)]
        yield from own


def _finding(
    severity: Severity,
    name: str,
    message: str,
    next_step: str,
    joint: str = "",
    numbers: Mapping[str, Quantity] | None = None,
    key: str = "model",
) -> Finding:
    """A finding about the table ``[robot]``."""
    kind = FindingKind(ROBOT, name, ("robot", key))
    return kind.finding(severity, message, joint, next_step, numbers)


def _gravity(robot: Robot) -> Iterator[Finding]:
    size = float(np.linalg.norm(robot.gravity))
    if size == 0.0:
        text = "Gravity is zero in the description."
        step = (
            "That is right only if no joint carries weight; otherwise set gravity = [0, 0, -9.81] "
            "(m/s², in the base frame)."
        )
        yield _finding("warning", "no gravity", text, step, key="gravity")
    elif abs(size - EARTH) > TOLERANCE:
        cause = "in units of g" if abs(size - 1.0) < 0.1 else "in another unit"
        text = f"Gravity is {size:.4g} m/s² in the description, 9.81 m/s² on Earth."
        step = f"It may have been given {cause}; it is a vector in m/s² in the base frame."
        yield _finding("error", "gravity", text, step, key="gravity")


def _limits(joint: Joint, file: str) -> Iterator[Finding]:
    turning = joint.kind == "revolute"
    unit, other = ("rad", "degrees") if turning else ("m", "millimetres")
    if joint.position_limits is not None:
        low, high = joint.position_limits
        farthest = max(abs(low), abs(high))
        if math.isfinite(farthest) and farthest > (MAX_ANGLE if turning else MAX_TRAVEL):
            text = f"The limits of {joint.name} are {low:.4g} to {high:.4g} {unit} in {file}."
            step = (
                f"They may be {other}; URDF limits are in {unit}. Positions in a wrong unit "
                "cannot be recognised with them."
            )
            evidence = {"lower": Quantity(low, unit), "upper": Quantity(high, unit)}
            yield _finding("error", "position limits", text, step, joint.name, evidence)
    speed = joint.rated_speed
    if speed is not None and speed > (MAX_TURN_SPEED if turning else MAX_SLIDE_SPEED):
        text = f"The rated speed of {joint.name} is {speed:.4g} {unit}/s in {file}."
        step = (
            f"It may be {other} per second; rows below 1 % of the rated speed are excluded, which "
            "here is most of the record."
        )
        evidence = {"speed": Quantity(speed, f"{unit}/s")}
        yield _finding("error", "rated speed", text, step, joint.name, evidence)


def _distance(joint: Joint, file: str) -> Iterator[Finding]:
    far = float(np.linalg.norm(joint.translation))
    if far > MAX_DISTANCE:
        text = f"The axis of {joint.name} is {far:.4g} m from its parent's in {file}."
        step = "Its origin may be in millimetres; lengths are in metres."
        yield _finding("error", "lengths", text, step, joint.name, {"distance": Quantity(far, "m")})


def _body(joint: Joint, link: Link, file: str) -> Iterator[Finding]:
    """What no rigid body has: its moments must be positive, none larger than the two others."""
    if not np.any(link.inertia):
        return
    body = Body.of_parameters(link.inertia)
    place = f"of link {link.name} in {file}"
    if body.mass == 0.0:
        text = f"The mass {place} is 0 kg, but it has an inertia, which no body has."
        step = "Give the mass in kg for a model that is exported or simulated; estimates from "
        step += "torques do not need it."
        yield _finding("warning", "no mass", text, step, joint.name)
        return
    away = float(np.linalg.norm(body.center_of_mass))
    if away > MAX_DISTANCE:
        text = f"The centre of mass {place} is {away:.4g} m from its joint."
        step = "It may be in millimetres; lengths are in metres."
        yield _finding(
            "error", "centre of mass", text, step, joint.name, {"distance": Quantity(away, "m")}
        )
        return
    moments = body.principal[0]
    numbers = ", ".join(f"{moment:.3g}" for moment in moments)
    principal = {
        f"J{k}": Quantity(float(x), "kg m²", digits=3) for k, x in enumerate(moments, start=1)
    }
    scale = float(np.abs(moments).max())
    if moments[0] < -ROUNDING * scale:
        text = (
            f"The inertia {place} is not positive definite: its principal moments are {numbers} "
            "kg m²."
        )
        step = "Check the signs, and that it is taken about the centre of mass, not the joint."
        yield _finding("error", "inertia", text, step, joint.name, principal)
    elif moments[2] > (moments[0] + moments[1]) * (1 + ROUNDING) + ROUNDING * scale:
        text = (
            f"No body has the inertia {place}: of its principal moments, {numbers} kg m², one is "
            "larger than the two others together."
        )
        step = "Check the elements; a CAD program may give them about another point."
        yield _finding("warning", "inertia", text, step, joint.name, principal)
    elif body.mass > HEAVY and 0 < scale < body.mass * SMALLEST**2:
        text = (
            f"The mass {place} is {body.mass:.4g} kg within "
            f"{1e3 * math.sqrt(scale / body.mass):.3g} mm, more than any metal weighs."
        )
        step = "It may be in grams; masses are in kg."
        evidence = {
            "mass": Quantity(body.mass, "kg"),
            "radius": Quantity(1e3 * math.sqrt(scale / body.mass), "mm", digits=3),
        }
        yield _finding("error", "mass", text, step, joint.name, evidence)
    elif scale > body.mass * 3.0**2:
        radius = math.sqrt(scale / body.mass)
        text = f"The inertia {place} is that of {body.mass:.3g} kg spread over {radius:.3g} m."
        step = "It may be in kg mm² or g mm²; it is in kg m²."
        evidence = {
            "mass": Quantity(body.mass, "kg", digits=3),
            "radius": Quantity(radius, "m", digits=3),
        }
        yield _finding("error", "inertia", text, step, joint.name, evidence)
