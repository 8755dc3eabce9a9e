"""What a fit of a simulator gives: values with intervals, joint by joint."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pivident.foundation.text.display import Displayed
from pivident.foundation.text.numbers import format_significant, plus_minus
from pivident.foundation.version import __version__
from pivident.robot.description import Robot

#: Probability that an interval covers the truth.
LEVEL = 0.95


@dataclass(frozen=True)
class FittedValue(Displayed):
    """One fitted quantity.

    Attributes:
        quantity: such as ``armature``.
        joint: name of the joint; empty where it is one for all.
        unit: its unit.
        value: the estimate [unit].
        std: its standard error; NaN where the record does not determine it or a bound binds.
        low: lower end of the interval of 95 %.
        high: upper end.
        start: value from which the search started.
        note: what a reader has to know; empty mostly.
    """

    quantity: str
    joint: str
    unit: str
    value: float
    std: float
    low: float
    high: float
    start: float
    note: str = ""

    def __str__(self) -> str:
        if not math.isfinite(self.std):
            return f"{format_significant(self.value)} {self.unit} (no interval: {self.note})"
        return f"{plus_minus(self.value, self.value - self.low)} {self.unit}"


@dataclass(frozen=True, eq=False)
class SimulatorFit(Displayed):
    """A simulator fitted to a record of positions.

    Attributes:
        robot: the robot that was simulated, links as described.
        values: what was fitted.
        kp: position gain of each joint, fitted or given [N m/rad or N/m]; NaN where the law has
            none, shape (joints,); likewise:
        kd: speed gain [N m s/rad or N s/m].
        rms: root mean square of the simulation errors on the record of the fit, shape (joints,)
            [rad or m].
        converged: whether the iteration settled in all branches.
        passes: simulations with tangents, of the branch that took the most.
        delay_p_value: of one delay for all branches; NaN where there is one branch.
        recordings: names of the recordings.
        samples: number of compared samples of each joint.
        control_rate: rate of the control loop [Hz].
        version: of pivident.
        notes: reservations that come from file and law, as sentences.
    """

    robot: Robot
    values: tuple[FittedValue, ...]
    kp: np.ndarray
    kd: np.ndarray
    rms: np.ndarray
    converged: bool
    passes: int
    delay_p_value: float
    recordings: tuple[str, ...]
    samples: int
    control_rate: float
    version: str = __version__
    notes: tuple[str, ...] = ()

    def of(self, quantity: str) -> dict[str, FittedValue]:
        """Fitted values of one quantity by the name of the joint."""
        return {v.joint: v for v in self.values if v.quantity == quantity}

    def value(self, quantity: str, joint: str = "", default: float = 0.0) -> float:
        """One value, or the default where it was not fitted.

        Args:
            quantity: such as ``armature``.
            joint: name of the joint; empty for what all joints share.
            default: the value otherwise.

        Returns:
            The value in its unit.
        """
        found = self.of(quantity).get(joint)
        return default if found is None else found.value

    @property
    def delay(self) -> FittedValue | None:
        """The delay of the torque, where it was fitted."""
        return self.of("delay").get("")

    @property
    def bias(self) -> np.ndarray:
        """Measured less true position of each joint, zero where not fitted, (joints,)."""
        return np.array([self.value("bias", name) for name in self.robot.joint_names])

    def findings(self) -> Iterator[str]:
        """What a reader should know, in sentences."""
        yield from self.notes
        if not self.converged:
            yield (
                "The fit did not settle; its intervals do not hold. Check the gains, the control "
                "rate and the description, or record a motion that begins more slowly."
            )
        if self.delay_p_value < 0.01:
            yield (
                f"The branches of the robot do not have one delay (p = {self.delay_p_value:.2g}); "
                "their drives differ, or the description of one is wrong."
            )
        for v in self.values:
            if v.note:
                whose = f" of {v.joint}" if v.joint else ""
                yield f"{v.quantity}{whose}: {v.note}."
