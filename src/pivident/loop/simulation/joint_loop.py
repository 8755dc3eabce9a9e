"""One joint's closed loop over frequency, the other joints at rest: plant, S, T and bandwidth.

A joint of inertia J and viscous friction F_v turns torque into position as

    G(s) = 1 / (s (J s + F_v)),      S = 1 / (1 + G g C),      T = 1 - S

with C the feedback from position to controller output and g the drive gain: the loop that the
paper draws in (P-11) to (P-17). Here the law is the sampled one that runs, and the torque is held
from sample to sample, which G takes into account exactly; a delay of the drive shifts it.

The bandwidth f_dyn = ω_dyn/2π is where |S| comes up to 1/√2. Below it the loop makes the joint
follow its reference, so that is where the motion of a record lies. For u = kp e + kd de/dt with
ω_n² = g kp/J and 2 ζ ω_n = (g kd + F_v)/J and without F_v it is

    ω_dyn/ω_n = √(2ζ² - 1 + √((2ζ² - 1)² + 1)),      1 for ζ = 1/√2.

|T|, with which noise of the encoder reaches the position, falls below 1/√2 further up.

Coulomb friction, gravity and saturation are not linear and not in it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pivident.foundation.text.display import Displayed
from pivident.loop.simulation.controllers import Controller

#: Points per search for a crossing, from the lowest frequency searched to the Nyquist frequency.
_POINTS = 1500

#: Lowest frequency searched, relative to the sampling rate.
_LOWEST = 1e-6

#: A pole this far outside the unit circle is one: several poles near z = 1 lose digits.
_OUTSIDE = 1e-6

#: Relative step of the derivatives of the bandwidth.
_STEP = 1e-3

HALF_POWER = math.sqrt(0.5)


@dataclass(frozen=True, eq=False)
class JointFeedback(Displayed):
    """What one joint's sampled law makes of the position: -u/q.

    C = B/A + K_i h/(1 - z⁻¹) W/A, see :class:`pivident.loop.simulation.controllers.SampledLaw`.

    Attributes:
        feedback: B, coefficients of z⁰, z⁻¹, … [unit of u per rad or m].
        pole: A, likewise.
        integrand: W, likewise.
        integral_gain: K_i per second.
        rate: control rate [Hz].
    """

    feedback: np.ndarray
    pole: np.ndarray
    integrand: np.ndarray
    integral_gain: float
    rate: float

    def response(self, frequency: np.ndarray) -> np.ndarray:
        """C(e^{jω}), complex [unit of u per rad or m], shape (points,).

        Args:
            frequency: frequencies [Hz], shape (points,).
        """
        angle = -2j * np.pi * np.asarray(frequency, dtype=float) / self.rate
        back = np.exp(angle)
        feedback, pole, integrand = (
            np.polyval(p[::-1], back) for p in (self.feedback, self.pole, self.integrand)
        )
        summed = self.integral_gain / self.rate * integrand / -np.expm1(angle)
        return (feedback + summed) / pole

    def fraction(self) -> tuple[np.ndarray, np.ndarray]:
        """Numerator and denominator of C in z⁻¹."""
        if self.integral_gain == 0.0:
            return self.feedback, self.pole
        difference = np.array([1.0, -1.0])
        step = self.integral_gain / self.rate
        numerator = np.convolve(self.feedback, difference)
        numerator[: self.integrand.size] += step * self.integrand
        return numerator, np.convolve(self.pole, difference)


def joint_feedbacks(controller: Controller, rate: float, joints: int) -> tuple[JointFeedback, ...]:
    """The feedback of each joint of a control law.

    Args:
        controller: the law.
        rate: control rate [Hz].
        joints: number of joints.

    Returns:
        One for each joint.

    Raises:
        ExperimentError: the law is a Python function without a linear law beside it, or runs at
            another rate only.
    """
    still = np.zeros((1, joints))
    law = controller.law(rate, still, still)
    return tuple(
        JointFeedback(
            law.feedback[j], law.pole[j], law.integrand[j], float(law.integral_gain[j]), rate
        )
        for j in range(joints)
    )


@dataclass(frozen=True, eq=False)
class JointLoop:
    """A joint with its inertia and friction in its loop.

    Attributes:
        inertia: J [kg m² or kg].
        viscous: F_v [N m s/rad or N s/m].
        feedback: the law.
        drive_gain: g, joint torque per controller output.
        delay: time from a sample until its torque acts [s].
    """

    inertia: float
    viscous: float
    feedback: JointFeedback
    drive_gain: float = 1.0
    delay: float = 0.0

    def plant(self, frequency: np.ndarray) -> np.ndarray:
        """G with its hold, from torque samples to position samples, complex, shape (points,).

        Args:
            frequency: frequencies [Hz], shape (points,).
        """
        angle = -2j * np.pi * np.asarray(frequency, dtype=float) * self._period
        back = np.exp(angle)
        slow = -np.expm1(angle)
        fade = -np.expm1(angle - self._decay)
        return np.polyval(self._plant_numerator[::-1], back) / (slow * fade)

    def open_loop(self, frequency: np.ndarray) -> np.ndarray:
        """G g C, complex, shape (points,).

        Args:
            frequency: frequencies [Hz], shape (points,).
        """
        return self.plant(frequency) * self.drive_gain * self.feedback.response(frequency)

    def sensitivity(self, frequency: np.ndarray) -> np.ndarray:
        """S = 1/(1 + G g C), complex, shape (points,).

        Args:
            frequency: frequencies [Hz], shape (points,).
        """
        return 1.0 / (1.0 + self.open_loop(frequency))

    def complementary(self, frequency: np.ndarray) -> np.ndarray:
        """T = G g C/(1 + G g C), complex, shape (points,).

        Args:
            frequency: frequencies [Hz], shape (points,).
        """
        loop = self.open_loop(frequency)
        return loop / (1.0 + loop)

    @cached_property
    def is_stable(self) -> bool:
        """Whether all poles of the sampled loop lie inside the unit circle."""
        numerator, denominator = self.feedback.fraction()
        decay = math.exp(-self._decay)
        plant = np.convolve([1.0, -1.0], [1.0, -decay])
        poles = np.convolve(denominator, plant)
        loop = self.drive_gain * np.convolve(numerator, self._plant_numerator)
        closed = np.zeros(max(poles.size, loop.size))
        closed[: poles.size] += poles
        closed[: loop.size] += loop
        return bool((np.abs(np.roots(closed)) < 1.0 + _OUTSIDE).all())

    @cached_property
    def bandwidth(self) -> float:
        """f_dyn, where |S| first comes up to 1/√2 [Hz]; NaN where it does not."""
        return self._crossing(lambda f: np.abs(self.sensitivity(f)) - HALF_POWER)

    @cached_property
    def noise_bandwidth(self) -> float:
        """Where |T| first falls to 1/√2 [Hz]; NaN where it does not."""
        return self._crossing(lambda f: HALF_POWER - np.abs(self.complementary(f)))

    @cached_property
    def peak(self) -> float:
        """Largest |S|: two is a common limit of good design, much more is close to unstable."""
        return float(np.abs(self.sensitivity(self._grid)).max())

    def bandwidth_slopes(self) -> np.ndarray:
        """Derivatives of f_dyn with respect to J and F_v, by central differences, shape (2,)."""
        scale = max(self.viscous, 2.0 * math.pi * self.bandwidth * self.inertia)
        steps = _STEP * np.array([self.inertia, scale])
        ends = [
            [
                replace(self, inertia=self.inertia + sign * dj, viscous=self.viscous + sign * dv)
                for sign in (-1.0, 1.0)
            ]
            for dj, dv in ((steps[0], 0.0), (0.0, steps[1]))
        ]
        return np.array(
            [
                (high.bandwidth - low.bandwidth) / (2.0 * step)
                for (low, high), step in zip(ends, steps, strict=True)
            ]
        )

    @property
    def _period(self) -> float:
        return 1.0 / self.feedback.rate

    @property
    def _decay(self) -> float:
        """F_v h/J."""
        return self.viscous * self._period / self.inertia

    @property
    def _grid(self) -> np.ndarray:
        rate = self.feedback.rate
        return np.geomspace(_LOWEST * rate, 0.5 * rate, _POINTS)

    @cached_property
    def _plant_numerator(self) -> np.ndarray:
        """Numerator of G in z⁻¹ over (1 - z⁻¹)(1 - e^{-F_v h/J} z⁻¹).

        Within a period the torque of m + 1 samples ago acts until the delay's remainder is over,
        and from then on that of m samples ago.
        """
        whole = int(self.delay * self.feedback.rate + 1e-9)
        waiting = max(self.delay - whole * self._period, 0.0)
        new = self._pushed(self._period - waiting)
        old = self._pushed(self._period) - new
        decay, reach = math.exp(-self._decay), self._period * _mean_decay(self._decay)
        numerator = np.zeros(whole + 4)
        for late, (q, dq) in ((whole, new), (whole + 1, old)):
            numerator[late + 1] += q
            numerator[late + 2] += reach * dq - decay * q
        return numerator

    def _pushed(self, time: float) -> np.ndarray:
        """Position and speed after a unit torque has acted on the joint at rest for a time."""
        x = self.viscous * time / self.inertia
        return np.array([time**2 * _mean_of_means(x), time * _mean_decay(x)]) / self.inertia

    def _crossing(self, function) -> float:
        """Lowest frequency at which a function comes up through zero [Hz]."""
        from scipy.optimize import brentq

        grid = self._grid
        above = function(grid) >= 0.0
        if above[0] or not above.any():
            return math.nan
        k = int(np.argmax(above))
        low, high = np.log(grid[k - 1]), np.log(grid[k])
        return float(math.exp(brentq(lambda x: float(function(np.exp(x))), low, high, xtol=1e-12)))


def _mean_decay(x: float) -> float:
    """(1 - e⁻ˣ)/x, one for x = 0."""
    return -math.expm1(-x) / x if x != 0.0 else 1.0


def _mean_of_means(x: float) -> float:
    """(x - 1 + e⁻ˣ)/x², one half for x = 0."""
    if abs(x) < 1e-3:
        return 0.5 - x / 6.0 + x**2 / 24.0
    return (x + math.expm1(-x)) / x**2
