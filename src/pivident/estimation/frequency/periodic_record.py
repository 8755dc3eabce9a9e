"""Equations of a periodic motion on its lines, in two halves that are each other's instruments.

Mean positions of each half of the periods make its Φ, its mean torque τ. The lines 0 … K of each
column are held as the 2K + 1 samples that they are the transform of. By Parseval sums over these
samples are sums over the lines, and a weight w_k on each line is a filter that runs around the
period. The rows of both halves stand side by side, instant by instant, so that whatever
is summed by windows of time holds both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.covariance.windows import Windows
from pivident.estimation.decimated import DecimatedRecord
from pivident.estimation.equation_record import FittedRecording, JointColumns
from pivident.estimation.normal_equations import JointSums
from pivident.signals.prefilter import Prefilter

Rows = TypeVar("Rows")

#: Number of halves.
HALVES = 2


@dataclass(frozen=True, eq=False)
class PeriodicRecord(DecimatedRecord):
    """Lines of one recording; rows are instants of one period, each for both halves."""

    weights: np.ndarray = field(kw_only=True)  # w of each line, shape (joints, lines + 1)

    def add_to(
        self,
        sums: Sequence[JointSums],
        regressor: Regressor,
        filters: Sequence[Prefilter],
        windows: Windows | None,
    ) -> None:
        """Add the weighted rows to the normal equations of all joints."""
        shares = [] if windows is None else list(windows.shares(slice(0, self.t.size)))
        for j, joint in enumerate(sums):
            phi, z, _, tau = self._columns(regressor, j)
            joint.add(phi, z, tau, self.used[j], shares)

    def whitened(
        self, residual: np.ndarray, filters: Sequence[Prefilter], variance: np.ndarray
    ) -> np.ndarray:
        """Weighted residuals of unit variance, shape (joints, rows)."""
        white = [self._weighted(x[None], j)[0] for j, x in enumerate(residual)]
        return np.stack(white) / np.sqrt(np.where(variance > 0, variance, 1.0))[:, None]

    def columns_of(
        self, regressor: Regressor, filters: Sequence[Prefilter], joint: int, keep: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
        """Some of a joint's columns of Φ and Z, and its τ, weighted, on all rows."""
        phi, z, _, tau = self._columns(regressor, joint)
        return phi[keep], None if z is None else z[keep], tau

    def blocks(
        self,
        regressor: Regressor,
        filters: Sequence[Prefilter],
        extra: np.ndarray | None,
        make: Callable[[int, JointColumns, np.ndarray], Rows],
    ) -> Iterator[tuple[slice, tuple[Rows, ...]]]:
        """All rows as one block; further instruments there are none."""
        joints = range(regressor.robot.size)
        rows = [make(j, self._columns(regressor, j), self.used[j]) for j in joints]
        yield slice(0, self.t.size), tuple(rows)

    def fitted(
        self, regressor: Regressor, theta: np.ndarray, residual: np.ndarray, whitened: np.ndarray
    ) -> FittedRecording:
        """Signals for plots over one period: means of both halves."""
        recording, k = self.kinematics.recording, self.kinematics
        index = np.rint(self.sample_numbers).astype(int)[::HALVES]
        tau, model = _mean(self.tau), _mean(self.tau - residual)
        white = _mean(whitened) * np.sqrt(HALVES)
        used = self.used[:, ::HALVES]
        t = self.t[::HALVES]
        return FittedRecording(
            recording.name,
            t,
            k.q[:, index].T,
            k.dq[:, index].T,
            k.ddq[:, index].T,
            recording.q[index],
            tau.T,
            model.T,
            used.T,
            np.where(used, white, np.nan).T,
            float((t.size - 1) / (t[-1] - t[0])),
            None if recording.q_ref is None else recording.q_ref[index],
            recording.account,
            recording.torque_scale,
            recording.torque_source,
        )

    def _columns(self, regressor: Regressor, joint: int) -> JointColumns:
        """Φ, Z and τ of a joint, weighted."""
        own = slice(regressor.offsets[joint], regressor.offsets[joint + 1])
        assert self.z is not None
        phi, z = self._weighted(self.phi[own], joint), self._weighted(self.z[own], joint)
        return phi, z, None, self._weighted(self.tau[joint : joint + 1], joint)[0]

    def _weighted(self, x: np.ndarray, joint: int) -> np.ndarray:
        """Columns (columns, rows) with the weights on their lines."""
        halves = x.reshape(len(x), -1, HALVES)
        lines = np.fft.rfft(halves, axis=1) * self.weights[joint][None, :, None]
        return np.fft.irfft(lines, halves.shape[1], axis=1).reshape(x.shape)


def _mean(x: np.ndarray) -> np.ndarray:
    """Mean of both halves, shape (joints, instants)."""
    return x.reshape(len(x), -1, HALVES).mean(axis=2)
