"""The general position law with feed-forward of the reference, as it is identified from records.

    u = kp e + ki ∫e - kd D q + kv_ref D q_ref + ka_ref D D q_ref + offset,     e = q_ref - q

D is how the controller differentiates: a backward difference, the difference of two-sample means
(``averaged``), or a difference behind the lag 1/(T s + 1). PID, PD and the P-P cascade with and
without feed-forward are special cases: of a cascade kv (kp e - v̂) the gains are kp·kv and kv.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pivident.foundation.errors import ExperimentError
from pivident.loop.simulation.controllers import TAPS, SampledLaw


def differentiator(time: float, averaged: bool, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Numerator and denominator of D in z⁻¹, each of shape (TAPS,).

    ``time``: lag T [s]; zero: none.
    """
    if averaged:
        return np.array([0.5, 0.0, -0.5]) * rate, np.array([1.0, 0.0, 0.0])
    h = 1.0 / rate
    fade = time / (time + h)  # backward Euler
    return np.array([1.0, -1.0, 0.0]) / (time + h), np.array([1.0, -fade, 0.0])


def differentiated(x: np.ndarray, time: float, averaged: bool, rate: float) -> np.ndarray:
    """D x along time, from rest at the first sample, shape of x."""
    from scipy.signal import lfilter

    numerator, denominator = differentiator(time, averaged, rate)
    return lfilter(numerator, denominator, x - x[:1], axis=0)


@dataclass(frozen=True, eq=False)
class LinearLaw:
    """One joint's gains in every row; all gains have shape (joints,)."""

    kp: np.ndarray  # of the position error [u per rad or m]
    kd: np.ndarray  # of the measured speed [u per rad/s or m/s]
    ki: np.ndarray  # of the integral of the error [u per rad s or m s]
    speed_reference: np.ndarray  # kv_ref, of the reference's speed
    acceleration_reference: np.ndarray  # ka_ref, of the reference's acceleration
    offset: np.ndarray  # constant [u]
    derivative_time: np.ndarray  # T [s]
    #: Whether the speed is the difference of two-sample means, shape (joints,).
    averaged: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))

    def __post_init__(self) -> None:
        if self.averaged.size == 0:
            object.__setattr__(self, "averaged", np.zeros(len(self.kp), bool))

    def check(self, joints: int) -> None:
        """Refuse a law of another number of joints, or one that pushes away from the reference."""
        if len(self.kp) != joints:
            raise ExperimentError(
                f"the control law has {len(self.kp)} joints, but the robot has {joints}"
            )
        for name in ("kp", "kd"):
            bad = np.flatnonzero(~(getattr(self, name) >= 0))
            if bad.size:
                raise ExperimentError(
                    f"{name} of joint {bad[0] + 1} is {getattr(self, name)[bad[0]]:.6g}: this law "
                    "pushes away from its reference",
                    advice="check the sign of the torque",
                )

    def law(self, rate: float, q_ref: np.ndarray, dq_ref: np.ndarray | None) -> SampledLaw:
        """Discretise at ``rate`` [Hz]: see :class:`SampledLaw`."""
        n = q_ref.shape[1]
        feedback, pole = np.zeros((n, TAPS)), np.zeros((n, TAPS))
        reference = self.kp * q_ref + self.offset
        for j in range(n):
            numerator, pole[j] = differentiator(
                self.derivative_time[j], bool(self.averaged[j]), rate
            )
            feedback[j] = self.kp[j] * pole[j] + self.kd[j] * numerator
            speed, acceleration = self.reference_derivatives(
                j, q_ref[:, j], None if dq_ref is None else dq_ref[:, j], rate
            )
            reference[:, j] += self.speed_reference[j] * speed
            reference[:, j] += self.acceleration_reference[j] * acceleration
        return SampledLaw(feedback, pole, pole.copy(), self.ki, reference, q_ref.copy())

    def reference_derivatives(
        self, j: int, q_ref: np.ndarray, dq_ref: np.ndarray | None, rate: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Speed and acceleration of one joint's reference, as the law forms them, (samples,)."""
        time, averaged = self.derivative_time[j], bool(self.averaged[j])
        return reference_derivatives(q_ref, dq_ref, time, averaged, rate)


def reference_derivatives(
    q_ref: np.ndarray, dq_ref: np.ndarray | None, time: float, averaged: bool, rate: float
) -> tuple[np.ndarray, np.ndarray]:
    """Speed (recorded, or D q_ref) and acceleration (its backward difference), (samples,)."""
    speed = differentiated(q_ref, time, averaged, rate) if dq_ref is None else dq_ref
    return speed, differentiated(speed, 0.0, False, rate)
