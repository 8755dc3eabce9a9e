"""What a fit of a simulation gives beside the parameters of the model."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import nan
from typing import Annotated, Literal

import numpy as np

from pivident.estimation.output_error.simulation_fit import SimulationFit
from pivident.foundation.distributions import normal
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.plain_values import LATER, Known, Limits, Null, Sized

#: Root mean squares of errors of all joints; NaN where nothing was compared.
Errors = Annotated[np.ndarray, Sized("joints"), Null(nan)]


@dataclass(frozen=True)
class LoopParameter:
    """An unknown of the loop that was identified with the model."""

    name: str  # with the joint's label, such as kp2
    unit: str
    value: float
    std: Annotated[Known, Limits(ge=0.0)]  # standard error, zero where held
    bound: Literal["", "low", "high"] = ""  # ``low`` or ``high`` where a bound holds it, else empty
    held: bool = False  # whether nothing determines it and it was held

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Confidence interval, of one side where a bound holds the value."""
        half = float(normal.ppf(0.5 * (1.0 + level))) * self.std
        low = self.value if self.bound == "low" else self.value - half
        return low, self.value if self.bound == "high" else self.value + half


@dataclass(frozen=True, eq=False)
class SimulationResult(Displayed):
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
        bound_sides: which bound, ``low`` or ``high``, of each of them; empty where it is not known,
            as in files of earlier versions.
        noise_orders: orders of the noise models, joint by joint, positions before torques; empty
            where the squares of the errors were weighted by their size alone.
        horizon: longest simulation from a measured state [s]; None in files of earlier versions.
        fit: errors over time and derivatives; None where the result was read from a file.
    """

    compares: Literal["positions", "torques", "both"]
    loop: Literal["closed", "open"]
    position_rms: Errors
    torque_rms: Errors
    loop_parameters: tuple[LoopParameter, ...] = ()
    held: tuple[str, ...] = ()
    at_bound: tuple[str, ...] = ()
    bound_sides: Annotated[tuple[Literal["low", "high"], ...], LATER] = ()
    noise_orders: Annotated[tuple[int, ...], LATER] = ()
    horizon: Annotated[float | None, LATER] = None
    fit: SimulationFit | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self.bound_sides and len(self.bound_sides) != len(self.at_bound):
            raise ValueError("a side for each parameter at a bound is needed")
        if (self.position_rms < 0.0).any() or (self.torque_rms < 0.0).any():
            raise ValueError("an rms error is negative")

    def side(self, name: str) -> str:
        """Bound that holds a parameter, ``low`` or ``high``; empty for none and where unknown."""
        return dict(zip(self.at_bound, self.bound_sides, strict=False)).get(name, "")
