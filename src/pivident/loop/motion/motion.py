"""Motions that columns are made from: measured, simulated or any other, with inner signals.

Speeds and accelerations that are compared with differences of measured positions have to be
differences themselves. Those of a simulated motion are made from its positions where they are
needed: a long record keeps one array in place of three.

Inner signals are columns that need the path so far or the load, made once per record. Most
friction laws have none. Where there are some, they belong to the motion as its positions do, and
go with it through the blocks in which a record is processed.

The measured motion of a recording as the equations need it, and the residual they leave.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.regressor import Regressor
from pivident.robot.description import Coupling
from pivident.signals.alignment import AlignedTorque, align_torque
from pivident.signals.instants import differences_at_instants
from pivident.signals.spectral_lines import SpectralLine

#: Highest frequency of a robot's motion [Hz], twice the usual bandwidth of a position loop.
MOTION_BAND = 20.0
#: Samples that must remain between the ends that the filters distort.
MIN_RUN = 100


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


class Smoother(Protocol):
    """What has smoothed the positions of a joint: a linear operator S."""

    def smoothed(self, y: np.ndarray) -> np.ndarray:
        """S y of a channel, shape (samples,)."""

    def band(self, rate: float) -> float:
        """Frequency that it halves [Hz], at a sampling ``rate`` [Hz]."""


@dataclass(frozen=True, eq=False)
class Kinematics:
    """Estimated motion of one recording, time **last**, with the torque on the same instants."""

    recording: Recording  # where it comes from
    q: np.ndarray  # positions [rad or m], shape (joints, samples); ``dq ddq tau`` likewise
    dq: np.ndarray  # speeds
    ddq: np.ndarray  # accelerations
    tau: np.ndarray  # torque [N m or N]
    start: int  # first sample that may be used
    stop: int  # one past the last
    #: half-power frequency of the smoother [Hz], shape (joints,); NaN with a band-pass.
    f50: np.ndarray
    #: Measurement noise found [rad or m], shape (joints,); NaN with a band-pass. Where there are
    #: lines, its white floor.
    encoder_std: np.ndarray
    #: Spectral lines found in each joint's measurement noise; empty where not searched.
    lines: tuple[tuple[SpectralLine, ...], ...] = ()
    #: Smoother of each joint's positions; None where it is no linear operator on a signal and noise
    #: (visible counts), empty with a band-pass and with two passes.
    smoothers: tuple[Smoother | None, ...] = ()
    #: Columns with memory or load, shape (inner entries, samples), see ``Regressor.inner``; None
    #: where they were not made.
    inner: np.ndarray | None = None
    #: True for samples whose motion and torque were measured, see ``Recording.valid``; None: all.
    measured: np.ndarray | None = None

    def stretch(self, span: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, dq and ddq on some samples."""
        return self.q[:, span], self.dq[:, span], self.ddq[:, span]


def aligned_torque(recording: Recording, joint: int, align: bool = True) -> AlignedTorque:
    """Torque of one joint on the instants of the positions.

    A declared delay is taken out in any case.

    Args:
        recording: the run.
        joint: index of the joint.
        align: whether torques that are held or averaged are moved to the instants, too.
    """
    return align_torque(
        np.ascontiguousarray(recording.tau[:, joint]),
        recording.rate,
        recording.torque_timing if align else "sampled",
        control_rate=recording.control_rate,
        delay=recording.delay - recording.drive_delay,
    )


def measured_samples(kinematics: Kinematics) -> np.ndarray:
    """Samples of a joint's equation that were measured, shape (joints, samples) or (joints, 1)."""
    measured = kinematics.measured
    return np.ones((len(kinematics.q), 1), bool) if measured is None else measured


def usable_samples(kinematics: Kinematics) -> np.ndarray:
    """Those between the ends that the smoother distorts, shape (joints, samples)."""
    usable = np.zeros(kinematics.q.shape, bool)
    usable[:, kinematics.start : kinematics.stop] = True
    return usable & measured_samples(kinematics)


def torque_of(regressor: Regressor, motion: Kinematics, theta: np.ndarray) -> np.ndarray:
    """Φθ on a recording, time last, shape (joints, samples).

    Friction that grows with the load takes the one that is with the motion, or else that of θ.
    """
    return regressor.torque(motion.q.T, motion.dq.T, motion.ddq.T, theta, motion.inner).T


def residual_of(regressor: Regressor, kinematics: Kinematics, theta: np.ndarray) -> np.ndarray:
    """τ - Φθ: v of (P-4), (P-24), (P-30); on a recording, time last, shape (joints, samples)."""
    model = torque_of(regressor, kinematics, theta)
    return np.subtract(kinematics.tau, model, out=model)
