"""Sampled control laws of joint position loops, (P-6).

All laws here share one discrete form, joint by joint, with q the *measured* position,

    u_k = r_k - B(z)/A(z) q_k + I_k,       I_k = I_{k-1} + K_i h (w_k - W(z)/A(z) q_k)
    τ_k = gain · clip(u_k + g(q_k) + inputs_k, ±limit)

where r and w gather what is known beforehand (reference, feed-forward) and g is the torque of
gravity that a law may compensate. One compiled loop runs them all, and B/A is what the prefilter
of IDIM-PIV inverts: the law without its integrator and gravity, which are slow.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

import numpy as np

from pivident.foundation.compiled import read_only
from pivident.foundation.errors import ExperimentError, concerning
from pivident.foundation.text.display import Printed

#: One gain for each joint, or one for all.
Gains = np.ndarray | Sequence[float] | float

#: What a controller may add: nothing, gravity of the reference or of the measured position, or the
#: inverse dynamics of the reference.
FeedForward = Literal["none", "gravity", "gravity_measured", "computed_torque"]

#: What stands for a drive gain that nobody knows.
UNKNOWN_GAIN = "unknown"

TAPS = 3  # B, A and W have at most second order

#: Masses of a law that does not compensate gravity.
WEIGHTLESS = np.zeros((0, 0, 4))


class SampledLaw(NamedTuple):
    """A control law as arrays for the compiled loop."""

    #: B, coefficients of z⁰, z⁻¹, z⁻², shape (joints, TAPS); likewise ``pole`` (A, monic) and
    #: ``integrand`` (W).
    feedback: np.ndarray
    pole: np.ndarray  # A
    integrand: np.ndarray  # W
    integral_gain: np.ndarray  # K_i per second, shape (joints,)
    reference: np.ndarray  # r, shape (samples, joints) [unit of u]
    integrand_reference: np.ndarray  # w, shape (samples, joints)
    #: Of g, see ``gravity_compensation.GravityModel``, shape (joints, joints, 4); no joints: the
    #: law does not compensate gravity at the measured position.
    masses: np.ndarray = WEIGHTLESS

    def protected(self) -> SampledLaw:
        """The same arrays, read-only, so that the loop is compiled for one kind of them."""
        return SampledLaw(*map(read_only, self))


class Controller(Protocol):
    """What the simulation and the prefilter need of a control law."""

    def law(self, rate: float, q_ref: np.ndarray, dq_ref: np.ndarray | None) -> SampledLaw:
        """Discretise at ``rate`` [Hz] for a given reference, shape (samples, joints)."""
        ...

    def check(self, joints: int) -> None:
        """Refuse gains that do not belong to so many joints."""
        ...


def backward_difference(x: np.ndarray, rate: float) -> np.ndarray:
    """(x_k - x_{k-1}) rate, zero at the first sample, shape of ``x``."""
    out = np.empty_like(x)
    out[0] = 0.0
    np.subtract(x[1:], x[:-1], out=out[1:])
    out *= rate
    return out


@dataclass(frozen=True, eq=False)
class PID(Printed):
    """u = kp e + ki ∫e + kd (s dq_ref - dq̂), dq̂ the (filtered) backward difference of q.

    With derivative_time T > 0 the difference is filtered by h/(T + h - T z⁻¹) (backward Euler of
    1/(T s + 1)). Where dq_ref is not recorded, the reference is differentiated in the same way.
    With s = 0 the speed itself is damped, as by position actuators of MuJoCo.

    Attributes:
        kp: proportional gains, shape (joints,) or one for all [u per rad or m]; likewise:
        kd: derivative gains, shape (joints,) [u per rad/s or m/s].
        ki: integral gains, shape (joints,) [u per rad s or m s]; None: no integrator.
        derivative_time: filter time T of the derivative [s].
        speed_feed_forward: share s of the reference speed that the derivative counts.

    Example:
        >>> robot, level = pv.load_robot("planar_2r"), np.zeros((2000, 2))
        >>> loop = pv.Loop(pv.PID(kp=[6000, 2500], kd=[180, 60], ki=[60000, 25000]))
        >>> held = pv.simulate(robot, loop, level).recording
        >>> abs(1000.0 * held.q[-1]).round(1)  # the integral carries the weight [mrad]
        array([0., 0.])
    """

    kp: Gains
    kd: Gains
    ki: Gains | None = None
    derivative_time: float = 0.0
    speed_feed_forward: float = 1.0

    def __post_init__(self) -> None:
        _check_lengths(kp=self.kp, kd=self.kd, ki=self.ki)

    def check(self, joints: int) -> None:
        """Refuse gains of the wrong sign, or not one for each of so many joints.

        Raises:
            ExperimentError: names the gain, its value and what was expected.
        """
        _check_gains(joints, kp=self.kp, kd=self.kd, ki=self.ki)
        if self.derivative_time < 0:
            raise ExperimentError(f"derivative_time must not be negative: {self.derivative_time}")

    def law(self, rate: float, q_ref: np.ndarray, dq_ref: np.ndarray | None) -> SampledLaw:
        """Discretise at ``rate`` [Hz] for the reference ``q_ref``, ``dq_ref``: a `SampledLaw`."""
        n, h = q_ref.shape[1], 1.0 / rate
        fade = self.derivative_time / (self.derivative_time + h)  # pole of the derivative's filter
        kp, kd = _for_each(self.kp, n), _for_each(self.kd, n)
        gain = kd / (self.derivative_time + h)
        zero = np.zeros(n)
        feedback = np.stack([kp + gain, -kp * fade - gain, zero], axis=1)
        pole = np.stack([np.ones(n), np.full(n, -fade), zero], axis=1)
        integrand = np.stack([np.ones(n), np.full(n, -fade), zero], axis=1)
        if dq_ref is None:
            dq_ref = _faded(backward_difference(q_ref, rate), fade)
        ki = zero if self.ki is None else _for_each(self.ki, n)
        reference = kd * self.speed_feed_forward * dq_ref
        reference += kp * q_ref
        return SampledLaw(feedback, pole, integrand, ki, reference, q_ref)


def _faded(x: np.ndarray, fade: float) -> np.ndarray:
    """First-order lag y_k = fade y_{k-1} + (1 - fade) x_k along time, from rest."""
    if fade == 0.0:
        return x
    from scipy.signal import lfilter

    return lfilter([1.0 - fade], [1.0, -fade], x, axis=0)


@dataclass(frozen=True, eq=False, init=False)
class PD(PID):
    """Proportional-derivative law u = kp (q_ref - q) + kd (dq_ref - dq̂): a `PID` without ki.

    Attributes:
        kp: proportional gains, shape (joints,) or one for all [u per rad or m].
        kd: derivative gains, likewise [u per rad/s or m/s].
        ki: None: there is no integrator.
        derivative_time: filter time of the derivative [s].
        speed_feed_forward: share of dq_ref that it counts; 0: the speed itself is damped.

    Example:
        >>> robot, level = pv.load_robot("planar_2r"), np.zeros((2000, 2))
        >>> loop = pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> held = pv.simulate(robot, loop, level).recording
        >>> np.round(1000.0 * held.q[-1], 1)  # gravity pulls the arm down [mrad]
        array([-3.6, -1.4])
    """

    def __init__(
        self, kp: Gains, kd: Gains, derivative_time: float = 0.0, speed_feed_forward: float = 1.0,
        ki: None = None,
    ) -> None:  # fmt: skip
        super().__init__(kp, kd, ki, derivative_time, speed_feed_forward)


@dataclass(frozen=True, eq=False)
class Cascade(Printed):
    """Position loop around a speed loop: u = kv (kp e - v̂) + kv ki ∫(kp e - v̂).

    v̂ is the backward difference of q, of its two-sample mean when ``averaged`` (the EMPS drive:
    FIR filter [1/2 1/2], then difference). ``speed_feed_forward`` adds kv·k·dq_ref.

    Attributes:
        kp: position gains, shape (joints,) or one for all [1/s]; likewise:
        kv: speed gains, shape (joints,) [u per rad/s or m/s].
        ki: integral gains of the speed loop, shape (joints,) [1/s]; None: no integrator.
        averaged: whether the speed is taken from the two-sample mean.
        speed_feed_forward: share of the reference speed that is fed forward.
    """

    kp: Gains
    kv: Gains
    ki: Gains | None = None
    averaged: bool = False
    speed_feed_forward: float = 0.0

    def __post_init__(self) -> None:
        _check_lengths(kp=self.kp, kv=self.kv, ki=self.ki)

    def check(self, joints: int) -> None:
        """Refuse gains of the wrong sign, or not one for each of so many joints."""
        _check_gains(joints, kp=self.kp, kv=self.kv, ki=self.ki)

    def law(self, rate: float, q_ref: np.ndarray, dq_ref: np.ndarray | None) -> SampledLaw:
        """Discretise at ``rate`` [Hz] for the reference ``q_ref``, ``dq_ref``: a `SampledLaw`."""
        n = q_ref.shape[1]
        kp, kv = _for_each(self.kp, n), _for_each(self.kv, n)
        difference = np.array([0.5, 0.0, -0.5] if self.averaged else [1.0, -1.0, 0.0]) * rate
        inner = kp[:, None] * np.array([1.0, 0.0, 0.0]) + difference
        pole = np.tile([1.0, 0.0, 0.0], (n, 1))
        if dq_ref is None:
            dq_ref = backward_difference(q_ref, rate)
        wanted = kp * q_ref + self.speed_feed_forward * dq_ref
        ki = np.zeros(n) if self.ki is None else kv * _for_each(self.ki, n)
        return SampledLaw(kv[:, None] * inner, pole, inner, ki, kv * wanted, wanted)


@dataclass(frozen=True, eq=False)
class PythonController(Printed):
    """A control law given as a Python function, called once per control sample.

    ``function(k, q, q_ref, dq_ref) -> u`` receives the sample's index, the measured positions and
    the reference, each of shape (joints,), and returns u, shape (joints,). It may keep a state of
    its own; ``reset`` is called before each run. The simulation then runs at the speed of Python.

    Attributes:
        function: the law.
        reset: called before each simulation.
        linear: a law close to it whose B/A the prefilter inverts; None: no controller prefilter.
    """

    function: Callable[[int, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
    reset: Callable[[], None] | None = None
    linear: PID | Cascade | None = None

    def check(self, joints: int) -> None:
        """Check the linear law, where there is one, for so many joints."""
        if self.linear is not None:
            self.linear.check(joints)

    def law(self, rate: float, q_ref: np.ndarray, dq_ref: np.ndarray | None) -> SampledLaw:
        """The linear law that the prefilter inverts, at ``rate`` [Hz], for ``q_ref``, ``dq_ref``.

        Raises:
            ExperimentError: if there is none.
        """
        if self.linear is None:
            raise ExperimentError(
                "this controller is a Python function without a linear law beside it: use "
                'prefilter = "direct", or give PythonController(linear=PD(...))'
            )
        return self.linear.law(rate, q_ref, dq_ref)


def inverse_controller(
    controller: Controller, rate: float, joints: int
) -> tuple[np.ndarray, np.ndarray]:
    """The filter A/B that turns a torque residual back into encoder noise, (P-26).

    The integrator is left out: its inverse would take the mean out of every column.

    Zeros of B outside the unit circle are reflected into it: the magnitude, hence the whitening,
    stays, and the phase is common to all columns.

    Result: numerator and denominator of the inverse, each (joints, TAPS), denominators monic.
    """
    still = np.zeros((1, joints))
    law = controller.law(rate, still, still)
    numerator, denominator = np.zeros((joints, TAPS)), np.zeros((joints, TAPS))
    for j in range(joints):
        if law.feedback[j, 0] == 0.0:
            raise ExperimentError(
                f"the controller of joint {j + 1} has no gain, so its inverse does not exist",
                advice='use prefilter = "direct" or give its gains',
            )
        stable = _reflected(law.feedback[j])
        denominator[j] = stable / stable[0]
        numerator[j] = law.pole[j] / stable[0]
    return numerator, denominator


def _reflected(polynomial: np.ndarray) -> np.ndarray:
    """The polynomial in z⁻¹ of the same magnitude with all zeros inside the unit circle."""
    roots = np.roots(np.trim_zeros(polynomial, "b"))
    if not (np.abs(roots) >= 1.0).any():
        return polynomial
    gain = polynomial[0]
    inside = []
    for root in roots:
        if abs(root) >= 1.0:
            gain *= abs(root)
            root = 1.0 / np.conj(root)
        inside.append(root if abs(root) < 1.0 else 0.999999 * root)
    out = np.zeros(polynomial.size)
    coefficients = np.real(np.poly(inside)) * gain
    out[: coefficients.size] = coefficients
    return out


def _for_each(gain: Gains, joints: int) -> np.ndarray:
    """The gains as an array (joints,)."""
    return np.broadcast_to(np.asarray(gain, float), (joints,))


def _check_lengths(**gains: Gains | None) -> None:
    """Refuse gains that are not numbers or do not belong to the same joints."""
    shapes = {}
    for name, gain in gains.items():
        if gain is None:
            continue
        try:
            shape = np.asarray(gain, dtype=float).shape
        except (TypeError, ValueError):
            shape = (0, 0)
        if len(shape) > 1:
            raise ExperimentError(
                f"controller: {name} = {gain!r} is no gain",
                advice="give a number, or one for each joint",
            )
        if shape:
            shapes[name] = shape[0]
    if len(set(shapes.values())) > 1:
        listed = ", ".join(f"{name} has {count}" for name, count in shapes.items())
        raise ExperimentError(
            f"controller: {listed} gain(s)",
            advice="give each one number for all joints or one for each",
        )


def _check_gains(joints: int, **gains: Gains | None) -> None:
    for name, given in gains.items():
        if given is not None:
            _check_gain(joints, name, given)


def _check_gain(joints: int, name: str, given: Gains) -> None:
    with concerning(name):
        gain = np.full(joints, given, dtype=float) if np.ndim(given) == 0 else np.asarray(given)
        if np.shape(gain) != (joints,):
            raise ExperimentError(
                f"controller: {name} has shape {np.shape(gain)}, but the robot has {joints} joints",
                advice="give one gain per joint",
            )
        bad = np.flatnonzero(~(np.isfinite(gain) & (gain >= 0)))
        if bad.size:
            raise ExperimentError(
                f"controller: {name} of joint {bad[0] + 1} is {gain[bad[0]]}",
                advice="gains must be finite and not negative (a reversed axis belongs in the "
                "drive gain)",
            )
