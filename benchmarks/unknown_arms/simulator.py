"""The machine under its hidden law: rigid bodies by MuJoCo, dry friction exactly.

MuJoCo computes inertia M(q) and the torque b(q, v) of Coriolis forces and gravity. Its own dry
friction is a soft constraint, so the friction here is a set-valued law inside a midpoint step
(Moreau; Jean 1999): with p = q + h v/2 and w = (v + v⁺)/2,

    M(p) (v⁺ - v) = h (τ - b(p, w) - F_v w) - Σ_i d_i x_i,     q⁺ = p + h v⁺/2
    x_i ∈ h F_c,i Sgn(d_iᵀ v⁺)

which is of second order while joints slide, stops them within the step in which they stop, and
lets them stick. The impulses x_i are found by projected Gauss–Seidel, to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from .arms import Arm
from .laws import Law, hidden_law
from .models import mjcf
from .motion import Motion
from .truth import Machine

#: Rate of the steps of the simulation [Hz].
STEPS = 4000.0


@dataclass(frozen=True)
class Trace:
    """What happened, at the ticks of the controller; each array is (ticks, joints).

    Attributes:
        motion: the reference.
        law: the hidden law.
        q: true positions.
        dq: true speeds.
        ddq: mean accelerations of the first step after the tick.
        q_measured: what the encoders read there.
        tau: motor torque on the joint side, from the tick on until the next.
        tau_link: torque of the sensors behind the gears, in the first step after the tick.
        q_middle, dq_middle: position and speed in the middle of that step.
        dry: dry friction torque in that step, motor and bearings together.
    """

    motion: Motion
    law: Law
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    q_measured: np.ndarray
    tau: np.ndarray
    tau_link: np.ndarray
    q_middle: np.ndarray
    dq_middle: np.ndarray
    dry: np.ndarray


class RigidModel:
    """Rigid-body dynamics by MuJoCo."""

    def __init__(self, arm: Arm, bodies, rotor, shafts=()) -> None:
        import mujoco

        self._mujoco = mujoco
        self._model = mujoco.MjModel.from_xml_string(mjcf(arm, bodies, rotor, shafts))
        self._data = mujoco.MjData(self._model)
        self._full = np.zeros((arm.size, arm.size))

    def inertia(self, q: np.ndarray) -> np.ndarray:
        """M(q) with the rotors, shape (joints, joints); the array is overwritten by the next."""
        self._data.qpos[:] = q
        self._mujoco.mj_fwdPosition(self._model, self._data)
        self._mujoco.mj_fullM(self._model, self._data, self._full)
        return self._full

    def bias(self, dq: np.ndarray) -> np.ndarray:
        """b(q, dq) at the position of the last `inertia`; a view of MuJoCo's array."""
        self._data.qvel[:] = dq
        self._mujoco.mj_fwdVelocity(self._model, self._data)
        return self._data.qfrc_bias

    def gravity(self, q: np.ndarray) -> np.ndarray:
        """g(q), shape (joints,)."""
        self.inertia(q)
        return self.bias(np.zeros_like(q)).copy()

    def inverse_dynamics(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """M(q) ddq + b(q, dq), shape (joints,)."""
        return self.inertia(q) @ ddq + self.bias(dq)


class Plant:
    """A machine that moves under torques."""

    def __init__(self, made: Machine, q: np.ndarray) -> None:
        n = made.arm.size
        self._rigid = RigidModel(made.arm, made.bodies, made.rotor, made.shafts)
        directions = [*np.eye(n)]
        levels, viscous = [*made.coulomb], np.diag(made.viscous)
        for s in made.shafts:
            row = np.zeros(n)
            row[s.motor], row[s.joint] = 1.0, s.ratio
            directions.append(row)
            levels.append(s.coulomb)
            viscous = viscous + s.viscous * np.outer(row, row)
        self._directions, self._levels = np.array(directions), np.array(levels)
        self._viscous = viscous
        self._impulses = np.zeros(len(levels))
        self.q, self.v = np.array(q, dtype=float), np.zeros(n)

    def step(self, tau: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """One step of length h [s].

        Returns:
            Middle position, middle speed and dry friction torque of the step.
        """
        middle = self.q + 0.5 * h * self.v
        inertia = self._rigid.inertia(middle)
        w = self.v
        for _ in range(2):
            bias = self._rigid.bias(w)
            after, impulse = _friction_step(
                inertia,
                self.v,
                h * (tau - bias),
                h * self._viscous,
                self._directions,
                h * self._levels,
                self._impulses,
            )
            w = 0.5 * (self.v + after)
        self.q, self.v = middle + 0.5 * h * after, after
        return middle, w, impulse / h


@numba.njit(cache=True)
def _friction_step(inertia, v, impulse, viscous, directions, bounds, x):
    """Speeds after a step, and the impulse of dry friction; x is the guess and the result."""
    implicit = np.linalg.inv(inertia + 0.5 * viscous)
    free = implicit @ (inertia @ v - 0.5 * viscous @ v + impulse)
    response = directions @ implicit  # speeds per impulse, one row for each
    after = free - x @ response
    for _ in range(500):
        change = 0.0
        for i in range(len(x)):
            if bounds[i] == 0.0:
                continue
            slip = directions[i] @ after
            give = directions[i] @ response[i]
            new = min(max(x[i] + slip / give, -bounds[i]), bounds[i])
            step = new - x[i]
            if step != 0.0:
                after -= response[i] * step
                x[i] = new
                change = max(change, abs(step) / bounds[i])
        if change < 1e-12:
            break
    return after, x @ directions


def simulate(made: Machine, motion: Motion, noise: float = 1.0) -> Trace:
    """The machine under its law along a motion.

    Args:
        made: the machine.
        motion: reference at the ticks of the controller, which it begins at rest.
        noise: factor of the encoders' noise; their counts stay.
    """
    arm = made.arm
    rng = np.random.default_rng([made.seed, 3, *motion.name.encode()])
    vendor = RigidModel(arm, made.vendor_bodies, np.array(arm.rotor), arm.shafts)
    law = hidden_law(made, motion, vendor, np.diag(vendor.inertia(np.array(arm.home))).copy())
    plant = Plant(made, motion.q[0])
    substeps = round(STEPS / motion.rate)
    h = 1.0 / (motion.rate * substeps)
    counts = np.array(arm.counts)
    jitter = noise * np.array(arm.encoder_noise) * rng.standard_normal(motion.q.shape)
    rows = []
    for k in range(len(motion.q)):
        q, dq = plant.q, plant.v
        measured = np.round((q + jitter[k]) * counts) / counts
        tau = law.torque(k, measured)
        middle, w, dry = plant.step(tau, h)
        ddq = (plant.v - dq) / h
        rows.append((q, dq, ddq, measured, tau, middle, w, dry))
        for _ in range(substeps - 1):
            plant.step(tau, h)
    q, dq, ddq, measured, tau, middle, w, dry = (np.array(x) for x in zip(*rows, strict=True))
    # in front of the sensor: rotor and the motor's part of the friction
    motor = 1.0 - arm.bearing_share
    before = made.rotor * ddq + motor * (made.viscous * w + dry)
    tau_link = tau - before if motor else tau
    return Trace(motion, law, q, dq, ddq, measured, tau, tau_link, middle, w, dry)
