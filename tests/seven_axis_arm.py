"""A seven-axis arm with motors, gears and torque sensors behind them, and the logs it makes.

The geometry is that of the Franka Panda (modified DH parameters of its maker); bodies are drawn
for each seed. MuJoCo simulates rotors, dry and viscous friction and links under PD control with
gravity compensation at 1 kHz; what the sensors feel is computed from the motion by Pinocchio. None
of this is pivident's.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

#: d [m], r [m], alpha [rad] of each axis, as in Khalil's notation.
GEOMETRY = (
    (0.0, 0.333, 0.0),
    (0.0, 0.0, -np.pi / 2),
    (0.0, 0.316, np.pi / 2),
    (0.0825, 0.0, np.pi / 2),
    (-0.0825, 0.384, -np.pi / 2),
    (0.0, 0.0, np.pi / 2),
    (0.088, 0.0, np.pi / 2),
)
LIMITS = (
    (-2.8973, 2.8973), (-1.7628, 1.7628), (-2.8973, 2.8973), (-3.0718, -0.0698),
    (-2.8973, 2.8973), (-0.0175, 3.7525), (-2.8973, 2.8973),
)  # fmt: skip
SPEEDS = (2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61)
EFFORTS = (87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0)

MASSES = np.array([4.0, 4.0, 3.0, 2.7, 1.7, 1.6, 0.7])  # [kg], ± 20 % by seed
ROTORS = np.array([0.6, 0.6, 0.5, 0.5, 0.25, 0.2, 0.15])  # behind the gear [kg m²]
COULOMB = np.array([5.0, 6.0, 4.0, 4.0, 2.0, 1.5, 1.2])  # of drives and bearings [N m]
VISCOUS = np.array([3.0, 3.0, 2.0, 2.0, 0.8, 0.6, 0.5])  # [N m s/rad]
NOISE = np.array([0.05, 0.05, 0.05, 0.05, 0.02, 0.02, 0.02])  # of the sensors [N m]
CENTRE = np.array([0.0, 0.2, 0.0, -1.5, 0.0, 1.6, 0.0])
REACH = np.array([1.2, 0.8, 1.2, 0.9, 1.2, 0.9, 1.2])

RATE = 1000.0
COUNTS = 2**20  # of the encoders per turn

#: Names of the columns of `write_log`.
HEADER = ",".join(["t", *(f"{x}{j}" for x in ("q_", "q_ref_", "tau_") for j in range(1, 8))])


@dataclass(frozen=True, eq=False)
class SevenAxisLog:
    """One run; signals of shape (samples, 7)."""

    urdf: str
    t: np.ndarray  # [s]
    q: np.ndarray  # encoder positions [rad]
    q_ref: np.ndarray  # [rad]
    tau_motor: np.ndarray  # on the joint side [N m]
    tau_link: np.ndarray  # of the sensors behind the gears [N m]
    motion: tuple[np.ndarray, np.ndarray, np.ndarray]  # true q, dq, ddq


def seven_axis_log(
    seed: int, *, seconds: float = 15.0, bearings: float = 0.0, offset: float = 0.1
) -> SevenAxisLog:
    """A run of the machine; ``bearings``: share of its friction that the sensors feel."""
    import pinocchio

    rng = np.random.default_rng(seed)
    bodies = _bodies(rng)
    t = np.arange(int(seconds * RATE)) / RATE
    q_ref, dq_ref = _reference(rng, t)
    q, tau = _machine(bodies, q_ref, dq_ref)
    dq = np.gradient(q, axis=0) * RATE  # MuJoCo's own speeds are those of half a step before
    ddq = np.pad(np.diff(q, 2, axis=0), ((1, 1), (0, 0)), "edge") * RATE**2
    text = _urdf(bodies)
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    felt = np.array([pinocchio.rnea(model, data, *row) for row in zip(q, dq, ddq, strict=True)])
    felt += bearings * (COULOMB * np.tanh(dq / 1e-3) + VISCOUS * dq)
    felt += offset * rng.normal(size=7) + NOISE * rng.normal(size=q.shape)
    step = 2.0 * np.pi / COUNTS
    counted = step * np.round(q / step + rng.uniform(-0.5, 0.5, q.shape))
    noisy = tau + NOISE * rng.normal(size=q.shape)
    return SevenAxisLog(text, t, counted, q_ref, noisy, felt, (q, dq, ddq))


def write_log(folder: Path, log: SevenAxisLog, tau: np.ndarray) -> Path:
    """``log.csv`` with one of the torques, and ``arm.urdf`` beside it."""
    (folder / "arm.urdf").write_text(log.urdf, encoding="utf-8")
    table = np.column_stack([log.t, log.q, log.q_ref, tau])
    path = folder / "log.csv"
    np.savetxt(path, table, fmt="%.9g", delimiter=",", header=HEADER, comments="")
    return path


@dataclass(frozen=True, eq=False)
class _Body:
    mass: float
    centre: np.ndarray
    inertia: np.ndarray  # about the centre of mass, (3, 3)


def _bodies(rng: np.random.Generator) -> list[_Body]:
    """Boxes turned a little, their centres off the axes."""
    bodies = []
    for j, mass in enumerate(MASSES * rng.uniform(0.8, 1.2, 7)):
        size = rng.uniform(0.06, 0.14, 3) * (1.3 if j < 4 else 0.7)
        turned = np.linalg.qr(np.eye(3) + 0.3 * rng.normal(size=(3, 3)))[0]
        squares = size**2
        inertia = turned @ np.diag(mass / 3.0 * (squares.sum() - squares)) @ turned.T
        bodies.append(_Body(mass, rng.uniform(-0.5, 0.5, 3) * size, inertia))
    return bodies


def _reference(rng: np.random.Generator, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sums of five sines within reach and speed limits, which begin at rest."""
    omega = 2.0 * np.pi * rng.uniform(0.08, 0.15) * np.arange(1, 6)
    size = rng.normal(size=(7, 5)) / np.arange(2, 7)
    phase = omega * t[:, None, None] + rng.uniform(0.0, 2.0 * np.pi, (7, 5))
    q, dq = (size * np.sin(phase)).sum(axis=2), (size * omega * np.cos(phase)).sum(axis=2)
    scale = np.minimum(REACH / np.ptp(q, axis=0), 0.4 * np.array(SPEEDS) / np.abs(dq).max(axis=0))
    ramp = np.minimum(t / 1.0, 1.0)[:, None]
    blend, slope = ramp**2 * (3 - 2 * ramp), 6 * ramp * (1 - ramp)
    return CENTRE + scale * q * blend, scale * (dq * blend + q * slope)


def _machine(
    bodies: list[_Body], q_ref: np.ndarray, dq_ref: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """True positions and motor torques of the controlled machine in MuJoCo."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(_mjcf(bodies))
    data = mujoco.MjData(model)
    data.qpos[:] = q_ref[0]
    kp, kd = 900.0 * (ROTORS + 0.3), 42.0 * (ROTORS + 0.3)
    q, tau = np.empty_like(q_ref), np.empty_like(q_ref)
    mujoco.mj_forward(model, data)
    for k in range(len(q_ref)):
        q[k] = data.qpos
        law = kp * (q_ref[k] - q[k]) + kd * (dq_ref[k] - data.qvel) + data.qfrc_bias
        tau[k] = data.qfrc_applied[:] = law
        mujoco.mj_step(model, data, 2)
    return q, tau


def _mjcf(bodies: list[_Body]) -> str:
    """The machine with rotors and friction."""
    opened, closed = [], []
    for j, (body, (d, r, alpha)) in enumerate(zip(bodies, GEOMETRY, strict=True)):
        y, z = -r * np.sin(alpha), r * np.cos(alpha)
        i = body.inertia
        opened.append(
            f'<body pos="{d:.12g} {y:.12g} {z:.12g}" euler="{alpha:.12g} 0 0">'
            f'<inertial mass="{body.mass:.12g}" pos="{_text(body.centre)}" fullinertia="'
            f'{_text([i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]])}"/>'
            f'<joint axis="0 0 1" armature="{ROTORS[j]}" damping="{VISCOUS[j]}" '
            f'frictionloss="{COULOMB[j]}"/>'
        )
        closed.append("</body>")
    return (
        '<mujoco><compiler angle="radian"/><option timestep="0.0005" integrator="implicitfast"/>'
        f"<worldbody>{''.join(opened)}{''.join(closed)}</worldbody></mujoco>"
    )


def _urdf(bodies: list[_Body]) -> str:
    """What a user has: links, joints, limits."""
    lines = ['<robot name="seven_axis_arm">', '<link name="base"/>']
    for j, (body, (d, r, alpha)) in enumerate(zip(bodies, GEOMETRY, strict=True)):
        i, parent = body.inertia, "base" if j == 0 else f"link_{j}"
        low, high = LIMITS[j]
        xyz = _text([d, -r * np.sin(alpha), r * np.cos(alpha)])
        lines.append(
            f'<link name="link_{j + 1}"><inertial><origin xyz="{_text(body.centre)}"/>'
            f'<mass value="{body.mass:.12g}"/><inertia ixx="{i[0, 0]:.12g}" ixy="{i[0, 1]:.12g}" '
            f'ixz="{i[0, 2]:.12g}" iyy="{i[1, 1]:.12g}" iyz="{i[1, 2]:.12g}" izz="{i[2, 2]:.12g}"/>'
            "</inertial></link>"
            f'<joint name="joint_{j + 1}" type="revolute"><parent link="{parent}"/>'
            f'<child link="link_{j + 1}"/><origin xyz="{xyz}" rpy="{alpha:.12g} 0 0"/>'
            f'<axis xyz="0 0 1"/><limit lower="{low}" upper="{high}" velocity="{SPEEDS[j]}" '
            f'effort="{EFFORTS[j]}"/></joint>'
        )
    return "\n".join([*lines, "</robot>"])


def _text(numbers) -> str:
    return " ".join(f"{x:.12g}" for x in numbers)
