"""Gains of the position and velocity actuators of an MJCF file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pivident.robot.mjcf_model import (
    compiled,
    joint_names,
    moves_a_joint,
    mujoco_library,
    read_spec,
)
from pivident.robot.naming import errors_name


@dataclass(frozen=True)
class PositionGains:
    """What the position and velocity actuators of an MJCF file say of one joint.

    Attributes:
        kp: position gain [N m/rad or N/m].
        kv: speed gain [N m s/rad or N s/m].
        delay: time that the control is late [s].
    """

    kp: float
    kv: float
    delay: float


def position_gains(path: str | Path) -> dict[str, PositionGains]:
    """Gains of the joints that position and velocity actuators move, by the joint's name.

    An actuator with gain g, biases b and gear r on a joint is the law r (g u + b_1 r q + b_2 r dq)
    with kp = -b_1 r² and kv = -b_2 r²; those of one joint are added up.

    Args:
        path: the file.

    Returns:
        The gains; joints without such an actuator are left out.

    Raises:
        MissingExtra: MuJoCo is not installed.
        RobotDescriptionError: the file cannot be read.
    """
    mujoco = mujoco_library()
    with errors_name(str(path)):
        model = compiled(read_spec(path))
        names = joint_names(model)
    found: dict[str, PositionGains] = {}
    affine = int(mujoco.mjtBias.mjBIAS_AFFINE)
    delays = getattr(model, "actuator_delay", np.zeros(model.nu))
    for k in range(model.nu):
        if not moves_a_joint(model, k) or model.actuator_biastype[k] != affine:
            continue
        name = names[int(model.actuator_trnid[k, 0])]
        square = float(model.actuator_gear[k, 0]) ** 2
        bias = np.asarray(model.actuator_biasprm[k], dtype=float)
        before = found.get(name, PositionGains(0.0, 0.0, 0.0))
        found[name] = PositionGains(
            before.kp - square * float(bias[1]),
            before.kv - square * float(bias[2]),
            max(before.delay, float(delays[k])),
        )
    return {name: gains for name, gains in found.items() if gains.kp or gains.kv}
