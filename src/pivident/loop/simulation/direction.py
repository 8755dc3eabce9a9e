"""Parameters of a simulated loop that its motion may be differentiated along."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import Parameter
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.display import Displayed
from pivident.loop.simulation.closed_loop import LoopSignals, Model
from pivident.loop.simulation.controllers import Controller
from pivident.loop.simulation.gravity_compensation import GravityCompensated
from pivident.robot.description import Robot
from pivident.robot.friction import offset

Kind = Literal[
    "parameter", "shape", "law", "drive_gain", "inputs", "delay", "encoder_offset",
    "torque_offset", "initial_position", "initial_speed",
]  # fmt: skip

#: Kinds that belong to one joint, to all or one of them, and that have a name.
_OF_ONE_JOINT = ("shape", "encoder_offset", "torque_offset", "initial_position", "initial_speed")
_NAMED = ("parameter", "shape", "law")


@dataclass(frozen=True)
class Direction:
    """One parameter of a simulated loop.

    Attributes:
        kind: ``parameter``: a parameter of the dynamic model, inertial or of friction, by ``name``
            [its unit]; ``shape``: a constant of a joint's friction law by ``name``, such as
            ``gamma`` or the Stribeck speed; ``law``: an attribute of the control law by ``name``,
            such as ``kp``; ``drive_gain``: joint torque per controller output; ``inputs``: share of
            the known inputs, such as a feed-forward, that is added to the law's output, one for
            all of it; ``delay``: of the drives [s]; ``encoder_offset``: what the law reads beside
            the position [rad or m]; ``torque_offset``: a constant torque against the drive, as the
            parameter ``off`` [N m or N]; ``initial_position`` and ``initial_speed`` [rad or m, and
            per s].
        name: of the parameter, constant or attribute, where the kind has one.
        joint: index of the joint; -1: all of them, or the kind needs none.
    """

    kind: Kind
    name: str = ""
    joint: int = -1

    def __str__(self) -> str:
        """For messages: kind, name and joint."""
        where = f" of joint {self.joint + 1}" if self.joint >= 0 else ""
        return f"{self.kind}{' ' if self.name else ''}{self.name}{where}"


@dataclass(frozen=True, eq=False)
class ParametrisedLoop(Displayed):
    """A loop to simulate, in terms of the parameters that its motion depends on.

    Attributes:
        robot: the robot.
        parameters: standard parameters or heads of base groups; others count as zero.
        theta: their values, shape (parameters,).
        controller: the sampled control law.
        signals: what drives the loop.
        start: initial positions and speeds, each (joints,); None: at rest on the reference.
        clip: whether negative friction counts as none, see ``dynamics.forward.make_model``.
    """

    robot: Robot
    parameters: tuple[Parameter, ...]
    theta: np.ndarray
    controller: Controller
    signals: LoopSignals
    start: tuple[np.ndarray, np.ndarray] | None = None
    clip: bool = False

    @property
    def model(self) -> Model:
        """The robot with its parameter values, for the compiled loop."""
        return make_model(self.robot, self.parameters, self.theta, clip=self.clip)

    @property
    def begin(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and speeds at the first sample, each (joints,)."""
        if self.start is None:
            return np.asarray(self.signals.q_ref[0], float), np.zeros(self.robot.size)
        return np.asarray(self.start[0], float), np.asarray(self.start[1], float)

    def check(self, direction: Direction) -> None:
        """Refuse a direction that this loop does not have.

        Raises:
            ExperimentError: names the direction and what there is instead.
        """
        kind, name, joint, n = direction.kind, direction.name, direction.joint, self.robot.size
        if kind not in get_args(Kind):
            raise ExperimentError(
                f"a simulation has no direction of kind {kind!r}",
                advice=f"choose one of {', '.join(get_args(Kind))}",
            )
        lowest = 0 if kind in _OF_ONE_JOINT else -1
        if not lowest <= joint < n:
            raise ExperimentError(
                f"direction {kind} has joint = {joint}",
                advice=f"give a joint's index from 0 to {n - 1}"
                + ("" if lowest == 0 else ", or -1 for all"),
            )
        if (kind in _NAMED) != bool(name):
            raise ExperimentError(
                f"direction {kind} has name = {name!r}",
                advice="name what is meant, as Direction('parameter', 'fv1')"
                if kind in _NAMED
                else "this kind has no name",
            )
        if kind == "parameter" and name not in self._names:
            raise ExperimentError(
                f"the simulated model has no parameter {name!r}",
                advice=f"it has {', '.join(self._names)}",
            )
        if kind == "shape":
            known = sorted(self._shapes(joint))
            if name not in known:
                raise ExperimentError(
                    f"the friction of joint {joint + 1} has no constant {name!r}",
                    advice=f"it has {', '.join(known) or 'none'}",
                )
        if kind == "law":
            self.law_value(name, joint)
        if kind == "inputs" and self.signals.inputs is None:
            raise ExperimentError(
                "the loop has no known inputs, so there is no share of them",
                advice="leave the direction out, or give LoopSignals(inputs=…)",
            )

    def value(self, direction: Direction) -> float:
        """Present value of what a direction means; the first joint's where it means all."""
        kind, name, joint = direction.kind, direction.name, direction.joint
        if kind == "parameter":
            return float(self.theta[self._names.index(name)])
        if kind == "shape":
            return self._shapes(joint)[name]
        if kind == "law":
            return float(np.ravel(self.law_value(name, joint))[max(joint, 0)])
        if kind == "drive_gain":
            return float(self.signals.drive_gain[max(joint, 0)])
        if kind == "delay":
            return float(self.signals.drive_delay)
        if kind in ("initial_position", "initial_speed"):
            return float(self.begin[0 if kind == "initial_position" else 1][joint])
        return 1.0 if kind == "inputs" else 0.0

    def moved(self, direction: Direction, step: float) -> ParametrisedLoop:
        """The same loop with one parameter changed by ``step``.

        Args:
            direction: what to change; ``check`` has not refused it.
            step: how much.
        """
        kind, name, joint = direction.kind, direction.name, direction.joint
        n, signals = self.robot.size, self.signals
        which = np.arange(n) == joint if joint >= 0 else np.ones(n, bool)
        if kind == "parameter":
            theta = np.array(self.theta, dtype=float)
            theta[self._names.index(name)] += step
            return replace(self, theta=theta)
        if kind == "shape":
            return self._with_shape(joint, name, self._shapes(joint)[name] + step)
        if kind == "law":
            value = self.law_value(name, joint) + step * (which if joint >= 0 else 1.0)
            return replace(self, controller=_with_attribute(self.controller, name, value))
        if kind == "drive_gain":
            gain = np.broadcast_to(np.asarray(signals.drive_gain, float), n) + step * which
            return replace(self, signals=replace(signals, drive_gain=gain))
        if kind == "inputs":
            share = 1.0 + step * which
            inputs = np.zeros((1, n)) if signals.inputs is None else signals.inputs
            return replace(self, signals=replace(signals, inputs=inputs * share))
        if kind == "delay":
            late = signals.drive_delay + step
            return replace(self, signals=replace(signals, drive_delay=late))
        if kind == "encoder_offset":
            noise = np.zeros((1, n)) if signals.noise is None else signals.noise
            return replace(self, signals=replace(signals, noise=noise + step * which))
        if kind == "torque_offset":
            return self._with_torque_offset(joint, step)
        q, dq = self.begin
        if kind == "initial_position":
            return replace(self, start=(q + step * which, dq))
        return replace(self, start=(q, dq + step * which))

    def law_gains(self) -> dict[str, bool]:
        """Attributes of the control law that may be sought, and whether all joints share them."""
        law = self.controller
        while isinstance(law, GravityCompensated):
            law = law.feedback
        found = {}
        for name in getattr(law, "__dataclass_fields__", ()):
            number = np.asarray(getattr(law, name))
            if number.dtype.kind in "fi" and number.ndim <= 1:
                found[name] = name in _SCALARS
        return found

    def friction_constants(self, joint: int) -> dict[str, tuple[str, float, float]]:
        """Constants of a joint's friction law that may be sought: unit, lowest and highest value.

        Units are those of `pivident.robot.friction_term.Shape`.
        """
        found: dict[str, tuple[str, float, float]] = {}
        for p in self.parameters:
            if p.joint == self.robot.places[joint] and p.friction is not None:
                found |= {s.name: (s.unit, s.low, s.high) for s in p.friction.shapes}
                if p.friction.has_sign:
                    found["gamma"] = ("1/speed", 0.0, np.inf)
        return found

    @property
    def _names(self) -> list[str]:
        return [p.name for p in self.parameters]

    def _shapes(self, joint: int) -> dict[str, float]:
        """Constants of a joint's friction law by name."""
        found: dict[str, float] = {}
        for p in self.parameters:
            if p.joint == self.robot.places[joint] and p.friction is not None:
                found |= {shape.name: shape.value for shape in p.friction.shapes}
                if p.friction.has_sign:
                    found["gamma"] = p.friction.encoded(simulated=True)[2][0]
        return found

    def _with_shape(self, joint: int, name: str, value: float) -> ParametrisedLoop:
        """With another constant in all terms of a joint's law, and in its coupling's."""
        law = self.robot.joints[joint].friction.with_shapes({name: value})
        joints = list(self.robot.joints)
        joints[joint] = replace(joints[joint], friction=law)
        parameters = tuple(
            replace(p, friction=p.friction.with_shapes({name: value}))
            if p.joint == self.robot.places[joint] and p.friction is not None
            else p
            for p in self.parameters
        )
        return replace(self, robot=replace(self.robot, joints=tuple(joints)), parameters=parameters)

    def _with_torque_offset(self, joint: int, value: float) -> ParametrisedLoop:
        added = Parameter("torque offset", "off", self.robot.places[joint], "", friction=offset())
        return replace(
            self, parameters=(*self.parameters, added), theta=np.append(self.theta, value)
        )

    def law_value(self, name: str, joint: int = -1) -> np.ndarray:
        """An attribute of the control law as numbers: one, or one for each joint.

        Args:
            name: of the attribute.
            joint: index of a joint that is to have a number of its own; -1: none is.

        Raises:
            ExperimentError: the law has no such number; says which it has.
        """
        law = self.controller
        while isinstance(law, GravityCompensated):
            law = law.feedback
        value = getattr(law, name, None) if not name.startswith("_") else None
        if value is None and name == "ki" and hasattr(law, "ki"):
            value = 0.0
        number = np.asarray(value)
        if value is None or number.dtype.kind not in "fi" or number.ndim > 1:
            fields = getattr(law, "__dataclass_fields__", ())
            raise ExperimentError(
                f"the control law {type(law).__name__} has no gain {name!r} to differentiate by",
                advice=f"it has {', '.join(fields)}",
            )
        number = number.astype(float)
        if joint < 0:
            return number
        if number.ndim == 0 and name in _SCALARS:
            raise ExperimentError(
                f"{name} of the control law is one number for all joints",
                advice="give the direction joint = -1",
            )
        return np.broadcast_to(number, self.robot.size)


#: Attributes of control laws that all joints share.
_SCALARS = ("derivative_time", "speed_feed_forward", "rate")


def _with_attribute(controller: Controller, name: str, value: np.ndarray) -> Controller:
    """A control law with another value of an attribute."""
    if isinstance(controller, GravityCompensated):
        return replace(controller, feedback=_with_attribute(controller.feedback, name, value))
    changed = copy.copy(controller)
    object.__setattr__(changed, name, value if np.ndim(value) else float(value))
    return changed
