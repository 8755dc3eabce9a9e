"""Motions that users run: sums of sines, moves between postures, a motion that repeats."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arms import Arm

#: Standstill at both ends of a motion, and time in which sines swell and fade [s].
REST, FADE = 0.5, 1.5

#: Share of the rated speed that the joints reach.
SHARE = (0.45, 0.7)

Signals = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Motion:
    """A reference at the ticks of the controller.

    Attributes:
        name: what the user calls the run.
        rate: of the controller [Hz].
        q, dq, ddq: positions, speeds and accelerations, each (ticks, joints).
        period: of a motion that repeats [s], else 0.
    """

    name: str
    rate: float
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    period: float = 0.0


def sum_of_sines(
    name: str, arm: Arm, rng: np.random.Generator, rate: float, seconds: float
) -> Motion:
    """Five sines of random frequency and phase per joint, about the home posture."""
    t = np.arange(round(seconds * rate)) / rate
    frequencies = np.exp(rng.uniform(*np.log(arm.frequencies), (arm.size, 5)))
    return Motion(name, rate, *_faded(t, arm, frequencies, rng))


def repeated(arm: Arm, rng: np.random.Generator, rate: float, period: float, times: int) -> Motion:
    """A Fourier series of five harmonics, repeated; before and after it swells and fades.

    Between t = REST + FADE and t = REST + FADE + times · period the motion has its period exactly.
    """
    t = np.arange(round((2 * (REST + FADE) + times * period) * rate)) / rate
    frequencies = np.tile(np.arange(1, 6) / period, (arm.size, 1))
    return Motion("repeated", rate, *_faded(t, arm, frequencies, rng), period)


def moves(name: str, arm: Arm, rng: np.random.Generator, rate: float, seconds: float) -> Motion:
    """Moves between random postures, all joints at once, each of the fifth order in time."""
    t = np.arange(round(seconds * rate)) / rate
    home, reach = np.array(arm.home), np.array(arm.reach)
    q = np.tile(home, (len(t), 1))
    dq, ddq = np.zeros_like(q), np.zeros_like(q)
    begin, posture = REST, home
    while True:
        target = home + reach * rng.uniform(-1.0, 1.0, arm.size)
        # the steepest slope of the move is 15/8 of its mean
        wanted = rng.uniform(0.4, SHARE[1]) * arm.speeds
        length = max(float(np.max(1.875 * np.abs(target - posture) / wanted)), 0.35)
        end = begin + length
        last = end > seconds - REST - 0.8
        if last:
            target = home
            end = seconds - REST
            length = end - begin
            if float(np.max(1.875 * np.abs(target - posture) / arm.speeds)) > length:
                return Motion(name, rate, q, dq, ddq)
        now = (t >= begin) & (t < end)
        s, ds, dds = _fifth_order((t[now] - begin) / length)
        step = target - posture
        q[now] = posture + np.outer(s, step)
        dq[now] = np.outer(ds, step) / length
        ddq[now] = np.outer(dds, step) / length**2
        q[t >= end] = target
        if last:
            return Motion(name, rate, q, dq, ddq)
        begin, posture = end + rng.uniform(0.0, 0.3), target


def _faded(t: np.ndarray, arm: Arm, frequencies: np.ndarray, rng: np.random.Generator) -> Signals:
    """Sines about home under a window, as large as reach and speeds allow."""
    w = 2 * np.pi * frequencies
    amplitude = rng.uniform(0.4, 1.0, w.shape) / w
    phase = rng.uniform(-np.pi, np.pi, w.shape)
    angle = t[:, None, None] * w + phase
    x = (amplitude * np.sin(angle)).sum(axis=2)
    dx = (amplitude * w * np.cos(angle)).sum(axis=2)
    ddx = -(amplitude * w**2 * np.sin(angle)).sum(axis=2)
    g, dg, ddg = _window(t)
    q, dq, ddq = g * x, g * dx + dg * x, g * ddx + 2 * dg * dx + ddg * x
    wanted = rng.uniform(*SHARE, arm.size) * arm.speeds
    scale = np.minimum(wanted / np.abs(dq).max(axis=0), np.array(arm.reach) / np.abs(q).max(axis=0))
    return np.array(arm.home) + scale * q, scale * dq, scale * ddq


def _window(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A window that swells from 0 to 1 and fades, and its two derivatives, each (ticks, 1)."""
    up = _fifth_order(np.clip((t - REST) / FADE, 0.0, 1.0))
    down = _fifth_order(np.clip((t[-1] - REST - t) / FADE, 0.0, 1.0))
    g = up[0] * down[0]
    dg = (up[1] * down[0] - up[0] * down[1]) / FADE
    ddg = (up[2] * down[0] - 2 * up[1] * down[1] + up[0] * down[2]) / FADE**2
    return g[:, None], dg[:, None], ddg[:, None]


def _fifth_order(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The polynomial 10x³ - 15x⁴ + 6x⁵ from 0 to 1 and its two derivatives."""
    return (
        x**3 * (10 - 15 * x + 6 * x**2),
        30 * x**2 * (1 - x) ** 2,
        60 * x * (1 - x) * (1 - 2 * x),
    )
