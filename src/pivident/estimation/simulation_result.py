"""What a fit of a simulation gives beside the parameters of the model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.special import ndtri


@dataclass(frozen=True)
class LoopParameter:
    """An unknown of the loop that was identified with the model."""

    name: str  # with the joint's label, such as kp2
    unit: str
    value: float
    std: float  # standard error, zero where held
    bound: str = ""  # ``low`` or ``high`` where a bound holds it, else empty
    held: bool = False  # whether nothing determines it and it was held

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Confidence interval, of one side where a bound holds the value."""
        half = float(ndtri(0.5 * (1.0 + level))) * self.std
        low = self.value if self.bound == "low" else self.value - half
        high = self.value if self.bound == "high" else self.value + half
        return low, high


@dataclass(frozen=True, eq=False)
class SimulationResult:
    """How near the simulation comes, and what else of the loop was identified.

    Attributes:
        compares: ``positions``, ``torques`` or ``both``.
        loop: ``closed`` or ``open``.
        position_rms: rms error of the simulated positions, shape (joints,) [rad or m].
        torque_rms: rms error of the simulated torques, likewise [N m or N]; NaN where the torque
            was an input, or none was measured.
        loop_parameters: unknowns of the loop.
        held: names of parameters that nothing determines and that were held.
        at_bound: names of parameters that a bound holds.
    """

    compares: str
    loop: str
    position_rms: np.ndarray
    torque_rms: np.ndarray
    loop_parameters: tuple[LoopParameter, ...] = ()
    held: tuple[str, ...] = ()
    at_bound: tuple[str, ...] = ()

    def to_values(self) -> dict[str, Any]:
        """Plain values for a file."""
        return {
            "compares": self.compares,
            "loop": self.loop,
            "position_rms": self.position_rms.tolist(),
            "torque_rms": self.torque_rms.tolist(),
            "loop_parameters": [asdict(p) for p in self.loop_parameters],
            "held": list(self.held),
            "at_bound": list(self.at_bound),
        }

    @classmethod
    def from_values(cls, values: Mapping[str, Any], joints: int) -> SimulationResult:
        """The result of :meth:`to_values`.

        Raises:
            ValueError: it is none of that many joints.
        """
        try:
            positions, torques = (
                np.array([np.nan if x is None else float(x) for x in values[key]])
                for key in ("position_rms", "torque_rms")
            )
            made = cls(
                compares=str(values["compares"]),
                loop=str(values["loop"]),
                position_rms=positions,
                torque_rms=torques,
                loop_parameters=tuple(LoopParameter(**own) for own in values["loop_parameters"]),
                held=tuple(map(str, values["held"])),
                at_bound=tuple(map(str, values["at_bound"])),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"simulation: a key is missing or wrong ({error})") from error
        if positions.shape != (joints,) or torques.shape != (joints,):
            raise ValueError(f"simulation: one rms error for each of {joints} joints is needed")
        return made
