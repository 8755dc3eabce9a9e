"""Impedance of a joint from its motor's side, rigid or flexible.

A rigid joint has Z(p) = J p + fv. From torque less friction to the motor's speed a flexible one has

    Z(p) = Jm p + fv + H(p) (Jl p + fv_l),      H(p) = (d p + k) / (Jl p² + (d + fv_l) p + k)

with H from the motor's to the load's speed. It is large at the antiresonance √(k/Jl), where the
load swings against a motor that hardly moves, and small at the resonance √(k (1/Jm + 1/Jl)).
Coulomb friction of both sides enters as (fc + H fc_l) sign(dq). Parameters of the rigid joint are
J, fv, fc; those of the flexible one ln Jm, ln Jl, ln ω_a, ln ζ, fv, fv_l, fc, fc_l, with ω_a the
antiresonance and ζ its damping ratio.
"""

from __future__ import annotations

import numpy as np

#: Number of parameters of the flexible joint.
FLEXIBLE = 8

#: Steps in which the load's speed and its friction come to agree.
LOAD_STEPS = 30


def rigid_impedance(frequency: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """J p + fv, shape (bins,) [N m s/rad]."""
    return 2j * np.pi * frequency * theta[0] + theta[1]


def flexible_parts(
    frequency: np.ndarray, theta: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Admittance 1/Z, friction fc of the motor and H fc_l of the load, shape (bins,) each."""
    motor, load = np.exp(np.clip(theta[:2], -40, 40))
    p = 2j * np.pi * frequency
    share = passed(frequency, theta)
    impedance = motor * p + theta[4] + share * (load * p + theta[5])
    return 1 / impedance, np.full(len(p), theta[6], dtype=complex), share * theta[7]


def load_speed(motor_speed: np.ndarray, rate: float, theta: np.ndarray) -> np.ndarray:
    """The load's speed from the motor's, shape (samples,) [rad/s]."""
    n = len(motor_speed)
    # Padded with zeros of the same length, so that the end does not wrap around to the start.
    spectrum = np.fft.rfft(motor_speed, 2 * n)
    return np.fft.irfft(passed(np.fft.rfftfreq(2 * n, 1 / rate), theta) * spectrum, 2 * n)[:n]


def periodic_load_speed(
    motor_speed: np.ndarray, rate: float, theta: np.ndarray, gamma: float
) -> np.ndarray:
    """The load's speed from one period of the motor's, with the load's own dry friction in it.

        (Jl p² + (d + fv_l) p + k) v_l = (d p + k) v_m - p fc_l s(v_l),     s(v) = (2/π) atan(γ v)

    solved by steps that go half of the way, shape (samples of a period,) [rad/s].
    """
    n = len(motor_speed)
    frequency = np.fft.rfftfreq(n, 1 / rate)
    linear = passed(frequency, theta) * np.fft.rfft(motor_speed)
    answer = 2j * np.pi * frequency * theta[7] / _swinging(frequency, theta)
    speed = np.fft.irfft(linear, n)
    for _ in range(LOAD_STEPS):
        sign = 2 / np.pi * np.arctan(gamma * speed)
        speed += 0.5 * (np.fft.irfft(linear - answer * np.fft.rfft(sign), n) - speed)
    return speed


def passed(frequency: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """H, from the motor's to the load's speed, shape (bins,)."""
    load, omega, zeta = np.exp(np.clip(theta[1:4], -40, 40))
    stiffness, damping = omega**2 * load, 2 * zeta * omega * load
    return (2j * np.pi * frequency * damping + stiffness) / _swinging(frequency, theta)


def _swinging(frequency: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Jl p² + (d + fv_l) p + k: the load on its spring."""
    load, omega, zeta = np.exp(np.clip(theta[1:4], -40, 40))
    p = 2j * np.pi * frequency
    return load * p**2 + (2 * zeta * omega * load + theta[5]) * p + omega**2 * load
