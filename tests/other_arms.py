"""Logs of arms that neither our model nor our simulator made: Pinocchio's inverse dynamics.

A serial arm of random links goes from posture to posture and stops between them. Motion and torque
are computed at the instants of the stamps, whatever these are, so that the truth does not depend
on a clock. Encoders round, torques are noisy, and an arm that stands is held by static friction.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

ClockKind = Literal["regular", "alternating", "jitter", "gaps"]

#: Counts per turn of an encoder of 14 bits.
COUNTS = 2**14


@dataclass(frozen=True, eq=False)
class Arm:
    """A serial arm of revolute joints and its drives."""

    urdf: str
    joint_names: tuple[str, ...]
    rotor_inertia: np.ndarray  # on the joint side [kg m²]
    viscous: np.ndarray  # [N m s/rad]
    coulomb: np.ndarray  # [N m]
    offset: np.ndarray  # [N m]
    reduction: np.ndarray  # gear ratio between encoder and joint, 1 for an encoder at the joint
    speed: np.ndarray  # rated [rad/s]


@dataclass(frozen=True)
class Setting:
    """How a log is taken.

    Attributes:
        clock: ``regular``, ``alternating`` (10 and 12 ms, say), ``jitter`` of every interval, or
            ``gaps``: jitter and single lost samples.
        rate: mean sampling rate [Hz].
        seconds: length [s].
        stops: seconds for which the arm stands between two moves, at most.
        torque_noise: standard deviation, as share of each joint's largest torque.
        speed: ``none``; ``true``: with noise of the size of a count per sample; ``drive``: first
            order filter of 2 ms over differences of the encoder's counts at 1 kHz.
        fastest: share of the rated speeds.
    """

    clock: ClockKind = "alternating"
    rate: float = 91.0
    seconds: float = 30.0
    stops: float = 1.0
    torque_noise: float = 0.005
    speed: Literal["none", "true", "drive"] = "drive"
    fastest: float = 0.8


@dataclass(frozen=True, eq=False)
class ArmLog:
    """Samples of a log and the truth behind them, time first."""

    arm: Arm
    t: np.ndarray  # stamps [s], shape (samples,)
    q: np.ndarray  # logged positions [rad], shape (samples, joints)
    dq: np.ndarray | None  # logged speeds [rad/s], or None
    tau: np.ndarray  # logged torques [N m]
    motion: tuple[np.ndarray, np.ndarray, np.ndarray]  # true q, dq, ddq
    torque: np.ndarray  # without noise [N m]
    #: Columns as `write` names them.
    columns: dict[str, np.ndarray] = field(default_factory=dict)

    def write(self, folder: Path, digits: int = 9) -> tuple[Path, Path]:
        """A table of samples and the robot's description; paths of both."""
        robot, log = folder / "arm.urdf", folder / "log.csv"
        robot.write_text(self.arm.urdf)
        table = {"t": self.t} | self.columns
        text = np.column_stack(list(table.values()))
        np.savetxt(
            log, text, fmt=f"%.{digits}g", delimiter=",", header=",".join(table), comments=""
        )
        return log, robot


def random_arm(rng: np.random.Generator, joints: int = 6) -> Arm:
    """An arm of 5 to 60 kg with alternating axes and the friction of geared drives."""
    scale = rng.uniform(0.5, 1.6)
    size = np.linspace(1.0, 0.25, joints) * scale
    names = tuple(f"axis_{k + 1}" for k in range(joints))
    axes = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0", "0 1 0"]
    mass = 12.0 * size**2 * rng.uniform(0.7, 1.4, joints)
    speed = rng.uniform(1.5, 3.5, joints) / np.sqrt(scale)
    weight = 9.81 * np.cumsum((mass * 0.4 * size)[::-1])[::-1]
    coulomb = rng.uniform(0.03, 0.12, joints) * np.maximum(weight, 2.0)
    links, chain = ['<link name="base"/>'], []
    before = "base"
    for k, name in enumerate(names):
        length = 0.45 * size[k]
        centre = rng.uniform(-0.15, 0.15, 3) * length + [
            0.4 * length if k > 2 else 0,
            0,
            0.35 * length,
        ]
        principal = mass[k] * length**2 * rng.uniform(0.08, 0.15, 3)
        inertia = " ".join(
            f'{key}="{value:.6g}"'
            for key, value in zip(
                ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
                (principal[0], 0, 0, principal[1], 0, principal[2]),
                strict=True,
            )
        )
        links.append(
            f'<link name="link_{k + 1}"><inertial><origin xyz="{centre[0]:.5g} {centre[1]:.5g} '
            f'{centre[2]:.5g}"/><mass value="{mass[k]:.5g}"/><inertia {inertia}/></inertial></link>'
        )
        back = 0.45 * size[k - 1] if k else 0.2
        place = f"{back:.5g} 0 0" if k > 3 else f"0 0 {back:.5g}"
        chain.append(
            f'<joint name="{name}" type="revolute"><parent link="{before}"/>'
            f'<child link="link_{k + 1}"/><origin xyz="{place}"/><axis xyz="{axes[k]}"/>'
            f'<limit lower="-2.9" upper="2.9" effort="{12 * weight[k]:.5g}" '
            f'velocity="{speed[k]:.5g}"/></joint>'
        )
        before = f"link_{k + 1}"
    urdf = f'<robot name="arm">{"".join(links)}{"".join(chain)}</robot>'
    return Arm(
        urdf,
        names,
        mass * (0.15 * size) ** 2 * rng.uniform(0.5, 2.0, joints),
        coulomb * rng.uniform(0.2, 1.0, joints) / speed,
        coulomb,
        0.1 * coulomb * rng.standard_normal(joints),
        np.where(rng.uniform(size=joints) < 0.5, 1.0, 100.0),
        speed,
    )


def stamps(rng: np.random.Generator, setting: Setting) -> np.ndarray:
    """Instants of the samples [s]."""
    n, period = round(setting.seconds * setting.rate), 1.0 / setting.rate
    intervals = np.full(n, period)
    if setting.clock == "alternating":
        intervals *= np.where(np.arange(n) % 2, 12.0, 10.0) / 11.0
    elif setting.clock in ("jitter", "gaps"):
        intervals *= 1.0 + np.clip(0.15 * rng.standard_normal(n), -0.6, 0.6)
    if setting.clock == "gaps":
        intervals[rng.choice(np.arange(20, n - 20), 6, replace=False)] *= rng.integers(2, 4, 6)
    t = np.cumsum(intervals) + 1e-6 * rng.standard_normal(n)
    return np.round(t - t[0], 6)


class Moves:
    """Moves with bounded jerk between random postures, and stops between them."""

    def __init__(self, rng: np.random.Generator, arm: Arm, setting: Setting) -> None:
        joints, t = len(arm.joint_names), 0.0
        self.parts: list[tuple[float, float, np.ndarray, np.ndarray]] = []
        here = rng.uniform(-0.5, 0.5, joints)
        while t < setting.seconds + 10:
            t += rng.uniform(0.0, setting.stops)
            there = rng.uniform(-1.3, 1.3, joints)
            # a quintic is fastest at 15/8 of its mean speed
            lasting = max(
                0.3, float(np.max(15 / 8 * abs(there - here) / arm.speed)) / setting.fastest
            )
            self.parts.append((t, lasting, here, there))
            here, t = there, t + lasting

    def at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """q, dq, ddq and the number of the move that began last, -1 before the first."""
        starts = np.array([part[0] for part in self.parts])
        last = np.searchsorted(starts, t, side="right") - 1
        k = np.maximum(last, 0)
        begun, lasting = (np.array([p[i] for p in self.parts])[k] for i in (0, 1))
        here, there = (np.array([p[i] for p in self.parts])[k] for i in (2, 3))
        s = np.clip((t - begun) / lasting, 0.0, 1.0)[:, None]
        way, lasting = there - here, lasting[:, None]
        return (
            here + way * s**3 * (10 - 15 * s + 6 * s**2),
            way * 30 * s**2 * (1 - s) ** 2 / lasting,
            way * 60 * s * (1 - s) * (1 - 2 * s) / lasting**2,
            last,
        )


def torque_of(
    arm: Arm, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, sign: np.ndarray
) -> np.ndarray:
    """Pinocchio's inverse dynamics with rotors and friction [N m]; ``sign`` of dry friction."""
    import pinocchio as pin

    model = pin.buildModelFromXML(arm.urdf)
    data = model.createData()
    rigid = np.array([pin.rnea(model, data, *x) for x in zip(q, dq, ddq, strict=True)])
    return rigid + arm.rotor_inertia * ddq + arm.viscous * dq + arm.coulomb * sign + arm.offset


def predicted_motion(seed: int, setting: Setting, joints: int = 6) -> tuple[np.ndarray, ...]:
    """Another motion of the arm of a log, without stops: exact q, dq, ddq and torque."""
    arm = random_arm(np.random.default_rng(seed), joints)
    other = replace(setting, seconds=30.0, stops=0.0)
    q, dq, ddq, _ = Moves(np.random.default_rng([seed, 99]), arm, other).at(np.arange(0, 30, 0.02))
    fast = (np.abs(dq) > 0.01).all(axis=1)
    q, dq, ddq = q[fast], dq[fast], ddq[fast]
    return q, dq, ddq, torque_of(arm, q, dq, ddq, np.sign(dq))


def make_log(seed: int, setting: Setting, joints: int = 6) -> ArmLog:
    """The log of a random arm."""
    rng = np.random.default_rng(seed)
    arm = random_arm(rng, joints)
    moves, t = Moves(rng, arm, setting), stamps(rng, setting)
    q, dq, ddq, move = moves.at(t)
    # At rest static friction holds what the drive has left over from the move before.
    held = rng.uniform(-0.8, 0.8, (len(moves.parts) + 1, joints))[move]
    torque = torque_of(arm, q, dq, ddq, np.where(dq == 0.0, held, np.sign(dq)))
    noise = setting.torque_noise * abs(torque).max(axis=0)
    tau = torque + noise * rng.standard_normal(torque.shape)
    step = 2 * np.pi / COUNTS / arm.reduction
    logged = np.round(q / step) * step
    speed = _logged_speed(rng, setting, moves, t, dq, step)
    columns = {f"q_{name}": logged[:, k] for k, name in enumerate(arm.joint_names)}
    if speed is not None:
        columns |= {f"dq_{name}": speed[:, k] for k, name in enumerate(arm.joint_names)}
    columns |= {f"tau_{name}": tau[:, k] for k, name in enumerate(arm.joint_names)}
    return ArmLog(arm, t, logged, speed, tau, (q, dq, ddq), torque, columns)


def log_of_motion(
    arm: Arm, t: np.ndarray, motion: tuple[np.ndarray, np.ndarray, np.ndarray], noise: float = 0.05
) -> ArmLog:
    """The log of a motion q, dq, ddq at stamps t; encoders tremble, torques have noise [N m]."""
    rng = np.random.default_rng(len(t))
    q, dq, ddq = motion
    torque = torque_of(arm, q, dq, ddq, np.where(dq == 0.0, 0.4, np.sign(dq)))
    tau = torque + noise * rng.standard_normal(torque.shape)
    step = 2 * np.pi / COUNTS / arm.reduction
    logged = np.round((q + 0.2 * step * rng.standard_normal(q.shape)) / step) * step
    columns = {f"q_{name}": logged[:, k] for k, name in enumerate(arm.joint_names)}
    columns |= {f"tau_{name}": tau[:, k] for k, name in enumerate(arm.joint_names)}
    return ArmLog(arm, t, logged, None, tau, motion, torque, columns)


def _logged_speed(
    rng: np.random.Generator,
    setting: Setting,
    moves: Moves,
    t: np.ndarray,
    dq: np.ndarray,
    step: np.ndarray,
) -> np.ndarray | None:
    """Speeds as a drive or a sensor gives them."""
    from scipy.signal import lfilter

    if setting.speed == "none":
        return None
    if setting.speed == "true":
        return dq + 0.3 * step * setting.rate * rng.standard_normal(dq.shape)
    fast = np.arange(0.0, t[-1] + 2e-3, 1e-3)
    counted = np.round(moves.at(fast)[0] / step) * step
    forget = np.exp(-1e-3 / 2e-3)
    smooth = lfilter(
        [1 - forget], [1, -forget], np.diff(counted, axis=0, prepend=counted[:1]) * 1e3, axis=0
    )
    return smooth[np.searchsorted(fast, t, side="right") - 1]
