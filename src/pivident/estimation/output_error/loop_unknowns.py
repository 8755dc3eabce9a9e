"""Unknowns of a fitted loop with their bounds: parameters, and what else is sought by name.

What a simulation is fitted by: unknowns of a loop, with their bounds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.data.recording.checks import MAX_DRIVE_DELAY
from pivident.estimation.problem import Problem, position_units, torque_units
from pivident.foundation.errors import ExperimentError
from pivident.loop.simulation.controllers import Cascade
from pivident.loop.simulation.direction import Direction, Kind, ParametrisedLoop
from pivident.robot.friction_column import unit_on_joint
from pivident.robot.naming import nearest

#: Kinds of one joint each that may be sought; the others are of the whole loop.
OF_JOINTS: tuple[Kind, ...] = ("drive_gain", "encoder_offset", "torque_offset")


@dataclass(frozen=True)
class Unknown:
    """One parameter that is sought.

    Attributes:
        name: its name in results.
        unit: its unit; empty for a ratio.
        direction: what it is in a simulated loop.
        low: the smallest value that it may take [unit].
        high: the largest one [unit].
        held: whether its value is known.
    """

    name: str
    unit: str
    direction: Direction
    low: float = -np.inf
    high: float = np.inf
    held: bool = False

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise ExperimentError(
                f"the bounds of {self.name} are {self.low:g} and {self.high:g} {self.unit}",
                advice="the lower one has to be smaller",
            )


def values_of(loop: ParametrisedLoop, unknowns: Sequence[Unknown]) -> np.ndarray:
    """Present values of the unknowns in a loop, shape (unknowns,)."""
    return np.array([loop.value(u.direction) for u in unknowns], dtype=float)


def with_values(
    loop: ParametrisedLoop, unknowns: Sequence[Unknown], values: np.ndarray
) -> ParametrisedLoop:
    """The loop with other values of its unknowns.

    ``loop``: the loop as it was given, since offsets are counted from it; ``values``: shape
    (unknowns,).
    """
    for unknown, value in zip(unknowns, values.tolist(), strict=True):
        step = value - loop.value(unknown.direction)
        if step != 0.0:
            loop = loop.moved(unknown.direction, step)
    return loop


def start_directions(joints: int) -> list[Direction]:
    """Initial positions of all joints, then their initial speeds: unknowns of one stretch alone."""
    return [
        Direction(kind, joint=j)
        for kind in ("initial_position", "initial_speed")
        for j in range(joints)
    ]  # fmt: skip


def model_unknowns(problem: Problem) -> list[Unknown]:
    """The problem's parameters; friction cannot feed energy in."""
    unknowns = []
    for name, p in zip(problem.names, problem.regressor.parameters, strict=True):
        friction = p.friction is not None or p.stem in ("fvm", "fcm")
        held = name in problem.known.fixed
        low = 0.0 if friction and p.is_dissipative and not held else -np.inf
        unknowns.append(Unknown(name, p.unit, Direction("parameter", p.name), low, held=held))
    return within_bounds(unknowns, problem.known.bounds)


def loop_unknowns(problem: Problem, loop: ParametrisedLoop, names: Sequence[str]) -> list[Unknown]:
    """Unknowns of the loop by the names that a method gives them.

    Raises:
        ExperimentError: the loop has no such unknown; says which there are.
    """
    known = _by_name(problem, loop)
    unknowns: dict[str, Unknown] = {}
    for name in names:
        chosen = [u for key, own in known.items() for u in own if name in (key, u.name)]
        if not chosen:
            listed = list(known)
            raise ExperimentError(
                f"free names {name!r}, which this loop does not have", advice=nearest(name, listed)
            ).about("free")
        unknowns |= {u.name: u for u in chosen}
    return list(unknowns.values())


def within_bounds(
    unknowns: Sequence[Unknown], bounds: Mapping[str, tuple[float, float]]
) -> list[Unknown]:
    """The unknowns with other bounds.

    Raises:
        ExperimentError: bounds of an unknown that is not sought.
    """
    # a parameter of the model may be named without the trailing ``r`` of its group
    names = {u.direction.name or u.name: k for k, u in enumerate(unknowns)}
    names |= {u.name: k for k, u in enumerate(unknowns)}
    made = list(unknowns)
    for name, (low, high) in bounds.items():
        if name not in names:
            raise ExperimentError(
                f"bounds names {name!r}, which is not sought", advice=nearest(name, list(names))
            ).about("bounds")
        made[names[name]] = replace(made[names[name]], low=low, high=high)
    return made


def _by_name(problem: Problem, loop: ParametrisedLoop) -> dict[str, list[Unknown]]:
    """All unknowns that the loop has, by the name that stands for those of all joints."""
    robot = problem.robot
    labels = [robot.label(j) for j in range(robot.size)]
    torque, position = torque_units(problem), position_units(problem)
    known: dict[str, list[Unknown]] = {
        "delay": [Unknown("delay", "s", Direction("delay"), 0.0, MAX_DRIVE_DELAY)],
    }
    if loop.signals.inputs is not None:
        known["inputs"] = [Unknown("inputs", "", Direction("inputs"))]
    units = {
        "drive_gain": [f"{t} per output" for t in torque],
        "encoder_offset": position,
        "torque_offset": torque,
    }
    for kind in OF_JOINTS:
        low = 0.0 if kind == "drive_gain" else -np.inf
        known[kind] = [
            Unknown(f"{kind}{labels[j]}", units[kind][j], Direction(kind, joint=j), low)
            for j in range(robot.size)
        ]
    for name, shared in loop.law_gains().items():
        if shared:
            unit = "s" if "time" in name else ""
            known[name] = [Unknown(name, unit, Direction("law", name), 0.0)]
            continue
        known[name] = [
            Unknown(
                f"{name}{labels[j]}", gain_unit(loop, name, position[j]),
                Direction("law", name, j), 0.0,
            )
            for j in range(robot.size)
        ]  # fmt: skip
    for j in range(robot.size):
        for name, (unit, low, high) in loop.friction_constants(j).items():
            own = Unknown(
                f"{name}{labels[j]}", unit_on_joint(unit, robot.joints[j].kind),
                Direction("shape", name, j), low, high,
            )  # fmt: skip
            known.setdefault(name, []).append(own)
    return known


def gain_unit(loop: ParametrisedLoop, name: str, position: str) -> str:
    """Unit of a gain of the law, whose output has the unit that the drive gain turns into torque.

    ``position``: unit of the joint's position.
    """
    if isinstance(loop.controller, Cascade):
        return {"kv": f"output s/{position}"}.get(name, "1/s")
    return {"kd": f"output s/{position}", "ki": f"output/({position} s)"}.get(
        name, f"output/{position}"
    )
