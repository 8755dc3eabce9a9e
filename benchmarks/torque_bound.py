"""Cramér-Rao bounds of the simulated TX40, by Pinocchio and the known spectra of the noise.

Torque with sensor noise (*fine*, *coarse*): the equations τ_j = φ_j θ + ε_j on the true motion. The
noise is that of the sensor, and encoder noise that the law C = kp + kd (1 - z⁻¹) rate has answered
to. No unbiased estimator from these equations has a smaller covariance than

    P = (Σ_j Σ_ω φ_j(ω)ᴴ φ_j(ω)/S_j(ω))⁻¹,    S_j = σ_v² + |C_j|² (σ_n² + σ_c² |1/D|²/Σ|1/D|²)

Applied torque in the log (*loop*, *coloured*): only the positions are noisy, and what they tell is
how far the arm moves for the same torque, from an unknown start,

    P = (Σ_t s_tᵀ s_t/σ²)⁻¹,    M s̈ + (∂τ/∂q̇) ṡ + (∂τ/∂q) s = -φ,    s = ∂q/∂θ

with σ² the noise's level at low frequencies. An estimator reaches that only if it believes the
model over seconds without a doubt.

Columns are Pinocchio's joint torque regressor on a model built from the robot's table, friction is
written out, derivatives are differences of the two; only the noise-free motion comes from
pivident's simulator. Rounding of the recorded positions is in no bound.
"""

from __future__ import annotations

import tomllib
from importlib.resources import files

import numpy as np
import pinocchio as pin

from pivident.experiment import simulated_tx40 as scenarios
from pivident.loop.simulation.simulated_record import Noise

#: Every which sample of the motion the sensitivities are computed at.
STEP = 5

#: q dq ddq, each of shape (samples, joints).
Motion = tuple[np.ndarray, np.ndarray, np.ndarray]

#: Pinocchio's order of the ten parameters of a link.
ORDER = ("m", "mx", "my", "mz", "xx", "xy", "yy", "xz", "yz", "zz")


def table() -> dict:
    """The robot's own file."""
    source = files("pivident.robot") / "gallery" / "staubli_tx40.toml"
    return tomllib.loads(source.read_text(encoding="utf-8"))


def model_of(joints: list[dict]) -> pin.Model:
    """The chain of a modified DH table in degrees: Rx(α) Tx(d) Rz(θ) Tz(r), joints about z."""
    model, parent = pin.Model(), 0
    for joint in joints:
        alpha, theta = (np.deg2rad(joint.get(key, 0.0)) for key in ("alpha", "theta"))
        turn = pin.SE3(pin.utils.rotate("x", alpha), np.array([joint.get("d", 0.0), 0.0, 0.0]))
        lift = pin.SE3(pin.utils.rotate("z", theta), np.array([0.0, 0.0, joint.get("r", 0.0)]))
        parent = model.addJoint(parent, pin.JointModelRZ(), turn * lift, joint["name"])
    return model


def columns(names: tuple[str, ...], q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """φ of the named parameters, shape (samples, joints, parameters)."""
    content = table()
    model = model_of(content["joints"])
    data = model.createData()
    states = zip(q, dq, ddq, strict=True)
    rigid = np.array([pin.computeJointTorqueRegressor(model, data, *s).copy() for s in states])
    gamma = content["friction"][1]["gamma"]
    out = np.zeros((len(q), q.shape[1], len(names)))
    for k, name in enumerate(names):
        stem, j = name[:-1], int(name[-1]) - 1
        if stem in ORDER:
            out[:, :, k] = rigid[:, :, 10 * j + ORDER.index(stem)]
        elif stem == "ia":
            out[:, j, k] = ddq[:, j]
        elif stem == "fvm":  # what both wrist joints have of it alone belongs to their own fv
            out[:, [4, 5], k] = dq[:, [5, 4]]
        else:  # the motor of axis 6 rubs with the speeds of both wrist joints
            speed = dq[:, 5] + dq[:, 4] if stem == "fcm" else dq[:, j]
            friction = speed if stem == "fv" else np.arctan(gamma * speed) * 2.0 / np.pi
            out[:, [4, 5] if stem == "fcm" else [j], k] = friction[:, None]
    return out


def spectrum(noise: Noise, kp: np.ndarray, kd: np.ndarray, samples: int) -> np.ndarray:
    """S, two-sided per sample [(N m)²], shape (frequencies, joints)."""
    back = np.exp(-2j * np.pi * np.fft.rfftfreq(samples))[:, None]
    law = np.abs(kp + kd * scenarios.RATE * (1.0 - back)) ** 2
    shape = 1.0 / np.abs(np.polyval(noise.denominator[::-1], back)) ** 2
    return noise.torque**2 + law * (noise.encoder**2 + noise.coloured**2 * shape / noise.gain**2)


def bound(scenario: str, samples: int = 34500) -> tuple[tuple[str, ...], np.ndarray]:
    """Names of the parameters, and their smallest standard errors, shape (parameters,)."""
    problem, truth = scenarios.tx40_scenario(scenario, 0, samples)
    made = scenarios.simulate_tx40(Noise(encoder=0.0, torque=0.0), 0, samples)
    motion = made.q, made.dq, made.ddq
    names, noise = tuple(p.name for p in problem.regressor.parameters), scenarios.NOISES[scenario]
    if noise.torque:
        law = problem.loop.controller
        found = torque_information(names, motion, noise, np.asarray(law.kp), np.asarray(law.kd))
    else:
        found = motion_information(names, np.array([truth[n] for n in names]), motion, noise)
    scale = np.sqrt(np.diag(found))
    errors = np.sqrt(np.diag(np.linalg.inv(found / np.outer(scale, scale)))) / scale
    return names, errors[: len(names)]


def torque_information(
    names: tuple[str, ...], motion: Motion, noise: Noise, kp: np.ndarray, kd: np.ndarray
) -> np.ndarray:
    """Information of the torque equations behind the filter that whitens their noise."""
    phi = np.fft.rfft(columns(names, *motion), axis=0)
    samples = len(motion[0])
    twice = np.full(len(phi), 2.0 / samples)  # negative frequencies
    twice[0] = 1.0 / samples
    weight = twice[:, None] / spectrum(noise, kp, kd, samples)
    return np.einsum("fjk,fj,fjl->kl", phi.conj(), weight, phi, optimize=True).real


def motion_information(
    names: tuple[str, ...], theta: np.ndarray, motion: Motion, noise: Noise
) -> np.ndarray:
    """Information of the positions, of the parameters and then of 12 values of the start."""
    motion = tuple(x[::STEP] for x in motion)
    h, n, p = STEP / scenarios.RATE, motion[0].shape[1], len(names)

    def slope(which: int, step: float) -> np.ndarray:
        """∂τ/∂q, ∂τ/∂q̇ or ∂τ/∂q̈, shape (samples, joints, joints)."""
        out = np.zeros((len(motion[0]), n, n))
        for i in range(n):
            aside = step * (np.arange(n) == i)
            above, below = (
                columns(names, *(x + sign * aside * (k == which) for k, x in enumerate(motion)))
                for sign in (1.0, -1.0)
            )
            out[:, :, i] = (above - below) @ theta / (2.0 * step)
        return out

    stiffness, damping, mass = slope(0, 1e-5), slope(1, 1e-6), slope(2, 1.0)
    phi, start = columns(names, *motion), np.zeros((n, n))
    s = np.hstack([np.zeros((n, p)), np.eye(n), start])
    speed = np.hstack([np.zeros((n, p)), start, np.eye(n)])
    total = np.zeros((p + 2 * n,) * 2)
    for m, d, k, f in zip(mass, damping, stiffness, phi, strict=True):
        total += s.T @ s
        force = np.hstack([f, np.zeros((n, 2 * n))]) + k @ s
        speed = np.linalg.solve(m + h * d + h * h * k, m @ speed - h * force)  # implicit Euler
        s = s + h * speed
    peak = 1.0 / np.sum(noise.denominator) ** 2 / noise.gain**2
    return total * STEP / (noise.encoder**2 + noise.coloured**2 * peak)
