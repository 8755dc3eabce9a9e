"""A control loop for records that come without law, without reference, or without both.

With the reference recorded, the law follows from it (``identify_controller``). With neither, the
feedback is still in the record: above the band of the motion the reference is silent, and there
the torque answers nothing but the measured position,

    H(z) u = -kp H(z) q - kd H(z) D q,     H a high-pass beyond the motion's band

Least squares on it gives kp and kd with the loop's own noise as excitation, where there is enough
of it. The reference is then what the law must have been given, r = q + (u + kd D q)/kp, made
smooth. Where the torque is hardly explained in this way (a coarse log, an unknown structure) the
law cannot be identified, and a declared one takes its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pivident.data.recording.joint_order import in_order_of
from pivident.data.recording.recording import Recording
from pivident.estimation.control_law.identified_law import (
    identify_controller,
)
from pivident.estimation.control_law.joint_law import differentiator_values
from pivident.estimation.control_law.reference_reconstruction import (
    reconstruct_reference,
)
from pivident.foundation.errors import IdentificationError
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.numbers import plus_minus
from pivident.loop.simulation.control_loop import Loop, virtual_pd
from pivident.loop.simulation.controllers import Controller
from pivident.loop.simulation.linear_law import LinearLaw, differentiated
from pivident.robot.description import Robot

#: Cut-off frequencies of the high-pass tried [Hz].
CUTOFFS = (20.0, 30.0, 45.0, 60.0, 100.0, 150.0, 200.0)

#: Share of the high-passed torque that a feedback law must explain to be believed.
EXPLAINED = 0.9


#: Said of the law of a robot with closed loops.
WITHOUT_GRAVITY = (
    "Whether the law compensates gravity was not looked for, since the robot has closed loops."
)


@dataclass(frozen=True)
class Feedback(Displayed):
    """Feedback of one joint, identified from the noise in the loop.

    Attributes:
        name: name of the joint.
        kp: [u per rad or m]; ``kp_std`` its standard error.
        kp_std: see ``kp``.
        kd: [u per rad/s or m/s]; ``kd_std`` its standard error.
        kd_std: see ``kd``.
        averaged: whether the speed is the difference of two-sample means.
        cutoff: of the high-pass that explained most [Hz].
        explained: share of the high-passed torque explained.
    """

    name: str
    kp: float
    kp_std: float
    kd: float
    kd_std: float
    averaged: bool
    cutoff: float
    explained: float

    @property
    def known(self) -> bool:
        """Whether the law can be believed."""
        return self.explained > EXPLAINED and self.kp > 0.0 and self.kd > 0.0

    def to_values(self) -> dict[str, Any]:
        """The law as plain values; one found from noise has no fit and no saturated samples."""
        return {
            "joint": self.name,
            "terms": ("kp", "kd"),
            "gains": (self.kp, self.kd),
            "std": (self.kp_std, self.kd_std),
            "differentiator": differentiator_values(self.averaged),
            "relative_error": None,
            "saturated": None,
            "f_tests": {},
            "gravity": None,
        }


def feedback_from_noise(recording: Recording, drive_gain: np.ndarray) -> tuple[Feedback, ...]:
    """Feedback gains of all joints, without a reference.

    Args:
        recording: one run.
        drive_gain: joint torque per controller output, shape (joints,).

    Returns:
        The gains of each joint and the share of the output that they explain.

    Raises:
        IdentificationError: the recording is sampled too slowly.
    """
    recording.require_torque("a control law is identified")
    known_inputs = sum(recording.inputs.values(), np.zeros(recording.tau.shape))
    u = recording.tau / drive_gain - known_inputs
    found = []
    for j, name in enumerate(recording.joint_names):
        trials = [
            _high_passed_fit(name, u[:, j], recording.q[:, j], recording.rate, cutoff, averaged)
            for cutoff in CUTOFFS
            if cutoff < 0.2 * recording.rate
            for averaged in (False, True)
        ]
        if not trials:
            raise IdentificationError(
                f"recording {recording.name!r} at {recording.rate:g} Hz is too slow to identify a "
                "control law from its noise",
                advice='log faster, or declare type = "virtual_pd"',
            )
        found.append(max(trials, key=lambda f: f.explained))
    return tuple(found)


def _high_passed_fit(
    name: str, u: np.ndarray, q: np.ndarray, rate: float, cutoff: float, averaged: bool
) -> Feedback:
    """Least squares beyond the band of the motion."""
    from scipy.signal import butter, sosfiltfilt

    high_pass = butter(4, cutoff, btype="high", fs=rate, output="sos")
    ends = min(int(5.0 * rate / cutoff), u.size // 4)
    part = slice(ends, u.size - ends)
    columns = np.column_stack([-q, -differentiated(q, 0.0, averaged, rate)])
    phi, y = sosfiltfilt(high_pass, columns, axis=0)[part], sosfiltfilt(high_pass, u)[part]
    scale = np.maximum(np.sqrt(np.sum(phi**2, axis=0)), 1e-300)
    gains = np.linalg.lstsq(phi / scale, y, rcond=None)[0] / scale
    error = y - phi @ gains
    covariance = np.linalg.pinv((phi / scale).T @ (phi / scale)) * np.var(error)
    std = np.sqrt(np.diag(covariance)) / scale
    explained = 1.0 - float(np.var(error) / max(np.var(y), 1e-300))
    return Feedback(name, gains[0], std[0], gains[1], std[1], averaged, cutoff, explained)


def reconstruct_loop(
    robot: Robot,
    recordings: Sequence[Recording],
    controller: Controller | None = None,
    reconstruct: bool = False,
    drive_gain: np.ndarray | float = 1.0,
    limit: np.ndarray | float = np.inf,
) -> tuple[tuple[Recording, ...], Loop]:
    """Recordings with a reference and a loop with a law, whatever was missing.

    Args:
        robot: the robot; a declared law takes its inertia, gravity in an identified one its
            geometry.
        recordings: runs under the same law.
        controller: the law; None: it is identified.
        reconstruct: whether the reference is reconstructed, recorded or not.
        drive_gain: joint torque per controller output, shape (joints,) or a scalar.
        limit: largest controller output, shape (joints,) or one for all [unit of the output].

    Returns:
        The recordings with a reference, and the loop with a law.

    Raises:
        ExperimentError: a recording has no reference and it is not to be reconstructed.
        IdentificationError: the law that comes out is none.
    """
    recordings = tuple(in_order_of(robot, recording) for recording in recordings)
    gain = np.broadcast_to(np.asarray(drive_gain, float), (robot.size,))
    if not reconstruct:
        if controller is not None:
            return recordings, Loop(controller, drive_gain, limit)
        loops = robot.constraints is not None
        found = identify_controller(recordings, gain, limit, robot=None if loops else robot)
        law_notes = (*found.notes, *((WITHOUT_GRAVITY,) if loops else ()))
        return found.signals, Loop(found.law, drive_gain, limit, identified=found, notes=law_notes)
    notes: list[str] = []
    feedback: tuple[Feedback, ...] = ()
    signals = [r.q for r in recordings]
    if controller is None:
        by_recording = [feedback_from_noise(r, gain) for r in recordings]
        best = [max(own, key=lambda f: f.explained) for own in zip(*by_recording, strict=True)]
        if all(f.known for f in best):
            law, feedback = _law(best), tuple(best)
            controller, signals = law, [_implied_reference(r, law, gain) for r in recordings]
            notes.append(_identified(best))
        else:
            posture = np.mean([r.q.mean(axis=0) for r in recordings], axis=0)
            # the declared law makes joint torques by itself: no drive, no limit, no inputs
            controller, drive_gain, limit = virtual_pd(robot, posture), 1.0, np.inf
            recordings = tuple(replace(r, inputs={}) for r in recordings)
            notes.append(_unidentified(best))
    made = [reconstruct_reference(x, r.rate) for x, r in zip(signals, recordings, strict=True)]
    notes += [
        f"The reference of recording {r.name!r} is reconstructed: {own}."
        for r, own in zip(recordings, made, strict=True)
    ]
    completed = tuple(
        replace(r, q_ref=own.q, dq_ref=own.dq, ddq_ref=own.ddq)
        for r, own in zip(recordings, made, strict=True)
    )
    return completed, Loop(
        controller,
        drive_gain,
        limit,
        feedback=feedback,
        reconstructed=tuple(made),
        notes=tuple(notes),
    )


def _law(feedback: Sequence[Feedback]) -> LinearLaw:
    """The law of these gains; feed-forward of the reference, if any, is in the reference."""
    zero = np.zeros(len(feedback))
    return LinearLaw(
        kp=np.array([f.kp for f in feedback]),
        kd=np.array([f.kd for f in feedback]),
        ki=zero,
        speed_reference=zero,
        acceleration_reference=zero,
        offset=zero,
        derivative_time=zero,
        averaged=np.array([f.averaged for f in feedback]),
    )


def _implied_reference(recording: Recording, law: LinearLaw, gain: np.ndarray) -> np.ndarray:
    """R = q + (u + kd D q)/kp, shape (samples, joints)."""
    known_inputs = sum(recording.inputs.values(), np.zeros(recording.tau.shape))
    u = recording.tau / gain - known_inputs
    reference = np.empty_like(recording.q)
    for j in range(recording.joints):
        speed = differentiated(recording.q[:, j], 0.0, bool(law.averaged[j]), recording.rate)
        reference[:, j] = recording.q[:, j] + (u[:, j] + law.kd[j] * speed) / law.kp[j]
    return reference


def _identified(feedback: Sequence[Feedback]) -> str:
    gains = "; ".join(
        f"{f.name}: kp {plus_minus(f.kp, 2 * f.kp_std)}, kd {plus_minus(f.kd, 2 * f.kd_std)}"
        for f in feedback
    )
    return (
        "Law and reference are unknown: the feedback is identified from the noise in the loop "
        f"({gains}); feed-forward cannot be distinguished from the reference itself."
    )


def _unidentified(feedback: Sequence[Feedback]) -> str:
    shares = ", ".join(f"{f.name} {100 * f.explained:.0f} %" for f in feedback)
    return (
        "Law and reference are unknown, and the gains cannot be identified from this record: "
        f"feedback explains only part of the torque beyond the motion's band ({shares}). A "
        "declared virtual PD law carries the simulation instead."
    )
