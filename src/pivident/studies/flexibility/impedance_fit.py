"""Impedance of a joint fitted to spectra of its loop.

The fit minimises

    Σ |Y - (U - (fc + H fc_l) S)/Z|² / σ²(θ)

over the bins, with Z and H as below and σ²(θ) from the noise of speed Y and torque U,
which neither the reference nor the sign S of friction explains (`frequency_response`), so noise fed
back by the loop does not bias it. The sum is the cost.

A rigid joint has Z(p) = J p + fv. From torque less friction to the motor's speed a flexible one has

    Z(p) = Jm p + fv + H(p) (Jl p + fv_l),      H(p) = (d p + k) / (Jl p² + (d + fv_l) p + k)

with H from the motor's to the load's speed. It is large at the antiresonance √(k/Jl), where the
load swings against a motor that hardly moves, and small at the resonance √(k (1/Jm + 1/Jl)).
Coulomb friction of both sides enters as (fc + H fc_l) sign(dq). Parameters of the rigid joint are
J, fv, fc; those of the flexible one ln Jm, ln Jl, ln ω_a, ln ζ, fv, fv_l, fc, fc_l, with ω_a the
antiresonance and ζ its damping ratio.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pivident.studies.flexibility.frequency_response import LocalSpectra

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


#: Where the search for the antiresonance starts: number of frequencies.
STARTS = 10


def fit_rigid(spectra: LocalSpectra) -> tuple[np.ndarray, float, np.ndarray]:
    """J, fv, fc of a rigid joint, cost and covariance; the sign of the speed is the disturbance."""
    (y, u), s = spectra.x.T, spectra.disturbance[:, 0]
    p = 2j * np.pi * spectra.frequency
    columns = np.column_stack([p * y, y, s])
    stacked = np.concatenate([columns.real, columns.imag])
    start = np.linalg.lstsq(stacked, np.concatenate([u.real, u.imag]), rcond=None)[0]
    start[0] = max(start[0], 1e-9)

    def residual(theta: np.ndarray) -> np.ndarray:
        admittance = 1 / rigid_impedance(spectra.frequency, theta)
        return weighted_errors(spectra, admittance, np.full((len(y), 1), theta[2]))

    return least_squares_fit(residual, start)


def fit_flexible(
    spectra: LocalSpectra,
    rigid: np.ndarray,
    motor_inertia: float | None,
    known: np.ndarray | None = None,
) -> tuple[np.ndarray, float, np.ndarray]:
    """Parameters, cost and covariance, from a known fit or the best of several starts.

    Signs of the motor's speed and, where it is known, of the load's are the disturbances. A given
    Jm is held.
    """
    held = None if motor_inertia is None else np.log(motor_inertia)
    free = np.arange(FLEXIBLE) if held is None else np.arange(1, FLEXIBLE)

    def whole(x: np.ndarray) -> np.ndarray:
        theta = np.zeros(FLEXIBLE)
        theta[0] = 0.0 if held is None else held
        theta[free] = x
        return theta

    def residual(x: np.ndarray) -> np.ndarray:
        return flexible_errors(spectra, whole(x))

    low, high = spectra.frequency[0], spectra.frequency[-1]
    best = None if known is None else (known[free], 0.0, np.empty(0))
    for start in np.geomspace(1.3 * low, high / 1.1, STARTS if known is None else 0):
        motor = 0.5 * rigid[0] if motor_inertia is None else motor_inertia
        load = max(rigid[0] - motor, 0.2 * rigid[0])
        initial = [np.log(motor), np.log(load), np.log(2 * np.pi * start), np.log(0.05)]
        initial += [0.5 * abs(rigid[1]), 0.5 * abs(rigid[1]), 0.5 * rigid[2], 0.5 * rigid[2]]
        found = least_squares_fit(residual, np.array(initial)[free], 12)
        if best is None or found[1] < best[1]:
            best = found
    assert best is not None
    best = least_squares_fit(residual, best[0])
    covariance = np.zeros((FLEXIBLE, FLEXIBLE))
    covariance[np.ix_(free, free)] = best[2]
    return whole(best[0]), best[1], covariance


def flexible_errors(spectra: LocalSpectra, theta: np.ndarray) -> np.ndarray:
    """Weighted errors of a flexible joint, real and imaginary parts."""
    admittance, motor, load = flexible_parts(spectra.frequency, theta)
    # Until the load's speed is known, its friction has the sign of the motor's speed.
    both = spectra.disturbance.shape[1] == 2
    friction = np.stack([motor, load], axis=1) if both else (motor + load)[:, None]
    return weighted_errors(spectra, admittance, friction)


def weighted_errors(
    spectra: LocalSpectra, admittance: np.ndarray, friction: np.ndarray
) -> np.ndarray:
    """(Y - G (U - F S))/σ, real and imaginary parts."""
    v = np.stack([np.ones_like(admittance), -admittance], axis=1)
    e = np.einsum("ks,ks->k", v, spectra.x) + admittance * np.sum(
        friction * spectra.disturbance, axis=1
    )
    variance = np.einsum("ks,kst,kt->k", v, spectra.noise, v.conj()).real
    floor = 1e-14 * np.einsum("kss->k", spectra.noise).real
    scaled = e / np.sqrt(np.maximum(variance, floor))
    return np.concatenate([scaled.real, scaled.imag])


def least_squares_fit(
    residual: Callable[[np.ndarray], np.ndarray], start: np.ndarray, most: int = 200
) -> tuple[np.ndarray, float, np.ndarray]:
    """Minimum, its sum of squares (the cost), and the covariance."""
    from scipy.optimize import least_squares

    found = least_squares(residual, start, x_scale="jac", max_nfev=most)
    information = 2 * found.jac.T @ found.jac
    scale = 1 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    inverse = np.linalg.pinv(information * np.outer(scale, scale), rcond=1e-12)
    cost = 2 * float(found.cost)
    # Model error widens the intervals like noise.
    misfit = max(1.0, cost / (len(found.fun) / 2))
    return found.x, cost, misfit * inverse * np.outer(scale, scale)
