"""Angles over which a torque may ripple, and the revolutions to which an order may belong."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pivident.errors import ExperimentError
from pivident.robot.description import Robot

#: An order belongs to a revolution if the probability of a chance match is below this.
COINCIDENCE = 0.2

#: Multiples of a named order that are recognised.
NAMED_MULTIPLES = 4


@dataclass(frozen=True)
class NamedOrder:
    """An order that is expected, such as gear teeth or pole pairs.

    Attributes:
        name: in words, ``pole pairs``.
        count: cycles per revolution.
        of: revolution of the ``motor`` or of the ``joint``.
        joint: the joint's name; None: all joints.
    """

    name: str  # in words, ``pole pairs``
    count: float  # cycles per revolution
    of: Literal["motor", "joint"] = "motor"  # revolution of the ``motor`` or of the ``joint``
    joint: str | None = None  # the joint's name; None: all joints

    def __post_init__(self) -> None:
        if not (math.isfinite(self.count) and self.count > 0):
            raise ExperimentError(
                f"named order {self.name!r} has {self.count} cycles per revolution",
                advice="give a positive number",
            )
        if self.of not in ("motor", "joint"):
            raise ExperimentError(
                f"named order {self.name!r} is of the {self.of!r}",
                advice="choose 'motor' or 'joint'",
            )


@dataclass(frozen=True, eq=False)
class Angle:
    """The angle φ = c·q over which a torque may ripple."""

    name: str  # ``joint_1`` or ``motor of joint_6``
    coefficients: np.ndarray  # c, shape (joints,)
    # motor turns per unit of this angle, by the motor's name [rad/rad or rad/m]
    motors: tuple[tuple[str, float], ...]
    own: bool = True  # whether it is the joint's own position, as in the friction term


@dataclass(frozen=True)
class Relation:
    """The revolution to which an order belongs."""

    text: str  # in words, ``6 per revolution of the motor of joint_1``
    order: float  # the exact order n
    coincidence: float  # probability that a random order comes as close


def angles_of(robot: Robot, joint: int) -> tuple[Angle, ...]:
    """Angles over which a joint's torque may ripple: its position, and coupled motors acting on it.

    A motor that turns with this joint alone has an angle proportional to its position.
    """
    names = [j.name for j in robot.joints]
    reduction = robot.transmission.reduction
    own_motors, others = [], []
    for m in np.flatnonzero(reduction[:, joint]):
        row, motor = reduction[m], f"motor of {names[m]}"
        gear = float(abs(row[joint]))
        if np.count_nonzero(row) > 1:
            others.append(Angle(motor, row / row[joint], ((motor, gear),), own=False))
        else:
            own_motors.append((motor, gear))
    own = Angle(names[joint], np.eye(robot.size)[joint], tuple(own_motors))
    return (own, *others)


def relate(
    order: float, std: float, angle: Angle, revolute: bool, named: Sequence[NamedOrder]
) -> Relation | None:
    """The revolution to which an order belongs; None if none is near, or too many are."""
    reach = max(2.0 * std, 1e-3 * order)
    found = []
    for wanted in named:
        for text, base in named_bases(wanted, angle, revolute):
            multiple = round(order / base)
            if 1 <= multiple <= NAMED_MULTIPLES and abs(order - multiple * base) <= reach:
                times = "" if multiple == 1 else f"{multiple} x "
                words = f"{times}{wanted.name}: {multiple * wanted.count:g} per {text}"
                found.append(Relation(words, multiple * base, min(2.0 * reach / base, 1.0)))
    turns = [(f"revolution of the {name}", gear) for name, gear in angle.motors if gear != 1.0]
    turns += [(f"revolution of {angle.name}", 1.0)] if revolute and angle.own else []
    for text, base in turns:
        multiple = round(order / base)
        if multiple >= 1 and abs(order - multiple * base) <= reach:
            words = f"{multiple} per {text}"
            found.append(Relation(words, multiple * base, min(2.0 * reach / base, 1.0)))
    likely = [relation for relation in found if relation.coincidence <= COINCIDENCE]
    return likely[0] if likely else None


def named_bases(wanted: NamedOrder, angle: Angle, revolute: bool) -> list[tuple[str, float]]:
    """Orders n of a named order over an angle, with the revolution in words."""
    if wanted.of == "motor":
        return [(f"revolution of the {name}", wanted.count * g) for name, g in angle.motors]
    if revolute and angle.own:
        return [(f"revolution of {angle.name}", wanted.count)]
    return []
