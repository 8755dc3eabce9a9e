"""The measured motion of a recording as the equations need it, and the residual they leave."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.recording.recording import Recording
from pivident.signals.alignment import AlignedTorque, align_torque
from pivident.signals.spectral_lines import SpectralLine

#: Highest frequency of a robot's motion [Hz], twice the usual bandwidth of a position loop.
MOTION_BAND = 20.0

#: Samples that must remain between the ends that the filters distort.
MIN_RUN = 100


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
