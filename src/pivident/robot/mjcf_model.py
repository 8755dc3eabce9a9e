"""An MJCF file as MuJoCo compiles it, and what of it a robot of pivident cannot be.

MuJoCo resolves classes, includes and inertias from shapes itself; pivident reads the compiled
model. This module needs the extra ``mujoco``.
"""

from __future__ import annotations

from collections.abc import Collection, Set
from pathlib import Path
from typing import Any

import numpy as np

from pivident.foundation.errors import RobotDescriptionError
from pivident.foundation.extras import require
from pivident.foundation.files import regular_file
from pivident.robot.frames import exact_angle

#: Largest MJCF that is read, without what it includes [bytes].
MAXIMUM_SIZE = 8 * 2**20


def mujoco_library(purpose: str = "reading an MJCF") -> Any:
    """The library, or an error that names the extra."""
    return require("mujoco", extra="mujoco", purpose=purpose)


def read_spec(path: str | Path) -> Any:
    """The ``mujoco.MjSpec`` of a file.

    Raises:
        MissingExtra: MuJoCo is not installed.
        RobotDescriptionError: the file cannot be read, or MuJoCo refuses it; the message is
            MuJoCo's.
    """
    mujoco, file = mujoco_library(), Path(path)
    try:
        if regular_file(file).stat().st_size > MAXIMUM_SIZE:
            raise RobotDescriptionError(
                f"is larger than {MAXIMUM_SIZE // 2**20} MiB",
                advice="this is not a robot description",
            )
    except OSError as error:
        raise RobotDescriptionError(
            f"cannot be read ({error.strerror})", advice="check the path and its permissions"
        ) from error
    try:
        return mujoco.MjSpec.from_file(str(file))
    except ValueError as error:
        raise _refused(error) from error


def with_exact_angles(spec: Any) -> Any:
    """The spec with angles of bodies that are rounded quarter turns made exact, in place."""
    for body in spec.bodies if not spec.compiler.degree else ():
        turn = body.alt
        turn.euler = [exact_angle(float(x)) for x in turn.euler]
        turn.axisangle = [*turn.axisangle[:3], exact_angle(float(turn.axisangle[3]))]
    return spec


def compiled(spec: Any) -> Any:
    """The ``mujoco.MjModel`` of a spec, see `compilable`.

    Raises:
        RobotDescriptionError: MuJoCo refuses it; the message is MuJoCo's.
    """
    return compilable(spec)[1]


def compilable(spec: Any) -> tuple[Any, Any, str]:
    """A spec that compiles, its ``mujoco.MjModel``, and what was left out of it, or nothing.

    Where files of meshes are missing or no meshes, the shapes that need them are left out, and all
    shapes if that is not enough. Without them MuJoCo cannot compute the inertia of a body that has
    none written, so this is done only where every such body has its own.

    Raises:
        RobotDescriptionError: MuJoCo refuses it; the message is MuJoCo's.
    """
    try:
        return spec, spec.compile(), ""
    except ValueError as error:
        bodies = [body for body in spec.bodies if body.name != "world"]
        if not spec.meshes or not all(body.explicitinertial for body in bodies):
            raise _refused(error) from error
        refusal, said = error, _said(error)
    for whole in (False, True):
        bare, meshes = spec.copy(), mujoco_library().mjtGeom.mjGEOM_MESH
        whole = whole or bare.compiler.inertiafromgeom == 1  # of what is left it would be wrong
        geoms = [geom for geom in bare.geoms if whole or geom.type == meshes]
        rest = (bare.excludes, bare.pairs) if whole else ()
        for kind in (geoms, bare.meshes, bare.materials, bare.textures, *rest):
            for element in list(kind):
                bare.delete(element)
        for geom in bare.geoms:
            geom.material = ""
        for site in bare.sites:
            site.material = ""
        try:
            model = bare.compile()
        except ValueError as error:
            refusal = error
            continue
        shapes = "all shapes" if whole else "meshes, materials and textures"
        return bare, model, f"{shapes} are left out, since MuJoCo says: {said}"
    raise _refused(refusal) from refusal


def rotation_of_quaternion(quaternion: np.ndarray) -> np.ndarray:
    """Rotation of a quaternion w x y z of any length but zero."""
    w, x, y, z = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _refused(error: ValueError) -> RobotDescriptionError:
    return RobotDescriptionError(f"MuJoCo refuses it: {_said(error)}")


def _said(error: ValueError) -> str:
    return " ".join(str(error).split()).removesuffix(".").removeprefix("Error: ")


#: What makes a tendon act on its joints, arrays of a compiled model.
_OF_TENDONS = (
    "stiffness",
    "stiffnesspoly",
    "damping",
    "dampingpoly",
    "frictionloss",
    "armature",
    "limited",
    "actfrclimited",
)


def joint_names(model: Any) -> tuple[str, ...]:
    """Names of the joints of a compiled model; one without a name has that of its body."""
    names = []
    for k in range(model.njnt):
        body = model.body(int(model.jnt_bodyid[k]))
        alone = int(body.jntnum[0]) == 1
        names.append(model.joint(k).name or (body.name if alone else ""))
        if not names[-1]:
            raise RobotDescriptionError(
                f"a joint of body {body.name!r} has no name", advice="give it one, <joint name=…>"
            )
    return tuple(names)


def actuated_joints(model: Any) -> frozenset[int]:
    """Indices of the joints that an actuator moves."""
    return frozenset(
        int(model.actuator_trnid[k, 0])
        for k in range(len(model.actuator_trntype))
        if moves_a_joint(model, k)
    )


def actuator_name(model: Any, k: int) -> str:
    """An actuator as a sentence names it."""
    return f"actuator {model.actuator(k).name or f'number {k + 1}'!r}"


def moves_a_joint(model: Any, actuator: int) -> bool:
    """Whether an actuator acts on one joint."""
    types = mujoco_library().mjtTrn
    own = int(model.actuator_trntype[actuator])
    return own in (int(types.mjTRN_JOINT), int(types.mjTRN_JOINTINPARENT))


def _only_couples(model: Any, k: int) -> bool:
    """Whether a tendon is a sum of joint positions that an equality holds, and nothing more."""
    mujoco = mujoco_library()
    acts = any(
        np.any(getattr(model, f"tendon_{what}", np.zeros(model.ntendon))[k]) for what in _OF_TENDONS
    )
    moved = any(
        int(model.actuator_trntype[u]) == int(mujoco.mjtTrn.mjTRN_TENDON)
        and int(model.actuator_trnid[u, 0]) == k
        for u in range(len(model.actuator_trntype))
    )
    held = any(
        int(model.eq_type[e]) == int(mujoco.mjtEq.mjEQ_TENDON)
        and model.eq_active0[e]
        and k in (int(model.eq_obj1id[e]), int(model.eq_obj2id[e]))
        for e in range(model.neq)
    )
    return tendon_joints(model, k) is not None and held and not acts and not moved


def _is_still(model: Any, k: int, moving: Set[int]) -> bool:
    """Whether a tendon is a sum of joint positions of which none moves."""
    joints = tendon_joints(model, k)
    return joints is not None and not joints & moving


def tendon_joints(model: Any, k: int) -> frozenset[int] | None:
    """Indices of the joints that a fixed tendon adds up; None: of a tendon in space."""
    first, count = int(model.tendon_adr[k]), int(model.tendon_num[k])
    of_joint = int(mujoco_library().mjtWrap.mjWRAP_JOINT)
    if any(int(kind) != of_joint for kind in model.wrap_type[first : first + count]):
        return None
    return frozenset(int(joint) for joint in model.wrap_objid[first : first + count])


def refuse_unknown_physics(model: Any, moving: Collection[int]) -> None:
    """Refuse what acts on moving joints and is not in the model of rigid links.

    Args:
        model: the compiled model.
        moving: indices of the joints that move.

    Raises:
        RobotDescriptionError: names the element and the next step.
    """
    names = [
        model.tendon(k).name or f"number {k + 1}"
        for k in range(model.ntendon)
        if not _is_still(model, k, set(moving)) and not _only_couples(model, k)
    ]
    if names:
        raise RobotDescriptionError(
            f"has tendons ({', '.join(names)}), whose forces are not in the model",
            advice="remove <tendon> with its actuators, and declare coupled motors by couplings "
            "under [robot]",
        )
    if model.opt.density or model.opt.viscosity:
        raise RobotDescriptionError(
            f"has a fluid around it (density = {model.opt.density:g}, viscosity = "
            f"{model.opt.viscosity:g}), whose forces are not in the model",
            advice="remove both from <option>",
        )
    for body in range(1, model.nbody):
        if model.body_gravcomp[body]:
            raise RobotDescriptionError(
                f"body {model.body(body).name!r} has gravcomp = {model.body_gravcomp[body]:g}: "
                "gravity that is compensated is no property of the body",
                advice="remove it",
            )
    names_of_joints = joint_names(model)
    for k in moving:
        dof = int(model.jnt_dofadr[k])
        for what, values in (
            ("damping", getattr(model, "dof_dampingpoly", np.zeros((model.nv, 1)))[dof]),
            ("stiffness", getattr(model, "jnt_stiffnesspoly", np.zeros((model.njnt, 1)))[k]),
        ):
            if np.any(values):
                raise RobotDescriptionError(
                    f"joint {names_of_joints[k]!r}: {what} grows with powers of speed or position",
                    advice=f"give one number, {what}=…",
                )
