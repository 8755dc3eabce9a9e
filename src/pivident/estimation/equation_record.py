"""What every estimator needs of one recording: rows of Φ, Z and τ, at full rate or decimated.

`FullRateRecord` makes its columns block by block and filters them on the way, `DecimatedRecord`
holds them. Both answer the same questions, so that no estimator or test has to ask which one it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Protocol

import numpy as np

from pivident.data.logs.torque_scale import TorqueScale
from pivident.data.recording.recording import TorqueSource
from pivident.dynamics.regressor import Regressor
from pivident.estimation.covariance.windows import Windows, windows_of
from pivident.estimation.normal_equations import JointSums
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.plain_values import Sized
from pivident.loop.motion.motion import Kinematics, SimulatedMotion, measured_samples
from pivident.signals.prefilter import Prefilter


@dataclass(frozen=True, eq=False)
class FittedRecording(Displayed):
    """Signals of one recording as the estimator saw them, for plots; arrays (rows, joints)."""

    name: str  # name of the recording
    t: np.ndarray  # time of each row [s], shape (rows,)
    q: np.ndarray  # estimated positions [rad or m]
    dq: np.ndarray  # estimated speeds [rad/s or m/s]
    ddq: np.ndarray  # estimated accelerations [rad/s² or m/s²]
    q_measured: np.ndarray  # measured positions on the same rows [rad or m]
    tau: np.ndarray  # measured torque, aligned with the positions [N m or N]
    tau_model: np.ndarray  # reconstructed torque Φθ
    used: np.ndarray  # True for rows that the estimate used
    #: Residual of the equation that was solved, scaled to unit variance, on the rows of the
    #: estimator, shape (rows, joints); NaN on rows that were not used.
    whitened: np.ndarray
    whitened_rate: float  # rate of ``whitened`` [Hz]
    #: Recorded or reconstructed reference on the same rows [rad or m], or None.
    q_ref: np.ndarray | None = None
    #: How the record was logged and what was done to its samples, in sentences.
    account: tuple[str, ...] = ()
    torque_scale: tuple[TorqueScale, ...] = ()  # joints whose torque has an unverified scale
    torque_source: TorqueSource = "measured"  # whether the torque was measured, see `Recording`

    @classmethod
    def at(
        cls,
        kinematics: Kinematics,
        samples: slice | np.ndarray,
        t: np.ndarray,
        torques: tuple[np.ndarray, np.ndarray],
        used: np.ndarray,
        whitened: np.ndarray,
        rate: float,
    ) -> FittedRecording:
        """Signals on the rows of an estimator, which stand for some samples of its recording.

        ``torques``: measured and reconstructed ones, (joints, rows) as ``used`` and ``whitened``.
        """
        recording, k = kinematics.recording, kinematics
        return cls(
            recording.name,
            t,
            k.q[:, samples].T,
            k.dq[:, samples].T,
            k.ddq[:, samples].T,
            recording.q[samples],
            torques[0].T,
            torques[1].T,
            used.T,
            whitened.T,
            rate,
            None if recording.q_ref is None else recording.q_ref[samples],
            recording.account,
            recording.torque_scale,
            recording.torque_source,
        )

    @property
    def torque_label(self) -> str:
        """What the torque is, for the legend of a figure."""
        return "measured" if self.torque_source == "measured" else "of the control law"


OfJoints = Annotated[np.ndarray, Sized("joints")]


@dataclass(frozen=True, eq=False)
class MotionRange(Displayed):
    """Range of the fitted motion: where an estimate knows the robot; arrays (joints,)."""

    low: OfJoints  # least positions [rad or m]
    high: OfJoints  # largest positions
    speed: OfJoints  # largest speeds [rad/s or m/s]
    acceleration: OfJoints  # largest accelerations [rad/s² or m/s²]

    @classmethod
    def of(cls, recordings: Sequence[FittedRecording]) -> MotionRange:
        """Range of the rows that the estimate used for at least one joint."""
        rows = [np.asarray(r.used, dtype=bool).any(axis=1) for r in recordings]
        q, dq, ddq = (
            np.vstack([getattr(r, name)[own] for r, own in zip(recordings, rows, strict=True)])
            for name in ("q", "dq", "ddq")
        )
        return cls(q.min(axis=0), q.max(axis=0), np.abs(dq).max(axis=0), np.abs(ddq).max(axis=0))


#: Φ, Z, (filtered further instruments) and τ of one joint, time last.
JointColumns = tuple[np.ndarray, np.ndarray | None, np.ndarray | None, np.ndarray]


class EquationRecord(Protocol):
    """Equations of one recording, time **last**."""

    @property
    def kinematics(self) -> Kinematics:
        """The motion and torque that they are made from."""

    @property
    def used(self) -> np.ndarray:
        """True for rows that the estimate uses, shape (joints, rows)."""

    @property
    def row_weights(self) -> np.ndarray | None:
        """Weights of the rows, shape (joints, rows); None: all one."""

    @property
    def seen(self) -> np.ndarray:
        """True for rows that prefilters which begin anew may remember, shape (joints, rows)."""

    @property
    def full_rate(self) -> bool:
        """Whether the rows are all samples of the record, behind prefilters."""

    @property
    def motion(self) -> SimulatedMotion | None:
        """Simulated motion that makes the instruments; None: none, or it was not kept."""

    @property
    def z(self) -> np.ndarray | None:
        """Packed instruments, shape (entries, rows), where they are held."""

    @property
    def has_instruments(self) -> bool:
        """Whether instruments differ from the observation matrix."""

    @property
    def tau(self) -> np.ndarray:
        """Torque, not prefiltered, shape (joints, rows) [N m or N]."""

    @property
    def usable_rows(self) -> int:
        """Rows that a joint would have if none were excluded."""

    @property
    def sample_numbers(self) -> np.ndarray:
        """Sample of the recording that each row stands for, shape (rows,)."""

    def with_torque(self, tau: np.ndarray) -> EquationRecord:
        """The same rows with another torque, shape (joints, rows)."""

    def add_to(
        self,
        sums: Sequence[JointSums],
        regressor: Regressor,
        filters: Sequence[Prefilter],
        windows: Windows | None,
    ) -> None:
        """Add the rows to the normal equations, and to those of each window if there are any."""

    def residual(self, regressor: Regressor, theta: np.ndarray) -> np.ndarray:
        """τ - Φθ, not prefiltered, shape (joints, rows)."""

    def whitened(
        self, residual: np.ndarray, filters: Sequence[Prefilter], variance: np.ndarray
    ) -> np.ndarray:
        """L_j ε_j λ_j^(-1/2): a residual of unit variance, shape (joints, rows)."""

    def fitted(
        self, regressor: Regressor, theta: np.ndarray, residual: np.ndarray, whitened: np.ndarray
    ) -> FittedRecording:
        """Signals for plots; both residuals are overwritten."""

    def columns_of(
        self, regressor: Regressor, filters: Sequence[Prefilter], joint: int, keep: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
        """Some of a joint's columns of Φ and Z, and its τ, filtered, on all rows."""

    def blocks(
        self, regressor: Regressor, filters: Sequence[Prefilter], extra: Any, make: Any
    ) -> Iterator[tuple[slice, tuple[Any, ...]]]:
        """Walk through the rows: ``make(joint, columns, used)`` of each block and joint."""


def weighted(record: EquationRecord, joint: int, span: slice = slice(None)) -> np.ndarray:
    """Roots of the weights of a joint's rows, zero where they are not used, shape (rows,).

    ``span``: which rows.
    """
    used = record.used[joint, span]
    if record.row_weights is None:
        return used
    return np.where(used, np.sqrt(record.row_weights[joint, span]), 0.0)


def accumulate(
    regressor: Regressor,
    records: Sequence[EquationRecord],
    filters: Sequence[Prefilter],
    by_window: bool = True,
) -> list[JointSums]:
    """Normal equations of all joints over all recordings."""
    windows = windows_of([r.used.shape[1] for r in records])
    count = sum(w.count for w in windows) if by_window else 0
    sums = [
        JointSums.empty(name, regressor.columns_of(j), count)
        for j, name in enumerate(regressor.robot.joint_names)
    ]
    for j, joint in enumerate(sums):
        joint.left_out = not any(measured_samples(r.kinematics)[j].any() for r in records)
    for record, own in zip(records, windows, strict=True):
        record.add_to(sums, regressor, filters, own if by_window else None)
    return sums
