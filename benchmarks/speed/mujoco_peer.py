"""MuJoCo beside us: the same arm under the same law, stepped by its own rollout in C.

The law is built of actuators, a position and a velocity servo per joint, with the reference as
control; viscous friction is the joints' damping. Coulomb friction is left out for the figure
quoted, because MuJoCo solves it as a constraint, which costs it more than half again; the figure
with it stands beside. Rotor inertia is the armature. No geometry, no contacts.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pivident.loop.simulation.closed_loop import LoopSignals
from pivident.loop.simulation.controllers import PD
from pivident.robot.description import Robot

#: Smallest mass and inertia that the other simulator accepts.
_LEAST = 1e-3


def model_of(
    robot: Robot, law: PD, rate: float, viscous: np.ndarray, coulomb: np.ndarray, integrator: str
):
    """The arm as a MuJoCo model.

    Args:
        robot: the robot; links that are no physical bodies get small ones.
        law: gains.
        rate: of the control, which is that of the steps [Hz].
        viscous: fv of each joint, shape (joints,).
        coulomb: fc of each joint, likewise; zeros: none.
        integrator: ``implicitfast``, ``RK4`` …
    """
    import mujoco

    spec = mujoco.MjSpec()
    spec.option.timestep = 1.0 / rate
    spec.option.gravity = robot.gravity
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    bodies = []
    kp, kd = (np.broadcast_to(np.asarray(x, float), (robot.size,)) for x in (law.kp, law.kd))
    for i, (joint, link) in enumerate(zip(robot.joints, robot.links, strict=True)):
        parent = spec.worldbody if joint.parent < 0 else bodies[joint.parent]
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(joint.rotation).ravel())
        body = parent.add_body(name=link.name, pos=joint.translation, quat=quaternion)
        _give_inertia(body, link.inertia)
        body.add_joint(
            name=joint.name,
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0, 0, 1],
            armature=robot.rotor_inertia[i],
            damping=_as_damping(viscous[i]),
            frictionloss=coulomb[i],
        )
        bodies.append(body)
        for gain, bias in ((kp[i], [0.0, -kp[i], 0.0]), (kd[i], [0.0, 0.0, -kd[i]])):
            servo = spec.add_actuator(target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            servo.gainprm[0] = gain
            servo.biastype = mujoco.mjtBias.mjBIAS_AFFINE
            servo.biasprm[:3] = bias
    return spec.compile()


def _as_damping(value: float):
    """Damping as the installed version takes it: one number, or coefficients of a polynomial."""
    import mujoco

    probe = mujoco.MjSpec().worldbody.add_body().add_joint().damping
    return value if np.ndim(probe) == 0 else np.r_[value, np.zeros(len(probe) - 1)]


def _give_inertia(body, inertia: np.ndarray) -> None:
    """Mass, centre and inertia about it; a small body where the parameters make none."""
    xx, xy, xz, yy, yz, zz, mx, my, mz, m = inertia
    mass = max(m, _LEAST)
    centre = np.array([mx, my, mz]) / mass if m > _LEAST else np.zeros(3)
    whole = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    own = whole - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    values = np.linalg.eigvalsh(own)
    if values[0] < _LEAST * 1e-2 or values[0] + values[1] < values[2]:
        own = np.eye(3) * max(values[2], _LEAST)
    body.mass, body.ipos = mass, centre
    body.fullinertia = [own[0, 0], own[1, 1], own[2, 2], own[0, 1], own[0, 2], own[1, 2]]
    body.explicitinertial = True


def rollout(model, signals: LoopSignals, start: tuple[np.ndarray, np.ndarray]) -> Callable:
    """The run along the reference: a work that returns positions, shape (samples, joints)."""
    import mujoco
    from mujoco.rollout import rollout as run

    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = start
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    state = np.empty(size)
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    assert signals.dq_ref is not None
    control = np.stack([signals.q_ref, signals.dq_ref], axis=2).reshape(1, len(signals.q_ref), -1)
    control = np.ascontiguousarray(control)
    states = np.empty((1, control.shape[1], size))

    def work() -> np.ndarray:
        run(model, data, state[None], control, state=states)
        return states[0, :, 1 : 1 + model.nq]

    return work
