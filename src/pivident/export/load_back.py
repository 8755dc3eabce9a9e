"""Robot files loaded back by Pinocchio and MuJoCo, their torques compared with the model's.

The torque that the engine computes for q, dq, ddq is completed with what the file leaves out, as a
user of the file would do it,

    tau = engine + Φ (left out) + dry friction,

and the dry friction is the model's smooth one, scaled by the level that the engine has read over
the model's. So every number in the file enters the comparison.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pivident.dynamics.parameters import Parameter
from pivident.errors import ExportError
from pivident.export import mjcf, urdf
from pivident.export.joint_side import JointSide, joint_side
from pivident.export.robot_file import RobotFile
from pivident.export.shafts import Shaft
from pivident.models.exported import SAME, Verification, compared
from pivident.models.runnable_model import RunnableModel

#: Relative difference of torques due to rounding to seven digits.
SEVEN_DIGITS = 1e-5

_SUPPORTED = {"urdf": urdf.SUPPORTED, "mjcf": mjcf.SUPPORTED}


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
    side = joint_side(model, _SUPPORTED[file.format])
    names = model.robot.joint_names
    try:
        loaded = _pinocchio_model(pin, file, names, frozen or {})
    except ValueError as error:
        reason = " ".join(str(error).split())
        return Verification("Pinocchio", skipped=f"Pinocchio refuses the file: {reason}")
    loaded.gravity.linear = np.asarray(model.robot.gravity, dtype=float)
    data = loaded.createData()
    at = [loaded.joints[loaded.getJointId(name)].idx_v for name in names]
    newer = hasattr(loaded, "upperDryFrictionLimit")
    levels = np.array(loaded.upperDryFrictionLimit if newer else loaded.friction)

    def engine(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        out = np.empty_like(q)
        for k in range(len(q)):
            configuration = _pinocchio_positions(
                pin, loaded, dict(zip(names, q[k].tolist(), strict=True))
            )
            v, a = np.zeros(loaded.nv), np.zeros(loaded.nv)
            v[at], a[at] = dq[k], ddq[k]
            out[k] = (pin.rnea(loaded, data, configuration, v, a) + loaded.damping * v)[at]
        return out

    dry = _DryLevels(levels[at], np.zeros(0))
    return _compared(f"Pinocchio {pin.__version__}", model, side, dry, engine)


def _pinocchio_model(
    pin: Any, file: RobotFile, names: Sequence[str], frozen: Mapping[str, float]
) -> Any:
    """The robot in Pinocchio, joints that were not identified locked.

    A link may have the name of a joint. Pinocchio searches both among its frames, so those of the
    links are renamed to names that no joint has.
    """
    whole = pin.buildModelFromXML(file.text)
    longest = max(map(len, whole.names))
    for k, frame in enumerate(whole.frames):
        if frame.type != pin.FrameType.JOINT:
            frame.name = f"{k}_".ljust(longest + 1, "_")
    locked = [i for i in range(1, whole.njoints) if whole.names[i] not in names]
    return pin.buildReducedModel(whole, locked, _pinocchio_positions(pin, whole, frozen))


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
    if file.format not in _SUPPORTED:
        raise ExportError(f"MuJoCo loads URDF and MJCF, not {file.format!r}")
    side = joint_side(model, _SUPPORTED[file.format])
    try:
        loaded = mujoco_model(file)
    except ExportError as error:
        return Verification("MuJoCo", skipped=str(error))
    if file.format == "urdf":
        loaded.opt.gravity[:] = model.robot.gravity
    loaded.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(loaded)
    joints = [loaded.joint(name) for name in model.robot.joint_names]
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
        out = np.empty_like(q)
        for k in range(len(q)):
            data.qpos[at_q], data.qvel[at_v], data.qacc[at_v] = q[k], dq[k], ddq[k]
            mujoco.mj_inverse(loaded, data)
            out[k] = (data.qfrc_inverse - bias)[at_v]
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
    friction = _values(model, side.dry_parts)
    ratio, unasked = _levels(dry.joints, side.dry_friction)
    turning = [shaft for shaft in side.shafts if shaft.dry_friction]
    read = dry.shafts[: len(side.shafts)]
    written = np.array([shaft.dry_friction for shaft in side.shafts])
    share, _ = _levels(read, written)

    def completed(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        # the load of load-dependent friction is that of all parameters
        load = model.regressor.inner(q.T, dq.T, ddq.T, model.values)

        def part(theta: np.ndarray) -> np.ndarray:
            return model.regressor.torque(q, dq, ddq, theta, load)

        by_hand = part(rest) + unasked + ratio * part(friction)
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
