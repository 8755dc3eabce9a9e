"""The general position law with feed-forward of the reference, as it is identified from records.

    u = kp e + ki ∫e - kd D q + kv_ref D q_ref + ka_ref D D q_ref + offset,     e = q_ref - q

D is how the controller differentiates: a backward difference, the difference of two-sample means
(``averaged``), or a difference behind the lag 1/(T s + 1). PID, PD and the P-P cascade with and
without feed-forward are special cases: of a cascade kv (kp e - v̂) the gains are kp·kv and kv.

Tangents of the sampled control laws, and what is kept of the tangents at a sample.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pivident.dynamics.lanes import LANES, load, nothing, store
from pivident.foundation.compiled import inlined as _inline
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.display import Printed
from pivident.loop.simulation.controllers import TAPS, SampledLaw
from pivident.loop.simulation.gravity_compensation import gravity_slopes
from pivident.loop.simulation.integration import Q, V
from pivident.loop.simulation.loop_tangent import (
    OF_DRIVE_GAIN,
    OF_FEEDBACK,
    OF_INPUTS,
    OF_INTEGRAL_GAIN,
    OF_INTEGRAND,
    OF_POLE,
    READ,
)


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
class LinearLaw(Printed):
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


#: Rows of ``law_columns``: what constants of the law change in its filter, its output, the growth
#: of its integral, and the torque.
_FILTERED, _OUTPUT, _GROWTH, _TORQUE = 0, 1, 2, 3
LAW_COLUMNS = 4


@_inline
def law_columns(
    integral_gain, integrand_reference, past, period, inputs, command, k, given, passed,
    reference, index, slope, columns,
):  # fmt: skip
    """Derivatives of the law at sample ``k`` by its constants, after its filters have moved on.

    ``given``: row of ``inputs``; ``command``: limited outputs, shape (joints,); ``passed``: what
    the integrator was given, whether the output is free, and whether the integrator moved, shape
    (joints, 3); ``columns``: shape (LAW_COLUMNS, joints, directions), zero where no constant is.
    """
    for e in range(index.shape[0]):
        j, d = index[e, 0], index[e, 1]
        filtered = 0.0
        u = reference[index[e, 2], k] if index[e, 2] >= 0 else 0.0
        summed = reference[index[e, 3], k] if index[e, 3] >= 0 else 0.0
        for m in range(TAPS):
            if m > 0:
                filtered -= slope[e, OF_POLE + m] * past[j, m]
            u -= slope[e, OF_FEEDBACK + m] * past[j, m]
            summed -= slope[e, OF_INTEGRAND + m] * past[j, m]
        columns[_FILTERED, j, d] = filtered
        columns[_OUTPUT, j, d] = u + slope[e, OF_INPUTS] * inputs[given, j]
        columns[_GROWTH, j, d] = period * (
            integral_gain[j] * summed
            + slope[e, OF_INTEGRAL_GAIN] * (integrand_reference[k, j] - passed[j, 0])
        )
        columns[_TORQUE, j, d] = slope[e, OF_DRIVE_GAIN] * command[j]


@_inline
def law_tangent(
    parent, prismatic, gravity, masses, place, feedback, pole, integrand, integral_gain, period,
    gains, first, late, passed, own, encoder, weight_slope, columns, past, integral, commanded,
):  # fmt: skip
    """Tangents of the control laws, after ``law_columns``.

    Counts of the encoder are passed over: in the mean what the law reads changes as the position.
    ``place``: poses of the links as the law reads them; ``first``: whether this is the sample until
    whose answer the torque is as if that acted.
    """
    n = own.shape[1]
    if masses.shape[0] > 0:
        gravity_slopes(parent, prismatic, gravity, masses, place, weight_slope)
    for at in range(0, own.shape[2], LANES):
        for j in range(n):
            store(own, (READ, j), at, load(own, (Q, j), at) + load(encoder, (j,), at))
        for j in range(n):
            read, u = load(own, (READ, j), at), load(integral, (j,), at)
            if masses.shape[0] > 0:
                for k in range(n):
                    u += weight_slope[j, k] * load(own, (READ, k), at)
            for m in range(1, TAPS):
                read -= pole[j, m] * load(past, (m - 1, j), at)
            for m in range(TAPS - 1, 0, -1):
                store(past, (m, j), at, load(past, (m - 1, j), at))
            store(past, (0, j), at, read + load(columns, (_FILTERED, j), at))
            growth = load(columns, (_GROWTH, j), at)
            u += load(columns, (_OUTPUT, j), at)
            for m in range(TAPS):
                u -= feedback[j, m] * load(past, (m, j), at)
            if integral_gain[j] != 0.0:
                summed = nothing()
                for m in range(TAPS):
                    summed += integrand[j, m] * load(past, (m, j), at)
                growth -= (integral_gain[j] * period) * summed
                if passed[j, 2] > 0.0:
                    store(integral, (j,), at, load(integral, (j,), at) + growth)
            for m in range(late + 1, 0, -1):
                store(commanded, (m, j), at, load(commanded, (m - 1, j), at))
            gain = gains[j] if passed[j, 1] > 0.0 else 0.0
            torque = load(columns, (_TORQUE, j), at) + gain * (u + growth)
            store(commanded, (0, j), at, torque)
            if first:
                for m in range(1, late + 2):
                    store(commanded, (m, j), at, torque)


@_inline
def record_tangent(own, commanded, record, row, which):
    """Keep the tangents at a sample; ``which``: row of the torque that acts in ``commanded``."""
    for j in range(own.shape[1]):
        for at in range(0, own.shape[2], LANES):
            store(record, (0, row, j), at, load(own, (Q, j), at))
            store(record, (1, row, j), at, load(own, (V, j), at))
            store(record, (2, row, j), at, load(commanded, (which, j), at))
