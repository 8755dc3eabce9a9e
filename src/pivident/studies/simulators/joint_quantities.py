"""What a simulator has of each joint, in its own words, and the unknowns that stand for it.

    armature ddq + damping dq + frictionloss sign(dq) + (M ddq + c + g)(q) = τ(t - delay)
    τ = kp (q_ref - q - bias) - kd d(q + bias)/dt

The links keep their inertias. Dry friction is MuJoCo's and Isaac's: a constant level, and a sign
that is as good as hard.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.data.recording.checks import MAX_DRIVE_DELAY
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.estimation.output_error.loop_unknowns import Unknown
from pivident.foundation.errors import ExperimentError, require_known
from pivident.loop.simulation.direction import Direction
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionLaw, coulomb, viscous

#: What may be sought of each joint; ``delay`` is one for all.
QUANTITIES = ("armature", "damping", "frictionloss", "bias", "kp", "kd", "delay")

#: What is sought where nothing else is asked for.
DEFAULT_QUANTITIES = ("armature", "damping", "frictionloss", "bias", "delay")

#: Parameters of the model that are quantities of a simulator.
STEMS = {"armature": "ia", "damping": "fv", "frictionloss": "fc"}

#: γ of the smoothed sign [s/rad or s/m]: it is within 1 % of ±1 at 1.3 mrad/s.
HARD_SIGN = 2000.0

#: Largest encoder bias that is sought [rad or m].
MAX_BIAS = 1.0

#: Where the search starts if the description says nothing: shares of the inertia in the joint,
#: and of the torque that the law commands at the measured errors.
INERTIA_SHARE, TORQUE_SHARE = 0.1, 0.1

#: Part of those shares that is as good as zero.
NOTHING = 1e-2


def simulator_robot(robot: Robot) -> Robot:
    """The robot with the friction that simulators have, its nominal values kept."""
    law = FrictionLaw((viscous(), coulomb("tanh", HARD_SIGN)))
    known = {
        f"{stem}{robot.label(j)}": robot.friction_nominal.get(f"{stem}{robot.label(j)}")
        for j in range(robot.size)
        for stem in ("fv", "fc")
    }
    nominal = {name: value for name, value in known.items() if value is not None}
    return replace(robot.with_friction(law), friction_nominal=nominal)


def check_quantities(free: Sequence[str]) -> None:
    """Refuse quantities that there are not, and a list of none."""
    for name in free:
        require_known(
            name, QUANTITIES, f"free names {name!r}, which simulators do not have", ExperimentError
        )
    if not free:
        raise ExperimentError(
            "nothing is to be fitted", advice=f"name some of {', '.join(QUANTITIES)}"
        )


@dataclass(frozen=True)
class JointQuantity:
    """A quantity of a joint (or of all), and its unknown in the simulated loop."""

    quantity: str
    joint: str  # name of the joint; empty for all
    unknown: Unknown


def joint_quantities(robot: Robot, free: Sequence[str]) -> list[JointQuantity]:
    """What is sought of a robot that `simulator_robot` has made, quantity by quantity."""
    made = []
    for quantity in QUANTITIES:
        if quantity not in free:
            continue
        if quantity == "delay":
            unknown = Unknown("delay", "s", Direction("delay"), 0.0, MAX_DRIVE_DELAY)
            made.append(JointQuantity(quantity, "", unknown))
            continue
        made += [
            JointQuantity(quantity, joint.name, _unknown(robot, quantity, j))
            for j, joint in enumerate(robot.joints)
        ]
    return made


def unit_of(robot: Robot, quantity: str, joint: int) -> str:
    """Unit of a quantity of a joint."""
    position, torque = robot.joints[joint].position_unit, robot.joints[joint].torque_unit
    return {
        "armature": "kg m²" if position == "rad" else "kg",
        "damping": f"{torque} s/{position}",
        "frictionloss": torque,
        "bias": position,
        "kp": f"{torque}/{position}",
        "kd": f"{torque} s/{position}",
        "delay": "s",
    }[quantity]


def _unknown(robot: Robot, quantity: str, j: int) -> Unknown:
    name, unit = f"{quantity}[{robot.joints[j].name}]", unit_of(robot, quantity, j)
    if quantity in STEMS:
        parameter = f"{STEMS[quantity]}{robot.label(j)}"
        return Unknown(name, unit, Direction("parameter", parameter), 0.0)
    if quantity == "bias":
        return Unknown(name, unit, Direction("encoder_offset", joint=j), -MAX_BIAS, MAX_BIAS)
    return Unknown(name, unit, Direction("law", quantity, j), 0.0)


def start_values(
    robot: Robot, free: Sequence[str], inertia: np.ndarray, torque: np.ndarray, speed: np.ndarray
) -> np.ndarray:
    """Standard parameters where the search starts, (parameters,).

    ``inertia``: of each joint [kg m² or kg], ``torque``: that its law commands, ``speed``: its
    root mean square, each (joints,). What is not sought keeps its value, and what the description
    has of some size, since MuJoCo's own fits begin at 1e-8 for zero.
    """
    parameters = standard_parameters(robot)
    values = nominal_values(robot, parameters)
    begin = {
        "ia": INERTIA_SHARE * inertia,
        "fv": TORQUE_SHARE * torque / np.maximum(speed, 1e-9),
        "fc": TORQUE_SHARE * torque,
    }
    sought = {STEMS[q] for q in free if q in STEMS}
    for k, p in enumerate(parameters):
        if p.stem in sought and values[k] < NOTHING * begin[p.stem][p.joint]:
            values[k] = begin[p.stem][p.joint]
    return values
