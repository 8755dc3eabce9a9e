"""Robot files loaded back by Pinocchio and MuJoCo, their torques compared with the model's.

The torque that the engine computes for q, dq, ddq is completed with what the file leaves out, as a
user of the file would do it,

    tau = engine + Φ (left out) + dry friction,

and the dry friction is the model's smooth one, scaled by the level that the engine has read over
the model's. So every number in the file enters the comparison.

Of a mechanism with loops the engine computes the torques of all joints as if nothing closed them,
at the motion of all joints that pivident finds, and has the slopes A of its own constraints. With
A N = 0, the torques of the independent joints are Nᵀ τ. Where the engine's constraints do not hold
at that posture, the torques are NaN.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.dynamics.parameters import Parameter
from pivident.foundation.errors import ExportError
from pivident.models.export.differences import RobotFile
from pivident.models.export.joint_side import JointSide, Shaft, joint_side
from pivident.models.exported import SAME, Verification, compared
from pivident.models.runnable_model import RunnableModel
from pivident.robot.closed_chains import proportions
from pivident.robot.description import Robot

#: Largest gap of a loop in the engine at a posture in which it is closed here [m, rad].
GAP = 1e-8

#: Relative size of a singular value of the engine's constraints that counts as zero.
RANK = 1e-8


def whole_motion(
    robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Motion of all joints of the tree at states one by one, each shape (samples, tree joints)."""
    if robot.constraints is None:
        return q, dq, ddq
    chains = ClosedChains(robot)
    found = [
        chains.motion(*(x[:, None] for x in state))[:3] for state in zip(q, dq, ddq, strict=True)
    ]
    one, two, three = (np.array([motion[k][:, 0] for motion in found]) for k in range(3))
    return one, two, three


def independent_torque(robot: Robot, tau: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Nᵀ τ of all joints, (tree joints,), for constraints A, (equations, tree joints)."""
    own = list(robot.places)
    others = [i for i in range(robot.tree.size) if i not in robot.places]
    follow = -np.linalg.lstsq(slope[:, others], slope[:, own], rcond=RANK)[0]
    return np.asarray(tau[own] + follow.T @ tau[others])


def mujoco_slopes(
    mujoco: Any, loaded: Any, data: Any, at_v: list[int]
) -> tuple[np.ndarray, np.ndarray]:
    """Gaps and slopes of MuJoCo's equality constraints at the posture of its data.

    Args:
        mujoco: the library.
        loaded: a model with a dense Jacobian whose constraints are not disabled.
        data: its state.
        at_v: places of the tree's joints among its speeds.
    """
    mujoco.mj_fwdPosition(loaded, data)
    rows = data.efc_type[: data.nefc] == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    slopes = np.array(data.efc_J).reshape(-1, loaded.nv)[: data.nefc]
    return np.array(data.efc_pos[: data.nefc])[rows], slopes[rows][:, at_v]


#: Relative difference of torques due to rounding to seven digits.
SEVEN_DIGITS = 1e-5


@dataclass(frozen=True, eq=False)
class _DryLevels:
    """Levels of dry friction as an engine has read them, of joints and of shafts."""

    joints: np.ndarray
    shafts: np.ndarray


def verify_with_pinocchio(
    file: RobotFile, model: RunnableModel, *, frozen: Mapping[str, float] | None = None
) -> Verification:
    """Compare the torques of a URDF in Pinocchio with the model's at random states.

    ``frozen`` are positions of the file's other joints [rad or m]. Gravity is set here, because a
    URDF has none.
    """
    try:
        import pinocchio as pin
    except ImportError:
        return Verification("Pinocchio", skipped="Pinocchio is not installed (pip install pin)")
    if file.format != "urdf":
        raise ExportError(f"Pinocchio loads a URDF here, not {file.format!r}")
    side = joint_side(model, file.supported)
    robot, names = model.robot, model.robot.tree.joint_names
    try:
        loaded = _pinocchio_model(pin, file, robot, frozen or {})
    except ValueError as error:
        reason = " ".join(str(error).split())
        return Verification("Pinocchio", skipped=f"Pinocchio refuses the file: {reason}")
    loaded.gravity.linear = np.asarray(model.robot.gravity, dtype=float)
    data = loaded.createData()
    at = [loaded.joints[loaded.getJointId(name)].idx_v for name in robot.joint_names]
    damping, levels = _pinocchio_dissipation(pin, file, names)
    found = proportions(robot)
    assert found is not None  # or there were no URDF
    follow = found[0]

    def engine(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        out = np.empty_like(q)
        for k in range(len(q)):
            configuration = _pinocchio_positions(
                pin, loaded, dict(zip(robot.joint_names, q[k].tolist(), strict=True))
            )
            v, a = np.zeros(loaded.nv), np.zeros(loaded.nv)
            v[at], a[at] = dq[k], ddq[k]
            rigid = pin.rnea(loaded, data, configuration, v, a)[at]
            out[k] = rigid + follow.T @ (damping * (follow @ dq[k]))
        return out

    dry = _DryLevels(levels, np.zeros(0))
    return _compared(f"Pinocchio {pin.__version__}", model, side, dry, engine)


def _pinocchio_model(pin: Any, file: RobotFile, robot: Robot, frozen: Mapping[str, float]) -> Any:
    """The robot in Pinocchio, joints that were not identified locked, followers moved along.

    A link may have the name of a joint. Pinocchio searches both among its frames, so those of the
    links are renamed to names that no joint has.
    """
    names = robot.tree.joint_names
    if robot.constraints is None:
        whole = pin.buildModelFromXML(file.text)
    else:
        whole = pin.buildModelFromXML(file.text, mimic=True)
    longest = max(map(len, whole.names))
    for k, frame in enumerate(whole.frames):
        if frame.type != pin.FrameType.JOINT:
            frame.name = f"{k}_".ljust(longest + 1, "_")
    locked = [i for i in range(1, whole.njoints) if whole.names[i] not in names]
    if robot.constraints is not None and not locked:
        return whole
    return pin.buildReducedModel(whole, locked, _pinocchio_positions(pin, whole, frozen))


def _pinocchio_dissipation(
    pin: Any, file: RobotFile, names: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Damping and levels of dry friction that Pinocchio has read of all joints, followers too."""
    every = pin.buildModelFromXML(file.text)
    at = [every.joints[every.getJointId(name)].idx_v for name in names]
    newer = hasattr(every, "upperDryFrictionLimit")
    levels = np.array(every.upperDryFrictionLimit if newer else every.friction)
    return np.array(every.damping)[at], levels[at]


def _pinocchio_positions(pin: Any, loaded: Any, positions: Mapping[str, float]) -> np.ndarray:
    """Pinocchio's configuration; continuous joints hold cosine and sine."""
    q = pin.neutral(loaded)
    for name, position in positions.items():
        if not loaded.existJointName(name):
            continue
        joint = loaded.joints[loaded.getJointId(name)]
        if joint.nq == 2:
            q[joint.idx_q : joint.idx_q + 2] = np.cos(position), np.sin(position)
        else:
            q[joint.idx_q] = position
    return q


def verify_with_mujoco(
    file: RobotFile, model: RunnableModel, *, frozen: Mapping[str, float] | None = None
) -> Verification:
    """Compare the torques of an MJCF or URDF file in MuJoCo with the model's at random states.

    Shapes are removed before compiling, so meshes may be missing. MuJoCo's inverse dynamics are
    computed without constraints (limits, contacts, dry friction); a motor's bias is added.
    """
    try:
        import mujoco
    except ImportError:
        return Verification("MuJoCo", skipped="MuJoCo is not installed (pip install mujoco)")
    if file.format not in ("urdf", "mjcf"):
        raise ExportError(f"MuJoCo loads URDF and MJCF, not {file.format!r}")
    side = joint_side(model, file.supported)
    try:
        loaded = mujoco_model(file)
    except ExportError as error:
        return Verification("MuJoCo", skipped=str(error))
    if file.format == "urdf":
        loaded.opt.gravity[:] = model.robot.gravity
    loaded.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    closed, loaded.opt.disableflags = (
        copy.copy(loaded),
        loaded.opt.disableflags | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT,
    )
    data = mujoco.MjData(loaded)
    joints = [loaded.joint(name) for name in model.robot.tree.joint_names]
    at_q = [int(joint.qposadr[0]) for joint in joints]
    at_v = [int(joint.dofadr[0]) for joint in joints]
    for name, position in (frozen or {}).items():
        if mujoco.mj_name2id(loaded, mujoco.mjtObj.mjOBJ_JOINT, name) >= 0:
            data.qpos[loaded.joint(name).qposadr[0]] = position
    bias = np.zeros(loaded.nv)
    for k in range(loaded.nu):
        joint = int(loaded.actuator_trnid[k, 0])
        bias[loaded.jnt_dofadr[joint]] += loaded.actuator_biasprm[k, 0]

    def engine(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        whole = whole_motion(model.robot, q, dq, ddq)
        out = np.empty_like(q)
        for k in range(len(q)):
            data.qpos[at_q], data.qvel[at_v], data.qacc[at_v] = (x[k] for x in whole)
            mujoco.mj_inverse(loaded, data)
            own = (data.qfrc_inverse - bias)[at_v]
            if model.robot.constraints is not None:
                gap, slope = mujoco_slopes(mujoco, closed, data, at_v)
                own = independent_torque(model.robot, own, slope)
                own[np.abs(gap).max(initial=0.0) > GAP] = np.nan
            out[k] = own
        return out

    dry = _DryLevels(loaded.dof_frictionloss[at_v], np.asarray(loaded.tendon_frictionloss))
    found = _compared(f"MuJoCo {mujoco.__version__}", model, side, dry, engine)
    if file.format == "urdf" and mujoco.__version__ < "4" and SAME < found.relative < SEVEN_DIGITS:
        reason = (
            f"MuJoCo {mujoco.__version__} diagonalises the inertia tensors of a URDF to seven "
            f"digits only, MuJoCo 4 to all; torques differ by {found.relative:.1g} of the largest"
        )
        return Verification(found.program, skipped=reason)
    return found


def mujoco_model(file: RobotFile) -> Any:
    """``mujoco.MjModel`` of a file without its shapes and meshes, which need not exist."""
    import mujoco

    try:
        spec = mujoco.MjSpec.from_string(file.text)
        for geom in list(spec.geoms):
            spec.delete(geom)
        for mesh in list(spec.meshes):
            spec.delete(mesh)
        return spec.compile()
    except ValueError as error:
        reason = " ".join(str(error).split()).removesuffix(".")
        raise ExportError(f"MuJoCo refuses the file: {reason}") from error


def _compared(
    program: str, model: RunnableModel, side: JointSide, dry: _DryLevels, engine: Any
) -> Verification:
    """The completed torques of the engine compared with the model's."""
    rest = _values(model, side.left_out)
    ratio, unasked = _levels(dry.joints, side.dry_friction)
    on_joint = np.array([ratio[p.joint] for p in model.parameters])
    friction = on_joint * _values(model, side.dry_parts)
    passive = [i for i in range(len(unasked)) if i not in model.robot.places]
    unasked = unasked[list(model.robot.places)] + unasked[passive].sum()
    turning = [shaft for shaft in side.shafts if shaft.dry_friction]
    read = dry.shafts[: len(side.shafts)]
    share, _ = _levels(read, np.array([shaft.dry_friction for shaft in side.shafts]))

    def completed(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        # the load of load-dependent friction is that of all parameters
        load = model.regressor.inner(q.T, dq.T, ddq.T, model.values)

        def part(theta: np.ndarray) -> np.ndarray:
            return model.regressor.torque(q, dq, ddq, theta, load)

        by_hand = part(rest) + unasked + part(friction)
        for shaft in turning:
            own = _values(model, {p.name: v for p, v in _dry_on(model, shaft)})
            by_hand += share[side.shafts.index(shaft)] * part(own)
        return engine(q, dq, ddq) + by_hand

    return compared(program, model.robot, model.torque, completed)


def _values(model: RunnableModel, by_name: Mapping[str, float]) -> np.ndarray:
    """Standard parameters with some values, zero elsewhere."""
    return np.array([by_name.get(p.name, 0.0) for p in model.parameters])


def _dry_on(model: RunnableModel, shaft: Shaft) -> Iterator[tuple[Parameter, float]]:
    """Parameters of the dry friction of a shaft."""
    for p, value in zip(model.parameters, model.values.tolist(), strict=True):
        c = p.coupling
        if c is not None and p.stem == "fcm" and (c.motor, c.joint) == (shaft.motor, shaft.joint):
            yield p, value


def _levels(read: np.ndarray, written: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Levels read over levels written; and levels read where none was written."""
    some = written > 0.0
    return np.where(some, read / np.where(some, written, 1.0), 0.0), np.where(some, 0.0, read)
