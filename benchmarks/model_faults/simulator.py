"""The machine in its loop: rigid bodies by MuJoCo, smooth friction implicitly, held torques.

With p = q + h v/2 and w = (v + v⁺)/2 a step of length h is, of second order and symmetric,

    M(p) (v⁺ - v) = h (τ - b(p, w) - Dᵀ φ(D w) - s(p, w)),     q⁺ = p + h v⁺/2

with inertia M and bias b by MuJoCo, friction φ of joints and shafts (rows of D), found by Newton's
iteration, and the torque s of an elastic gear, whose motor is one more coordinate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numba
import numpy as np
from benchmarks.unknown_arms.motion import Motion
from benchmarks.unknown_arms.simulator import RigidModel
from benchmarks.unknown_arms.truth import Body

from .machines import Extra, Payload, Setup

#: Longest step [s].
MAX_STEP = 2.5e-4

#: Time after which a load that grows is made anew [s].
GROWTH = 0.1

#: Rows of the friction table.
VISCOUS, COULOMB, OFFSET, GAMMA, EXCESS, SPEED = range(6)


@dataclass(frozen=True)
class Trace:
    """What happened at the ticks of the law, on the user's side; each array is (ticks, joints).

    Attributes:
        motion: the reference.
        q: what the law saw.
        tau: what it commanded.
        moved: speeds that the encoders would show without noise [rad/s or m/s].
    """

    motion: Motion
    q: np.ndarray
    tau: np.ndarray
    moved: np.ndarray


class Plant:
    """A machine that moves under torques on its own side."""

    def __init__(self, setup: Setup, record: int, q: np.ndarray) -> None:
        made, n = setup.made, setup.arm.size
        self._spring, self._n = setup.spring, n
        self.size = n + (self._spring is not None)
        rotor, bodies = made.rotor.copy(), made.bodies
        #: Coordinate of each joint's motor.
        self.motors = np.arange(n)
        if self._spring is not None:
            self.motors[self._spring.joint] = n
            rotor[self._spring.joint] = 0.0
        if setup.payload is not None and record in setup.payload.records:
            bodies = (*bodies[:-1], loaded(bodies[-1], setup.payload))
        self._setup, self._bodies, self._rotor = setup, bodies, rotor
        self.carry(0.0)
        self._inertia = np.zeros((self.size, self.size))
        if self._spring is not None:
            self._inertia[n, n] = made.rotor[self._spring.joint]
        self._rows, self._table = _friction(setup, self.motors, self.size)
        self._tanh = setup.tanh
        travel = np.mean([joint.limits for joint in setup.arm.joints], axis=1)
        stiffness = np.zeros(n) if setup.extra is None else np.resize(setup.extra.stiffness or 0, n)
        self._springs = stiffness, travel
        turned = [] if self._spring is None else [q[self._spring.joint]]
        self.q, self.v = np.append(q, turned), np.zeros(self.size)

    def carry(self, share: float) -> None:
        """Carry a share of the load that changes with time."""
        bodies, extra = self._bodies, self._setup.extra
        if extra is not None and extra.load is not None and share > 0.0:
            load = replace(extra.load, mass=share * extra.load.mass)
            bodies = (*bodies[:-1], loaded(bodies[-1], load))
        self._rigid = RigidModel(self._setup.arm, bodies, self._rotor, self._setup.made.shafts)

    def step(self, tau: np.ndarray, h: float, share: float) -> None:
        """One step of length h [s] under torques, shape (joints,), with a share of the friction."""
        n = self._n
        middle = self.q + 0.5 * h * self.v
        self._inertia[:n, :n] = self._rigid.inertia(middle[:n])
        forces = np.zeros(self.size)
        table = self._table.copy()
        table[[VISCOUS, COULOMB]] *= share
        w = after = self.v
        for _ in range(2):
            forces[:] = 0.0
            forces[self.motors] += tau
            forces[:n] -= self._rigid.bias(w[:n])
            forces[:n] -= self._springs[0] * (middle[:n] - self._springs[1])
            if self._spring is not None:
                j, through = self._spring.joint, self._transmitted(middle, w)
                forces[j] += through
                forces[n] -= through
            after = speeds_after(self._inertia, self.v, forces, h, self._rows, table, self._tanh)
            w = 0.5 * (self.v + after)
        self.q, self.v = middle + 0.5 * h * after, after

    def _transmitted(self, q: np.ndarray, v: np.ndarray) -> float:
        """Torque of the elastic gear on its link: none inside the play [N m]."""
        spring, j, m = self._spring, self._spring.joint, self._n
        twist = q[m] - q[j]
        beyond = twist - np.clip(twist, -spring.play / 2, spring.play / 2)
        if beyond == 0.0 and spring.play > 0.0:
            return 0.0
        return spring.stiffness * beyond + spring.damping * (v[m] - v[j])


def _friction(setup: Setup, motors: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions of friction (rows, coordinates) and its table (6, rows); friction is at motors."""
    made, n = setup.made, setup.arm.size
    rows, table = np.zeros((n + len(made.shafts), size)), np.zeros((6, n + len(made.shafts)))
    rows[np.arange(n), motors] = 1.0
    table[:, :n] = (
        made.viscous,
        made.coulomb,
        made.offset,
        setup.gamma,
        setup.stribeck,
        setup.stribeck_speed,
    )
    for k, shaft in enumerate(made.shafts, n):
        rows[k, [motors[shaft.motor], motors[shaft.joint]]] = 1.0, shaft.ratio
        table[:, k] = shaft.viscous, shaft.coulomb, 0.0, setup.gamma[shaft.motor], 0.0, 1.0
    return rows, table


@numba.njit(cache=True)
def speeds_after(inertia, v, forces, h, rows, table, tanh):
    """Speeds after a step, by Newton's iteration on the friction."""
    after = v.copy()
    for _ in range(50):
        slip = rows @ (0.5 * (v + after))
        torque, slope = np.zeros(len(slip)), np.zeros(len(slip))
        for i in range(len(slip)):
            s = slip[i]
            x = table[GAMMA, i] * s
            if tanh:
                sign = np.tanh(x)
                steep = table[GAMMA, i] * (1.0 - sign * sign)
            else:
                sign = 2.0 / np.pi * np.arctan(x)
                steep = 2.0 / np.pi * table[GAMMA, i] / (1.0 + x * x)
            ratio = s / table[SPEED, i]
            excess = table[EXCESS, i] * np.exp(-ratio * ratio)
            level = table[COULOMB, i] + excess
            torque[i] = table[VISCOUS, i] * s + level * sign + table[OFFSET, i]
            fall = -2.0 * ratio / table[SPEED, i] * excess
            slope[i] = table[VISCOUS, i] + level * steep + fall * sign
        residual = inertia @ (after - v) - h * (forces - rows.T @ torque)
        change = np.linalg.solve(inertia + 0.5 * h * (rows.T * slope) @ rows, residual)
        after = after - change
        if np.abs(change).max() < 1e-14:
            break
    return after


def loaded(body: Body, payload: Payload) -> Body:
    """A body with a cube of 8 cm and the payload's mass at its place."""
    parts = [
        (body.mass, body.center, body.inertia),
        (
            payload.mass,
            np.array(payload.center),
            payload.mass * 0.08**2 / 6.0 * np.eye(3),
        ),
    ]
    mass = sum(m for m, _, _ in parts)
    center = sum(m * c for m, c, _ in parts) / mass
    inertia = np.zeros((3, 3))
    for m, c, own in parts:
        d = c - center
        inertia += own + m * (d @ d * np.eye(3) - np.outer(d, d))
    return Body(mass, center, inertia)


def simulate(setup: Setup, motion: Motion, record: int, records: int) -> Trace:
    """The machine under its law along a motion.

    Args:
        setup: the machine.
        motion: reference at the ticks of the law on the user's side, from rest.
        record: which of the records it is.
        records: how many there are.
    """
    arm, ticks = setup.arm, len(motion.q)
    rng = np.random.default_rng([setup.made.seed, 12, record])
    noise = np.array(arm.encoder_noise) * rng.standard_normal(motion.q.shape)
    counts = np.array(arm.counts)
    amplitude, order, phase = setup.ripple
    weight = _weight(setup, motion)
    plant = Plant(setup, record, (motion.q[0] - setup.zero) / setup.gear)
    q_log, tau_log, moved = (np.zeros_like(motion.q) for _ in range(3))
    answers = [weight(0, motion.q[0])] * setup.late  # drives that wait begin with the weight
    extra = setup.extra or Extra()
    shares = np.resize(extra.shares or 0.0, (arm.size, arm.size))
    carried = 0.0
    last, integral = None, np.zeros(arm.size)
    steps = int(np.ceil(1.0 / (setup.rate * MAX_STEP) - 1e-9))
    for k in range(ticks):
        turned = plant.q[plant.motors]
        passed = (record + k / ticks) / records
        seen = setup.gear * turned + setup.zero + amplitude * np.sin(order * turned + phase)
        seen = seen + shares @ turned
        measured = np.round((seen + noise[k]) * counts) / counts
        speed = np.zeros(arm.size) if last is None else (measured - last) * setup.rate
        last = measured
        u = setup.kp * (motion.q[k] - measured) + setup.kd * (motion.dq[k] - speed)
        integral = integral + u / (setup.rate * setup.integral_time)
        u = u + integral + weight(k, measured)
        q_log[k], tau_log[k], moved[k] = measured, u, setup.gear * plant.v[plant.motors]
        answers.append(u)
        acting = setup.drive * answers[k] - _offset(extra, passed, ticks * records / setup.rate)
        share = 1.0 - setup.drift * passed
        load = _share_of_load(extra, passed, k, int(GROWTH * setup.rate))
        if load is not None and load != carried:
            carried = load
            plant.carry(load)
        for _ in range(steps):
            plant.step(acting, 1.0 / (setup.rate * steps), share)
    if np.abs(tau_log).max(axis=0).max() > 1e6 or not np.isfinite(q_log).all():
        raise RuntimeError(f"{arm.name}, seed {setup.made.seed}: the loop is not stable")
    return Trace(motion, q_log, tau_log, moved)


def _offset(extra: Extra, passed: float, seconds: float) -> np.ndarray | float:
    """What the offsets have changed by after a share of all records, which last so long [s]."""
    drift = np.array(extra.drift) * passed * seconds if extra.drift else 0.0
    return drift + np.array(extra.jump) * (passed >= extra.instant) if extra.jump else drift


def _share_of_load(extra: Extra, passed: float, tick: int, every: int) -> float | None:
    """Share of the load that is carried; None: as before."""
    if extra.load is None or (extra.grows and tick % every):
        return None
    return passed if extra.grows else float(passed >= extra.instant)


def _weight(setup: Setup, motion: Motion):
    """What the law adds at a tick: nothing, or the weight of the user's robot."""
    n = setup.arm.size
    if setup.feed_forward == "none":
        return lambda k, q: np.zeros(n)
    believed = RigidModel(setup.believed_arm, setup.made.urdf_bodies, np.zeros(n))
    if setup.feed_forward == "gravity":
        return lambda k, q: believed.gravity(motion.q[k])
    return lambda k, q: believed.gravity(q)
