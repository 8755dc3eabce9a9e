"""Equations of the drives in the unit of the log: one row for each motor, sums for each load.

A log holds commands c (amperes, volts, or torques by a declared gain). With the transmission's
coupling of motors B (identity without couplings) and one unknown gain κ_m for each motor,

    tau = B (κ ∘ c),      (B⁻¹ Φ θ)_m = κ_m c_m      for each motor m,

so that a row belongs to one motor, and a gain to one row. Where the log is in N m already, κ is
the ratio of the true gain to the declared one.

The sums over samples that `pivident.estimation.normal_equations` computes for each row are
sufficient for every estimator of the gains.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.errors import IdentificationError
from pivident.estimation.covariance.windows import Windows
from pivident.estimation.full_rate import BLOCK, valid_samples
from pivident.estimation.normal_equations import JointSums
from pivident.motion.kinematics import Kinematics
from pivident.motion.motion import SimulatedMotion, SpeedLimits, packed_stretch, with_inner
from pivident.robot.description import Robot
from pivident.robot.transmission import Transmission

#: Windows of time of each record for the sandwich. All drives together have many more unknowns than
#: one identification, and with fewer windows the standard errors are too small.
WINDOWS = 60


@dataclass(frozen=True, eq=False)
class DriveRecord:
    """One recording in the drive equations."""

    kinematics: Kinematics  # motion, and commands (as torques) at the same instants
    limits: SpeedLimits  # speeds below which samples are excluded
    load: int = 0  # carried by the robot: 0 none, 1 the payload
    motion: SimulatedMotion | None = None  # simulated, for instruments; None: least squares


def motor_coupling(transmission: Transmission) -> np.ndarray:
    """B (joints, joints): joint torques of commands referred to each motor's own joint.

    From tau = Nᵀ tau_motor, B = Nᵀ diag(N)⁻¹; the identity where no motor drives a second joint.
    """
    return transmission.reduction.T / np.diag(transmission.reduction)


def drive_columns(robot: Robot, regressor: Regressor) -> list[np.ndarray]:
    """Parameters that act on each motor: those of all joints in its row."""
    rows = np.linalg.inv(motor_coupling(robot.transmission))
    return [
        np.unique(np.concatenate([regressor.columns_of(int(j)) for j in np.flatnonzero(rows[m])]))
        for m in range(robot.size)
    ]


def drive_sums(
    robot: Robot, regressor: Regressor, records: Sequence[DriveRecord]
) -> list[list[JointSums]]:
    """Sums of each motor's rows, ``sums[load][motor]``; ``tau`` of the sums is the command c."""
    columns = drive_columns(robot, regressor)
    rows = np.linalg.inv(motor_coupling(robot.transmission))
    windows = [
        Windows(r.kinematics.q.shape[1], WINDOWS, k * WINDOWS) for k, r in enumerate(records)
    ]
    count = sum(w.count for w in windows)
    loads = 1 + max(r.load for r in records)
    sums = [
        [
            JointSums.empty(name, own, count)
            for name, own in zip(robot.joint_names, columns, strict=True)
        ]
        for _ in range(loads)
    ]
    for record, own in zip(records, windows, strict=True):
        k = with_inner(regressor, record.kinematics)
        motion = None if record.motion is None else with_inner(regressor, record.motion)
        valid = valid_samples(k, k.dq if motion is None else motion.dq, record.limits)
        commands = rows @ k.tau
        for start in range(0, own.samples, BLOCK):
            span = slice(start, min(start + BLOCK, own.samples))
            shares = list(own.shares(span))
            phi = packed_stretch(regressor, k, span)
            z = phi
            if motion is not None:
                z = packed_stretch(regressor, motion, span)
            for m in range(robot.size):
                sums[record.load][m].add(
                    motor_rows(regressor, rows[m], columns[m], phi),
                    None if motion is None else motor_rows(regressor, rows[m], columns[m], z),
                    commands[m, span],
                    motor_valid_samples(rows[m], valid[:, span]),
                    shares,
                )
    return sums


def motor_rows(
    regressor: Regressor, row: np.ndarray, columns: np.ndarray, packed: np.ndarray
) -> np.ndarray:
    """Rows of one motor, Σ_j (B⁻¹)_mj Φ_j, shape (columns, samples)."""
    joints = np.flatnonzero(row)
    offsets = regressor.offsets
    if joints.size == 1 and row[joints[0]] == 1.0:
        return packed[offsets[joints[0]] : offsets[joints[0] + 1]]
    made = np.zeros((columns.size, packed.shape[1]))
    for j in joints:
        place = np.searchsorted(columns, regressor.columns_of(int(j)))
        made[place] += row[j] * packed[offsets[j] : offsets[j + 1]]
    return made


def motor_valid_samples(row: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Samples of a motor that are valid for all its joints, True = used, shape (samples,)."""
    return np.all(valid[np.flatnonzero(row)], axis=0, out=np.empty(valid.shape[1], dtype=bool))


def refuse_load_friction(regressor: Regressor) -> None:
    """Refuse laws whose columns depend on the torque, which the gains are to determine."""
    if regressor.depends_on_load:
        names = [p.name for p in regressor.parameters if p.friction and p.friction.depends_on_load]
        raise IdentificationError(
            f"load-dependent friction ({', '.join(names)}) needs the torque in N m, whose gain is "
            "unknown here",
            advice="identify the gains with a law without load first",
        )
