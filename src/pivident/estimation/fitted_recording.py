"""Signals of one recording as an estimator saw them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.logs.torque_scale import TorqueScale


@dataclass(frozen=True, eq=False)
class FittedRecording:
    """Signals of one recording as the estimator saw them, for plots; arrays (rows, joints).

    Attributes:
        name: name of the recording.
        t: time of each row [s], shape (rows,).
        q: estimated positions [rad or m].
        dq: estimated speeds [rad/s or m/s].
        ddq: estimated accelerations [rad/s² or m/s²].
        q_measured: measured positions on the same rows [rad or m].
        tau: measured torque, aligned with the positions [N m or N].
        tau_model: reconstructed torque Φθ.
        used: True for rows that the estimate used.
        whitened: residual of the equation that was solved, scaled to unit variance, on the
            rows of the estimator, shape (rows, joints); NaN on rows that were not used.
        whitened_rate: rate of ``whitened`` [Hz].
        q_ref: recorded or reconstructed reference on the same rows [rad or m], or None.
        account: how the record was logged and what was done to its samples, in sentences.
        torque_scale: joints whose torque has an unverified scale.
    """

    name: str
    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    q_measured: np.ndarray
    tau: np.ndarray
    tau_model: np.ndarray
    used: np.ndarray
    whitened: np.ndarray
    whitened_rate: float
    q_ref: np.ndarray | None = None
    account: tuple[str, ...] = ()
    torque_scale: tuple[TorqueScale, ...] = ()
