"""Logs of arms with several kinds of friction: Pinocchio's inverse dynamics, exact signs.

Arms are those of `tests.other_arms`. Every joint has viscous and Coulomb friction and an offset;
some have Stribeck friction, friction that grows with the load, or viscous friction that falls while
the machine warms up. Motions have speeds, postures and temperatures of their own, so that a law
fitted to one can be judged on another.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.problem import Problem
from pivident.robot.description import Robot
from pivident.robot.urdf import read_urdf
from tests.other_arms import COUNTS, Arm, random_arm

RATE = 200.0


@dataclass(frozen=True, eq=False)
class Truth:
    """What viscous, Coulomb friction and offset of the arm leave out; arrays (joints,)."""

    excess: np.ndarray  # of the break-away level over Coulomb friction [N m]
    stribeck_speed: np.ndarray  # [rad/s]
    load: np.ndarray  # friction per torque carried
    warming: np.ndarray  # share of the viscous friction that a warm machine loses
    time_constant: float  # of the warming [s]


@dataclass(frozen=True)
class Programme:
    """One motion: sines of each joint, or moves from posture to posture of all joints at once."""

    seconds: float
    fastest: float  # share of the rated speeds
    travel: float  # largest distance from the middle posture [rad]
    sines: bool
    started: float = 0.0  # the machine has moved so long before [s]


def plain_truth(arm: Arm) -> Truth:
    """Nothing but viscous, Coulomb friction and offset."""
    none = np.zeros(len(arm.joint_names))
    return Truth(none, none + 0.1, none, none, 60.0)


def rich_truth(rng: np.random.Generator, arm: Arm) -> Truth:
    """Each effect on about every second joint."""
    n = len(arm.joint_names)

    def some(values: np.ndarray) -> np.ndarray:
        return values * (rng.uniform(size=n) < 0.5)

    return Truth(
        some(arm.coulomb * rng.uniform(0.2, 0.8, n)),
        arm.speed * rng.uniform(0.02, 0.1, n),
        some(rng.uniform(0.03, 0.12, n)),
        some(rng.uniform(0.2, 0.5, n)),
        rng.uniform(30.0, 300.0),
    )


@dataclass(frozen=True, eq=False)
class FrictionArm:
    """An arm with its friction, and what logs of it are like."""

    seed: int
    arm: Arm
    truth: Truth
    torque_noise: float  # standard deviation, as share of each joint's largest torque

    def motion(self, number: int, programme: Programme) -> tuple[np.ndarray, ...]:
        """Exact q, dq, ddq and torque, each (samples, joints)."""
        rng = np.random.default_rng([self.seed, number])
        t = np.arange(round(programme.seconds * RATE)) / RATE
        q, dq, ddq = (_sines if programme.sines else _moves)(rng, self.arm, programme, t)
        return q, dq, ddq, self.torque(q, dq, ddq, t + programme.started)

    def torque(self, q, dq, ddq, t) -> np.ndarray:
        """Inverse dynamics and friction with the exact sign, shape (samples, joints) [N m]."""
        import pinocchio as pin

        arm, truth = self.arm, self.truth
        model = pin.buildModelFromXML(arm.urdf)
        data = model.createData()
        rigid = np.array([pin.rnea(model, data, *x) for x in zip(q, dq, ddq, strict=True)])
        carried = rigid + arm.rotor_inertia * ddq
        warm = 1.0 - truth.warming * (1.0 - np.exp(-t / truth.time_constant))[:, None]
        level = arm.coulomb + truth.excess * np.exp(-((dq / truth.stribeck_speed) ** 2))
        level = level + truth.load * np.abs(carried)
        return carried + arm.viscous * warm * dq + level * np.sign(dq) + arm.offset

    def recording(self, number: int, programme: Programme) -> Recording:
        """Its log: counts of encoders, noisy torque."""
        q, _, _, torque = self.motion(number, programme)
        rng = np.random.default_rng([self.seed, number, 1])
        step = 2 * np.pi / COUNTS / self.arm.reduction
        noise = self.torque_noise * abs(torque).max(axis=0)
        tau = torque + noise * rng.standard_normal(torque.shape)
        return Recording(
            f"motion {number}",
            self.arm.joint_names,
            np.round(q / step) * step,
            tau,
            RATE,
            torque_timing="sampled",
        )

    def robot(self) -> Robot:
        """What its user has: the description, with the default friction law."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "arm.urdf"
            path.write_text(self.arm.urdf)
            return read_urdf(path)

    def problem(self, programmes: dict[int, Programme]) -> Problem:
        """The identification from logs of some motions."""
        logs = tuple(self.recording(number, own) for number, own in programmes.items())
        return Problem(self.robot(), logs)


def friction_arm(seed: int, rich: bool, joints: int) -> FrictionArm:
    """A random arm whose friction is plain or rich."""
    rng = np.random.default_rng([seed, 1])
    arm = random_arm(np.random.default_rng(seed), joints)
    truth = rich_truth(rng, arm) if rich else plain_truth(arm)
    return FrictionArm(seed, arm, truth, float(rng.choice([0.002, 0.005, 0.02])))


def programmes(seed: int, seconds: float = 30.0) -> dict[int, Programme]:
    """Two motions to fit and a third, faster or slower and over other postures."""
    rng = np.random.default_rng([seed, 2])
    sines = bool(rng.uniform() < 0.5)
    fastest, travel = rng.uniform(0.4, 0.8), rng.uniform(0.8, 1.2)
    other = rng.uniform(0.5, 1.3)
    return {
        1: Programme(seconds, fastest, travel, sines),
        2: Programme(seconds, fastest * rng.uniform(0.5, 1.0), 0.9 * travel, not sines, seconds),
        3: Programme(
            seconds, fastest * other, travel * rng.uniform(0.8, 1.2), bool(rng.uniform() < 0.5),
            rng.uniform(0.0, 300.0),
        ),
    }  # fmt: skip


def _sines(rng, arm: Arm, programme: Programme, t: np.ndarray) -> tuple[np.ndarray, ...]:
    """Five sines for each joint, about a posture of its own."""
    n = len(arm.joint_names)
    middle = rng.uniform(-0.5, 0.5, n)
    frequency = 0.05 * np.arange(1, 6) * rng.uniform(0.8, 1.6)
    weight, phase = rng.standard_normal((5, n)), rng.uniform(0, 2 * np.pi, (5, n))
    w = 2 * np.pi * frequency[:, None]
    angle = w * t[:, None, None] + phase
    q = (weight * np.sin(angle)).sum(axis=1)
    dq = (weight * w * np.cos(angle)).sum(axis=1)
    ddq = -(weight * w**2 * np.sin(angle)).sum(axis=1)
    size = programme.travel / np.abs(q).max(axis=0)
    # the clock of the whole motion is chosen by the joint that is fastest for its rating
    pace = programme.fastest / np.max(np.abs(dq * size).max(axis=0) / arm.speed)
    if pace < 1.0:
        return _sines_at(middle, weight * size, w * pace, phase, t)
    return middle + q * size, dq * size, ddq * size


def _sines_at(middle, weight, w, phase, t) -> tuple[np.ndarray, ...]:
    angle = w * t[:, None, None] + phase
    return (
        middle + (weight * np.sin(angle)).sum(axis=1),
        (weight * w * np.cos(angle)).sum(axis=1),
        -(weight * w**2 * np.sin(angle)).sum(axis=1),
    )


def _moves(rng, arm: Arm, programme: Programme, t: np.ndarray) -> tuple[np.ndarray, ...]:
    """Quintic moves between random postures, each joint with its own times."""
    columns = []
    for speed in arm.speed:
        here, begun = rng.uniform(-1.0, 1.0) * programme.travel, -rng.uniform(0.0, 0.5)
        q, dq, ddq = np.zeros((3, t.size))
        while begun < t[-1]:
            there = rng.uniform(-1.0, 1.0) * programme.travel
            way = there - here
            lasting = max(0.4, 15 / 8 * abs(way) / (programme.fastest * speed))
            lasting *= rng.uniform(1.0, 2.5)
            now = (t >= begun) & (t < begun + lasting)
            s = (t[now] - begun) / lasting
            q[now] = here + way * s**3 * (10 - 15 * s + 6 * s**2)
            dq[now] = way * 30 * s**2 * (1 - s) ** 2 / lasting
            ddq[now] = way * 60 * s * (1 - s) * (1 - 2 * s) / lasting**2
            here, begun = there, begun + lasting
        columns.append((q, dq, ddq))
    return tuple(np.array(x).T for x in zip(*columns, strict=True))
