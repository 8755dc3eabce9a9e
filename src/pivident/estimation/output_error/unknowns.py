"""What a simulation is fitted by: unknowns of a loop, with their bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.errors import ExperimentError
from pivident.simulation.direction import Direction, ParametrisedLoop


@dataclass(frozen=True)
class Unknown:
    """One parameter that is sought.

    Attributes:
        name: its name in results.
        unit: its unit; empty for a ratio.
        direction: what it is in a simulated loop.
        low: the smallest value that it may take [unit].
        high: the largest one [unit].
    """

    name: str
    unit: str
    direction: Direction
    low: float = -np.inf
    high: float = np.inf

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
