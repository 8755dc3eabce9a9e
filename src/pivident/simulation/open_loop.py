"""A loop that is open: the recorded torques drive the robot, and no law answers to its motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.simulation.controllers import TAPS, SampledLaw


@dataclass(frozen=True)
class OpenLoop:
    """u = 0: what acts are the known inputs times the drive gain."""

    def check(self, joints: int) -> None:
        """Fits any number of joints."""

    def law(self, rate: float, q_ref: np.ndarray, dq_ref: np.ndarray | None) -> SampledLaw:
        """No feedback, no integrator, no share of the reference.

        Args:
            rate: rate of the simulation [Hz].
            q_ref: reference positions, shape (samples, joints) [rad or m].
            dq_ref: reference speeds, likewise, or None.

        Returns:
            The law as arrays, all zero but the leading coefficients of its denominators.
        """
        n = q_ref.shape[1]
        none, monic = np.zeros((n, TAPS)), np.zeros((n, TAPS))
        monic[:, 0] = 1.0
        return SampledLaw(
            none, monic, none, np.zeros(n), np.zeros_like(q_ref), np.zeros_like(q_ref)
        )
