"""Equations after parallel decimation: columns and torque through the same filter, then thinned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.covariance.sandwich import windows_of
from pivident.estimation.inner_signals import packed_stretch
from pivident.estimation.kinematics import Kinematics
from pivident.estimation.methods import Bandpass
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.simulated_motion import SimulatedMotion
from pivident.signals.decimation import (
    Convention,
    decimation_blocks,
    decimation_offsets,
    decimation_overlap,
    decimation_stages,
    parallel_decimation,
)
from pivident.threads import run_in_threads


@dataclass(frozen=True, eq=False)
class DecimatedRecord:
    """Decimated equations of one recording, time **last**.

    Attributes:
        kinematics: the motion they were made from.
        t: time of each row [s], shape (rows,).
        phi: packed observation matrix, shape (entries, rows).
        z: packed instruments, likewise; None: least squares.
        tau: torque, shape (joints, rows) [N m or N].
        dq: speeds that decide about the mask, shape (joints, rows).
        votes: rows that count, shape (joints, rows).
    """

    kinematics: Kinematics
    t: np.ndarray
    phi: np.ndarray
    z: np.ndarray | None
    tau: np.ndarray
    dq: np.ndarray
    votes: np.ndarray


def decimate_record(
    regressor: Regressor,
    kinematics: Kinematics,
    signals: Bandpass,
    limits: np.ndarray,
    motion: SimulatedMotion | None = None,
    earlier: DecimatedRecord | None = None,
) -> DecimatedRecord:
    """Build and decimate the equations of one recording.

    Args:
        regressor: the observation matrix.
        kinematics: estimated motion and torque.
        signals: the recipe.
        limits: speeds below which a joint's rows do not vote, shape (joints,).
        motion: simulated motion for the instruments.
        earlier: an earlier result, whose Φ and τ are kept (only the instruments are new).
    """
    factor, like = signals.factor(kinematics.recording.rate), signals.convention
    part = slice(kinematics.start, kinematics.stop)
    if earlier is None:
        phi = _decimated_columns(regressor, kinematics, part, factor, like)
        tau = parallel_decimation(kinematics.tau[:, part].T, factor, convention=like).T
        index = _kept_samples(part.stop - part.start, factor, like)
        t = kinematics.recording.start_time + (part.start + index) / kinematics.recording.rate
    else:
        phi, tau, t = earlier.phi, earlier.tau, earlier.t
    source = kinematics if motion is None else motion
    z = None if motion is None else _decimated_columns(regressor, motion, part, factor, like)
    dq = parallel_decimation(source.dq[:, part].T, factor, convention=like).T
    votes = (np.abs(dq) > limits[:, None]) | (limits == 0.0)[:, None]
    return DecimatedRecord(kinematics, t, phi, z, tau, dq, votes)


def decimated_sums(regressor: Regressor, records: Sequence[DecimatedRecord]) -> list[JointSums]:
    """Normal equations of all joints over all recordings."""
    windows = windows_of([r.t.size for r in records])
    count = sum(w.count for w in windows)
    sums = []
    for j in range(regressor.robot.size):
        own = slice(regressor.offsets[j], regressor.offsets[j + 1])
        joint = JointSums.empty(regressor.robot.joint_names[j], regressor.columns_of(j), count)
        for r, w in zip(records, windows, strict=True):
            z = None if r.z is None else r.z[own]
            joint.add(r.phi[own], z, r.tau[j], r.votes[j], list(w.shares(slice(0, r.t.size))))
        sums.append(joint)
    return sums


def decimated_torque(
    regressor: Regressor, record: DecimatedRecord, theta: np.ndarray
) -> np.ndarray:
    """Φθ on the rows of a recording, shape (joints, rows)."""
    joints = range(regressor.robot.size)
    spans = [slice(regressor.offsets[j], regressor.offsets[j + 1]) for j in joints]
    return np.stack([theta[regressor.column[own]] @ record.phi[own] for own in spans])


def _decimated_columns(
    regressor: Regressor,
    motion: Kinematics | SimulatedMotion,
    part: slice,
    factor: int | tuple[int, ...],
    like: Convention,
) -> np.ndarray:
    """Packed columns of a motion, decimated in blocks that overlap by the filter's reach."""
    samples = part.stop - part.start
    reach = decimation_overlap(factor)
    thinning = int(np.prod(decimation_stages(factor)))
    blocks = list(decimation_blocks(samples, factor, max(4 * reach, 65536), like))
    out = np.empty((regressor.entries, _kept_samples(samples, factor, like).size))
    for b in blocks:
        span = slice(part.start + b.source.start, part.start + b.source.stop)
        packed = packed_stretch(regressor, motion, span)

        def work(j: int, packed=packed, b=b) -> None:
            own = slice(regressor.offsets[j], regressor.offsets[j + 1])
            if thinning > 1:
                whole = parallel_decimation(
                    packed[own].T, factor, convention=like, offsets=b.offsets
                )
                thin = whole[b.keep]
            else:
                thin = packed[own].T[b.keep]
            out[own, b.target] = thin.T

        run_in_threads(work, range(regressor.robot.size))
    return out


def _kept_samples(samples: int, factor: int | tuple[int, ...], like: Convention) -> np.ndarray:
    """Indices of the samples that decimation keeps."""
    index = np.arange(samples)
    offsets = decimation_offsets(samples, factor, like)
    for stage, offset in zip(decimation_stages(factor), offsets, strict=True):
        index = index[offset::stage]
    return index
