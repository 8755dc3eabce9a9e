"""A mechanism with closed loops or a measured base in MuJoCo: truth pivident has no part in.

The tree becomes nested bodies, closures and gears become equality constraints, as
stiff as ten Runge–Kutta steps in a millisecond allow; friction is applied as torque. (Semi-implicit
steps of 0.05 ms are late by half of one, and viscous friction takes it up by four standard errors.)
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, base_parameters
from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.dynamics.parameters import nominal_values
from pivident.robot.description import Robot

SUBSTEPS = 10

_ARCTANGENT = 2.0 / np.pi

_KINDS = {"revolute": mujoco.mjtJoint.mjJNT_HINGE, "prismatic": mujoco.mjtJoint.mjJNT_SLIDE}


def quaternion(rotation: np.ndarray) -> np.ndarray:
    out = np.zeros(4)
    mujoco.mju_mat2Quat(out, np.ascontiguousarray(rotation).ravel())
    return out


def mujoco_model(robot: Robot, step: float) -> mujoco.MjModel:
    """The mechanism as a MuJoCo model, whose joints come depth first."""
    return mujoco_spec(robot, step).compile()


def mujoco_spec(robot: Robot, step: float) -> mujoco.MjSpec:
    """The same before it is compiled: bodies have the names of their joints, a base its own."""
    tree, constraints = robot.tree, robot.constraints
    spec = mujoco.MjSpec()
    spec.option.timestep = step
    spec.option.gravity = tree.gravity
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.option.iterations, spec.option.tolerance = 50, 1e-14
    spec.compiler.balanceinertia = False
    spec.compiler.boundmass = spec.compiler.boundinertia = 1e-9
    bodies = []
    for i, (joint, link) in enumerate(zip(tree.joints, tree.links, strict=True)):
        if joint.motion != "driven":  # a measured base is one body with no joint, or a free one
            if i < tree.base_joints - 1:
                bodies.append(spec.worldbody)
                continue
            body = spec.worldbody.add_body(name=link.name)
            if joint.motion == "measured":
                body.add_freejoint()
        else:
            parent = spec.worldbody if joint.parent < 0 else bodies[joint.parent]
            body = parent.add_body(
                name=joint.name, pos=joint.translation, quat=quaternion(joint.rotation)
            )
            own = body.add_joint(name=joint.name, type=_KINDS[joint.kind], axis=[0.0, 0.0, 1.0])
            own.armature = tree.rotor_inertia[i]
        xx, xy, xz, yy, yz, zz, mx, my, mz, m = link.inertia
        if m > 0.0:
            c = np.array([mx, my, mz]) / m
            about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            about = about - m * (c @ c * np.eye(3) - np.outer(c, c))
            body.mass, body.ipos, body.explicitinertial = m, c, True
            body.fullinertia = about[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        bodies.append(body)
    for closure in constraints.closures if constraints else ():
        names = []
        for k, (link, frame) in enumerate(zip(closure.links, closure.frames, strict=True)):
            own = spec.worldbody if link < 0 else bodies[link]
            name = f"{closure.name}:{k}"
            own.add_site(name=name, pos=frame.translation, quat=quaternion(frame.rotation))
            names.append(name)
        # of a planar loop the plane holds the axis: that the origins meet is enough
        equality = spec.add_equality(
            name=closure.name, objtype=mujoco.mjtObj.mjOBJ_SITE, name1=names[0], name2=names[1]
        )
        equality.type = mujoco.mjtEq.mjEQ_CONNECT
        _stiff(equality, step)
    for one in constraints.linear if constraints else ():
        largest = np.abs(one.ratios).max()
        tendon = spec.add_tendon(name=one.name)
        for joint, ratio in zip(tree.joints, one.ratios / largest, strict=True):
            if ratio:
                tendon.wrap_joint(joint.name, float(ratio))
        equality = spec.add_equality(name=one.name, name1=one.name)
        equality.type = mujoco.mjtEq.mjEQ_TENDON
        equality.data[0] = one.offset / largest
        _stiff(equality, step)
    return spec


def _stiff(equality, step: float) -> None:
    equality.solref = [-1.0 / (2.0 * step) ** 2, -1.0 / step]
    equality.solimp = [0.9999, 0.9999, 0.001, 0.5, 2.0]


@dataclass(frozen=True)
class Made:
    """What MuJoCo made: arrays (samples, joints) of the independent joints."""

    q: np.ndarray
    tau: np.ndarray
    gap: float


def mujoco_record(
    robot: Robot,
    q_ref: np.ndarray,
    rate: float,
    gains: tuple[np.ndarray, np.ndarray],
    encoder: np.ndarray,
    seed: int,
) -> Made:
    """A PD law with noisy encoders, u = kp e + kd (dq_ref - dq̂), held over each period."""
    rng = np.random.default_rng(seed)
    model = mujoco_model(robot, 1.0 / (rate * SUBSTEPS))
    data = mujoco.MjData(model)
    order = [model.joint(joint.name).dofadr[0] for joint in robot.tree.joints]
    places = [order[i] for i in robot.places]
    data.qpos[order] = ClosedChains(robot).start(q_ref[0]).q
    law = friction_of(robot)
    samples = len(q_ref)
    noise = encoder * rng.normal(size=q_ref.shape)
    q, tau = np.zeros_like(q_ref), np.zeros_like(q_ref)
    kp, kd = gains
    before = q_ref[0] + noise[0]
    dq_ref = np.vstack([np.zeros(robot.size), np.diff(q_ref, axis=0)]) * rate
    gap = 0.0
    for k in range(samples):
        heard = data.qpos[places] + noise[k]
        speed = (heard - before) * rate if k else np.zeros(robot.size)
        before = heard
        u = kp * (q_ref[k] - heard) + kd * (dq_ref[k] - speed)
        q[k], tau[k] = heard, u
        for _ in range(SUBSTEPS):
            data.qfrc_applied[:] = 0.0
            data.qfrc_applied[places] = u - law(data.qvel[places])
            mujoco.mj_step(model, data)
        gap = max(gap, float(np.abs(data.efc_pos[: data.nefc]).max(initial=0.0)))
    return Made(q, tau, gap)


def friction_of(robot: Robot):
    """Friction of the driven joints from the description's values."""
    fv, fc, off, gamma = (np.zeros(robot.size) for _ in range(4))
    for j, i in enumerate(robot.places):
        label = robot.label(i)
        known = robot.friction_nominal
        fv[j], fc[j] = known.get(f"fv{label}", 0.0), known.get(f"fc{label}", 0.0)
        off[j] = known.get(f"off{label}", 0.0)
        gamma[j] = robot.joints[j].friction.slopes[0] if robot.joints[j].friction.slopes else 1.0
    return lambda v: fv * v + fc * _ARCTANGENT * np.arctan(gamma * v) + off


def truth_of(robot: Robot) -> tuple[BaseParameters, np.ndarray]:
    """Base parameters and their values in the description."""
    base = base_parameters(robot)
    return base, base.values(nominal_values(robot, base.standard))
