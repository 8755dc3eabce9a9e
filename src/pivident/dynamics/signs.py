"""Negative frictions and rotor inertias, which physics excludes.

A torque whose sign is reversed changes the sign of every parameter of its joint: then one warning
names the joint, and none the single parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.parameters import Parameter
from pivident.foundation.text.finding import Finding, Quantity
from pivident.foundation.text.numbers import plus_minus
from pivident.robot.description import Robot

#: Share of a joint's frictions and rotor inertias that has to be negative for a reversed sign.
NEARLY_ALL = 0.75

#: Standard errors below zero from which a sign is no accident.
_CLEAR = 2.0


@dataclass(frozen=True)
class NegativeParameter:
    """An estimate below zero of what cannot be negative."""

    parameter: Parameter  # head of the estimated group
    name: str  # name of the group
    value: float  # estimate [unit of the parameter]
    std: float  # its standard error

    @property
    def is_certain(self) -> bool:
        """Whether it is significantly negative: θ + 2σ < 0."""
        return self.value + _CLEAR * self.std < 0.0

    @property
    def quantity(self) -> Quantity:
        """The estimate with ±2σ."""
        interval = (self.value - 2.0 * self.std, self.value + 2.0 * self.std)
        return Quantity(self.value, self.parameter.unit, bound=0.0, interval=interval)

    def __str__(self) -> str:
        return f"{self.name} = {plus_minus(self.value, 2 * self.std)} {self.parameter.unit}"


def negative_parameters(
    parameters: Sequence[Parameter], names: Sequence[str], theta: np.ndarray, std: np.ndarray
) -> list[NegativeParameter]:
    """Frictions and rotor inertias that were estimated below zero, those that were fixed not."""
    return [
        NegativeParameter(p, name, float(value), float(s))
        for p, name, value, s in zip(parameters, names, theta, std, strict=True)
        if p.is_dissipative and value < 0 and s != 0.0
    ]


def reversed_joints(
    robot: Robot, parameters: Sequence[Parameter], theta: np.ndarray, std: np.ndarray
) -> tuple[int, ...]:
    """Joints whose torque seems to have the wrong sign."""
    negative = negative_parameters(parameters, [p.stem for p in parameters], theta, std)

    def reversed_(joints: Sequence[int]) -> bool:
        own = [p for p in parameters if p.joint in joints and p.is_dissipative]
        clear = [p for p in negative if p.is_certain and p.parameter.joint in joints]
        return len(clear) >= 2 and len(clear) >= NEARLY_ALL * len(own)

    if reversed_(range(robot.tree.size)):
        return tuple(range(robot.size))
    return tuple(j for j, place in enumerate(robot.places) if reversed_([place]))


def sign_warnings(
    robot: Robot,
    parameters: Sequence[Parameter],
    names: Sequence[str],
    theta: np.ndarray,
    std: np.ndarray,
) -> list[Finding]:
    """Parameters that physics wants positive and the data made negative."""
    joints = reversed_joints(robot, parameters, theta, std)
    found = []
    if joints and len(joints) == robot.size:
        text = "All signs are reversed: nearly all friction terms and rotor inertias are negative."
        step = "Reverse the sign of tau: units = {tau = -1.0} if in N m or N, else a negative gain."
        found.append(Finding("warning", "signs", "all reversed", text, next_step=step))
    elif joints:
        reversed_names = ", ".join(robot.joints[j].name for j in joints)
        text = (
            f"The signs of {reversed_names} seem to be reversed: nearly all friction terms "
            "and rotor inertias there are negative."
        )
        step = (
            "Reverse the sign of tau or q of these joints: a list under units, -1.0 in place of N "
            "m, N, rad or m."
        )
        found.append(Finding("warning", "signs", "reversed", text, reversed_names, step))
    if len(joints) == robot.size:
        return found
    told = {robot.places[j] for j in joints}
    return found + [
        _warning(p)
        for p in negative_parameters(parameters, names, theta, std)
        if p.parameter.joint not in told
    ]


def _warning(negative: NegativeParameter) -> Finding:
    """A single parameter below zero."""
    below = abs(negative.value) / max(negative.std, 1e-300)
    text = (
        f"{negative.name} = {negative.value:.3g} {negative.parameter.unit} is negative; friction "
        f"and rotor inertia cannot be ({below:.1f} standard errors below zero)."
    )
    step = "Check the low-speed mask, the signs of the torque and the friction law"
    if negative.parameter.friction is not None:
        step += "; a simulated loop takes it as zero"
    evidence = {negative.name: negative.quantity}
    return Finding("warning", "signs", "negative", text, negative.name, f"{step}.", evidence)
