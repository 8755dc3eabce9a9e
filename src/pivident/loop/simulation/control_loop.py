"""The control loop that a record was taken in: law, drives, limits, reference, feed-forward.

A law or a reference that was found from the record brings along where it comes from. What a result
needs of that is stated here as protocols; ``pivident.estimation.control_law`` holds the classes.

A declared PD law for records whose controller is not known.

Such a loop is virtual: it only has to carry the simulated robot along the measured motion, so its
gains follow from a bandwidth and the robot's nominal inertia instead of from the real drive.

Torques that a controller adds from nominal parameters.

Evaluated on the reference they are known before the run, so they enter the simulated loop like any
other known input: added to the controller's output (divide by the drive gain where that is not a
torque). Gravity at the measured position is not known before; it becomes a part of the law.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, get_args

import numpy as np

from pivident.dynamics.forward import mass_matrix
from pivident.dynamics.parameters import Parameter, nominal_values, standard_parameters
from pivident.dynamics.robot_regressor import regressor_of
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.display import Printed
from pivident.loop.simulation.controllers import PD, PID, Controller, FeedForward
from pivident.loop.simulation.gravity_compensation import GravityCompensated, GravityModel
from pivident.robot.description import Robot


class FoundInRecord(Protocol):
    """Something found from a record, which the file of a result holds."""

    def to_values(self) -> dict[str, Any]:
        """It as plain values."""


class FoundReference(FoundInRecord, Protocol):
    """A reference that was reconstructed from a record."""

    @property
    def rms(self) -> np.ndarray:
        """What it leaves of the signal that it was fitted to, shape (joints,) [rad or m]."""

    @property
    def relative(self) -> np.ndarray:
        """That over each joint's range, shape (joints,)."""


class FittedLaw(Protocol):
    """What control laws were fitted to, and what they make of it."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints."""

    @property
    def output(self) -> np.ndarray:
        """What was fitted, shape (samples, joints)."""

    @property
    def model(self) -> np.ndarray:
        """What the law makes of it, likewise."""

    @property
    def rate(self) -> float:
        """Sampling rate [Hz]."""


class IdentifiedLaw(FittedLaw, Protocol):
    """Control laws of all joints, identified from reference, positions and torques."""

    @property
    def joints(self) -> Sequence[Any]:
        """One law for each joint."""

    @property
    def recordings(self) -> Sequence[str]:
        """Names of the recordings."""

    @property
    def compared(self) -> str:
        """What output and model are."""

    @property
    def unit(self) -> str:
        """Their unit."""

    @property
    def warnings(self) -> Sequence[str]:
        """What the identification noticed, whole sentences."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader should know of the laws' structure, whole sentences."""


@dataclass(frozen=True, eq=False)
class Loop(Printed):
    """The control loop that a record was taken in.

    Attributes:
        controller: the sampled control law.
        drive_gain: joint torque per controller output, shape (joints,) or a scalar.
        gain_known: whether the drive gain is known; where it is not, 1 stands for it, and
            parameters from a log without torque are ratios to it.
        limit: largest controller output, shape (joints,) or a scalar; infinite without one.
        reference: ``recorded``: the log holds q_ref; ``smoothed``: it does not, and the
            smoothed measurement takes its place. Such a loop is virtual: it only has to carry
            the simulation along the motion, and the instruments then depend on the noise that
            the smoother let through.
        feed_forward: ``gravity`` or ``computed_torque``: the controller adds the inverse
            dynamics of the reference with the robot's nominal parameters, at rest or in motion;
            ``gravity_measured``: it adds the weight of the nominal links at the measured position.
        count: what the encoder counts in whose positions the law reads [rad or m], shape (joints,)
            or a scalar; zero: no counts that would show in the motion.
        identified: where the law comes from, if it was identified.
        feedback: where it comes from, joint by joint, if it was identified from the noise in
            the loop.
        reconstructed: where the references come from, one for each recording.
        notes: sentences about law and reference that belong to every result.

    Example:
        >>> robot, gain = pv.load_robot("planar_2r"), np.array([100.0, 50.0])  # [N m per A]
        >>> kp, kd = np.array([6000, 2500]), np.array([180, 60])  # [N m per rad, per rad/s]
        >>> newton_metres, amperes = pv.PD(kp, kd), pv.PD(kp / gain, kd / gain)
        >>> one = pv.simulate(robot, pv.Loop(newton_metres), duration=2.0).recording
        >>> other = pv.simulate(robot, pv.Loop(amperes, drive_gain=gain), duration=2.0).recording
        >>> np.allclose(one.tau, other.tau)
        True
    """

    controller: Controller
    drive_gain: np.ndarray | float = 1.0
    limit: np.ndarray | float = np.inf
    reference: Literal["recorded", "smoothed"] = "recorded"
    feed_forward: FeedForward = "none"
    count: np.ndarray | float = 0.0
    identified: IdentifiedLaw | None = None
    feedback: tuple[Any, ...] = ()
    reconstructed: tuple[FoundReference, ...] = ()
    notes: tuple[str, ...] = ()
    gain_known: bool = field(default=True, kw_only=True)

    def __post_init__(self) -> None:
        if not hasattr(self.controller, "law"):
            raise ExperimentError(
                f"controller of the loop is {self.controller!r}",
                advice="give a control law, such as PD(kp=…, kd=…)",
            )
        count = np.asarray(self.count, dtype=float)
        if not (np.isfinite(count) & (count >= 0.0)).all():
            raise ExperimentError(
                f"count of the loop is {self.count}",
                advice="give what the encoder counts in that the law reads, in rad or m, not "
                "negative, as one number or as one for each joint",
            )
        for name, choices in (
            ("reference", ("recorded", "smoothed")),
            ("feed_forward", get_args(FeedForward)),
        ):
            if getattr(self, name) not in choices:
                raise ExperimentError(
                    f"{name} of the loop is {getattr(self, name)!r}",
                    advice=f"choose one of {', '.join(choices)}",
                )

    def counts(self, joints: int) -> np.ndarray:
        """``count`` of each joint [rad or m], shape (joints,)."""
        return np.broadcast_to(np.asarray(self.count, dtype=float), (joints,))

    def law_values(self) -> list[dict[str, Any]] | None:
        """The law that was found, one entry for each joint, as plain values; None: it was given."""
        found = self.feedback if self.identified is None else self.identified.joints
        return [own.to_values() for own in found] or None

    def reference_values(self) -> list[dict[str, Any]] | None:
        """The references that were reconstructed, likewise, one entry for each recording."""
        return [own.to_values() for own in self.reconstructed] or None

    @property
    def found(self) -> bool:
        """Whether law or reference were found from the record."""
        return self.identified is not None or bool(self.feedback or self.reconstructed)


def virtual_pd(
    robot: Robot, posture: np.ndarray, bandwidth: float = 10.0, damping: float = 0.7
) -> PID:
    """PD gains kp = J ω², kd = 2 ζ J ω with ω = 2π · bandwidth and J = diag M(posture).

    A joint's inertia is that of the robot's nominal parameters, or one where they are not known.

    Args:
        robot: the robot.
        posture: joint positions at which the inertia is taken [rad or m], shape (joints,); the
            mean of the motion is a good one.
        bandwidth: of each joint's loop [Hz]. A soft loop lets the model show in the simulated
            motion, a stiff one makes it repeat the measured motion.
        damping: ζ, 1 for critical damping.

    Returns:
        The law, its output in joint torques [N m or N].

    Raises:
        ExperimentError: bandwidth or damping is not positive.
    """
    if not (bandwidth > 0 and damping > 0):
        raise ExperimentError(
            f"a virtual PD law needs a positive bandwidth and damping, not {bandwidth:g} Hz and "
            f"{damping:g}"
        )
    inertia = nominal_inertia(robot, posture)
    omega = 2.0 * np.pi * bandwidth
    return PD(inertia * omega**2, 2.0 * damping * inertia * omega)


def nominal_inertia(robot: Robot, posture: np.ndarray) -> np.ndarray:
    """Diagonal of M(posture) at the nominal parameters, one where that is not positive.

    ``posture``: joint positions [rad or m], shape (joints,). Result: inertia of each joint
    [kg m² or kg], shape (joints,).
    """
    parameters = standard_parameters(robot)
    values = nominal_values(robot, parameters)
    mass = mass_matrix(robot, parameters, values, np.atleast_2d(np.asarray(posture, float)))[0]
    inertia = np.diag(mass).copy()
    return np.where(np.isfinite(inertia) & (inertia > 0.0), inertia, 1.0)


def loop_feed_forward(
    robot: Robot, loop: Loop, reference: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> np.ndarray | None:
    """Known inputs of a loop on its reference, (samples, joints) [unit of the controller's output].

    ``reference``: q, dq, ddq, each (samples, joints).
    """
    if loop.feed_forward in ("none", "gravity_measured"):  # that one is a part of the law
        return None
    standard = standard_parameters(robot)
    theta = nominal_values(robot, standard)
    if loop.feed_forward == "gravity":
        torque = gravity_feed_forward(robot, standard, theta, reference[0])
    else:
        torque = computed_torque_feed_forward(robot, standard, theta, *reference)
    return torque / np.asarray(loop.drive_gain)


def gravity_feed_forward(
    robot: Robot, parameters: tuple[Parameter, ...], theta: np.ndarray, q_ref: np.ndarray
) -> np.ndarray:
    """Torque that holds the robot at rest on its reference, shape (samples, joints) [N m or N].

    ``q_ref``: reference positions [rad or m], shape (samples, joints).
    """
    still = np.zeros_like(q_ref)
    return computed_torque_feed_forward(robot, parameters, theta, q_ref, still, still)


def computed_torque_feed_forward(
    robot: Robot,
    parameters: tuple[Parameter, ...],
    theta: np.ndarray,
    q_ref: np.ndarray,
    dq_ref: np.ndarray,
    ddq_ref: np.ndarray,
) -> np.ndarray:
    """Inverse dynamics of the reference, Φ(q_ref, dq_ref, ddq_ref) θ, shape (samples, joints).

    ``q_ref``: reference positions [rad or m], shape (samples, joints). Result: torques or forces
    [N m or N].
    """
    return regressor_of(robot, parameters).torque(q_ref, dq_ref, ddq_ref, theta)


def with_measured_gravity(
    controller: Controller, robot: Robot, drive_gain: np.ndarray | float, kind: FeedForward
) -> Controller:
    """The law with the nominal robot's gravity at the measured position, where ``kind`` says so.

    ``drive_gain``: joint torque per controller output, shape (joints,) or a scalar.
    """
    if kind != "gravity_measured":
        return controller
    return GravityCompensated(controller, GravityModel.nominal(robot, drive_gain))
