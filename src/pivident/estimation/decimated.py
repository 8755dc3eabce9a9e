"""Equations after parallel decimation: columns and torque through one filter, thinned; (P-18)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, TypeVar

import numpy as np

from pivident.data.logs.timestamps import mostly_usable
from pivident.dynamics.regressor import Regressor
from pivident.estimation.covariance.windows import Windows
from pivident.estimation.equation_record import FittedRecording, JointColumns, weighted
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.signal_recipes import Decimated
from pivident.foundation.threads import run_in_threads
from pivident.loop.motion.motion import Kinematics, SimulatedMotion, SpeedLimits, packed_stretch
from pivident.signals.decimation import (
    Convention,
    decimation_blocks,
    decimation_offsets,
    decimation_overlap,
    decimation_stages,
    parallel_decimation,
)
from pivident.signals.prefilter import Prefilter

Rows = TypeVar("Rows")


@dataclass(frozen=True, eq=False)
class DecimatedRecord:
    """Decimated equations of one recording, time **last**."""

    kinematics: Kinematics  # the motion they were made from
    t: np.ndarray  # time of each row [s], shape (rows,)
    phi: np.ndarray  # packed observation matrix, shape (entries, rows)
    z: np.ndarray | None  # packed instruments, likewise; None: least squares
    tau: np.ndarray  # torque, shape (joints, rows) [N m or N]
    dq: np.ndarray  # speeds that decide which rows are used, shape (joints, rows)
    used: np.ndarray  # rows that the estimate uses, shape (joints, rows)

    full_rate: ClassVar[bool] = False
    motion: ClassVar[None] = None

    @property
    def row_weights(self) -> np.ndarray | None:
        """Weights of the samples that the rows stand for, shape (joints, rows); None: all one."""
        weights = self.kinematics.recording.weights
        return None if weights is None else weights[np.round(self.sample_numbers).astype(int)].T

    @property
    def has_instruments(self) -> bool:
        """Whether instruments differ from the observation matrix."""
        return self.z is not None

    @property
    def seen(self) -> np.ndarray:
        """All rows."""
        return np.ones_like(self.used)

    @property
    def usable_rows(self) -> int:
        """All rows."""
        return self.t.size

    @property
    def sample_numbers(self) -> np.ndarray:
        """Sample of the recording that each row stands for, shape (rows,)."""
        recording = self.kinematics.recording
        return (self.t - recording.start_time) * recording.rate

    def with_torque(self, tau: np.ndarray) -> DecimatedRecord:
        """The same rows with another torque, shape (joints, rows)."""
        return replace(self, tau=tau)

    def add_to(
        self,
        sums: Sequence[JointSums],
        regressor: Regressor,
        filters: Sequence[Prefilter],
        windows: Windows | None,
    ) -> None:
        """Add the rows to the normal equations of all joints."""
        shares = [] if windows is None else list(windows.shares(slice(0, self.t.size)))
        for j, joint in enumerate(sums):
            phi, z, _, tau = self._columns(regressor, j)
            weights = None if self.row_weights is None else self.row_weights[j]
            joint.add(phi, z, tau, self.used[j], shares, weights)

    def residual(self, regressor: Regressor, theta: np.ndarray) -> np.ndarray:
        """τ - Φθ on the rows, shape (joints, rows)."""
        return self.tau - self._model(regressor, theta)

    def whitened(
        self, residual: np.ndarray, filters: Sequence[Prefilter], variance: np.ndarray
    ) -> np.ndarray:
        """ε_j λ_j^(-1/2), shape (joints, rows)."""
        white = residual / np.sqrt(np.where(variance > 0, variance, 1.0))[:, None]
        return white if self.row_weights is None else white * np.sqrt(self.row_weights)

    def fitted(
        self, regressor: Regressor, theta: np.ndarray, residual: np.ndarray, whitened: np.ndarray
    ) -> FittedRecording:
        """Signals for plots on the decimated rows; both residuals are overwritten."""
        k = self.kinematics
        index = np.round(self.sample_numbers).astype(int)
        rate = 1.0 / np.median(np.diff(self.t)) if self.t.size > 1 else k.recording.rate
        whitened[~self.used] = np.nan
        torques = self.tau, self._model(regressor, theta)
        return FittedRecording.at(k, index, self.t, torques, self.used, whitened, float(rate))

    def columns_of(
        self, regressor: Regressor, filters: Sequence[Prefilter], joint: int, keep: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
        """Some of a joint's columns of Φ and Z, and its τ, on all rows."""
        phi, z, _, tau = self._columns(regressor, joint)
        return phi[keep], None if z is None else z[keep], tau

    def blocks(
        self,
        regressor: Regressor,
        filters: Sequence[Prefilter],
        extra: np.ndarray | None,
        make: Callable[[int, JointColumns, np.ndarray], Rows],
    ) -> Iterator[tuple[slice, tuple[Rows, ...]]]:
        """All rows as one block; ``extra``: packed columns of further instruments."""
        joints = range(regressor.robot.size)
        rows = [make(j, self._columns(regressor, j, extra), weighted(self, j)) for j in joints]
        yield slice(0, self.t.size), tuple(rows)

    def _columns(
        self, regressor: Regressor, joint: int, extra: np.ndarray | None = None
    ) -> JointColumns:
        """Φ, Z, what further instruments have beside Z, and τ of a joint."""
        own = _own(regressor, joint)
        z = None if self.z is None else self.z[own]
        further = None if extra is None or z is None else extra[own] - z
        return self.phi[own], z, further, self.tau[joint]

    def _model(self, regressor: Regressor, theta: np.ndarray) -> np.ndarray:
        """Φθ on the rows, shape (joints, rows)."""
        spans = [_own(regressor, j) for j in range(regressor.robot.size)]
        return np.stack([theta[regressor.column[own]] @ self.phi[own] for own in spans])


def decimate_record(
    regressor: Regressor,
    kinematics: Kinematics,
    signals: Decimated,
    limits: SpeedLimits,
    motion: SimulatedMotion | None = None,
    earlier: DecimatedRecord | None = None,
) -> DecimatedRecord:
    """Build and decimate the equations of one recording.

    ``limits``: speeds below which rows are excluded.
    """
    factor, like = signals.factor(kinematics.recording.rate), signals.convention
    part = slice(kinematics.start, kinematics.stop)
    if earlier is None:
        phi = decimated_columns(regressor, kinematics, part, factor, like)
        tau = parallel_decimation(kinematics.tau[:, part].T, factor, convention=like).T
        index = _kept_samples(part.stop - part.start, factor, like)
        t = kinematics.recording.start_time + (part.start + index) / kinematics.recording.rate
    else:
        phi, tau, t = earlier.phi, earlier.tau, earlier.t
    source = kinematics if motion is None else motion
    z = None if motion is None else decimated_columns(regressor, motion, part, factor, like)
    dq = parallel_decimation(source.dq[:, part].T, factor, convention=like).T
    used = limits.moving(dq)
    at = np.round((t - kinematics.recording.start_time) * kinematics.recording.rate).astype(int)
    if motion is not None and motion.valid is not None:
        used = used & motion.valid[at]
    if kinematics.measured is not None:  # the decimation mixes a sample with those beside it
        reach = int(np.prod(decimation_stages(factor)))
        used = used & [mostly_usable(measured, reach)[at] for measured in kinematics.measured]
    return DecimatedRecord(kinematics, t, phi, z, tau, dq, used)


def _own(regressor: Regressor, joint: int) -> slice:
    """Entries of the packed matrix that belong to a joint."""
    return slice(regressor.offsets[joint], regressor.offsets[joint + 1])


def decimated_columns(
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
