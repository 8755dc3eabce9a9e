"""One rotating axis with every friction law in a closed loop, simulated finely and independently.

The integrator (Runge–Kutta 4, many steps per control period) and the laws are written here once
more; nothing of the program's friction or simulation is used, so that it can serve as their oracle.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numba import njit

from pivident.data.recording.recording import Recording
from pivident.estimation.problem import Problem
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.robot.description import Joint, Link, Robot
from pivident.robot.friction import FrictionLaw
from pivident.robot.transmission import Transmission

RATE = 1000.0
SUBSTEPS = 20
INERTIA = 2.0
GAMMA = 50.0
KP, KD = 7200.0, 190.0

#: Largest number of Maxwell elements.
ELEMENTS = 3


@dataclass(frozen=True)
class Truth:
    """Friction of the axis; what is not named is not there. SI units, levels in N m."""

    fv: float = 2.5
    fcp: float = 0.0
    fcn: float = 0.0
    off: float = 0.3
    fs: float = 0.0
    stribeck_speed: float = 0.1
    fvx: float = 0.0
    viscous_exponent: float = 0.5
    fl: float = 0.0
    rc: float = 0.0
    rs: float = 0.0
    order: float = 1.0
    cbf: float = 0.0
    strut_ratio: float = 0.5
    strut_angle: float = 0.0
    fc_state: float = 0.0
    presliding_distance: float = 0.01
    stribeck_excess: float = 0.0
    fd: float = 0.0
    fm: tuple[float, ...] = ()
    distances: tuple[float, ...] = ()

    def vector(self) -> np.ndarray:
        """What the integrator takes."""
        fm = [*self.fm, *[0.0] * (ELEMENTS - len(self.fm))]
        d = [*self.distances, *[1.0] * (ELEMENTS - len(self.distances))]
        return np.array(
            [
                self.fv, self.fcp, self.fcn, self.off, self.fs, self.stribeck_speed, self.fvx,
                self.viscous_exponent, self.fl, self.rc, self.rs, self.order, self.cbf,
                self.strut_ratio, self.strut_angle, self.fc_state, self.presliding_distance,
                self.stribeck_excess, self.fd, *fm, *d,
            ]
        )  # fmt: skip


@njit(cache=True)
def _acceleration(p, q, v, z, slip, tau):
    """Acceleration of the axis and rate of the presliding state."""
    s = 2.0 / math.pi * math.atan(GAMMA * v)
    f = p[0] * v + p[1] * 0.5 * (1.0 + s) - p[2] * 0.5 * (1.0 - s) + p[3]
    fall = math.exp(-((v / p[5]) ** 2))
    f += p[4] * s * fall
    if p[6] != 0.0:
        f += p[6] * (s if p[7] < 1.0 else math.copysign(1.0, v)) * abs(v) ** p[7]
    f += p[9] * math.cos(p[11] * q) + p[10] * math.sin(p[11] * q)
    g = 1.0 + p[17] * fall
    rate = (v - abs(v) * z / g) / p[16]
    f += p[15] * z + p[18] * p[16] * rate
    for i in range(ELEMENTS):
        f += p[19 + i] * slip[i]
    spring = p[12] * math.sin(q - p[14])
    spring /= math.sqrt(1.0 + p[13] ** 2 - 2.0 * p[13] * math.cos(q - p[14]))
    left = tau - f - spring
    # the load is what moves the inertia and stretches the spring: L = τ - f - fl |L| s
    total = tau - f
    load = total / (1.0 + p[8] * s * math.copysign(1.0, total))
    return (left - p[8] * abs(load) * s) / INERTIA, rate


@njit(cache=True)
def _run(p, q_ref, noise, q, v, tau):
    """PD loop: the command of a sample is held until the next one."""
    h = 1.0 / (RATE * SUBSTEPS)
    x, dx, z, before = q_ref[0], 0.0, 0.0, 0.0
    slip = np.zeros(ELEMENTS)
    for k in range(q_ref.size):
        q[k], v[k] = x, dx
        error = q_ref[k] - x - noise[k]
        rate = 0.0 if k == 0 else (error - before) * RATE
        before = error
        u = KP * error + KD * rate
        tau[k] = u
        for _ in range(SUBSTEPS):
            a1, b1 = _acceleration(p, x, dx, z, slip, u)
            a2, b2 = _acceleration(
                p, x + 0.5 * h * dx, dx + 0.5 * h * a1, z + 0.5 * h * b1, slip, u
            )
            a3, b3 = _acceleration(
                p, x + 0.5 * h * (dx + 0.5 * h * a1), dx + 0.5 * h * a2, z + 0.5 * h * b2, slip, u
            )
            a4, b4 = _acceleration(p, x + h * (dx + 0.5 * h * a2), dx + h * a3, z + h * b3, slip, u)
            step = h * dx + h * h / 6.0 * (a1 + a2 + a3)
            x += step
            dx += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
            z += h / 6.0 * (b1 + 2.0 * b2 + 2.0 * b3 + b4)
            for i in range(ELEMENTS):
                slip[i] = min(max(slip[i] + step / p[19 + ELEMENTS + i], -1.0), 1.0)


def reference(seconds: float, seed: int = 0) -> np.ndarray:
    """Sines of many speeds, with large and small strokes, at rest at the start [rad]."""
    t = np.arange(round(seconds * RATE)) / RATE
    rng = np.random.default_rng(seed)
    q = np.zeros(t.size)
    for amplitude, frequency in ((0.6, 0.21), (0.3, 0.37), (0.12, 0.83), (0.03, 1.9), (0.01, 3.7)):
        phase = rng.uniform(0, 2 * np.pi)
        q += amplitude * np.sin(2 * np.pi * frequency * t + phase)
    return (q - q[0]) * np.minimum(t / 0.3, 1.0) ** 2 * (3.0 - 2.0 * np.minimum(t / 0.3, 1.0))


def robot(law: FrictionLaw) -> Robot:
    """The axis with a friction law to be identified; it turns about the vertical."""
    inertia = np.zeros(10)
    inertia[5] = INERTIA
    joint = Joint("axis", "revolute", -1, np.eye(3), np.zeros(3), rated_speed=5.0)
    return Robot(
        "axis",
        (joint.with_friction(law.with_default_gamma(GAMMA)),),
        (Link("arm", inertia),),
        np.array([0.0, 0.0, -9.81]),
        np.zeros(1),
        Transmission.direct(1),
    )


@dataclass(frozen=True)
class Noise:
    """Encoder noise in the loop [rad] and torque noise on the record [N m], deviations."""

    encoder: float = 2e-6
    torque: float = 0.1


@dataclass(frozen=True)
class Axis:
    """The axis with its truth; motion is the same for all seeds but for the noise."""

    truth: Truth
    seconds: float = 12.0
    noise: Noise = field(default_factory=Noise)
    motion: int = 0

    def recording(self, seed: int) -> Recording:
        """A record with noise of that seed."""
        rng = np.random.default_rng(seed)
        q_ref = reference(self.seconds, self.motion)
        q, v, tau = np.empty((3, q_ref.size))
        noise = self.noise.encoder * rng.standard_normal(q_ref.size)
        _run(self.truth.vector(), q_ref, noise, q, v, tau)
        measured = tau + self.noise.torque * rng.standard_normal(q_ref.size)
        return Recording(
            "run",
            ("axis",),
            (q + noise)[:, None],
            measured[:, None],
            RATE,
            q_ref=q_ref[:, None],
        )

    def problem(self, law: FrictionLaw, seed: int) -> Problem:
        """What is given to whoever believes in that law."""
        loop = Loop(PD(kp=[KP], kd=[KD]))
        return Problem(robot(law), (self.recording(seed),), loop, mask=None)
