"""Logs of the gallery's planar arm, simulated with nothing of the package under test.

The arm moves in a vertical plane; q₁ is the shoulder's angle, q₂ the elbow's,

    M(q) ddq = u - c(q, dq) - g(q) - fv dq - fc (2/π) atan(γ dq) - off,

with a point mass on the forearm as payload. The law u = kp e + kd de/dt acts on measured positions
once per sample; the motion between samples is integrated by two steps of Runge and Kutta.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

#: Masses [kg], distances of the centres of mass [m], moments of inertia about them [kg m²].
MASS, CENTER, INERTIA = (4.0, 2.5), (0.2, 0.15), (0.054, 0.02)

#: Length of the upper arm [m], moments of inertia of the rotors [kg m²], gravity [m/s²].
LENGTH, ROTOR, GRAVITY = 0.4, (0.25, 0.1), 9.81

#: Viscous and Coulomb friction and offset of both joints, steepness of the sign [s/rad].
VISCOUS, COULOMB, OFFSET, GAMMA = (2.5, 1.2), (4.0, 2.0), (0.3, -0.2), 400.0

State = tuple[float, float, float, float]


def _acceleration(
    state: State, u: Sequence[float], load: tuple[float, float], friction: float
) -> tuple[float, float]:
    """Accelerations of the joints [rad/s²]; load: mass [kg], distance from the elbow [m]."""
    q1, q2, v1, v2 = state
    mass, distance = load
    first = MASS[1] * CENTER[1] + mass * distance
    second = INERTIA[1] + MASS[1] * CENTER[1] ** 2 + mass * distance**2
    outer = MASS[1] + mass
    bend = LENGTH * first * math.cos(q2)
    m22 = second + ROTOR[1]
    m12 = second + bend
    m11 = INERTIA[0] + MASS[0] * CENTER[0] ** 2 + outer * LENGTH**2 + second + 2 * bend + ROTOR[0]
    h = LENGTH * first * math.sin(q2)
    weight = GRAVITY * first * math.cos(q1 + q2)
    arm = GRAVITY * (MASS[0] * CENTER[0] + outer * LENGTH) * math.cos(q1)
    b1, b2 = (
        u[j]
        - friction * (VISCOUS[j] * v + COULOMB[j] * 2 / math.pi * math.atan(GAMMA * v))
        - OFFSET[j]
        for j, v in enumerate((v1, v2))
    )
    b1 += h * (2 * v1 * v2 + v2 * v2) - arm - weight
    b2 += -h * v1 * v1 - weight
    determinant = m11 * m22 - m12 * m12
    return (m22 * b1 - m12 * b2) / determinant, (m11 * b2 - m12 * b1) / determinant


def _step(
    state: State, u: Sequence[float], load: tuple[float, float], friction: float, h: float
) -> State:
    """One step of Runge and Kutta of length h [s]."""

    def slope(at: State) -> State:
        return (at[2], at[3], *_acceleration(at, u, load, friction))

    def moved(by: State, share: float) -> State:
        a, b, c, d = (x + share * y for x, y in zip(state, by, strict=True))
        return a, b, c, d

    k1 = slope(state)
    k2 = slope(moved(k1, h / 2))
    k3 = slope(moved(k2, h / 2))
    k4 = slope(moved(k3, h))
    mean = tuple((a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4, strict=True))
    return moved((mean[0], mean[1], mean[2], mean[3]), h)


def _reference(t: np.ndarray, rng: np.random.Generator, period: float | None = None) -> np.ndarray:
    """Sums of five sines that rise from rest [rad], shape (samples, 2).

    With a period [s], the sines are its first five harmonics.
    """
    rise = (1.0 - np.exp(-((t / 0.5) ** 2)))[:, None]
    rates = 2 * np.pi * rng.uniform(0.1, 0.9, (5, 2))
    if period is not None:
        rates = 2 * np.pi / period * np.arange(1.0, 6.0)[:, None] * np.ones(2)
    sizes = rng.uniform(0.1, 0.5, (5, 2))
    phases = rng.uniform(0, 2 * np.pi, (5, 2))
    return rise * np.sum(sizes * np.sin(rates * t[:, None, None] + phases), axis=1)


def simulate(
    seed: int,
    samples: int,
    rate: float,
    kp: Sequence[float],
    kd: Sequence[float],
    *,
    load: tuple[float, float] = (0.0, 0.0),
    friction: float = 1.0,
    motion: int | None = None,
    encoder: float = 2e-6,
    period: float | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Measured positions and references [rad], torques [N m], each of shape (samples, 2).

    Args:
        seed: of the noise.
        samples: how many.
        rate: of samples and control law [Hz].
        kp: position gains [N m/rad].
        kd: speed gains [N m s/rad].
        load: mass [kg] of a point on the forearm and its distance from the elbow [m].
        friction: factor on viscous and Coulomb friction.
        motion: seed of the reference; None: that of the noise.
        encoder: standard deviation of the encoders' noise [rad].
        period: of the reference [s]; None: it does not repeat.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(samples) / rate
    shapes = np.random.default_rng(seed if motion is None else motion)
    reference = _reference(t, shapes, period)
    noise = encoder * rng.standard_normal((samples, 2))
    state: State = (float(reference[0, 0]), float(reference[0, 1]), 0.0, 0.0)
    last = [0.0, 0.0]
    q, tau = np.empty((samples, 2)), np.empty((samples, 2))
    for k in range(samples):
        u = []
        for j in (0, 1):
            q[k, j] = state[j] + noise[k, j]
            error = float(reference[k, j] - q[k, j])
            u.append(kp[j] * error + kd[j] * (error - last[j]) * rate * (k > 0))
            last[j] = error
        tau[k] = u
        for _ in (0, 1):
            state = _step(state, u, load, friction, 0.5 / rate)
    return q, reference, tau


def write_ampere_logs(folder: Path) -> None:
    """Logs in amperes without (empty.csv) and with a payload of 1.2 kg (loaded.csv)."""
    for name, seed, load in (("empty", 2, (0.0, 0.0)), ("loaded", 3, (1.2, 0.35))):
        signals = simulate(seed, 5000, 1000.0, (6000, 2500), (180, 60), load=load)
        _write_amperes(folder / f"{name}.csv", seed, signals, 1000.0)


def write_periods(folder: Path) -> None:
    """A log in amperes of six periods of 2 s (periods.csv)."""
    signals = simulate(4, 6000, 500.0, (6000, 2500), (180, 60), period=2.0)
    _write_amperes(folder / "periods.csv", 4, signals, 500.0)


def _write_amperes(
    path: Path, seed: int, signals: tuple[np.ndarray, np.ndarray, np.ndarray], rate: float
) -> None:
    """Positions and references in degrees, noisy currents in amperes, as a table."""
    q, reference, tau = signals
    noise = 0.01 * np.random.default_rng(seed + 10).standard_normal(tau.shape)
    columns = [np.arange(len(q)) / rate, np.rad2deg(q), np.rad2deg(reference)]
    rows = np.column_stack([*columns, tau / np.array([12.0, 5.0]) + noise])
    header = "time,q1,q2,r1,r2,i1,i2"
    np.savetxt(path, rows, fmt="%.9g", delimiter=",", header=header, comments="")


def write_fleet(folder: Path) -> None:
    """Five days of two arms; the friction of the second is 20 % higher on the last two."""
    for arm in (1, 2):
        (folder / f"arm_{arm}").mkdir(parents=True)
        for day in range(1, 6):
            seed = 10 * arm + day
            rng = np.random.default_rng(seed)
            celsius = 30.0 + 5.0 * rng.standard_normal()
            worn = 1.2 if arm == 2 and day > 3 else 1.0
            q, reference, tau = simulate(
                seed,
                1500,
                500.0,
                (6000, 2500),
                (180, 60),
                friction=worn * (1.0 + 0.004 * rng.standard_normal()),
                motion=2,
            )
            warm = celsius + 0.1 * rng.standard_normal(len(q))
            path = folder / f"arm_{arm}" / f"2026-03-{day:02d}.npz"
            np.savez(path, q=q, r=reference, tau=tau, celsius=warm)
