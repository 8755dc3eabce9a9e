"""The control law that the actuators of an MJCF file are.

MuJoCo compiles every actuator to a gain and a bias. One of gear r on a joint, with u its control,
is the torque r (g u + b_0 + b_1 r q + b_2 r dq), which for b_1 < 0 is a position loop

    kp (q_ref - q) - kd dq,     kp = -b_1 r²,  kd = -b_2 r²,  q_ref = -(g u + b_0)/(b_1 r)

that damps the speed itself. A velocity actuator (b_1 = 0) beside it adds kv (dq_ref - dq), kv =
-b_2 r². Classes, shortcuts such as ``position`` and damping ratios are resolved by MuJoCo.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pivident.foundation.text.display import Displayed
from pivident.robot.mjcf_model import (
    actuator_name,
    compiled,
    joint_names,
    moves_a_joint,
    mujoco_library,
    read_spec,
)
from pivident.robot.naming import errors_name


@dataclass(frozen=True)
class ActuatorLaw(Displayed):
    """The law of the actuators of some joints.

    Attributes:
        kp: position gain of each joint [N m/rad or N/m], shape (joints,); likewise:
        kd: speed gain [N m s/rad or N s/m].
        servo: part of ``kd`` of velocity actuators, which acts on dq_ref - dq, shape (joints,).
        limit: largest torque, infinite where there is none, shape (joints,) [N m or N].
        reach: lowest and highest position that can be commanded, shape (joints, 2) [rad or m].
        step: time step of the file [s].
        reasons: why the actuators are no such law, as sentences; none where they are.
        notes: what else a reader has to know, as sentences.
    """

    kp: np.ndarray
    kd: np.ndarray
    servo: np.ndarray
    limit: np.ndarray
    reach: np.ndarray
    step: float
    reasons: tuple[str, ...]
    notes: tuple[str, ...]

    def speed_feed_forward(self, with_speeds: bool) -> float | None:
        """Share of dq_ref that ``kd`` counts; None where the joints differ.

        Args:
            with_speeds: whether the log has reference speeds, the controls of velocity actuators;
                otherwise these are taken for zero, so that they damp.
        """
        damped = self.kd > 0.0
        if not with_speeds or not damped.any():
            return 0.0
        shares = self.servo[damped] / self.kd[damped]
        return float(shares[0]) if np.allclose(shares, shares[0]) else None


def actuator_law(path: str | Path, joints: Sequence[str]) -> ActuatorLaw:
    """The law of the actuators of some joints.

    Args:
        path: the MJCF file.
        joints: names of the joints.

    Returns:
        Gains and limits, zero and infinite for joints that have a reason against the law.

    Raises:
        MissingExtra: MuJoCo is not installed.
        RobotDescriptionError: the file cannot be read.
    """
    with errors_name(str(path)):
        model = compiled(read_spec(path))
        names = joint_names(model)
    n, notes, reasons = len(joints), [], []
    gains, limit, reach = np.zeros((3, n)), np.full(n, np.inf), np.tile([-np.inf, np.inf], (n, 1))
    of_joint: dict[str, list[int]] = {name: [] for name in names}
    for k in range(len(model.actuator_trntype)):
        if moves_a_joint(model, k):
            of_joint[names[int(model.actuator_trnid[k, 0])]].append(k)
            continue
        kind = mujoco_library().mjtTrn(int(model.actuator_trntype[k])).name[len("mjTRN_") :]
        notes.append(f"{actuator_name(model, k)} acts on a {kind.lower()} and is in no law")
    for j, name in enumerate(joints):
        own = of_joint.get(name, [])
        faults = [f"{fault} (joint {name!r})" for k in own if (fault := _fault(model, k))]
        positions = [k for k in own if model.actuator_biasprm[k, 1] < 0.0]
        if not faults and len(positions) != 1:
            listed = " and ".join(actuator_name(model, k) for k in positions or own)
            followed = "two commands" if positions else "a speed and no position"
            faults = [f"joint {name!r} follows {followed}, of {listed}"]
            faults = faults if own else [f"no actuator moves joint {name!r}"]
        if faults:
            reasons += faults
            continue
        for k in own:
            r, (b1, b2) = float(model.actuator_gear[k, 0]), -model.actuator_biasprm[k, 1:3]
            gains[:, j] += np.array([b1, b2, 0.0 if b1 else b2]) * r * r
            notes += [f"{note} (joint {name!r})" for note in _notes(model, k, len(own) > 1)]
            if model.actuator_forcelimited[k]:
                limit[j] = min(limit[j], abs(r) * np.abs(model.actuator_forcerange[k]).max())
        k, at = positions[0], names.index(name)
        if model.jnt_actfrclimited[at]:
            limit[j] = min(limit[j], np.abs(model.jnt_actfrcrange[at]).max())
        if model.actuator_ctrllimited[k]:
            scale, shift = _reference(model, k)
            reach[j] = np.sort(scale * model.actuator_ctrlrange[k] + shift)
    step = float(model.opt.timestep)
    kp, kd, servo = gains
    return ActuatorLaw(kp, kd, servo, limit, reach, step, tuple(reasons), tuple(notes))


def _fault(model: Any, k: int) -> str:
    """Why an actuator is no gain on its control beside gains on position and speed, or nothing."""
    mujoco, name = mujoco_library(), actuator_name(model, k)
    for key, kinds, fine in (
        ("dyntype", mujoco.mjtDyn, ("mjDYN_NONE",)),
        ("gaintype", mujoco.mjtGain, ("mjGAIN_FIXED",)),
        ("biastype", mujoco.mjtBias, ("mjBIAS_NONE", "mjBIAS_AFFINE")),
    ):
        kind = kinds(int(getattr(model, f"actuator_{key}")[k])).name
        if kind not in fine:
            return f"{name} has {key}={kind.partition('_')[2].lower()}, and no fixed gains"
    r, g = float(model.actuator_gear[k, 0]), float(model.actuator_gainprm[k, 0])
    bias = model.actuator_biasprm[k, 1:3]
    if not bias.any():
        return f"{name} is a motor: its control is {r * g:g} N m (N) per unit and no position"
    return f"{name} pushes away from its command" if (bias > 0.0).any() or not r * g else ""


def _reference(model: Any, k: int) -> tuple[float, float]:
    """Position that a position actuator holds: scale of its control, and what is added."""
    r, b = float(model.actuator_gear[k, 0]), model.actuator_biasprm[k]
    return -float(model.actuator_gainprm[k, 0] / (b[1] * r)), -float(b[0] / (b[1] * r))


def _notes(model: Any, k: int, beside: bool) -> Iterator[str]:
    """What the law of one actuator leaves out."""
    name = actuator_name(model, k)
    if beside:
        yield f"{name} is one of several, whose gains on speed add up"
    if model.actuator_biasprm[k, 1]:
        scale, shift = _reference(model, k)
        if abs(scale - 1.0) > 1e-6 or abs(shift) > 1e-9:
            yield f"{name} holds {scale:g} times its control" + (f" {shift:+g}" if shift else "")
    low, high = (float(x) for x in model.actuator_forcerange[k])
    if model.actuator_forcelimited[k] and abs(low + high) > 1e-9 * (high - low):
        yield f"{name} has forcerange {low:g} to {high:g}, and a law one limit on both sides"
    if getattr(model, "actuator_delay", np.zeros(k + 1))[k]:
        late = 1e3 * float(model.actuator_delay[k])
        yield f"{name} is {late:g} ms late, which the delay of a fit contains"
