"""An exported model in MuJoCo under a sampled control law, beside our own simulator.

The law is the one that `pivident.loop.simulation` compiles: it reads positions at each control
sample and its torque is held over the period, during which MuJoCo makes some steps. Dry friction is
MuJoCo's own, a constraint with a sharp sign, or the model's smooth one, put on by hand: in each
step it is linearised about the present speed v,

    F(v⁺) ≈ F(v) + F'(v) (v⁺ - v),

its slope added to the damping, which MuJoCo's implicit integrators take at the end of the step.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from pivident.foundation.errors import ExportError, SimulationDiverged
from pivident.loop.simulation.closed_loop import LoopSignals
from pivident.loop.simulation.controllers import TAPS, Controller, SampledLaw
from pivident.models.export import mjcf
from pivident.models.export.differences import RobotFile
from pivident.models.export.joint_side import joint_side
from pivident.models.export.load_back import mujoco_model
from pivident.models.runnable_model import RunnableModel
from pivident.robot.friction_term import FrictionTerm

Integrator = Literal["euler", "implicitfast", "implicit", "rk4"]


def simulate_in_mujoco(
    file: RobotFile,
    model: RunnableModel,
    controller: Controller,
    signals: LoopSignals,
    start: tuple[np.ndarray, np.ndarray] | None = None,
    *,
    steps: int = 1,
    integrator: Integrator = "implicitfast",
    friction: Literal["mujoco", "model"] = "mujoco",
) -> np.ndarray:
    """Positions of a closed loop in MuJoCo.

    Args:
        file: exported MJCF.
        model: the model that it was made from.
        controller: the sampled law.
        signals: reference, gains and bounds; drives that answer late are not simulated here.
        start: initial positions and speeds, each (joints,); default: at rest on the reference.
        steps: time steps of MuJoCo per control period.
        integrator: MuJoCo's.
        friction: dry friction by MuJoCo's constraint, or the model's by hand.

    Returns:
        q at the control samples, shape (samples, joints) [rad or m].

    Raises:
        ExportError: the file is no MJCF, or the drives answer late.
        SimulationDiverged: names the joint, the time and the distance from the reference.
    """
    import mujoco

    if file.format != "mjcf" or signals.drive_delay:
        raise ExportError("a loop in MuJoCo needs an MJCF file and drives without delay")
    loaded = mujoco_model(file)
    loaded.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    loaded.opt.timestep = 1.0 / (signals.rate * steps)
    by_hand = _SmoothFriction(model, loaded) if friction == "model" else None
    data = mujoco.MjData(loaded)
    names = model.robot.joint_names
    at = [int(loaded.joint(name).qposadr[0]) for name in names]
    motors = [int(loaded.actuator(name).id) for name in names]
    q_ref = np.asarray(signals.q_ref, dtype=float)
    data.qpos[at], data.qvel[at] = start if start is not None else (q_ref[0], 0.0)
    law = _RunningLaw(controller.law(signals.rate, q_ref, signals.dq_ref), data.qpos[at], signals)
    out = np.empty_like(q_ref)
    for k in range(len(q_ref)):
        out[k] = data.qpos[at]
        off = np.abs(out[k] - q_ref[k])
        worst = int(np.argmax(np.where(np.isfinite(off), off / signals.bound, np.inf)))
        if not off[worst] <= signals.bound[worst]:
            bound = float(signals.bound[worst])
            raise SimulationDiverged(names[worst], k / signals.rate, float(off[worst]), bound)
        data.ctrl[motors] = law.torque(k, out[k])
        for _ in range(steps):
            if by_hand is not None:
                by_hand.put_on(data)
            mujoco.mj_step(loaded, data)
    return out


class _RunningLaw:
    """A sampled law that is run sample by sample, as in ``simulation.loop_kernel``."""

    def __init__(self, law: SampledLaw, q: np.ndarray, signals: LoopSignals) -> None:
        self._law, self._signals = law, signals
        total = law.pole.sum(axis=1)
        at_rest = np.divide(q, total, out=np.zeros(len(q)), where=total != 0.0)
        self._past = np.tile(at_rest[:, None], TAPS - 1)
        self._integral = np.zeros(len(q))

    def torque(self, k: int, q: np.ndarray) -> np.ndarray:
        """Joint torque that answers the positions at sample k [N m or N]."""
        law, s = self._law, self._signals
        if s.noise is not None:
            q = q + s.noise[k]
        w = q - np.sum(law.pole[:, 1:] * self._past, axis=1)
        all_w = np.column_stack([w, self._past])
        self._past = all_w[:, :-1]
        proportional = np.sum(law.feedback * all_w, axis=1)
        integrated = np.sum(law.integrand * all_w, axis=1)
        growth = law.integral_gain / s.rate * (law.integrand_reference[k] - integrated)
        u = law.reference[k] - proportional + self._integral + growth
        if s.inputs is not None:
            u = u + s.inputs[k]
        held = np.clip(u, -s.limit, s.limit)
        self._integral = self._integral + np.where((u - held) * growth <= 0.0, growth, 0.0)
        return s.drive_gain * held


class _SmoothFriction:
    """The model's dry friction in the place of MuJoCo's, joint by joint and shaft by shaft."""

    def __init__(self, model: RunnableModel, loaded: Any) -> None:
        side = joint_side(model, mjcf.SUPPORTED)
        self._loaded = loaded
        self._at = np.array([int(loaded.joint(n).dofadr[0]) for n in model.robot.joint_names])
        self._damping = loaded.dof_damping.copy()
        self._shaft_damping = loaded.tendon_damping.copy()
        self._joints = [
            (i, side.dry_friction[i], _sharpness(model, i)) for i in range(len(self._at))
        ]
        self._shafts = [
            (k, shaft.dry_friction, _sharpness(model, shaft.motor), shaft)
            for k, shaft in enumerate(side.shafts)
            if shaft.dry_friction
        ]
        loaded.dof_frictionloss[:] = 0.0
        loaded.tendon_frictionloss[:] = 0.0

    def put_on(self, data: Any) -> None:
        """Set force and damping for the next step."""
        force = np.zeros(len(self._at))
        speed = data.qvel[self._at]
        for i, level, term in self._joints:
            rest, slope = _linearised(term, level, speed[i])
            force[i] -= rest
            self._loaded.dof_damping[self._at[i]] = self._damping[self._at[i]] + slope
        for k, level, term, shaft in self._shafts:
            v = speed[shaft.motor] + shaft.ratio * speed[shaft.joint]
            rest, slope = _linearised(term, level, v)
            force[shaft.motor] -= rest
            force[shaft.joint] -= shaft.ratio * rest
            self._loaded.tendon_damping[k] = self._shaft_damping[k] + slope
        data.qfrc_applied[self._at] = force


def _sharpness(model: RunnableModel, joint: int) -> tuple[str, float]:
    """Smoothing and γ of a joint's dry friction; the hard sign is simulated with the arctangent."""
    terms: list[FrictionTerm] = [
        t for t in model.robot.joints[joint].friction.terms if t.has_sign and not t.depends_on_load
    ]
    if not terms:
        return "atan", np.inf
    smoothing = "tanh" if terms[0].smoothing == "tanh" else "atan"
    return smoothing, terms[0].encoded(simulated=True)[2][0]


def _linearised(term: tuple[str, float], level: float, v: float) -> tuple[float, float]:
    """Force F(v) - F'(v) v and slope F'(v) of level · s(v)."""
    smoothing, gamma = term
    if level == 0.0 or not np.isfinite(gamma):
        return 0.0, 0.0
    x = gamma * v
    if smoothing == "atan":
        s, slope = 2.0 / np.pi * np.arctan(x), 2.0 / np.pi * gamma / (1.0 + x * x)
    else:
        s = np.tanh(x)
        slope = gamma * (1.0 - s * s)
    return level * (s - slope * v), level * slope
