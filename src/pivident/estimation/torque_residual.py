"""Residual of the torque, τ - Φθ: v of (P-4), (P-24), and (P-30) in the iteration."""

from __future__ import annotations

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.motion.kinematics import Kinematics


def torque_of(regressor: Regressor, motion: Kinematics, theta: np.ndarray) -> np.ndarray:
    """Φθ on a recording, time last, shape (joints, samples).

    Friction that grows with the load takes the one that is with the motion, or else that of θ.
    """
    return regressor.torque(motion.q.T, motion.dq.T, motion.ddq.T, theta, motion.inner).T


def residual_of(regressor: Regressor, kinematics: Kinematics, theta: np.ndarray) -> np.ndarray:
    """τ - Φθ on a recording, time last, shape (joints, samples)."""
    model = torque_of(regressor, kinematics, theta)
    return np.subtract(kinematics.tau, model, out=model)
