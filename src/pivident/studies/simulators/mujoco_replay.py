"""A recorded motion simulated by MuJoCo: the loop of the record around a robot file.

The sampled law of ``simulation.controllers`` is computed here a second time, step by step in
NumPy, so that a replay shares nothing with the fit but the file, the gains and the delay.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add, mul
from typing import Any

import numpy as np

from pivident.foundation.errors import ExperimentError
from pivident.loop.simulation.closed_loop import LoopSignals
from pivident.loop.simulation.controllers import TAPS, Controller, PythonController
from pivident.loop.simulation.gravity_compensation import GravityCompensated
from pivident.robot.frames import rotation_about
from pivident.robot.mjcf_model import compiled, mujoco_library

#: Longest step of a fine replay [s].
FINE_STEP = 1e-4

#: MuJoCo's largest impedance, of dry friction that hardly gives.
HARD_IMPEDANCE = (0.9999, 0.9999, 0.001, 0.5, 2.0)


@dataclass(frozen=True, eq=False)
class Replay:
    """What is simulated beside a recording.

    Attributes:
        controller: the law.
        signals: what drives it, at the control rate.
        q: measured positions, shape (samples, joints) [rad or m].
        step: control samples from one measured sample to the next.
        speed: with which it begins [rad/s or m/s], shape (joints,) or one for all.
    """

    controller: Controller
    signals: LoopSignals
    q: np.ndarray
    step: int
    speed: np.ndarray | float = 0.0


def held_spec(spec: Any, joint_names: Sequence[str], frozen: Mapping[str, float]) -> Any:
    """A copy without what does not belong to the tree: other joints held, no actuators, contacts.

    Args:
        spec: a ``mujoco.MjSpec``.
        joint_names: joints that move.
        frozen: position of the others [rad or m]; zero where there is none.
    """
    mujoco, held = mujoco_library(), spec.copy()
    model = compiled(held)
    for kind in (held.actuators, held.sensors, held.keys):
        for element in list(kind):
            held.delete(element)
    for joint in list(held.joints):
        alone = len(joint.parent.joints) == 1
        name = joint.name or (joint.parent.name if alone else "")
        if name in joint_names:
            continue
        if joint.type in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
            _place(joint, model, frozen.get(name, 0.0))
        held.delete(joint)
    held.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    return held


def _place(joint: Any, model: Any, position: float) -> None:
    """Move a body to where its joint is held."""
    mujoco, body = mujoco_library(), joint.parent
    way = position - float(joint.ref)
    at, elements = np.array(model.body_pos[body.id]), np.zeros(9)
    mujoco.mju_quat2Mat(elements, np.array(model.body_quat[body.id]))
    turn, axis = elements.reshape(3, 3), np.array(joint.axis) / np.linalg.norm(joint.axis)
    if joint.type == mujoco.mjtJoint.mjJNT_SLIDE:
        body.pos = at + turn @ (way * axis)
        return
    own, anchor = rotation_about(axis, way), np.array(joint.pos)
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, (turn @ own).ravel())
    body.pos = at + turn @ (anchor - own @ anchor)
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    body.quat = quaternion


def fine_settings(spec: Any, period: float) -> Any:
    """A copy that steps by Runge–Kutta, and whose dry friction stops a joint within a step."""
    mujoco, fine = mujoco_library(), spec.copy()
    step = period / np.ceil(period / FINE_STEP - 1e-9)
    fine.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    fine.option.timestep = step
    for joint in fine.joints:
        set_hard_friction(joint, step)
    return fine


def set_hard_friction(joint: Any, step: float) -> None:
    """Dry friction of a ``mujoco.MjsJoint`` that stops it within a step of so many seconds."""
    joint.solref_friction[:2] = (-1.0, -1.0 / step)
    joint.solimp_friction[:5] = HARD_IMPEDANCE


def replay(
    spec: Any, joint_names: Sequence[str], run: Replay, delay: float, bias: np.ndarray
) -> np.ndarray:
    """Positions that the encoders would show, at the measured samples, shape of ``run.q``.

    Args:
        spec: of the robot, see `held_spec`.
        joint_names: order of the joints.
        run: the recording and its loop.
        delay: time from a control sample until its torque acts [s].
        bias: measured less true position, shape (joints,) [rad or m].

    Raises:
        ExperimentError: a law that is no sampled law of single joints.
    """
    mujoco, signals = mujoco_library(), run.signals
    model = compiled(spec)
    period = 1.0 / float(signals.rate)
    steps = int(np.ceil(period / model.opt.timestep - 1e-9))
    model.opt.timestep = period / steps
    data = mujoco.MjData(model)
    at_q = [int(model.joint(name).qposadr[0]) for name in joint_names]
    at_v = [int(model.joint(name).dofadr[0]) for name in joint_names]
    data.qpos[at_q], data.qvel[at_v] = run.q[0] - bias, run.speed
    law = _Law(run.controller, signals, run.q[0], np.broadcast_to(run.speed, len(at_q)))
    whole, part = divmod(delay / model.opt.timestep, 1.0)
    periods, late = divmod(int(whole), steps)
    torques: list[np.ndarray] = []
    kinds = mujoco.mjtWarning
    unstable = [
        data.warning[int(kind)]
        for kind in (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC)
    ]
    q = np.full_like(run.q, np.nan)
    for k in range(min(len(signals.q_ref), (len(q) - 1) * run.step + 1)):
        read = data.qpos[at_q] + bias
        if k % run.step == 0:
            q[k // run.step] = read
        torques = [*torques[-periods - 1 :], law.torque(k, read)]
        new, old = (torques[max(len(torques) - 1 - periods - m, 0)] for m in (0, 1))
        for torque, count in (
            (old, late),
            (part * old + (1.0 - part) * new, 1),
            (new, steps - late - 1),
        ):
            if count:
                data.qfrc_applied[at_v] = torque
                mujoco.mj_step(model, data, count)
        if any(warning.number for warning in unstable):
            break  # MuJoCo has started anew
    return q


class _Law:
    """A sampled law, sample by sample; see ``simulation.controllers``."""

    def __init__(
        self, controller: Controller, signals: LoopSignals, start: np.ndarray, speed: np.ndarray
    ) -> None:
        if isinstance(controller, (PythonController, GravityCompensated)):
            raise ExperimentError(
                f"a replay in MuJoCo needs a law of single joints, not {type(controller).__name__}"
            )
        self.law = controller.law(float(signals.rate), signals.q_ref, signals.dq_ref)
        self.signals, n = signals, len(start)
        total = self.law.pole.sum(axis=1)
        before = start[:, None] - speed[:, None] * (np.arange(1, TAPS + 1) / float(signals.rate))
        total = np.where(total != 0.0, total, np.inf)[:, None]
        self.past = list((before / total).T.copy())  # w_{k-1}, w_{k-2}, …
        self.pole, self.integrand, self.feedback = (
            list(own.T.copy()) for own in (self.law.pole, self.law.integrand, self.law.feedback)
        )
        self.integral = np.zeros(n)
        self.inputs = np.broadcast_to(
            np.zeros((1, n)) if signals.inputs is None else signals.inputs, signals.q_ref.shape
        )

    def torque(self, k: int, read: np.ndarray) -> np.ndarray:
        """Joint torques that answer to what the encoders show.

        Tap by tap: NumPy takes longer to begin a sum than to add the numbers of a few joints.
        """
        law, signals = self.law, self.signals
        w = read - reduce(add, map(mul, self.pole[1:], self.past))
        self.past = [w, *self.past[: TAPS - 1]]
        error = law.integrand_reference[k] - reduce(add, map(mul, self.integrand, self.past))
        growth = law.integral_gain * error / float(signals.rate)
        wanted = law.reference[k] - reduce(add, map(mul, self.feedback, self.past))
        u = wanted + self.integral + growth + self.inputs[k]
        command = np.minimum(np.maximum(u, -signals.limit), signals.limit)
        self.integral = np.where(command == u, self.integral + growth, self.integral)
        return signals.drive_gain * command
