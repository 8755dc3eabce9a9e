"""What a fit of a simulation gives beside the parameters of the model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from scipy.special import ndtri

from pivident.estimation.output_error.simulation_fit import SimulationFit

#: What may be compared, and which loop it is.
COMPARED, LOOPS = ("positions", "torques", "both"), ("closed", "open")


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

    @classmethod
    def from_values(cls, values: Mapping[str, Any]) -> LoopParameter:
        """The parameter of ``asdict``.

        Raises:
            ValueError: a value is none that a parameter can have.
        """
        std = values["std"]  # null where it is not known
        own = cls(
            str(values["name"]), str(values["unit"]), float(values["value"]),
            np.nan if std is None else float(std), str(values["bound"]), values["held"],
        )  # fmt: skip
        if not np.isfinite(own.value) or own.std < 0.0 or np.isinf(own.std):
            raise ValueError(f"{own.name} is {own.value} with standard error {own.std}")
        if own.bound not in ("", "low", "high") or not isinstance(own.held, bool):
            raise ValueError(f"{own.name} has bound {own.bound!r} and held {own.held!r}")
        return own


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
        bound_sides: which bound, ``low`` or ``high``, of each of them; empty where it is not known,
            as in files of earlier versions.
        noise_orders: orders of the noise models, joint by joint, positions before torques; empty
            where the squares of the errors were weighted by their size alone.
        fit: errors over time and derivatives; None where the result was read from a file.
    """

    compares: str
    loop: str
    position_rms: np.ndarray
    torque_rms: np.ndarray
    loop_parameters: tuple[LoopParameter, ...] = ()
    held: tuple[str, ...] = ()
    at_bound: tuple[str, ...] = ()
    bound_sides: tuple[str, ...] = ()
    noise_orders: tuple[int, ...] = ()
    fit: SimulationFit | None = field(default=None, repr=False)

    def side(self, name: str) -> str:
        """Bound that holds a parameter, ``low`` or ``high``; empty for none and where unknown."""
        return dict(zip(self.at_bound, self.bound_sides, strict=False)).get(name, "")

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
            "bound_sides": list(self.bound_sides),
            "noise_orders": list(self.noise_orders),
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
                loop_parameters=tuple(map(LoopParameter.from_values, values["loop_parameters"])),
                held=tuple(map(str, values["held"])),
                at_bound=tuple(map(str, values["at_bound"])),
                bound_sides=tuple(map(str, values.get("bound_sides", ()))),
                noise_orders=tuple(map(int, values.get("noise_orders", ()))),
            )
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise ValueError(f"simulation: a key is missing or wrong ({error})") from error
        if positions.shape != (joints,) or torques.shape != (joints,):
            raise ValueError(f"simulation: one rms error for each of {joints} joints is needed")
        if made.compares not in COMPARED or made.loop not in LOOPS:
            raise ValueError(f"simulation: compares {made.compares!r} in a {made.loop!r} loop")
        if made.bound_sides and len(made.bound_sides) != len(made.at_bound):
            raise ValueError("simulation: a side for each parameter at a bound is needed")
        if not set(made.bound_sides) <= {"low", "high"}:
            raise ValueError(f"simulation: bounds are low or high, not {made.bound_sides}")
        if (positions < 0.0).any() or (torques < 0.0).any():
            raise ValueError("simulation: an rms error is negative")
        return made
