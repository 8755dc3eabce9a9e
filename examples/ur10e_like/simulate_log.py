"""A six-axis arm of the size of a UR10e: writes its URDF and a log as an RTDE recorder writes it.

    python examples/ur10e_like/simulate_log.py FOLDER
    cd FOLDER
    pivident init rtde_log.csv --robot ur10e_like.urdf
    pivident identify experiment.toml

The machine is simulated with Pinocchio (``pip install pin``) and a loop of its own, nothing of
pivident: PID in joint space at 500 Hz with gravity compensation, Coulomb and viscous friction,
rotor inertias, encoder counts, and noise on the measured currents. The URDF is what a user has:
its masses and centres of mass differ from the machine's by several per cent, and it knows neither
friction nor rotors. The log has currents, no torques; nobody says what an ampere is worth.
``truth.json`` has what an identification should find.
"""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path

import numpy as np

NAMES = (
    "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint",
    "wrist_1_joint", "wrist_2_joint", "wrist_3_joint",
)  # fmt: skip

#: Origin (xyz, rpy) of each joint in the link before it, and the joint's axis is z.
ORIGINS = (
    ((0.0, 0.0, 0.181), (0.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (np.pi / 2, 0.0, 0.0)),
    ((-0.613, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ((-0.572, 0.0, 0.174), (0.0, 0.0, 0.0)),
    ((0.0, -0.12, 0.0), (np.pi / 2, 0.0, 0.0)),
    ((0.0, 0.117, 0.0), (-np.pi / 2, 0.0, 0.0)),
)

#: Nominal bodies: mass [kg], centre of mass [m], moments of inertia about it [kg m²].
BODIES = (
    (7.4, (0.02, 0.0, 0.03), (0.034, 0.035, 0.022)),
    (13.0, (-0.23, 0.0, 0.16), (0.042, 0.62, 0.62)),
    (4.0, (-0.31, 0.0, 0.06), (0.010, 0.15, 0.15)),
    (2.1, (0.0, -0.02, 0.01), (0.0031, 0.0026, 0.0024)),
    (2.0, (0.0, 0.02, 0.01), (0.0027, 0.0022, 0.0023)),
    (0.6, (0.0, 0.0, -0.03), (0.0009, 0.0009, 0.0005)),
)

SPEED = np.array([2.1, 2.1, 3.1, 3.1, 3.1, 3.1])  # rated speeds [rad/s]
EFFORT = np.array([330.0, 330.0, 150.0, 56.0, 56.0, 56.0])  # torque limits [N m]

#: The machine: joint torque per ampere [N m/A], friction [N m, N m s/rad], rotors [kg m²].
GAIN = np.array([14.3, 14.1, 11.2, 9.4, 9.1, 9.2])
COULOMB = np.array([9.0, 11.0, 6.0, 1.9, 1.7, 1.5])
VISCOUS = np.array([13.0, 15.0, 9.0, 2.4, 2.2, 1.9])
ROTOR = np.array([3.1, 3.1, 1.4, 0.35, 0.35, 0.35])

#: Rate of controller and log [Hz], steps of the simulation per period, encoder counts per turn.
RATE, SUBSTEPS, COUNTS = 500.0, 2, 2**20

#: Bandwidth [Hz] and damping of the position loops, noise of the measured currents [A].
BANDWIDTH, DAMPING, NOISE = 6.0, 0.9, 0.05

HEADER = ("timestamp", *(
    f"{signal}_{k}"
    for signal in ("target_q", "target_qd", "actual_q", "actual_qd", "actual_current")
    for k in range(6)
), "joint_temperatures_0", "robot_mode")  # fmt: skip


def urdf(bodies=BODIES) -> str:
    """The arm as URDF."""
    lines = ['<robot name="ur10e_like">', '<link name="base_link"/>']
    parent = "base_link"
    for name, (xyz, rpy), (mass, center, inertia), speed, effort in zip(
        NAMES, ORIGINS, bodies, SPEED, EFFORT, strict=True
    ):
        link = name.replace("_joint", "_link")
        x, y, z = inertia
        lines += [
            f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{link}"/>',
            f'<origin xyz="{" ".join(map(str, xyz))}" rpy="{" ".join(map(str, rpy))}"/>',
            f'<axis xyz="0 0 1"/><limit lower="{-2 * np.pi}" upper="{2 * np.pi}" '
            f'velocity="{speed}" effort="{effort}"/></joint>',
            f'<link name="{link}"><inertial><mass value="{mass}"/>',
            f'<origin xyz="{" ".join(map(str, center))}" rpy="0 0 0"/>',
            f'<inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="0" ixz="0" iyz="0"/></inertial></link>',
        ]
        parent = link
    return "\n".join([*lines, "</robot>\n"])


def machine_bodies(rng: np.random.Generator) -> tuple:
    """The bodies that the machine really has: some per cent beside those of the URDF."""
    made = []
    for mass, center, inertia in BODIES:
        factor = 1.0 + rng.uniform(-0.08, 0.08)
        shifted = tuple(c + rng.uniform(-0.008, 0.008) for c in center)
        made.append((mass * factor, shifted, tuple(i * factor for i in inertia)))
    return tuple(made)


def reference(rng: np.random.Generator, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Moves with smooth acceleration between postures, standstill at both ends."""
    t = np.arange(int(seconds * RATE)) / RATE
    q, dq = np.zeros((len(t), 6)), np.zeros((len(t), 6))
    home = np.array([0.0, -1.4, 1.2, -1.2, -1.5, 0.3])
    q[:] = home
    begin, posture = 2.0, home
    while True:
        target = home + rng.uniform(-1.0, 1.0, 6) * np.array([1.8, 0.9, 1.2, 1.5, 1.5, 2.0])
        speed = SPEED * rng.uniform(0.3, 0.8)
        duration = max(float(np.max(1.9 * np.abs(target - posture) / speed)), 0.5)
        end = begin + duration
        if end > seconds - 2.0:
            return q, dq
        now = (t >= begin) & (t < end)
        s = (t[now] - begin) / duration
        shape, slope = 10 * s**3 - 15 * s**4 + 6 * s**5, 30 * s**2 - 60 * s**3 + 30 * s**4
        q[now] = posture + np.outer(shape, target - posture)
        dq[now] = np.outer(slope, target - posture) / duration
        q[t >= end] = target
        begin, posture = end + rng.uniform(0.0, 0.3), target


def simulate(seconds: float, seed: int) -> tuple[np.ndarray, dict]:
    """Rows of the log, and the truth."""
    import pinocchio as pin

    rng = np.random.default_rng(seed)
    bodies = machine_bodies(rng)
    real = pin.buildModelFromXML(urdf(bodies))
    nominal = pin.buildModelFromXML(urdf())
    real.armature = ROTOR
    data, planned = real.createData(), nominal.createData()
    q_ref, dq_ref = reference(rng, seconds)
    inertia = np.diag(pin.crba(nominal, planned, q_ref[0])) + ROTOR
    kp = inertia * (2 * np.pi * BANDWIDTH) ** 2
    kd = 2 * DAMPING * inertia * 2 * np.pi * BANDWIDTH
    ki = 0.5 * kp
    q, dq, integral = q_ref[0].copy(), np.zeros(6), np.zeros(6)
    grid, h = 2 * np.pi / COUNTS, 1.0 / (RATE * SUBSTEPS)
    last = np.round(q / grid) * grid
    rows = []
    for k in range(len(q_ref)):
        measured = np.round(q / grid) * grid
        speed = (measured - last) * RATE
        last = measured
        error = q_ref[k] - measured
        integral += error / RATE
        gravity = pin.computeGeneralizedGravity(nominal, planned, measured)
        torque = kp * error + kd * (dq_ref[k] - speed) + ki * integral + gravity
        current = torque / GAIN
        logged = current + NOISE * rng.standard_normal(6)
        stamp = 1.7e5 + k / RATE + 2e-5 * rng.standard_normal()
        rows.append((stamp, *q_ref[k], *dq_ref[k], *measured, *speed, *logged, 31.5, 7))
        for _ in range(SUBSTEPS):
            friction = COULOMB * np.tanh(dq / 1e-3) + VISCOUS * dq
            acceleration = pin.aba(real, data, q, dq, torque - friction)
            # Friction that is steep at standstill: the step that stops is taken implicitly.
            stiff = 1.0 + h * (COULOMB / 1e-3 / np.cosh(np.clip(dq / 1e-3, -50, 50)) ** 2) / inertia
            dq = dq + h * acceleration / stiff
            q = q + h * dq
    truth = {
        "mass": {n: b[0] for n, b in zip(NAMES, bodies, strict=True)},
        "center_of_mass": {n: list(b[1]) for n, b in zip(NAMES, bodies, strict=True)},
        "coulomb": dict(zip(NAMES, COULOMB.tolist(), strict=True)),
        "viscous": dict(zip(NAMES, VISCOUS.tolist(), strict=True)),
        "rotor_inertia": dict(zip(NAMES, ROTOR.tolist(), strict=True)),
        "newton_metre_per_ampere": dict(zip(NAMES, GAIN.tolist(), strict=True)),
    }
    return np.array(rows), truth


def write(folder: Path, seconds: float = 60.0, seed: int = 3) -> None:
    """Write ``ur10e_like.urdf``, ``rtde_log.csv`` and ``truth.json``."""
    rows, truth = simulate(seconds, seed)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "ur10e_like.urdf").write_text(urdf(), encoding="utf-8")
    (folder / "truth.json").write_text(json.dumps(truth, indent=1), encoding="utf-8")
    with (folder / "rtde_log.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(HEADER)
        writer.writerows([f"{x:.9g}" if k else f"{x:.6f}" for k, x in enumerate(r)] for r in rows)


if __name__ == "__main__":
    write(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
