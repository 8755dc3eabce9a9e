"""An arm of three joints whose gears warm up, simulated by Pinocchio: its friction is known.

Forward dynamics by the articulated body algorithm, integrated by Runge and Kutta; a PD law at 1 kHz
along Fourier series. Viscous and Coulomb friction of the first two joints fall as their temperature
rises exponentially; that of the third stays, although its temperature rises too.
"""

from functools import cache
from pathlib import Path

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.problem import Problem
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.robot.description import Robot
from pivident.robot.gallery import load_robot

RATE = 1000.0
NAMES = ("j1", "j2", "j3")
#: Viscous [N m s/rad] and Coulomb friction [N m] at 25 °C, and slope of the sign [s/rad].
VISCOUS, COULOMB, GAMMA = np.array([3.0, 2.5, 1.0]), np.array([4.0, 3.0, 1.5]), 150.0
#: Temperatures start at 25 °C and rise by so much, with a time constant of a third of the record.
START, RISE = 25.0, np.array([18.0, 12.0, 9.0])
KP, KD = np.array([4000.0, 4000.0, 1500.0]), np.array([160.0, 160.0, 40.0])
#: Standard deviations of the noise of positions [rad] and torques [N m].
ENCODER, TORQUE = 2e-5, 0.1

_LINK = """
  <link name="l{k}"><inertial><origin xyz="{c}"/><mass value="{m}"/>
    <inertia ixx="{i}" iyy="{i}" izz="{z}" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="j{k}" type="revolute"><parent link="{parent}"/><child link="l{k}"/>
    <origin xyz="{o}"/><axis xyz="{a}"/>
    <limit lower="-6" upper="6" velocity="5" effort="300"/></joint>"""

URDF = (
    '<robot name="warming arm"><link name="base"/>'
    + _LINK.format(k=1, c="0 0 0.1", m=6, i=0.08, z=0.05, parent="base", o="0 0 0.3", a="0 0 1")
    + _LINK.format(k=2, c="0.2 0 0", m=5, i=0.09, z=0.09, parent="l1", o="0 0 0.1", a="0 1 0")
    + _LINK.format(k=3, c="0.15 0 0", m=3, i=0.03, z=0.03, parent="l2", o="0.4 0 0", a="0 1 0")
    + "</robot>"
)


def temperatures(samples: int) -> np.ndarray:
    """Of the joints, shape (samples, joints) [°C]."""
    t = np.arange(samples) / samples
    return START + RISE * (1.0 - np.exp(-3.0 * t[:, None]))


def changes(fall: float) -> tuple[np.ndarray, np.ndarray]:
    """β of viscous and Coulomb friction for a fall by a share over the record, by joint, per K."""
    share = -fall * np.array([1.0, 1.0, 0.0]) / (RISE * (1.0 - np.exp(-3.0)))
    return share * VISCOUS, share * COULOMB


def truth(fall: float, samples: int, reference: float | None = None) -> dict[str, float]:
    """Friction at a temperature [°C], the mean of the record by default, by parameter."""
    mean = temperatures(samples).mean(axis=0)
    at = mean if reference is None else np.full(3, reference)
    viscous, coulomb = changes(fall)
    fv, fc = VISCOUS + viscous * (at - START), COULOMB + coulomb * (at - START)
    return {f"f{s}{j + 1}": float(x[j]) for s, x in (("v", fv), ("c", fc)) for j in range(3)}


def _reference(rng: np.random.Generator, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions and speeds of a motion, shape (samples, joints) each."""
    t = np.arange(samples)[:, None] / RATE
    q, dq = np.zeros((2, samples, 3))
    for k in range(1, 7):
        w, a, b = 2.0 * np.pi * 0.17 * k, *rng.normal(0.0, 0.45 / k, (2, 3))
        q += a * np.sin(w * t) + b * (np.cos(w * t) - 1.0)
        dq += w * (a * np.cos(w * t) - b * np.sin(w * t))
    return q, dq


@cache
def motion(seed: int, fall: float, samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, torques and references without noise, shape (samples, joints) each."""
    import pinocchio as pin

    model = pin.buildModelFromXML(URDF)
    data = model.createData()
    q_ref, dq_ref = _reference(np.random.default_rng(seed), samples)
    warm = temperatures(samples) - START
    viscous, coulomb = changes(fall)
    q, v = q_ref[0].copy(), dq_ref[0].copy()
    made = np.empty((2, samples, 3))
    h = 1.0 / RATE
    for k in range(samples):
        tau = KP * (q_ref[k] - q) + KD * (dq_ref[k] - v)
        made[:, k] = q, tau
        fv, fc = VISCOUS + viscous * warm[k], COULOMB + coulomb * warm[k]

        def slope(q, v, tau=tau, fv=fv, fc=fc):
            friction = fv * v + fc * 2.0 / np.pi * np.arctan(GAMMA * v)
            return v, pin.aba(model, data, q, v, tau - friction)

        a = slope(q, v)
        b = slope(q + 0.5 * h * a[0], v + 0.5 * h * a[1])
        c = slope(q + 0.5 * h * b[0], v + 0.5 * h * b[1])
        d = slope(q + h * c[0], v + h * c[1])
        q = q + h / 6.0 * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0])
        v = v + h / 6.0 * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1])
    return made[0], made[1], q_ref


def recording(
    seed: int, fall: float, samples: int = 12000, temperature: np.ndarray | None = None
) -> Recording:
    """The log with noise; ``temperature``: that of the record by default."""
    q, tau, q_ref = motion(seed, fall, samples)
    rng = np.random.default_rng(1000 + seed)
    return Recording(
        f"run {seed}",
        NAMES,
        q + rng.normal(0.0, ENCODER, q.shape),
        tau + rng.normal(0.0, TORQUE, q.shape),
        RATE,
        q_ref=q_ref,
        temperature=temperatures(samples) if temperature is None else temperature,
    )


@cache
def arm(folder: Path) -> Robot:
    """The arm as described, with viscous and Coulomb friction."""
    path = folder / "arm.urdf"
    path.write_text(URDF)
    return load_robot(path)


def problem(folder: Path, *recordings: Recording, looped: bool = False, **given) -> Problem:
    """The problem of some recordings; ``looped``: with the control law."""
    loop = Loop(PD(kp=KP, kd=KD)) if looped else None
    return Problem(arm(folder), recordings, loop, **given)
