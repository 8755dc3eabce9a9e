"""Limits of a robot's joints, as far as its description and its user know them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.sentences import listed
from pivident.loop.motion.wanted_motion import RISE
from pivident.robot.description import Robot

#: Share of a limit that a motion is planned to use, and room that it keeps beyond clearances [m]:
#: for what happens between the samples of the search, and a controller that follows not exactly.
PLANNED_SHARE, ROOM = 0.95, 0.01

DESCRIPTION, FILE, ASSUMED = "description", "file", "assumed"


@dataclass(frozen=True, eq=False)
class JointLimits(Displayed):
    """What a motion must stay inside of; arrays of shape (joints,), infinite for no limit.

    Attributes:
        low: lowest positions [rad or m].
        high: highest positions [rad or m].
        speed: largest speeds [rad/s or m/s].
        acceleration: largest accelerations [rad/s² or m/s²].
        jerk: largest jerks [rad/s³ or m/s³].
        torque: largest torques [N m or N].
        rms_torque: largest root mean square of the torque, which heats the motor [N m or N].
        source: where the limits of a quantity come from: ``description``, ``file``, ``assumed``.
    """

    low: np.ndarray
    high: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray
    torque: np.ndarray
    rms_torque: np.ndarray
    source: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def within(self, share: float) -> JointLimits:
        """The same limits, of which only a share is used; ranges keep their middles."""
        middle, half = self.middle, self.half
        return replace(
            self,
            low=middle - share * half,
            high=middle + share * half,
            **{
                name: share * getattr(self, name)
                for name in ("speed", "acceleration", "jerk", "torque", "rms_torque")
            },
        )

    def of_robot(self, robot: Robot) -> Robot:
        """The robot with these ranges of its joints in place of those of its description.

        What can touch depends on them, see `pivident.studies.clearances_of_room`.

        Args:
            robot: the robot.
        """
        ranges = zip(self.low.tolist(), self.high.tolist(), strict=True)
        joints = tuple(
            replace(joint, position_limits=own)
            for joint, own in zip(robot.joints, ranges, strict=True)
        )
        return replace(robot, joints=joints)

    @property
    def middle(self) -> np.ndarray:
        """Middle of each range."""
        return 0.5 * (self.low + self.high)

    @property
    def half(self) -> np.ndarray:
        """Half of each range."""
        return 0.5 * (self.high - self.low)


#: What a user may give, by the name of the joint: limits of one quantity.
Given = Mapping[str, Mapping[str, float | tuple[float, float]]]


def joint_limits(
    robot: Robot,
    given: Given | None = None,
    *,
    speed_share: float = 1.0,
    torque_share: float = 1.0,
) -> JointLimits:
    """Limits of a robot's description, and those that a user gave in their place.

    Args:
        robot: the robot.
        given: by joint, then by quantity: ``position`` (low, high), ``speed``, ``acceleration``,
            ``jerk``, ``torque``, ``rms_torque``, in SI units on the joint side.
        speed_share: share of the rated speeds that may be used.
        torque_share: share of the torque limits that may be used.

    Returns:
        The limits. Where no acceleration is given, a joint may reach its largest speed in 0.25 s.

    Raises:
        ExperimentError: joints without limits of position or speed, named; limits in the wrong
            order.
    """
    n, none = robot.size, np.inf
    sources: dict[str, list[str]] = {}
    found: dict[str, np.ndarray] = {}
    described: dict[str, list[float | None]] = {
        "speed": [j.rated_speed for j in robot.joints],
        "acceleration": [None] * n,
        "jerk": [None] * n,
        "torque": [j.torque_limit for j in robot.joints],
        "rms_torque": [None] * n,
    }
    ranges: list[tuple[float, float] | None] = []
    given = given or {}
    for joint in robot.joints:
        own = given.get(joint.name, {}).get("position")
        ranges.append(own if isinstance(own, tuple) else joint.position_limits)
        sources.setdefault("position", []).append(FILE if own is not None else DESCRIPTION)
    for quantity, values in described.items():
        used = []
        for joint, value in zip(robot.joints, values, strict=True):
            own = given.get(joint.name, {}).get(quantity)
            share = {"speed": speed_share, "torque": torque_share}.get(quantity, 1.0)
            known = own if own is not None else None if value is None else share * value
            used.append(none if known is None else float(known))  # type: ignore[arg-type]
            is_own = own is not None or share != 1.0
            sources.setdefault(quantity, []).append(FILE if is_own else DESCRIPTION)
        found[quantity] = np.array(used)
    _check_known(robot, ranges, found["speed"])
    low, high = np.array(ranges, dtype=float).T
    for j in np.flatnonzero(np.isinf(found["acceleration"])):
        found["acceleration"][j] = found["speed"][j] / RISE
        sources["acceleration"][j] = ASSUMED
    limits = JointLimits(low, high, **found, source={k: tuple(v) for k, v in sources.items()})
    _check_possible(robot, limits)
    return limits


def wider_than_described(robot: Robot, limits: JointLimits) -> Iterator[str]:
    """One sentence for each limit that goes beyond the one of the description.

    Args:
        robot: the robot.
        limits: of its joints.
    """
    for j, joint in enumerate(robot.joints):
        if (own := joint.position_limits) is not None and (
            limits.low[j] < own[0] or limits.high[j] > own[1]
        ):
            yield (
                f"The range of {joint.name} is wider than that of the description: "
                f"{limits.low[j]:g} to {limits.high[j]:g} {joint.position_unit} against "
                f"{own[0]:g} to {own[1]:g}."
            )
        yield from [
            f"The limit of the {words} of {joint.name} is higher than that of the "
            f"description: {used:g} against {known:g} {unit}."
            for words, used, known, unit in (
                ("speed", limits.speed[j], joint.rated_speed, f"{joint.position_unit}/s"),
                ("torque", limits.torque[j], joint.torque_limit, joint.torque_unit),
            )
            if known is not None and np.isfinite(used) and used > known
        ]


def _check_known(robot: Robot, ranges: list[tuple[float, float] | None], speed: np.ndarray) -> None:
    """Refuse joints without a known range or speed."""
    for quantity, missing, example in (
        ("position", [r is None for r in ranges], "[-2.9, 2.9]"),
        ("speed", np.isinf(speed).tolist(), "2.0"),
    ):
        names = [j.name for j, m in zip(robot.joints, missing, strict=True) if m]
        if names:
            unit = robot.joints[robot.joint_names.index(names[0])].position_unit
            unit = unit if quantity == "position" else f"{unit}/s"
            raise ExperimentError(
                f"no {quantity} limits are known of {listed(names)}",
                advice=f"give them, for instance excite.joint.{json.dumps(names[0])}.{quantity} = "
                f"{example} ({unit}, on the joint side)",
            ).about("joint", names[0])


def _check_possible(robot: Robot, limits: JointLimits) -> None:
    """Refuse limits between which there is no motion."""
    for j, joint in enumerate(robot.joints):
        if not limits.low[j] < limits.high[j]:
            raise ExperimentError(
                f"the position limits of {joint.name}, {limits.low[j]:g} to {limits.high[j]:g} "
                f"{joint.position_unit}, are in the wrong order: the lowest position comes first"
            ).about("joint", joint.name)
        for quantity in ("speed", "acceleration", "jerk", "torque", "rms_torque"):
            value = getattr(limits, quantity)[j]
            if not value > 0.0:
                raise ExperimentError(
                    f"the {quantity.replace('_', ' ')} limit of {joint.name} is {value:g}",
                    advice="a positive number is needed, or leave it out",
                ).about("joint", joint.name)
