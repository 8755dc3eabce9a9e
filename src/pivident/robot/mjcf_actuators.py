"""The control law that the actuators of an MJCF file are.

MuJoCo compiles every actuator to a gain and a bias. One of gear r on a joint, with u its control,
is the torque r (g u + b_0 + b_1 r q + b_2 r dq), which for b_1 < 0 is a position loop

    kp (q_ref - q) - kd dq,     kp = -b_1 r²,  kd = -b_2 r²,  q_ref = -(g u + b_0)/(b_1 r)

that damps the speed itself. A velocity actuator (b_1 = 0) beside it adds kv (dq_ref - dq), kv =
-b_2 r². Classes, shortcuts such as ``position`` and damping ratios are resolved by MuJoCo.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

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
class ActuatorLaw:
    """The law of the actuators of some joints.

    Attributes:
        kp: position gain of each joint [N m/rad or N/m], shape (joints,); likewise:
        kd: speed gain [N m s/rad or N s/m].
        servo: part of ``kd`` that belongs to velocity actuators, and so acts on dq_ref - dq.
        limit: largest torque, infinite where there is none [N m or N].
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


@dataclass
class _OfJoint:
    """What the actuators of one joint add up to."""

    kp: float = 0.0
    kd: float = 0.0
    servo: float = 0.0
    limit: float = np.inf
    reach: tuple[float, float] = (-np.inf, np.inf)
    positions: list[str] = field(default_factory=list)
    velocities: list[str] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def actuator_law(path: str | Path, joints: Sequence[str]) -> ActuatorLaw:
    """The law of the actuators of some joints.

    Args:
        path: the MJCF file.
        joints: names of the joints.

    Returns:
        Gains and limits of the law, zero and infinite where `ActuatorLaw.reasons` has a joint.

    Raises:
        MissingExtra: MuJoCo is not installed.
        RobotDescriptionError: the file cannot be read.
    """
    with errors_name(str(path)):
        model = compiled(read_spec(path))
        names = joint_names(model)
    of_joints = {name: _OfJoint() for name in joints}
    elsewhere = []
    for k in range(len(model.actuator_trntype)):
        if not moves_a_joint(model, k):
            kind = mujoco_library().mjtTrn(int(model.actuator_trntype[k])).name
            kind = kind.removeprefix("mjTRN_").lower()
            elsewhere.append(f"{actuator_name(model, k)} acts on a {kind}")
            continue
        target = of_joints.get(names[int(model.actuator_trnid[k, 0])])
        if target is not None:
            _add(target, model, k, names[int(model.actuator_trnid[k, 0])])
    for name, own in of_joints.items():
        if name in names and model.jnt_actfrclimited[names.index(name)]:
            allowed = model.jnt_actfrcrange[names.index(name)]
            own.limit = min(own.limit, float(np.abs(allowed).max()))
        _judge(own, name)
    rows = list(of_joints.values())
    notes = [note for own in rows for note in own.notes]
    if elsewhere:
        notes.append(f"{'; '.join(elsewhere)}: not on one joint, and in no law of the joints")
    return ActuatorLaw(
        *(np.array([getattr(own, key) for own in rows]) for key in ("kp", "kd", "servo", "limit")),
        np.array([own.reach for own in rows]).reshape(-1, 2),
        float(model.opt.timestep),
        tuple(reason for own in rows for reason in own.reasons),
        tuple(notes),
    )


def _add(own: _OfJoint, model: Any, k: int, joint: str) -> None:
    """Add an actuator to what moves its joint."""
    mujoco, name = mujoco_library(), f"{actuator_name(model, k)} of joint {joint!r}"
    dynamics = mujoco.mjtDyn(int(model.actuator_dyntype[k]))
    gain = mujoco.mjtGain(int(model.actuator_gaintype[k]))
    bias = mujoco.mjtBias(int(model.actuator_biastype[k]))
    kinds = (mujoco.mjtBias.mjBIAS_NONE, mujoco.mjtBias.mjBIAS_AFFINE)
    if dynamics != mujoco.mjtDyn.mjDYN_NONE or gain != mujoco.mjtGain.mjGAIN_FIXED:
        words = [
            f"{key}={kind.name.partition('_')[2].lower()}"
            for key, kind in (("dyntype", dynamics), ("gaintype", gain))
            if kind not in (mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtGain.mjGAIN_FIXED)
        ]
        own.reasons.append(f"{name} has {', '.join(words)}, and its force no fixed gain on control")
        return
    if bias not in kinds:
        own.reasons.append(f"{name} has biastype={bias.name.partition('_')[2].lower()}")
        return
    r, g = float(model.actuator_gear[k, 0]), float(model.actuator_gainprm[k, 0])
    given = model.actuator_biasprm[k, :3] if bias == kinds[1] else np.zeros(3)
    b0, b1, b2 = (float(x) for x in given)
    if b1 > 0.0 or b2 > 0.0 or not r or not g:
        text = f"{name} (gear {r:g}, gain {g:g}, bias {b0:g} {b1:g} {b2:g})"
        own.reasons.append(f"{text} does not hold a position")
        return
    if not b1 and not b2:
        own.reasons.append(
            f"{name} is a motor: its control is {r * g:g} N m (N) per unit and no position"
        )
        return
    own.kp, own.kd = own.kp - b1 * r * r, own.kd - b2 * r * r
    (own.positions if b1 else own.velocities).append(name)
    if model.actuator_forcelimited[k]:
        low, high = (float(x) for x in model.actuator_forcerange[k])
        own.limit = min(own.limit, abs(r) * max(abs(low), abs(high)))
        if abs(low + high) > 1e-9 * (high - low):
            text = f"{name} has forcerange {low:g} to {high:g}: a law has one limit on both sides"
            own.notes.append(text)
    if getattr(model, "actuator_delay", np.zeros(k + 1))[k]:
        late = 1e3 * float(model.actuator_delay[k])
        own.notes.append(f"{name} is {late:g} ms late, which the delay of the fit contains")
    if not b1:
        own.servo -= b2 * r * r
        return
    scale, shift = -g / (b1 * r), -b0 / (b1 * r)
    if abs(scale - 1.0) > 1e-6 or abs(shift) > 1e-9:
        own.notes.append(
            f"{name} has gear {r:g}, gain {g:g}, bias {b0:g} {b1:g}: it drives the joint to "
            f"{scale:g} times its control" + (f" {shift:+g}" if shift else "")
        )
    if model.actuator_ctrllimited[k]:
        ends = sorted(scale * float(u) + shift for u in model.actuator_ctrlrange[k])
        own.reach = (ends[0], ends[1])


def _judge(own: _OfJoint, joint: str) -> None:
    """Whether it is one position loop; else no gains."""
    if not own.positions and own.velocities:
        own.reasons.append(f"{', '.join(own.velocities)} holds a speed, and no position")
    elif not own.positions and not own.reasons:
        own.reasons.append(f"no actuator moves joint {joint!r}")
    if len(own.positions) > 1:
        own.reasons.append(f"{' and '.join(own.positions)} hold the same joint by two commands")
    if own.reasons:
        own.kp = own.kd = own.servo = 0.0
        own.limit = np.inf
    elif own.velocities:
        own.notes.append(
            f"{own.positions[0]} and {', '.join(own.velocities)} act together: their gains on "
            "speed add up"
        )
