"""Motions that columns are made from: measured, simulated or any other, with inner signals.

Speeds and accelerations that are compared with differences of measured positions have to be
differences themselves. Those of a simulated motion are made from its positions where they are
needed: a long record keeps one array in place of three.

Inner signals are columns that need the path so far or the load, made once per record. Most
friction laws have none. Where there are some, they belong to the motion as its positions do, and
go with it through the blocks in which a record is processed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol, TypeVar

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.robot.description import Coupling
from pivident.signals.instants import differences_at_instants

if TYPE_CHECKING:
    from pivident.motion.kinematics import Kinematics


class Motion(Protocol):
    """Positions, speeds and accelerations, each (joints, samples)."""

    @property
    def q(self) -> np.ndarray:
        """Positions [rad or m]."""

    @property
    def dq(self) -> np.ndarray:
        """Speeds [rad/s or m/s]."""

    @property
    def ddq(self) -> np.ndarray:
        """Accelerations [rad/s² or m/s²]."""

    @property
    def inner(self) -> np.ndarray | None:
        """Columns with memory or load, (inner entries, samples), where there are any."""

    def stretch(self, span: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, dq and ddq on some samples."""


@dataclass(frozen=True, eq=False)
class SimulatedMotion:
    """Noise-free motion of one recording, time **last**, on the samples of the record."""

    q: np.ndarray  # positions [rad or m], shape (joints, samples)
    rate: float  # sampling rate [Hz]
    #: Dq and ddq right after each sample's torque, shape (2, joints, samples); None: from
    #: differences of q, as the smoother's. With a torque that is held over each period the
    #: acceleration has no value at an instant; this is its mean over the two periods that adjoin
    #: it.
    derivatives: np.ndarray | None = None
    #: Torque held from each sample on [N m or N]; None where it was not kept.
    tau: np.ndarray | None = None
    #: Columns with memory or load of this motion, shape (inner entries, samples); None where they
    #: were not made.
    inner: np.ndarray | None = None
    #: Samples at which it may make instruments, shape (samples,); None: all.
    valid: np.ndarray | None = None
    #: Whether it comes from the record, not from a model with friction: it then does not know
    #: where the joint itself sticks.
    from_record: bool = False

    @property
    def dq(self) -> np.ndarray:
        """Speeds of the whole record [rad/s or m/s], where they are differences made anew."""
        return self.stretch(slice(None))[1]

    @property
    def ddq(self) -> np.ndarray:
        """Accelerations of the whole record [rad/s² or m/s²], likewise."""
        return self.stretch(slice(None))[2]

    def stretch(self, span: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, dq and ddq on some samples; where they begin and end makes no difference."""
        if self.derivatives is not None:
            dq, ddq = self.derivatives[:, :, span]
            return self.q[:, span], dq, ddq
        first, last, _ = span.indices(self.q.shape[1])
        dq, ddq = np.empty((2, len(self.q), last - first))
        differences_at_instants(self.q, self.rate, first, dq, ddq)
        return self.q[:, first:last], dq, ddq


def central_differences(q: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """(q_{k+1} - q_{k-1}) rate/2 and (q_{k+1} - 2 q_k + q_{k-1}) rate², ends repeated."""
    dq, ddq = np.empty_like(q), np.empty_like(q)
    dq[1:-1] = 0.5 * rate * (q[2:] - q[:-2])
    ddq[1:-1] = rate**2 * ((q[2:] - q[1:-1]) - (q[1:-1] - q[:-2]))
    for x in (dq, ddq):
        x[0], x[-1] = x[1], x[-2]
    return dq, ddq


AnyMotion = TypeVar("AnyMotion", "Kinematics", "SimulatedMotion")


def with_inner(
    regressor: Regressor, motion: AnyMotion, theta: np.ndarray | None = None
) -> AnyMotion:
    """The motion with its inner signals; itself where the friction law has none.

    ``theta``: parameters that make the load, shape (parameters,); None: no load.
    """
    if regressor.inner_entries.size == 0:
        return motion
    return replace(motion, inner=regressor.inner(motion.q, motion.dq, motion.ddq, theta))


def packed_stretch(
    regressor: Regressor,
    motion: Motion,
    span: slice,
    out: np.ndarray | None = None,
    place: np.ndarray | None = None,
) -> np.ndarray:
    """Packed columns of a stretch of a record, shape (entries, samples)."""
    inner = None if motion.inner is None else motion.inner[:, span]
    if inner is None and regressor.inner_entries.size:
        raise ValueError(
            "a stretch does not contain the path before it: give the motion its inner signals "
            "(with_inner) before it is cut into blocks"
        )
    return regressor.packed(*motion.stretch(span), out=out, inner=inner, place=place)


@dataclass(frozen=True, eq=False)
class SpeedLimits:
    """Speeds below which samples are excluded, from an observation matrix with friction in it.

    At standstill dry friction takes any value up to its level, and no law of it holds. The motor of
    a coupling rubs with its own speed v = dq_motor + ratio·dq_joint, in the torques of both joints:
    where it stands still, neither joint's torque can be told, however fast the two move.

    Attributes:
        joints: by joint, shape (joints,) [rad/s or m/s]; zero: all samples count.
        couplings: motors that rub with the speeds of two joints; their limit is that of ``motor``.
    """

    joints: np.ndarray
    couplings: Sequence[Coupling] = ()

    def moving(self, dq: np.ndarray) -> np.ndarray:
        """Samples faster than the limits, shape (joints, samples), for speeds ``dq`` like it."""
        limits = self.joints[:, None]
        moving = (np.abs(dq) > limits) | (limits == 0.0)
        for c in self.couplings:
            if c.coulomb and self.joints[c.motor] > 0.0:
                motor = np.abs(dq[c.motor] + c.ratio * dq[c.joint]) > self.joints[c.motor]
                moving[[c.motor, c.joint]] &= motor
        return moving
